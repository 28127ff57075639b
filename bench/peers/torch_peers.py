"""Plain PyTorch solvers: projected Gauss-Seidel over cones, an accelerated projected gradient and ADMM with batched
Cholesky factors. All environments of a padded batch go at once, on whatever device the tensors lie. Convex law.

Coordinates are x = D z with friction cones that are unit cones and cones of mean diagonal 1. The solvers compute the
natural map |z - P(z - y)| / max|b| after every chunk. They stop when 95 % of the environments have come to the
tolerance. On a GPU a chunk can be captured once and replayed as a CUDA graph.
"""

import numpy as np
import torch
from environments import BOX, FREE, FRICTION, UNILATERAL

SHARE = 0.95


class Given:
    """A batch in tensors of one type and device, repeated up to `envs` environments."""

    def __init__(self, padded, envs, dtype, device):
        self.segments, self.rows = padded.segments, padded.rows
        kind = {"f32": torch.float32, "f64": torch.float64}[dtype]
        self.tensors = {}
        some = {name: getattr(padded, name) for name in ("A", "J", "b", "target", "R", "mu", "bound", "v_free")}
        some |= {"friction": padded.friction(), "factor": np.linalg.cholesky(padded.M)}
        for name, value in some.items():
            one = torch.as_tensor(value, dtype=kind, device=device)
            copies = -(-envs // len(one))
            self.tensors[name] = one.repeat((copies,) + (1,) * (one.dim() - 1))[:envs].contiguous()

    def __getattr__(self, name):
        return self.__dict__["tensors"][name]


class Peer:
    """One method on one batch. A chunk's arrays are allocated once and changed in place: CUDA graphs keep addresses."""

    chunk = 10

    def __init__(self, given, graphed=False):
        self.given = given
        self.A, self.b = torch.empty_like(given.A), torch.empty_like(given.b)
        self.scale, self.z, self.y = (torch.zeros_like(given.b) for _ in range(3))
        self.low, self.high = torch.zeros_like(given.b), torch.zeros_like(given.b)
        self.error, self.unit = (torch.zeros_like(given.b[:, 0]) for _ in range(2))
        self.graph = None
        self.allocate()
        if graphed:
            self.capture()

    def allocate(self):
        """Takes the method's own memory."""

    def capture(self):
        """Captures one chunk; a run before has allocated the libraries' memory."""
        self.prepare()
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            self.advance()
        torch.cuda.current_stream().wait_stream(stream)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self.advance()
        self.graph = graph

    def prepare(self):
        """Scales the problem; z = 0."""
        given = self.given
        A = given.A + torch.diag_embed(given.R)
        diagonal = torch.diagonal(A, dim1=1, dim2=2) * given.mu**2
        for kind, size, cones, first in given.segments:
            own = diagonal[:, first:first + size * cones].reshape(-1, cones, size)
            mean = own.mean(dim=2, keepdim=True).expand_as(own).reshape(-1, cones * size)
            self.scale[:, first:first + size * cones] = mean.rsqrt()
        self.scale.mul_(given.mu)
        torch.mul(A, self.scale[:, :, None] * self.scale[:, None, :], out=self.A)
        torch.mul(given.b, self.scale, out=self.b)
        torch.div(given.bound, self.scale.clamp_min(1e-30), out=self.high)
        torch.neg(self.high, out=self.low)
        self.unit.copy_(self.b.abs().amax(dim=1).clamp_min(1e-30))
        self.z.zero_()
        self.begin()

    def begin(self):
        """Prepares a method before its first iteration."""

    def motion(self, z):
        return torch.baddbmm(self.b[:, :, None], self.A, z[:, :, None])[:, :, 0]

    @staticmethod
    def onto_cone(z):
        """z (..., rows of a friction cone) onto the unit cone."""
        normal, length = z[..., :1], z[..., 1:].norm(dim=-1, keepdim=True)
        middle = 0.5 * (normal + length)
        inside, polar = length <= normal, length <= -normal
        # No scalar as an operand of torch.where: on a GPU it would be copied there, which a graph cannot hold.
        factor = (middle / length.clamp_min(1e-30)).masked_fill(polar, 0).masked_fill(inside, 1)
        return torch.cat((torch.where(inside, normal, middle.masked_fill(polar, 0)), factor * z[..., 1:]), dim=-1)

    def onto(self, kind, z, first, last):
        """z (environments, cones, rows) onto cones of that kind, which are the rows from first to last."""
        if kind == FRICTION:
            return self.onto_cone(z)
        if kind == UNILATERAL:
            return z.clamp_min(0)
        if kind == BOX:
            return torch.maximum(torch.minimum(z, self.high[:, first:last, None]), self.low[:, first:last, None])
        assert kind == FREE
        return z

    def project(self, z):
        found = []
        for kind, size, cones, first in self.given.segments:
            own = z[:, first:first + size * cones].reshape(-1, cones, size)
            found.append(self.onto(kind, own, first, first + size * cones).reshape(-1, cones * size))
        return torch.cat(found, dim=1)

    def look(self, z, y):
        self.error.copy_((z - self.project(z - y)).abs().amax(dim=1) / self.unit)

    def advance(self):
        for _ in range(self.chunk):
            self.iterate()
        self.look(self.z, self.motion(self.z))

    def after_chunk(self):
        """Adapts a method's parameters, which needs numbers on the host."""

    def solve(self, tolerance, most=2000):
        """Reactions (environments, rows); at most that many iterations."""
        self.prepare()
        for self.iterations in range(self.chunk, most + self.chunk, self.chunk):
            self.graph.replay() if self.graph else self.advance()
            if float((self.error <= tolerance).double().mean()) >= SHARE:
                break
            self.after_chunk()
        return self.z * self.scale


class Pgs(Peer):
    """Cones one after the other, each in all environments at once."""

    chunk = 4

    def allocate(self):
        cones = [(kind, row, row + size) for kind, size, count, first in self.given.segments
                 for row in range(first, first + size * count, size)]
        self.gain = torch.ones_like(self.z[:, :len(cones)])
        self.steps = [(*cone, self.gain[:, k:k + 1]) for k, cone in enumerate(cones)]

    def begin(self):
        for _, first, last, gain in self.steps:
            gain.copy_(1 / self.A[:, first:last, first:last].abs().sum(dim=2).amax(dim=1, keepdim=True))

    def iterate(self):
        for kind, first, last, gain in self.steps:
            y = torch.baddbmm(self.b[:, first:last, None], self.A[:, first:last], self.z[:, :, None])[:, :, 0]
            point = self.z[:, first:last] - gain * y
            self.z[:, first:last] = self.onto(kind, point[:, None, :] if kind == FRICTION else point[:, :, None], first, last).reshape(
                point.shape)


class Apgd(Peer):
    """Accelerated projected gradient with restart (O'Donoghue and Candes 2015); the step is 1 over a bound of A's norm."""

    def allocate(self):
        self.before, self.ahead = torch.zeros_like(self.z), torch.zeros_like(self.z)
        self.theta, self.gain = (torch.ones_like(self.z[:, :1]) for _ in range(2))

    def begin(self):
        bound = torch.minimum(self.A.abs().sum(dim=2).amax(dim=1), self.A.square().sum(dim=(1, 2)).sqrt())
        self.gain.copy_(1 / bound[:, None])
        self.before.zero_()
        self.ahead.zero_()
        self.theta.fill_(1)

    def iterate(self):
        point = self.project(self.ahead - self.gain * self.motion(self.ahead))
        uphill = ((self.ahead - point) * (point - self.z)).sum(dim=1, keepdim=True) > 0
        theta = self.theta.masked_fill(uphill, 1)
        following = 0.5 * (torch.sqrt(theta**4 + 4 * theta**2) - theta**2)
        beta = (theta * (1 - theta) / (theta**2 + following)).masked_fill(uphill, 0)
        self.ahead.copy_(point + beta * (point - self.z))
        self.z.copy_(point)
        self.theta.copy_(following)


class Admm(Peer):
    """Splitting with one Cholesky factor of A + rho I for each environment, made again where rho is far off."""

    relaxation, off = 1.6, 5.0

    def allocate(self):
        self.factor, self.dual, self.last = torch.zeros_like(self.A), torch.zeros_like(self.z), torch.zeros_like(self.z)
        self.rho, self.primal, self.change = (torch.ones_like(self.z[:, :1]) for _ in range(3))
        self.eye = torch.eye(self.A.shape[1], dtype=self.A.dtype, device=self.A.device)

    def factorize(self):
        self.factor.copy_(torch.linalg.cholesky(self.A + self.rho[:, :, None] * self.eye))

    def begin(self):
        self.dual.zero_()
        bound = torch.minimum(self.A.abs().sum(dim=2).amax(dim=1), self.A.square().sum(dim=(1, 2)).sqrt())
        self.rho.copy_(0.1 * bound[:, None])
        self.factorize()

    def iterate(self):
        right = self.rho * (self.z - self.dual) - self.b
        x = torch.cholesky_solve(right[:, :, None], self.factor)[:, :, 0]
        relaxed = self.relaxation * x + (1 - self.relaxation) * self.z
        self.last.copy_(self.z)
        self.z.copy_(self.project(relaxed + self.dual))
        self.dual.add_(relaxed - self.z)
        self.primal.copy_((x - self.z).abs().amax(dim=1, keepdim=True))
        self.change.copy_(self.rho * (self.z - self.last).abs().amax(dim=1, keepdim=True))

    def after_chunk(self):
        ratio = self.primal * self.rho / self.change.clamp_min(1e-30)
        factor = ratio.sqrt().clamp(0.1, 10).masked_fill((ratio <= self.off) & (ratio >= 1 / self.off), 1)
        if bool((factor != 1).any()):
            self.rho.mul_(factor)
            self.dual.div_(factor)
            self.factorize()


METHODS = {"PGS": Pgs, "APGD": Apgd, "ADMM": Admm}
