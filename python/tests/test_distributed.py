"""Environments over ranks: the same bits however many ranks there are, moved, and taken up again from checkpoints."""

import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from conftest import ROOT
from frameworks import framework

from stiction import distributed
from stiction.distributed import Ranks, Shard

TOTAL, STEPS, SEED = 12, 1000, 5


# -- what launchers say -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("variables, expected", [
    ({}, Ranks()),
    ({"RANK": "3", "WORLD_SIZE": "8", "LOCAL_RANK": "1"}, Ranks(3, 8, 1, "torchrun")),
    ({"SLURM_PROCID": "5", "SLURM_STEP_NUM_TASKS": "6", "SLURM_LOCALID": "1"}, Ranks(5, 6, 1, "srun")),
    ({"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_LOCAL_RANK": "0"},
     Ranks(1, 2, 0, "mpirun")),
    ({"PMI_RANK": "1", "PMI_SIZE": "4"}, Ranks(1, 4, 0, "mpiexec")),
    # A batch script of Slurm is one process, whatever its steps will be.
    ({"SLURM_PROCID": "0", "SLURM_NTASKS": "4", "SLURM_LOCALID": "0"}, Ranks()),
    # mpirun in a step of Slurm: the step's tasks are mpirun's own, one for each machine.
    ({"SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "2", "SLURM_LOCALID": "0", "OMPI_COMM_WORLD_RANK": "6",
      "OMPI_COMM_WORLD_SIZE": "8", "OMPI_COMM_WORLD_LOCAL_RANK": "2"}, Ranks(6, 8, 2, "mpirun")),
    # torchrun started by srun, once for each machine.
    ({"SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "2", "RANK": "9", "WORLD_SIZE": "16", "LOCAL_RANK": "1"},
     Ranks(9, 16, 1, "torchrun")),
])
def test_launchers_are_read(variables, expected):
    assert distributed.ranks(variables) == expected


@pytest.mark.parametrize("variables, what", [({"RANK": "1"}, "WORLD_SIZE"), ({"WORLD_SIZE": "2"}, "RANK"),
                                             ({"RANK": "one", "WORLD_SIZE": "2"}, "RANK"),
                                             ({"RANK": "2", "WORLD_SIZE": "2"}, "rank")])
def test_what_makes_no_sense_is_refused_by_name(variables, what):
    with pytest.raises(ValueError, match=what):
        distributed.ranks(variables)


def test_shards_cover_all_environments_once():
    for size in (1, 2, 3, 7):
        for total in (7, 12, 100):
            shards = [Shard.split(total, Ranks(rank, size)) for rank in range(size)]
            assert np.array_equal(np.concatenate([shard.ids for shard in shards]), np.arange(total))
            counts = [shard.num_envs for shard in shards]
            assert max(counts) - min(counts) <= 1
    assert Shard.per_rank(4, Ranks(2, 3)) == Shard(8, 12, 12)
    with pytest.raises(ValueError, match="every rank has an environment"):
        Shard.split(2, Ranks(0, 3))


def test_episodes_share_no_numbers():
    drawn = [distributed.generator(seed, env, episode).integers(0, 2**63, 64)
             for seed in (0, 1) for env in (0, 1, 2**40) for episode in (0, 1, 2)]
    assert len(np.unique(np.concatenate(drawn))) == 64 * len(drawn)
    again = distributed.generator(1, 2**40, 2).integers(0, 2**63, 64)
    assert np.array_equal(again, drawn[-1])


def test_offsets_move_towards_equal_time_and_no_further_than_allowed():
    offsets = [0, 100, 200, 300]
    assert distributed.rebalance(offsets, [1.0, 1.0, 1.0]) == offsets
    moved = distributed.rebalance(offsets, [4.0, 1.0, 1.0])
    assert moved == [0, 95, 195, 300]  # half as many would be best for the first rank: five at a time
    for _ in range(100):  # environments cost four times as much below 100
        seconds = [sum(4.0 if env < 100 else 1.0 for env in range(moved[k], moved[k + 1])) for k in range(3)]
        moved = distributed.rebalance(moved, seconds)
    assert max(seconds) / min(seconds) < 1.15
    assert distributed.rebalance([0, 1, 2], [5.0, 1.0]) == [0, 1, 2]


def test_statistics_are_added_up():
    one = {"solves": 2, "seconds": 1.5, "codes": {"solved": 7}, "iterations": {"p50": 3.0, "max": 9.0}}
    two = {"solves": 3, "seconds": 0.5, "codes": {"solved": 1, "stalled": 2}, "iterations": {"p50": 4.0, "max": 5.0}}
    assert distributed.merge_stats([one, two]) == {
        "solves": 5, "seconds": 1.5, "codes": {"solved": 8, "stalled": 2}, "iterations": {"p50": 4.0, "max": 9.0}}


def test_one_process_of_several_needs_a_group(monkeypatch):
    assert distributed.gather("x") == ["x"]
    monkeypatch.setenv("RANK", "0")
    monkeypatch.setenv("WORLD_SIZE", "2")
    with pytest.raises(RuntimeError, match="init_process_group"):
        distributed.gather("x")
    with pytest.raises(TypeError, match="mpi4py"):
        distributed.gather("x", group=3)

    class Communicator:
        @staticmethod
        def allgather(value):
            return [value, "of the other"]

    assert distributed.gather("x", Communicator) == ["x", "of the other"]


# -- environments -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def envs_of():
    pytest.importorskip("gymnasium", reason="environments over ranks are NOT tested: pip install gymnasium mujoco")
    pytest.importorskip("mujoco", reason="environments over ranks are NOT tested: pip install gymnasium mujoco")
    from stiction.envs import MujocoVectorEnv
    # One thread each: on a busy machine every stage would wait for another thread's turn.
    return lambda shard: MujocoVectorEnv("Hopper", shard=shard, tolerance=1e-4, max_episode_steps=150, threads=1)


def step(envs, first, last):
    """Steps first .. last - 1 with actions that follow the environments' ids."""
    for k in range(first, last):
        envs.step(np.stack([distributed.generator(99, env, k).uniform(-1, 1, 3) for env in envs.shard.ids]))


def digest_of(all_envs):
    return sum(distributed.digest(envs.states()) for envs in all_envs) % 2**64


@pytest.fixture(scope="module")
def alone(envs_of):
    """Digests of one rank's environments after half and after all of the steps."""
    envs = envs_of(Shard(0, TOTAL, TOTAL))
    envs.reset(seed=SEED)
    step(envs, 0, STEPS // 2)
    half = digest_of([envs])
    step(envs, STEPS // 2, STEPS)
    return half, digest_of([envs])


@pytest.mark.parametrize("size", [2, 3, 4])
def test_states_are_the_same_for_any_number_of_ranks(envs_of, alone, size):
    ranks = [envs_of(Shard.split(TOTAL, Ranks(rank, size))) for rank in range(size)]
    for envs in ranks:
        envs.reset(seed=SEED)
        step(envs, 0, STEPS)
    assert digest_of(ranks) == alone[1]
    assert any((envs.states()["episode"] > 2).any() for envs in ranks)  # noise of several resets is in it


def test_another_seed_and_another_id_are_another_state(envs_of):
    envs = envs_of(Shard(0, 2, 2))
    first = envs.reset(seed=1)[0]
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(envs.reset(seed=2)[0], first)
    assert np.array_equal(envs.reset(seed=1)[0], first)
    assert not np.array_equal(envs.reset()[0], first)  # the next episode
    other = envs_of(Shard(1, 2, 2))
    assert np.array_equal(other.reset(seed=1)[0][0], first[1])


def test_a_range_that_moved_goes_on_as_it_was(envs_of, alone):
    before, after = [0, 6, TOTAL], [0, 5, TOTAL]
    ranks = [envs_of(Shard.of(before, Ranks(rank, 2))) for rank in range(2)]
    for envs in ranks:
        envs.reset(seed=SEED)
        step(envs, 0, STEPS // 2)
    states = [envs.states() for envs in ranks]
    leaves = {name: values[5:] for name, values in states[0].items()}

    class Both:  # messages of both ranks
        @staticmethod
        def allgather(value):
            return [leaves, {name: values[:0] for name, values in states[1].items()}]

    moved = []
    for rank in range(2):
        shard = Shard.of(after, Ranks(rank, 2))
        moved.append(envs_of(shard))
        moved[-1].set_states(distributed.exchange(states[rank], shard, Both))
    assert digest_of(moved) == alone[0]
    for envs in moved:
        step(envs, STEPS // 2, STEPS)
    assert digest_of(moved) == alone[1]


@pytest.mark.parametrize("writers, readers", [(2, 3), (3, 1), (1, 4)])
def test_a_checkpoint_is_taken_up_by_another_number_of_ranks(envs_of, alone, tmp_path, writers, readers):
    assert distributed.load(tmp_path, Shard(0, TOTAL, TOTAL)) == (None, None)
    for rank in range(writers):
        envs = envs_of(Shard.split(TOTAL, Ranks(rank, writers)))
        envs.reset(seed=SEED)
        step(envs, 0, STEPS // 2)
        assert distributed.load(tmp_path, envs.shard) == (None, None)  # one part is missing still
        distributed.save(tmp_path, STEPS // 2, envs.states(), envs.shard)
    ranks = []
    for rank in range(readers):
        shard = Shard.split(TOTAL, Ranks(rank, readers))
        found, states = distributed.load(tmp_path, shard)
        assert found == STEPS // 2
        ranks.append(envs_of(shard))
        ranks[-1].set_states(states)
        step(ranks[-1], STEPS // 2, STEPS)
    assert digest_of(ranks) == alone[1]


@pytest.mark.parametrize("first", [7, 12])  # after a reset; within an episode
@pytest.mark.parametrize("name", ["Ant", "HalfCheetah", "Hopper", "Walker2d", "Humanoid"])
@pytest.mark.parametrize("engine", ["mujoco", "lanes"])
def test_every_task_goes_on_from_its_states(envs_of, engine, name, first):
    from stiction.envs import MujocoVectorEnv
    shard = Shard(2, 5, 8)
    one, other = (MujocoVectorEnv(name, shard=shard, max_episode_steps=6, threads=threads, engine=engine) for threads in (1, 2))
    one.reset(seed=3)
    draw = np.random.default_rng(0)
    actions = [draw.uniform(-0.3, 0.3, one.action_space.shape) for _ in range(24)]
    for k in range(first):
        seen = one.step(actions[k])[0]
    assert np.array_equal(other.set_states(one.states()), seen)
    for k in range(first, 24):
        for mine, theirs in zip(one.step(actions[k])[:4], other.step(actions[k])[:4]):
            assert np.array_equal(mine, theirs), (name, k)
    assert distributed.digest(one.states()) == distributed.digest(other.states())


def test_what_cannot_be_taken_up_is_refused(envs_of, tmp_path):
    from stiction.envs import MujocoVectorEnv
    envs = envs_of(Shard(0, 2, 4))
    with pytest.raises(ValueError, match="seed"):
        envs.reset()
    with pytest.raises(ValueError, match="same on every rank"):
        envs.reset(seed=[1, 2])
    envs.reset(seed=1)
    states = envs.states()
    with pytest.raises(ValueError, match="2..3"):
        envs_of(Shard(2, 4, 4)).set_states(states)
    with pytest.raises(ValueError, match="another"):
        MujocoVectorEnv("Ant", shard=Shard(0, 2, 4)).set_states(states)
    with pytest.raises(ValueError, match="shard"):
        MujocoVectorEnv("Hopper", 2).states()
    with pytest.raises(ValueError, match="num_envs"):
        MujocoVectorEnv("Hopper", 3, shard=Shard(0, 2, 4))
    by_reactions = MujocoVectorEnv("Hopper", shard=Shard(0, 2, 4), solver="npgs")
    by_reactions.reset(seed=1)
    with pytest.raises(ValueError, match="warm_start"):
        by_reactions.states()
    with pytest.raises(ValueError, match="none of"):
        distributed.exchange(states, Shard(0, 4, 4))


# -- files ------------------------------------------------------------------------------------------------------------


def states_of(shard, value):
    return {"id": shard.ids, "value": np.full(shard.num_envs, value)}


def test_the_last_complete_checkpoints_are_kept(tmp_path):
    shards = [Shard.split(5, Ranks(rank, 2)) for rank in range(2)]
    for step_number in (10, 20, 30):
        for shard in shards:
            distributed.save(tmp_path, step_number, states_of(shard, step_number), shard)
    distributed.save(tmp_path, 40, states_of(shards[0], 40), shards[0])
    names = sorted(place.name for place in tmp_path.iterdir() if any(place.iterdir()))
    assert names == ["step_000000020", "step_000000030", "step_000000040"]
    found, states = distributed.load(tmp_path, Shard(1, 4, 5))
    assert found == 30 and np.array_equal(states["id"], [1, 2, 3]) and (states["value"] == 30).all()
    # Other ranks go over the same steps: the newer one counts.
    whole = Shard(0, 5, 5)
    distributed.save(tmp_path, 30, states_of(whole, 31), whole)
    assert (distributed.load(tmp_path, Shard(1, 4, 5))[1]["value"] == 31).all()
    with pytest.raises(ValueError, match="6 environments in all"):
        distributed.load(tmp_path, Shard(0, 2, 6))


def test_a_damaged_file_is_one_sentence(tmp_path):
    shard = Shard(0, 50, 50)
    distributed.save(tmp_path, 1, states_of(shard, 1), shard)
    path = next(tmp_path.glob("*/*.npz"))
    whole = path.read_bytes()
    for damaged in (whole[:100], whole[:-30], b"", whole[:400] + b"\xff" * 64 + whole[464:]):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="expected a checkpoint, got a damaged file"):
            distributed.load(tmp_path, shard)


def test_a_killed_process_loses_nothing_that_was_complete(tmp_path):
    """Whatever it was doing when it was killed, the last checkpoint is whole."""
    program = textwrap.dedent("""
        import sys, numpy as np
        from stiction import distributed
        shard = distributed.Shard(0, 2000, 2000)
        for step in range(1, 10**6):
            distributed.save(sys.argv[1], step, {"id": shard.ids, "value": np.full((2000, 50), step)}, shard)
            print(step, flush=True)
    """)
    draw = np.random.default_rng(1)
    for k in range(10):
        folder = tmp_path / str(k)
        process = subprocess.Popen([sys.executable, "-c", program, folder], stdout=subprocess.PIPE, text=True,
                                   env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)})
        written = [int(process.stdout.readline()) for _ in range(int(draw.integers(1, 6)))][-1]
        process.send_signal(signal.SIGKILL)
        written = max([written, *map(int, process.communicate()[0].split())])
        found, states = distributed.load(folder, Shard(500, 600, 2000))
        assert found >= written and (states["value"] == found).all()


# -- processes --------------------------------------------------------------------------------------------------------


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def run_ranks(commands, variables):
    """Runs one process for each dict of variables; their outputs."""
    plain = {name: value for name, value in os.environ.items()
             if not name.startswith(("SLURM_", "OMPI_", "PMI_", "RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_"))}
    plain["PYTHONPATH"] = os.pathsep.join(sys.path)
    processes = [subprocess.Popen(commands, env=plain | own, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                 for own in variables]
    outputs = [process.communicate(timeout=250)[0] for process in processes]
    assert [process.returncode for process in processes] == [0] * len(processes), "\n".join(outputs)
    return outputs


LEARNING = ["--iterations", "2", "--envs", "4"]
EXAMPLE = str(pathlib.Path(ROOT) / "examples" / "python" / "07_ranks.py")


@pytest.fixture
def learner():
    for module in ("torch", "tensordict", "rsl_rl"):
        framework(module, "learning on two ranks is")
    for module in ("gymnasium", "mujoco"):
        pytest.importorskip(module, reason="learning on two ranks is NOT tested: pip install gymnasium mujoco")


def test_torchrun_learns_one_policy_on_two_ranks(learner):
    out, = run_ranks([sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--master-port",
                      str(free_port()), EXAMPLE, *LEARNING], [{}])
    assert "2 ranks, 8 environments, 2 iterations" in out
    assert "all of them solved: True" in out and "same policy on all ranks: True" in out


def test_slurms_variables_do_too(learner):
    variables = [{"SLURM_PROCID": str(rank), "SLURM_STEP_NUM_TASKS": "2", "SLURM_LOCALID": str(rank)}
                 for rank in range(2)]
    out = run_ranks([sys.executable, EXAMPLE, *LEARNING, "--master", f"127.0.0.1:{free_port()}"], variables)
    assert "2 ranks, 8 environments" in out[0] and "same policy on all ranks: True" in out[0]
    assert "ranks," not in out[1]


def test_processes_exchange_what_moved(envs_of, alone):
    framework("torch", "environments that move between processes are")
    program = textwrap.dedent("""
        import json, sys
        import torch
        sys.path.insert(0, sys.argv[1])
        from test_distributed import SEED, STEPS, TOTAL, step
        from stiction import distributed
        from stiction.envs import MujocoVectorEnv
        job = distributed.ranks()
        torch.distributed.init_process_group("gloo", rank=job.rank, world_size=job.size)
        make = lambda shard: MujocoVectorEnv("Hopper", shard=shard, tolerance=1e-4, max_episode_steps=150, threads=1)
        offsets = [0, 4, TOTAL]
        envs = make(distributed.Shard.of(offsets))
        envs.reset(seed=SEED)
        step(envs, 0, STEPS // 2)
        seconds = distributed.gather([1.0, 3.0][job.rank])
        offsets = distributed.rebalance(offsets, seconds, most=0.5)
        states = distributed.exchange(envs.states(), distributed.Shard.of(offsets))
        envs = make(distributed.Shard.of(offsets))
        envs.set_states(states)
        step(envs, STEPS // 2, STEPS)
        digest = sum(distributed.gather(distributed.digest(envs.states()))) % 2**64
        if job.is_first:
            print(json.dumps({"digest": digest, "offsets": offsets}))
        torch.distributed.destroy_process_group()
    """)
    port = str(free_port())
    variables = [{"RANK": str(rank), "WORLD_SIZE": "2", "LOCAL_RANK": str(rank), "MASTER_ADDR": "127.0.0.1",
                  "MASTER_PORT": port} for rank in range(2)]
    out = run_ranks([sys.executable, "-c", program, str(pathlib.Path(__file__).parent)], variables)
    said = json.loads(out[0].strip().splitlines()[-1])
    assert said["offsets"] != [0, 4, TOTAL]
    assert said["digest"] == alone[1]
