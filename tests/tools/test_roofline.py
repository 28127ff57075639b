#!/usr/bin/env python3
"""bench/peers/counts.py against sweeps spelled out with numbers that count; the yardstick and the summary's rows.

Run as a program it exits with 77 (skipped) when numpy or h5py is missing, and says which.
"""
import ctypes
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path[:0] = [str(BENCH / "peers"), str(BENCH / "studies")]

try:
    import numpy as np

    import counts
    import summary
except ImportError as missing:
    print(f"SKIPPED: the roofline is not tested, {missing}")
    sys.exit(77)


class Counting:
    """A number that counts the operations done with it."""

    done = 0

    def __init__(self, value):
        self.value = value

    def _with(self, value):
        Counting.done += 1
        return Counting(value)

    def __add__(self, other):
        return self._with(self.value + other.value)

    def __sub__(self, other):
        return self._with(self.value - other.value)

    def __mul__(self, other):
        return self._with(self.value * other.value) if isinstance(other, Counting) else NotImplemented

    def __truediv__(self, other):
        return self._with(self.value / other.value)

    def root(self):
        return self._with(self.value**0.5)


def numbers(*shape):
    rng = np.random.default_rng(len(shape))
    made = np.empty(shape, object)
    made.ravel()[:] = [Counting(value) for value in rng.uniform(0.5, 1.5, int(np.prod(shape)))]
    return made


def vector(*values):
    return np.array(values, object)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return vector(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def coulomb_step(x, y, inverse_n, inverse_t, coupling, omega, weight):
    """docs/math/local_solve.md: the normal, then the tangents on the disk of the fresh normal; x is moved. The change."""
    normal = x[0] - omega * inverse_n * y[0]
    change = [normal - x[0]]
    gain = omega * inverse_t
    tangents = [x[k] - gain * (y[k] + coupling[k - 1] * change[0]) for k in (1, 2)]
    factor = normal / (tangents[0] * tangents[0] + tangents[1] * tangents[1]).root()
    change += [factor * tangents[k - 1] - x[k] for k in (1, 2)]
    for k in range(3):
        x[k] = x[k] + change[k]
    change[0] * weight
    return change


class Counts(unittest.TestCase):
    def setUp(self):
        Counting.done = 0

    def test_a_cone(self):
        coulomb_step(list(numbers(3)), numbers(3), *numbers(2), numbers(2), *numbers(2))
        self.assertEqual(counts.STEP, Counting.done)

    def sweep(self, A, x, y):
        for row in range(0, len(A), 3):
            own = list(x[row:row + 3])
            change = coulomb_step(own, y[row:row + 3], *numbers(2), numbers(2), *numbers(2))
            x[row:row + 3] = own
            for i in range(len(A)):
                for k in range(3):
                    y[i] = y[i] + A[i, row + k] * change[k]

    def test_sweeps_of_a_matrix(self):
        A, x, y, b = numbers(12, 12), numbers(12), numbers(12), numbers(12)
        for _ in range(counts.REFRESH):
            self.sweep(A, x, y)
        for i in range(12):
            y[i] = b[i]
            for j in range(12):
                y[i] = y[i] + A[i, j] * x[j]
        self.assertEqual(counts.of_matrix(4, 4).operations * counts.REFRESH, Counting.done)

    def test_a_sweep_of_a_factor(self):
        Y, x, b = numbers(12, 7), numbers(12), numbers(12)
        u = numbers(7)
        for k in range(7):
            for i in range(12):
                u[k] = u[k] + Y[i, k] * x[i]
        for row in range(0, 12, 3):
            y = list(b[row:row + 3])
            for i in range(3):
                for k in range(7):
                    y[i] = y[i] + Y[row + i, k] * u[k]
            own = list(x[row:row + 3])
            change = coulomb_step(own, y, *numbers(2), numbers(2), *numbers(2))
            for k in range(7):
                for i in range(3):
                    u[k] = u[k] + Y[row + i, k] * change[i]
        self.assertEqual(counts.of_factor(4, 7, 4).operations, Counting.done)

    def test_a_contact_of_bodies(self):
        n, arms, twists, x = numbers(3), numbers(2, 3), numbers(2, 6), list(numbers(3))
        sign, mu, bias, compliance, minus = numbers(5)
        a = minus / (sign + n[2])
        b = n[0] * n[1] * a
        first = vector(minus + sign * n[0] * n[0] * a, sign * b, sign * n[0])
        second = vector(b, sign + n[1] * n[1] * a, n[1])
        Counting.done = 0  # a pack keeps its tangents
        u = (twists[1, :3] + cross(twists[1, 3:], arms[1])) - (twists[0, :3] + cross(twists[0, 3:], arms[0]))
        y = [dot(u, n) + bias + compliance * x[0]]
        y += [mu * (dot(u, t) + compliance * (mu * x[k])) for k, t in ((1, first), (2, second))]
        change = coulomb_step(x, y, *numbers(2), numbers(2), *numbers(2))
        impulse = change[0] * n + (mu * change[1]) * first + (mu * change[2]) * second
        for body in range(2):
            mass, inertia = numbers(1)[0], numbers(3, 3)
            about = cross(arms[body], impulse)
            twists[body, :3] = twists[body, :3] + mass * impulse
            for i in range(3):
                for j in range(3):
                    twists[body, 3 + i] = twists[body, 3 + i] + inertia[i, j] * about[j]
        self.assertEqual(counts.CONTACT, Counting.done)

    def test_bytes_grow_with_the_size_of_a_number(self):
        for count in (lambda size: counts.of_matrix(8, size, True), lambda size: counts.of_factor(8, 6, size)):
            self.assertEqual(count(8).bytes, 2 * count(4).bytes)
            self.assertEqual(count(8).intensity, count(4).intensity / 2)


class Yardstick(unittest.TestCase):
    def test_longer_loops_take_longer(self):
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder, "yardstick.so")
            try:
                subprocess.run(["cc", "-O2", "-shared", "-fPIC", BENCH / "peers" / "yardstick.c", "-o", library], check=True)
            except (FileNotFoundError, subprocess.CalledProcessError):
                self.skipTest("no C compiler")
            functions = ctypes.CDLL(str(library))
            functions.vector_bytes.restype = ctypes.c_size_t
            self.assertIn(functions.vector_bytes(), (16, 32, 64))
            for name in ("multiply_adds_f32", "multiply_adds_f64", "multiply_adds_one_f32", "multiply_adds_one_f64"):
                function = getattr(functions, name)
                function.restype = ctypes.c_double
                few, many = (function(ctypes.c_long(rounds)) for rounds in (50_000, 2_000_000))
                self.assertGreater(many, 10 * few, name)  # forty times the rounds


class Summary(unittest.TestCase):
    def test_what_is_said_of_the_roof(self):
        text = "kernel,precision,batch,share,share_of_one_lane\npgs,f32,near,0.5,\npgs,f32,near,0.7,2\npgs,f32,far,0.1,\n"
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "roofline.csv").write_text(text)
            (what, question, _, found), = summary.roofline_lines(Path(folder))
        self.assertEqual((what, question), ("G10", "share of one core's roof, pgs f32"))
        self.assertEqual(found, "0.60 (0.50 to 0.70; 2); of one lane's multiply-adds 2.00 (2.00 to 2.00; 1)")

    def test_what_is_said_of_a_gpu(self):
        rows = ["robot,environments,goal,us,peer,peer_us,ratio", "a,64,1e-4,2,MJX CG,9,4.5", "a,64,1e-4,1,MJX CG,9,9",
                "a,64,1e-4,1,MJX Newton,5,5", "b,64,1e-4,1,MJX CG,7,7"]
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "gpu.csv").write_text("\n".join(rows))
            Path(folder, "gpu_fallback.csv").write_text("same_bits,ratio\nTrue,10\nFalse,20\n")
            (what, _, _, found), (other, question, _, ratio) = summary.gpu_lines(Path(folder))
        self.assertEqual((what, found), ("G4", "6.00 (5.00 to 7.00; 2)"))
        self.assertEqual((other, ratio), ("X1", "15.00 (10.00 to 20.00; 2)"))
        self.assertIn("in 1 of 2", question)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
