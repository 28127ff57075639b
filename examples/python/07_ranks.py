"""PPO of rsl_rl over several processes: each has its own environments, gradients are averaged over all.

    torchrun --nproc-per-node 2 examples/python/07_ranks.py
    srun --ntasks 2 python examples/python/07_ranks.py --master node01:29500

Needs rsl-rl-lib, tensordict, gymnasium, mujoco. docs/howto/clusters.md.
"""

import argparse
import os
import pathlib
import runpy
import sys
import tempfile

try:
    import torch
    from gymnasium.vector import AutoresetMode
    from rsl_rl.runners import OnPolicyRunner

    from stiction import distributed
    from stiction.envs import MujocoVectorEnv
    from stiction.envs.rsl_rl import RslRlEnv
except ImportError as missing:
    print(f"NOT run, because this needs rsl-rl-lib, tensordict, gymnasium and mujoco: {missing}")
    sys.exit(77)

train_cfg = runpy.run_path(str(pathlib.Path(__file__).with_name("06_rsl_rl.py")))["train_cfg"]


class CpuRunner(OnPolicyRunner):
    """rsl_rl's runner over processes on CPUs: its own asks for a GPU each, and for NCCL."""

    def __init__(self, job, *arguments, **named):
        self._job = job
        super().__init__(*arguments, **named)

    def _configure_multi_gpu(self):
        job = self._job
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank = job.size, job.rank, job.local_rank
        self.is_distributed = job.size > 1
        self.cfg["multi_gpu"] = {"global_rank": job.rank, "local_rank": job.local_rank, "world_size": job.size} \
            if self.is_distributed else None


def connect(job, master):
    """The process group, by gloo; torchrun says where its first process is, Slurm and mpirun do not."""
    if job.size == 1:
        return
    if master:
        os.environ["MASTER_ADDR"], _, os.environ["MASTER_PORT"] = master.rpartition(":")
    torch.distributed.init_process_group("gloo", rank=job.rank, world_size=job.size)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="Hopper")
    parser.add_argument("--envs", type=int, default=32, help="of each process")
    parser.add_argument("--iterations", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1, help="of each process")
    parser.add_argument("--master", default="", help="HOST:PORT of rank 0, where the launcher does not say")
    arguments = parser.parse_args()
    job = distributed.ranks()
    connect(job, arguments.master)
    torch.set_num_threads(1)
    torch.manual_seed(arguments.seed + job.rank)  # of the policy's noise; the first weights are rank 0's
    shard = distributed.Shard.per_rank(arguments.envs, job)
    envs = MujocoVectorEnv(arguments.task, shard=shard, tolerance=1e-4, threads=arguments.threads,
                           autoreset_mode=AutoresetMode.SAME_STEP)
    env = RslRlEnv(envs)
    env.reset(seed=arguments.seed)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # the log's thread may still be writing
        runner = CpuRunner(job, env, train_cfg(), log_dir=folder if job.is_first else None)
        runner.learn(arguments.iterations, init_at_random_ep_len=False)
    weights = torch.cat([weight.detach().reshape(-1) for weight in runner.alg.actor.parameters()])
    same = all(torch.equal(weights, other) for other in distributed.gather(weights))
    stats = distributed.merge_stats(distributed.gather(envs.stats()))
    if job.is_first:
        returns = runner.logger.rewbuffer
        print(f"{job.size} ranks, {shard.total} environments, {arguments.iterations} iterations: return "
              f"{sum(returns) / max(1, len(returns)):.0f} over the last {len(returns)} episodes of rank 0, "
              f"{stats['environments']} solves, all of them solved: {list(stats['codes']) == ['solved']}, "
              f"same policy on all ranks: {same}")
    if job.size > 1:
        torch.distributed.destroy_process_group()


if __name__ == "__main__":
    main()
