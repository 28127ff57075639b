"""A Gymnasium vector environment over MuJoCo models whose constraints stiction solves, all environments in one call."""

import pathlib

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from stiction.core.arguments import whole
from stiction.distributed import generator
from stiction.mujoco import BatchedSimulation

from .tasks import TASKS

_PHYSICS = mujoco.mjtState.mjSTATE_INTEGRATION
_CONES = {"pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL, "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC}


class MujocoVectorEnv(VectorEnv):
    """Gymnasium's "Ant", "HalfCheetah", "Hopper", "Walker2d" or "Humanoid" (version 5: the same observations, rewards,
    ends and resets) with stiction as the constraint solver.

        envs = stiction.envs.MujocoVectorEnv("Ant", num_envs=1024, tolerance=1e-4)
        observations, infos = envs.reset(seed=1)
        observations, rewards, terminations, truncations, infos = envs.step(actions)   # (1024, 8)

    Environment i of reset(seed=s) is seeded with s + i, as in Gymnasium's vector environments. Its results depend on
    its seed and its actions alone, bit for bit: not on num_envs, the others, or threads.

    shard: a stiction.distributed.Shard, for one of several processes. It sets the number of environments; num_envs is
        left out. The noise of their resets then follows the seed, the environment's global id and how many episodes it
        has begun. Hence reset() takes one seed, the same on every rank.
    name: the task, with or without "-v5". max_episode_steps: steps until truncation.
    autoreset_mode: AutoresetMode.NEXT_STEP, SAME_STEP (infos["final_obs"], infos["final_info"]) or DISABLED
        (reset(options={"reset_mask": mask})).
    solver, tolerance, max_iterations, threads, warm_start: of stiction.mujoco.BatchedSimulation.
    engine: "mujoco", or "lanes" (docs/howto/robots_in_lanes.md). There `dtype` is that of the steps, and solver and
        warm_start have no effect. An environment whose step fails for a number that is not finite stays where it was,
        and keeps its observations. varies: constants of which each environment has its own there, such as
        ("body_mass", "geom_friction"), in `simulation.varied`.
    cone: "pyramidal" or "elliptic" instead of the model's (Gymnasium's: pyramidal). xml_file: another model.
    task: parameters of Gymnasium's class, such as ctrl_cost_weight=0.5.

    Raises ValueError for names and parameters that are not known. Nothing is rendered: pass `simulation.data[i]` to a
    mujoco.Renderer.
    """

    def __init__(self, name, num_envs=None, *, shard=None, max_episode_steps=1000, autoreset_mode=AutoresetMode.NEXT_STEP,
                 solver="auto", tolerance=1e-6, max_iterations=1000, threads=0, warm_start=0.95, cone=None,
                 xml_file=None, engine="mujoco", dtype="float64", varies=(), **task):
        name = name.removesuffix("-v5")
        if name not in TASKS:
            raise ValueError(f"name: expected one of {', '.join(TASKS)}, got {name!r}")
        if cone is not None and cone not in _CONES:
            raise ValueError(f"cone: expected 'pyramidal' or 'elliptic', got {cone!r}")
        if shard is not None and num_envs not in (None, shard.num_envs):
            raise ValueError(f"num_envs: expected the shard's {shard.num_envs} or none, got {num_envs}")
        num_envs = shard.num_envs if shard is not None else 1 if num_envs is None else whole("num_envs", num_envs)
        if whole("max_episode_steps", max_episode_steps) < 1:
            raise ValueError(f"max_episode_steps: expected at least 1, got {max_episode_steps}")
        if engine not in ("mujoco", "lanes"):
            raise ValueError(f"engine: expected 'mujoco' or 'lanes', got {engine!r}")
        if len(varies) and engine != "lanes":
            raise ValueError(f"varies: expected none with engine='mujoco', got {varies!r}")
        known = TASKS[name].__dataclass_fields__
        for parameter in task:
            if parameter not in known:
                raise ValueError(f"{parameter}: not a parameter of {name}; there are {', '.join(known)}")
        self.task = TASKS[name](**task)
        self.model = mujoco.MjModel.from_xml_path(str(xml_file or _assets() / self.task.xml))
        if cone is not None:
            self.model.opt.cone = _CONES[cone]
        self.task.prepare(self.model)
        self._is_in_lanes = engine == "lanes"
        how = dict(solver=solver, warm_start=warm_start)
        if self._is_in_lanes:
            how = dict(engine=engine, dtype=dtype, observes_bodies=self.task.observes_bodies, varies=varies)
        self.simulation = BatchedSimulation(self.model, num_envs, tolerance=tolerance, max_iterations=max_iterations,
                                            threads=threads, **how)
        self.num_envs, self.max_episode_steps = num_envs, max_episode_steps
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        first = self.simulation.data[0]
        self.task.init_qpos, self._init_qvel = first.qpos.copy(), first.qvel.copy()
        self.shard, self._seed = shard, None
        self._episodes = np.zeros(num_envs, np.int64)
        self._random = [None] * num_envs
        self.episode_length = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, bool)
        self._is_reset = False

        low, high = self.model.actuator_ctrlrange.astype(np.float32).T
        width = self.task.observe(self._state()).shape[1]
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (width,), np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    # -- Gymnasium's interface ----------------------------------------------------------------------------------------

    def reset(self, *, seed=None, options=None):
        """Starts episodes anew: all, or those of options["reset_mask"], bool (num_envs,).

        seed: int, environment i gets seed + i; a list of one for each, which may include None: its stream goes on.
        """
        mask = np.ones(self.num_envs, bool)
        if options is not None and "reset_mask" in options:
            mask = options["reset_mask"]
            if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
                raise ValueError(f"options['reset_mask']: expected a NumPy bool array ({self.num_envs},) that names an "
                                 f"environment, got {mask!r}")
        elif seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=None if seed is None else int(seed))
        seeds = [None] * self.num_envs if seed is None else \
            [int(seed) + i for i in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected an int or {self.num_envs} of them, got {len(seeds)}")
        if self.shard is None:
            for i in np.flatnonzero(mask):
                if seeds[i] is not None or self._random[i] is None:
                    self._random[i], _ = seeding.np_random(seeds[i])
        elif seed is not None:
            if not isinstance(seed, (int, np.integer)) or seed < 0:
                raise ValueError(f"seed: expected one number, the same on every rank, got {seed!r}")
            self._seed = int(seed)
            self._episodes[mask] = 0
        elif self._seed is None:
            raise ValueError("seed: expected one number, the same on every rank, got None at the first reset")
        if not self._is_reset and not mask.all():
            raise ValueError("options['reset_mask']: expected a reset of all environments first")
        self._is_reset = True
        self._start_over(mask)
        state = self._state()
        return self.task.observe(state), _masked(self.task.where(state), mask)

    def step(self, actions):
        """One control step (frame_skip time steps) of every environment. actions (num_envs, nu) [of ctrl]."""
        actions = np.asarray(actions)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"actions: expected {self.action_space.shape}, got {actions.shape}")
        if not self._is_reset:
            raise gymnasium.error.ResetNeeded("step before reset: call reset(seed=...) first")
        restarting = np.zeros(self.num_envs, bool)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            restarting = self._over.copy()
        elif self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            raise ValueError(f"environment {int(np.argmax(self._over))} has ended: reset(options={{'reset_mask': ...}})")

        moving = ~restarting
        before = self.task.place(self._state()).copy()
        if moving.any():
            everyone = None if moving.all() else moving
            self.simulation.step(actions, self.task.frame_skip, active=everyone)
            if not self._is_in_lanes:
                self.simulation.run("mj_rnePostConstraint", active=everyone)
        self.episode_length[moving] += 1
        if restarting.any():
            self._start_over(restarting)
        state = self._state()
        rewards, terminations, infos = self.task.step(state, before, actions)
        observations = self.task.observe(state)
        rewards[restarting] = 0.0
        terminations &= moving
        truncations = moving & (self.episode_length >= self.max_episode_steps)
        infos = _masked(infos, moving)
        if restarting.any():
            _add(infos, self.task.where(state), restarting)
        over = terminations | truncations
        if self.autoreset_mode is AutoresetMode.SAME_STEP and over.any():
            observations, infos = self._restart_now(over, observations, infos)
            self._over[:] = False
        else:
            self._over = over
        return observations, rewards, terminations, truncations, infos

    def _restart_now(self, over, observations, infos):
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = observations[i].copy()
        ended = {name: np.where(_wide(over, value), value, np.zeros_like(value))
                 for name, value in infos.items() if not name.startswith("_")}
        ended.update({f"_{name}": over.copy() for name in list(ended)})
        self._start_over(over)
        state = self._state()
        where = self.task.where(state)
        observations = self.task.observe(state)
        infos = _masked({name: value for name, value in infos.items() if not name.startswith("_")}, ~over)
        _add(infos, where, over)
        infos.update({"final_obs": final, "_final_obs": over.copy(), "final_info": ended, "_final_info": over.copy()})
        return observations, infos

    # -- beyond it ----------------------------------------------------------------------------------------------------

    def set_accuracy(self, accuracy):
        """Tolerance and iteration limit of the solves to come: the result of a stiction.AccuracyPolicy's `apply`.
        Raises ValueError in lanes, where both are given when the environments are made."""
        self._require_mujoco()
        self.simulation.set_accuracy(accuracy.tolerance, accuracy.max_iterations)

    def stats(self):
        """Statistics of the solves, as stiction.Solver.stats(). Raises ValueError in lanes: see `simulation.status`."""
        self._require_mujoco()
        return self.simulation.solver.stats()

    def states(self):
        """All that the environments go on from, arrays by environment. "id", "seed", "episode", "episode_length",
        "over" and "physics" (MuJoCo's integration state) are there, the task's observations, and constants that vary.
        For checkpoints, and for environments that move to another rank (stiction.distributed). Needs a shard.

        Raises ValueError where solves start from the reactions of the step before, which are not included.
        """
        self._require_shard()
        physics = np.empty((self.num_envs, mujoco.mj_stateSize(self.model, _PHYSICS)))
        for i, data in enumerate(self.simulation.data):
            mujoco.mj_getState(self.model, data, physics[i], _PHYSICS)
        return {"id": self.shard.ids, "seed": np.full(self.num_envs, self._seed, np.int64), "episode": self._episodes.copy(),
                "episode_length": self.episode_length.copy(), "over": self._over.copy(), "physics": physics,
                **{f"seen_{field}": values for field, values in self._state().items()},
                **{f"varied_{name}": values.copy() for name, values in self._varied().items()}}

    def set_states(self, states):
        """Goes on from states() of this shard's environments, which any rank and any number of ranks may have returned.
        Returns the observations, as the last step did."""
        self._require_shard(is_set=True)
        if not np.array_equal(states["id"], self.shard.ids):
            raise ValueError(f"states: expected those of environments {self.shard.begin}..{self.shard.end - 1}")
        if states["physics"].shape[1] != mujoco.mj_stateSize(self.model, _PHYSICS):
            raise ValueError("states: expected those of this model, got those of another")
        seen = self.simulation.observed if self._is_in_lanes else {}
        for i, data in enumerate(self.simulation.data):
            mujoco.mj_setState(self.model, data, states["physics"][i], _PHYSICS)
            for field in self.task.fields:
                (seen[field][i] if field in seen else getattr(data, field))[:] = states[f"seen_{field}"][i]
            if self._is_in_lanes:
                self.simulation.take(i)
        for name, values in self._varied().items():
            values[:] = states[f"varied_{name}"]
        self._seed = int(states["seed"][0])
        self._episodes[:], self.episode_length[:], self._over[:] = (states[name] for name in
                                                                    ("episode", "episode_length", "over"))
        self._is_reset = True
        return self.task.observe(self._state())

    def _varied(self):
        return self.simulation.varied if self._is_in_lanes else {}

    def _require_mujoco(self):
        if self._is_in_lanes:
            raise ValueError("engine: expected 'mujoco', got 'lanes'")

    def _require_shard(self, is_set=False):
        if self.shard is None:
            raise ValueError("shard: expected a stiction.distributed.Shard, got None: environments have no ids")
        if not is_set and not self._is_reset:
            raise gymnasium.error.ResetNeeded("states before reset: call reset(seed=...) first")
        if not self._is_in_lanes and self.simulation.starts_from_reactions:
            raise ValueError("warm_start: expected 0 with this solver, whose solves start from the last reactions: they "
                             "are not part of a state")

    def _start_over(self, mask):
        chosen = np.flatnonzero(mask)
        self.simulation.reset(chosen)
        states = None if self._is_in_lanes else self.simulation.data
        for i in chosen:
            qpos, qvel = self.task.noise(self._stream(i), self.model.nq, self.model.nv)
            to = (self.simulation.qpos[i], self.simulation.qvel[i]) if states is None else (states[i].qpos, states[i].qvel)
            to[0][:] = self.task.init_qpos + qpos
            to[1][:] = self._init_qvel + qvel
        if not self._is_in_lanes or self.task.observes_bodies:
            self.simulation.forward(active=None if mask.all() else mask)
        if "cfrc_ext" in self.task.fields and self._is_in_lanes:
            self.simulation.observed["cfrc_ext"][chosen] = 0  # as mj_resetData and mj_forward leave it
        self.simulation.reset_warm_start(chosen)
        self._episodes[chosen] += 1
        self.episode_length[chosen] = 0
        self._over[chosen] = False

    def _stream(self, i):
        """Random numbers of the episode that environment i begins."""
        if self.shard is None:
            return self._random[i]
        return generator(self._seed, self.shard.begin + i, int(self._episodes[i]))

    def _state(self):
        return {field: self.simulation.read(field) for field in self.task.fields}


def _wide(mask, value):
    return mask.reshape(mask.shape + (1,) * (value.ndim - 1))


def _masked(infos, mask):
    """Infos of the environments of a mask, zeros elsewhere, and the masks themselves, as Gymnasium has them."""
    out = {}
    _add(out, infos, mask)
    return out


def _add(out, infos, mask):
    for name, value in infos.items():
        if name not in out:
            out[name], out[f"_{name}"] = np.zeros_like(value), np.zeros(len(mask), bool)
        out[name][mask] = value[mask]
        out[f"_{name}"] = out[f"_{name}"] | mask


def _assets():
    return pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
