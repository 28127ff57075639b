#!/usr/bin/env python3
"""bench/peers, batched peers: environments filled up to one shape, and PyTorch, MJX and MuJoCo Warp on problems with known answers.

Run as a program it exits with 77 (skipped) when numpy, h5py or PyTorch is missing, and says which. MJX and MuJoCo Warp skip their
own tests where they are not installed. All on the CPU.
"""
import importlib.util
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path[:0] = [str(BENCH / folder) for folder in ("peers", "arena", "studies")]

try:
    import numpy as np
    import torch

    import padded
    import systems
    import torch_peers
    from table import read
    from environments import BOX, FREE, FRICTION, UNILATERAL, Environment
except ImportError as missing:
    print(f"SKIPPED: the batched peers are NOT tested, {missing}: scripts/test.sh --frameworks")
    sys.exit(77)

try:
    import mjx_peer
except ImportError as missing:
    mjx_peer, NO_MJX = None, f"MJX is NOT compared, {missing}: scripts/test.sh --frameworks"
else:
    NO_MJX = ""

try:
    import warp_peer
except ImportError as missing:
    warp_peer, NO_WARP = None, f"MuJoCo Warp is NOT compared, {missing}: scripts/test.sh --frameworks"
else:
    NO_WARP = ""

SHAPES = {FREE: 1, BOX: 1, UNILATERAL: 1, FRICTION: 3}


def system(kinds, reaction, motion, param):
    """An environment whose answer is this reaction with this motion; J and M are drawn, R = 0.25."""
    sizes = [SHAPES[kind] for kind in kinds]
    rows, rng = sum(sizes), np.random.default_rng(len(kinds))
    J, root = rng.standard_normal((rows, 6)), 0.3 * rng.standard_normal((6, 6))
    M = root @ root.T + np.eye(6)
    compliance = np.full(rows, 0.25)
    A = J @ np.linalg.solve(M, J.T)
    b = np.asarray(motion, float) - (A + np.diag(compliance)) @ reaction
    problem = Environment(np.arange(rows + 1) * rows, np.tile(np.arange(rows), rows), A.ravel(), b, compliance, np.array(kinds),
                          np.concatenate(([0], np.cumsum(sizes))), np.array(param, float))
    v_free = rng.standard_normal(6)
    return systems.System(problem, J, M, v_free, J @ v_free - b)


# A contact sticks, slides (reaction on the cone against the motion, which lies on the polar cone), or lets go. A limit
# is open and closed, a box at its bound and within. There is a free row. The second environment has its cones in
# another order and fewer of them.
SLIDING = ([2.0, -1, 0], [0.25, 0.5, 0])  # mu = 0.5: |x_t| = mu x_n, w_t against it, and x . w = 0
SOME = [system([FREE, BOX, BOX, UNILATERAL, UNILATERAL, FRICTION, FRICTION],
               np.array([0.7, -0.5, 0.2, 0, 1.5, 1, -0.1, 0.2, *SLIDING[0]]), [0, 0.3, 0, 0.7, 0, 0, 0, 0, *SLIDING[1]],
               [0, 0.5, 0.5, 0, 0, 0, 0.5, 0.5, 0, 0.5, 0.5]),
        system([FRICTION, UNILATERAL, FRICTION, BOX], np.array([0, 0, 0, 0.4, *SLIDING[0], 0.5]),
               [1, 0.3, 0.2, 0, *SLIDING[1], -0.2], [0, 0.5, 0.5, 0, 0, 0.5, 0.5, 0.5])]
ANSWERS = np.array([0.7, -0.5, 0.2, 0, 1.5, 1, -0.1, 0.2, *SLIDING[0], 0, 0, 0, 0.4, *SLIDING[0], 0.5])


class Arrays(unittest.TestCase):
    def test_what_fills_up_feels_and_does_nothing(self):
        whole = padded.Padded(SOME)
        self.assertEqual(whole.segments, [(FREE, 1, 1, 0), (BOX, 1, 2, 1), (UNILATERAL, 1, 2, 3), (FRICTION, 3, 2, 5)])
        np.testing.assert_allclose(np.einsum("eij,ejk->eik", whole.J, np.linalg.solve(whole.M, whole.J.transpose(0, 2, 1))), whole.A,
                                   atol=1e-12)  # of numbers up to 30
        np.testing.assert_allclose(np.einsum("eij,ej->ei", whole.J, whole.v_free) - whole.target, whole.b, atol=1e-12)
        self.assertEqual(whole.places[1].tolist(), [5, 6, 7, 3, 8, 9, 10, 1])
        self.assertEqual((whole.A[1, [0, 2, 4]] != 0).sum(), 0)
        self.assertEqual(whole.friction()[0].tolist(), [0] * 6 + [0.5, 0.5, 0, 0.5, 0.5])
        reactions = np.zeros((2, whole.rows))
        reactions[1, 5:8] = 1, 2, 3
        self.assertEqual(whole.own(reactions)[11:14].tolist(), [1, 2, 3])


class Peers(unittest.TestCase):
    def agree(self, found, precision, name):
        reactions = padded.Padded(SOME).own(np.asarray(found)[:2])
        np.testing.assert_allclose(reactions, ANSWERS, atol=1e-6 if precision == "f64" else 5e-4, err_msg=f"{name} {precision}")

    def test_pytorch_finds_the_known_answers(self):
        for precision in ("f64", "f32"):
            given = torch_peers.Given(padded.Padded(SOME), 5, precision, "cpu")
            for name, method in torch_peers.METHODS.items():
                peer = method(given)
                found = peer.solve(1e-9 if precision == "f64" else 1e-6, 20000)
                self.assertEqual(tuple(found.shape), (5, 11))
                self.agree(found, precision, name)
                self.agree(found[2:], precision, name)  # the same again: PyTorch does not promise equal bits
                self.assertLess(peer.iterations, 20000, name)

    def test_pytorch_stops_at_the_tolerance(self):
        given = torch_peers.Given(padded.Padded(SOME), 2, "f64", "cpu")
        for name, method in torch_peers.METHODS.items():
            peer = method(given)
            counted = []
            for tolerance in (1e-2, 1e-8):
                peer.solve(tolerance)
                self.assertLessEqual(float(peer.error.max()), tolerance, name)
                counted.append(peer.iterations)
            self.assertLess(counted[0], counted[1], name)

    @unittest.skipIf(mjx_peer is None, NO_MJX)
    def test_mjx_finds_the_known_answers(self):
        for method, precision in (("Newton", "f64"), ("Newton", "f32"), ("CG", "f64")):
            peer = mjx_peer.Peer(padded.Padded(SOME), 3, precision, method, "cpu")
            self.agree(peer.solve(1e-14), precision, f"MJX {method}")

    @unittest.skipIf(warp_peer is None, NO_WARP)
    def test_mujoco_warp_finds_the_known_answers(self):
        for method in warp_peer.SOLVERS:
            peer = warp_peer.Peer(padded.Padded(SOME), 3, method, "cpu")
            self.agree(peer.solve(1e-9).numpy(), "f32", f"MuJoCo Warp {method}")


class Comparison(unittest.TestCase):
    @unittest.skipUnless(importlib.util.find_spec("stiction") and importlib.util.find_spec("matplotlib"),
                         "the Python package or Matplotlib is not there")
    def test_all_of_it_on_the_cpu(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, BENCH / "peers" / "gpu.py", BENCH.parent / "examples" / "data" / "humanoid.h5", "--device",
                            "cpu", "--peers", "torch", "--envs", "80", "--goals", "1e-4", "--seconds", "0", "--results", folder, "--images",
                            folder], check=True)
            rows, alone = (read(Path(folder, f"{name}.csv"))[1] for name in ("gpu", "gpu_fallback"))
            page = Path(folder, "gpu.md").read_text()
            self.assertTrue(Path(folder, "peers_gpu.png").is_file())
        self.assertEqual({row["peer"] for row in rows}, {"torch PGS", "torch APGD", "torch ADMM"})
        self.assertEqual({(row["form"], row["precision"]) for row in rows}, {("matrix", "f32"), ("matrix", "f64")})
        for row in rows:
            for side in ("residual_p95", "peer_residual_p95"):
                self.assertLessEqual(float(row[side]), 1.02e-4, row)
            self.assertGreater(float(row["ratio"]), 0)
        self.assertEqual({row["same_bits"] for row in alone}, {"True"})
        self.assertIn("not a comparison of devices", page)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
