"""The loop: warm starts by contact id, resets, room, the same on both devices."""

import numpy as np
import pytest

import stiction
from stiction import FLAGS, Batch, Solver, SteppingSolver

IDS = np.arange(12, dtype=np.uint64).reshape(4, 3)


@pytest.fixture(params=["cpu", "emulated"])
def loop(request, padded):
    batch = Batch.from_delassus(padded.A, padded.b, cone_counts=padded.counts // 3, mu=0.7)
    return SteppingSolver(4, request.param, max_rows=9, max_cones=3, solver="npgs", tolerance=1e-8, beta=1.0), batch


def test_the_second_step_starts_from_the_first(loop):
    solver, batch = loop
    cold, warm = solver.step(batch, IDS, 0.01), solver.step(batch, IDS, 0.01)
    assert cold.iterations.max() > 0 and warm.iterations.max() == 0
    np.testing.assert_allclose(warm.lambda_, cold.lambda_, rtol=1e-15)  # scaled by mu and back: two roundings
    stats = solver.stats()
    assert stats["solves"] == 2 and stats["warm_start_hits"] == 6 and stats["warm_start_misses"] == 6


def test_contacts_are_known_by_their_ids(loop):
    solver, batch = loop
    solver.step(batch, IDS, 0.01)
    solver.step(batch, IDS + 100, 0.01)
    assert solver.stats()["warm_start_hits"] == 0


@pytest.mark.parametrize("which", ["ids", "mask", "all"])
def test_environments_that_start_over_start_from_zero(loop, which):
    solver, batch = loop
    cold = solver.step(batch, IDS, 0.01).iterations.copy()
    if which == "ids":
        solver.reset(ids=[0, 2])
    elif which == "mask":
        solver.reset(mask=np.array([True, False, True, False]))
    else:
        solver.reset()
    again = solver.step(batch, IDS, 0.01).iterations
    assert again[0] == cold[0] > 0 and again[2] == cold[2] > 0
    assert again[1] == (cold[1] if which == "all" else 0)


def test_numbers_are_read_in_place_at_every_step(loop, padded):
    solver, batch = loop
    first = solver.step(batch, IDS, 0.01).lambda_.copy()
    padded.b[0, :6] *= 2
    second = solver.step(batch, IDS, 0.01)
    assert (second.lambda_[0] != first[0]).any()
    np.testing.assert_allclose(second.lambda_[1:], first[1:], rtol=1e-15)  # scaled by mu and back: two roundings


def test_both_devices_step_through_the_same_bits(padded):
    runs = []
    for device in ("cpu", "emulated"):
        solver = SteppingSolver(4, device, max_rows=9, max_cones=3, tolerance=1e-6)
        rng = np.random.default_rng(0)
        b, counts, hashes = padded.b.copy(), padded.counts // 3, []
        batch = Batch.from_delassus(padded.A, b, cone_counts=counts, mu=0.7)
        for _ in range(5):
            b[:, :3] += rng.normal(size=(4, 3)) * 0.1
            counts[2] = rng.integers(1, 4)
            hashes.append(solver.step(batch, IDS, 0.01).hash())
        runs.append(hashes)
    assert runs[0] == runs[1] and len(set(runs[0])) == 5


def test_an_environments_steps_do_not_depend_on_its_neighbours(padded):
    def run(envs):
        solver = SteppingSolver(len(envs), max_rows=9, max_cones=3, tolerance=1e-6)
        batch = Batch.from_delassus(padded.A[envs].copy(), padded.b[envs].copy(), cone_counts=padded.counts[envs] // 3,
                                    mu=0.7)
        for _ in range(3):
            solution = solver.step(batch, IDS[envs], 0.01)
        return solution[0].lambda_

    np.testing.assert_array_equal(run([0]), run([0, 2, 1, 2, 3, 2, 1]))


def test_flat_batches_step_too(scenes):
    batch = Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7)
    solver = SteppingSolver(4, max_rows=9, max_cones=3, beta=1.0)
    ids = np.arange(6, dtype=np.int64)
    solver.step(batch, ids, 0.01)
    assert solver.step(batch, ids, 0.01).iterations.max() == 0


def test_a_queued_step_is_waited_for_by_its_status(padded):
    solver = SteppingSolver(4, "emulated", max_rows=9, max_cones=3)
    batch = Batch.from_delassus(padded.A, padded.b, cone_counts=padded.counts // 3, mu=0.7)
    solution = solver.step(batch, IDS, 0.01, stream=0)
    assert solution.solved.all() and (solution.lambda_[2, 0::3] > 0).any()
    assert solver.stats()["codes"] == {"solved": 4} and solver.stats()["warm_start_misses"] == 6


# -- the other forms ----------------------------------------------------------------------------------------------------

DOFS = 12


class Jacobians:
    """The scenes as padded Jacobians of 12 degrees of freedom, NaN where nothing may be read."""

    def __init__(self, scenes):
        count = len(scenes)
        self.J, self.v_free = np.full((count, 9, DOFS), np.nan), np.zeros((count, DOFS))
        self.M = np.tile(np.eye(DOFS), (count, 1, 1))
        for env, scene in enumerate(scenes):
            self.J[env, :scene.rows] = 0
            self.J[env, :scene.rows, :scene.dofs] = scene.J
            self.M[env, :scene.dofs, :scene.dofs] = scene.M
            self.v_free[env, :scene.dofs] = scene.v_free
        self.counts = np.array([scene.rows // 3 for scene in scenes], np.int32)

    def batch(self):
        return Batch.from_jacobian(self.J, self.M, self.v_free, cone_counts=self.counts, mu=0.7)


def jacobian_loop(device="cpu", **options):
    options = {"solver": "npgs", "tolerance": 1e-8, "beta": 1.0} | options
    return SteppingSolver(4, device, form="jacobian", max_rows=9, max_cones=3, max_dofs=DOFS, **options)


def balls(envs=3, dtype="float64", **stepping):
    """Two balls of 2 kg on the floor and one on another in every environment, falling, the last one with spin."""
    inv_mass = np.full((envs, 3), 0.5, dtype)
    inv_inertia = np.tile(np.array([125, 0, 0, 125, 0, 125], dtype), (envs, 3, 1))  # 2/5 m r2 with r = 0.1 m
    twist = np.zeros((envs, 3, 6), dtype)
    twist[:, :, 0] = 0.3 * np.arange(1, envs + 1)[:, None]
    change = np.zeros((envs, 3, 6), dtype)
    change[:, :, 2] = -9.81 * stepping.get("dt", 0.005)
    body_a = np.tile(np.array([-1, -1, 0], np.int32), (envs, 1))
    body_b = np.tile(np.array([0, 1, 2], np.int32), (envs, 1))
    down, up = np.tile(np.array([0, 0, -0.1], dtype), (envs, 3, 1)), np.zeros((envs, 3, 3), dtype)
    up[:, 2, 2] = 0.1
    normal = np.tile(np.array([0, 0, 1], dtype), (envs, 3, 1))
    mu, depth = np.full((envs, 3), 0.5, dtype), np.zeros((envs, 3), dtype)
    return Batch.from_bodies(inv_mass, inv_inertia, twist, body_a, body_b, up, down, normal, mu, depth,
                             twist_change=change, **stepping)


def body_ids(envs=3):
    return np.tile(np.array([11, 7, 2**63 + 5], np.uint64), (envs, 1))


def body_loop(device="cpu", envs=3, **options):
    options = {"tolerance": 1e-9, "beta": 1.0} | options
    return SteppingSolver(envs, device, form="bodies", max_rows=9, **options)


@pytest.mark.parametrize("device", ["cpu", "emulated"])
def test_jacobians_start_from_the_step_before(device, scenes):
    solver, batch = jacobian_loop(device), Jacobians(scenes).batch()
    cold, warm = solver.step(batch, IDS, 0.01), solver.step(batch, IDS, 0.01)
    assert cold.solved.all() and cold.iterations.max() > 0 and warm.iterations.max() == 0
    assert solver.stats()["warm_start_hits"] == 6 and solver.stats()["warm_start_misses"] == 6
    alone = Solver(device, solver="npgs", tolerance=1e-8).solve(batch)
    np.testing.assert_array_equal(cold.lambda_, alone.lambda_)
    np.testing.assert_array_equal(cold.velocities, alone.velocities)
    assert np.abs(cold.velocities[0] - batch.v_free[0]).max() > 0


@pytest.mark.parametrize("which", ["ids", "mask", "all"])
@pytest.mark.parametrize("device", ["cpu", "emulated"])
def test_jacobian_environments_that_start_over_start_from_zero(device, which, scenes):
    solver, batch = jacobian_loop(device), Jacobians(scenes).batch()
    cold = solver.step(batch, IDS, 0.01).iterations.copy()
    solver.reset(**{"ids": {"ids": [0, 2]}, "mask": {"mask": np.array([1, 0, 1, 0], np.uint8)}, "all": {}}[which])
    again = solver.step(batch, IDS, 0.01).iterations
    assert again[0] == cold[0] > 0 and again[2] == cold[2] > 0 and again[1] == (cold[1] if which == "all" else 0)


def test_jacobians_step_through_the_same_bits_on_both_devices(scenes):
    runs = []
    for device in ("cpu", "emulated"):
        solver, arrays = jacobian_loop(device, tolerance=1e-5, beta=0.95), Jacobians(scenes)
        rng, batch, hashes = np.random.default_rng(1), arrays.batch(), []
        for step in range(5):
            arrays.v_free += rng.normal(size=arrays.v_free.shape) * 0.1
            arrays.counts[2] = 1 + step % 3
            hashes.append(solver.step(batch, IDS, 0.01).hash())
        runs.append(hashes)
    assert runs[0] == runs[1] and len(set(runs[0])) == 5


def test_jacobian_contacts_beyond_the_room_are_cut_off_and_flagged(scenes):
    arrays = Jacobians(scenes)
    arrays.counts[2] = 5  # of room for 3
    solution = jacobian_loop().step(arrays.batch(), IDS, 0.01)
    assert solution.status["flags"][2] & (1 << FLAGS.index("contacts_dropped")) and not solution.status["flags"][0]


def test_flat_jacobians_step_too(scenes):
    batch = Batch.from_jacobian([s.J for s in scenes], [s.M for s in scenes], [s.v_free for s in scenes], mu=0.7)
    solver = jacobian_loop()
    solver.step(batch, np.arange(6), 0.01)
    assert solver.step(batch, np.arange(6), 0.01).iterations.max() == 0


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("device", ["cpu", "emulated"])
def test_bodies_start_from_the_step_before(device, dtype):
    solver, batch = body_loop(device, dtype=dtype, tolerance=1e-6), balls(dtype=dtype)
    cold, warm = solver.step(batch, body_ids()), solver.step(batch, body_ids())
    assert cold.solved.all() and cold.iterations.min() > 0 and warm.iterations.max() == 0
    # The floor carries three balls, the third lies on the first [N s].
    np.testing.assert_allclose(warm.lambda_[:, :, 0], np.tile([4, 2, 2], (3, 1)) * 9.81 * 0.005, rtol=1e-5)
    assert solver.stats()["warm_start_hits"] == 9
    alone = Solver(device, tolerance=1e-6).solve(batch)
    np.testing.assert_array_equal(cold.lambda_, alone.lambda_)
    np.testing.assert_array_equal(cold.velocities, alone.velocities)


@pytest.mark.parametrize("which", ["ids", "mask", "all"])
def test_bodies_that_start_over_start_from_zero(which):
    solver, batch = body_loop(), balls()
    cold = solver.step(batch, body_ids()).iterations.copy()
    solver.reset(**{"ids": {"ids": [0, 2]}, "mask": {"mask": np.array([1, 0, 1], bool)}, "all": {}}[which])
    again = solver.step(batch, body_ids()).iterations
    assert again[0] == cold[0] and again[2] == cold[2] and again[1] == (cold[1] if which == "all" else 0)


def test_the_last_steps_memory_survives_another_time_step():
    # A step half as long stores half the impulse, which is the answer to half the fall.
    solver = body_loop()
    solver.step(balls(), body_ids())
    slow = balls(dt=0.0025)
    slow.twist[:] *= 0.5  # everything half as fast: reactions halve exactly
    assert solver.step(slow, body_ids()).iterations.max() == 0
    assert solver.stats()["warm_start_hits"] == 9


def test_bodies_step_through_the_same_bits_whoever_is_beside_them():
    def run(device, envs):
        solver, batch = body_loop(device, envs, beta=0.95, tolerance=1e-5), balls(envs)
        for step in range(4):
            batch.twist[:, :, 1] += 0.1 * np.arange(1, envs + 1)[:, None]
            solution = solver.step(batch, body_ids(envs))
        return solution[0].lambda_.tobytes()

    assert len({run("cpu", 1), run("cpu", 3), run("emulated", 3)}) == 1


@pytest.mark.parametrize("solver", ["newton", "multigrid"])
def test_loops_of_bodies_know_their_solvers(solver):
    loop = body_loop(solver=solver)
    assert loop.step(balls(), body_ids()).solved.all()
    assert loop.step(balls(), body_ids()).iterations.max() == 0


def test_the_chapters_name_is_the_same_class():
    assert stiction.ParallelContactSolver is SteppingSolver
