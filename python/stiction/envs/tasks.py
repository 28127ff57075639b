"""Gymnasium's MuJoCo tasks, version 5, for many simulations at once: observation, reward, termination, reset noise.

Each class takes the parameters of Gymnasium's class of that name (those of rendering left out), with the same
defaults. It computes the same, over arrays whose first axis is the environment.
"""

from dataclasses import dataclass

import numpy as np


def _norm(xy):
    return np.sqrt(xy[:, 0] ** 2 + xy[:, 1] ** 2)


def _between(values, limits):
    return (limits[0] < values) & (values < limits[1])


@dataclass
class _Task:
    """Base of the tasks.

    Fields of mjData that a task reads are in `fields`; `state` is a dict of them, arrays (environments, ...).
    """

    frame_skip: int = 5
    forward_reward_weight: float = 1.0
    ctrl_cost_weight: float = 0.1
    reset_noise_scale: float = 0.1
    exclude_current_positions_from_observation: bool = True

    xml = ""
    hidden = 1              # positions along the ground that are left out of the observation
    normal_velocities = False  # reset noise of velocities: normal, or uniform
    fields = ("qpos", "qvel")

    @property
    def observes_bodies(self):
        """True where it reads more than coordinates, velocities and controls."""
        return not set(self.fields) <= {"qpos", "qvel", "ctrl"}

    def prepare(self, model):
        """Called once, with the model."""
        self.init_qpos = None
        self.dt = model.opt.timestep * self.frame_skip

    def place(self, state):
        """Positions of the environments, before and after a step [m]."""
        return state["qpos"][:, :1]

    def noise(self, rng, nq, nv):
        """Noise that a reset adds to positions and velocities."""
        scale = self.reset_noise_scale
        qpos = rng.uniform(low=-scale, high=scale, size=nq)
        if self.normal_velocities:
            return qpos, scale * rng.standard_normal(nv)
        return qpos, rng.uniform(low=-scale, high=scale, size=nv)

    def observe(self, state):
        skipped = self.hidden if self.exclude_current_positions_from_observation else 0
        return np.concatenate([state["qpos"][:, skipped:], self.velocities(state["qvel"])] + self.extras(state), axis=1)

    def velocities(self, qvel):
        return qvel

    def extras(self, state):
        """Parts of the observation beyond positions and velocities."""
        return []

    def healthy(self, state):
        """True for each environment that is upright, or None if the task does not ask."""
        return None

    def costs(self, state, actions):
        """Reward terms that are taken off, by the name they have in infos."""
        return {"reward_ctrl": self.ctrl_cost_weight * np.sum(np.square(actions), axis=1)}

    def step(self, state, before, actions):
        """Rewards, terminations and infos of a step that began at `before`."""
        velocity = (self.place(state) - before) / self.dt
        forward = self.forward_reward_weight * velocity[:, 0]
        rewards, terms = forward, {"reward_forward": forward}
        healthy = self.healthy(state)
        terminated = np.zeros(len(forward), bool)
        if healthy is not None:
            survive = healthy * self.healthy_reward
            rewards = rewards + survive
            terms["reward_survive"] = survive
            if self.terminate_when_unhealthy:
                terminated = ~healthy
        costs = self.costs(state, actions)
        rewards = rewards - sum(costs.values())
        terms.update({name: -cost for name, cost in costs.items()})
        infos = self.where(state)
        infos.update({f"{axis}_velocity": velocity[:, i] for i, axis in enumerate("xy"[:velocity.shape[1]])})
        return rewards, terminated, infos | terms

    def where(self, state):
        """Infos of a reset, and of a step beside its rewards."""
        return {"x_position": state["qpos"][:, 0]}


@dataclass
class HalfCheetah(_Task):
    xml = "half_cheetah.xml"
    normal_velocities = True


@dataclass
class _Planar(_Task):
    frame_skip: int = 4
    ctrl_cost_weight: float = 1e-3
    reset_noise_scale: float = 5e-3
    healthy_reward: float = 1.0
    terminate_when_unhealthy: bool = True

    def velocities(self, qvel):
        return np.clip(qvel, -10, 10)

    def where(self, state):
        return {"x_position": state["qpos"][:, 0], "z_distance_from_origin": state["qpos"][:, 1] - self.init_qpos[1]}

    def healthy(self, state):
        return _between(state["qpos"][:, 1], self.healthy_z_range) & \
            _between(state["qpos"][:, 2], self.healthy_angle_range)


@dataclass
class Hopper(_Planar):
    healthy_state_range: tuple = (-100.0, 100.0)
    healthy_z_range: tuple = (0.7, float("inf"))
    healthy_angle_range: tuple = (-0.2, 0.2)
    xml = "hopper.xml"

    def healthy(self, state):
        all_of_it = np.concatenate([state["qpos"], state["qvel"]], axis=1)[:, 2:]
        return super().healthy(state) & _between(all_of_it, self.healthy_state_range).all(axis=1)


@dataclass
class Walker2d(_Planar):
    healthy_z_range: tuple = (0.8, 2.0)
    healthy_angle_range: tuple = (-1.0, 1.0)
    xml = "walker2d_v5.xml"


@dataclass
class Ant(_Task):
    ctrl_cost_weight: float = 0.5
    contact_cost_weight: float = 5e-4
    healthy_reward: float = 1.0
    main_body: int = 1
    terminate_when_unhealthy: bool = True
    healthy_z_range: tuple = (0.2, 1.0)
    contact_force_range: tuple = (-1.0, 1.0)
    include_cfrc_ext_in_observation: bool = True
    xml = "ant.xml"
    hidden = 2
    normal_velocities = True
    fields = ("qpos", "qvel", "xpos", "cfrc_ext")

    def prepare(self, model):
        super().prepare(model)
        self._body = model.body(self.main_body).id

    def place(self, state):
        return state["xpos"][:, self._body, :2]

    def forces(self, state):
        return np.clip(state["cfrc_ext"], *self.contact_force_range)

    def extras(self, state):
        if not self.include_cfrc_ext_in_observation:
            return []
        return [self.forces(state)[:, 1:].reshape(len(state["qpos"]), -1)]

    def healthy(self, state):
        low, high = self.healthy_z_range
        finite = np.isfinite(state["qpos"]).all(axis=1) & np.isfinite(state["qvel"]).all(axis=1)
        return finite & (low <= state["qpos"][:, 2]) & (state["qpos"][:, 2] <= high)

    def costs(self, state, actions):
        contact = self.contact_cost_weight * np.sum(np.square(self.forces(state)), axis=(1, 2))
        return super().costs(state, actions) | {"reward_contact": contact}

    def where(self, state):
        return {"x_position": state["qpos"][:, 0], "y_position": state["qpos"][:, 1],
                "distance_from_origin": _norm(state["qpos"])}


@dataclass
class Humanoid(_Task):
    forward_reward_weight: float = 1.25
    contact_cost_weight: float = 5e-7
    contact_cost_range: tuple = (-np.inf, 10.0)
    healthy_reward: float = 5.0
    terminate_when_unhealthy: bool = True
    healthy_z_range: tuple = (1.0, 2.0)
    reset_noise_scale: float = 1e-2
    include_cinert_in_observation: bool = True
    include_cvel_in_observation: bool = True
    include_qfrc_actuator_in_observation: bool = True
    include_cfrc_ext_in_observation: bool = True
    xml = "humanoid.xml"
    hidden = 2
    fields = ("qpos", "qvel", "xipos", "cinert", "cvel", "qfrc_actuator", "cfrc_ext", "ctrl", "ten_length",
              "ten_velocity")

    def prepare(self, model):
        super().prepare(model)
        self._mass = model.body_mass.copy()

    def place(self, state):
        return (np.einsum("b,ebj->ej", self._mass, state["xipos"]) / self._mass.sum())[:, :2]

    def extras(self, state):
        count = len(state["qpos"])
        parts = ((self.include_cinert_in_observation, state["cinert"][:, 1:]),
                 (self.include_cvel_in_observation, state["cvel"][:, 1:]),
                 (self.include_qfrc_actuator_in_observation, state["qfrc_actuator"][:, 6:]),
                 (self.include_cfrc_ext_in_observation, state["cfrc_ext"][:, 1:]))
        return [part.reshape(count, -1) for wanted, part in parts if wanted]

    def healthy(self, state):
        return _between(state["qpos"][:, 2], self.healthy_z_range)

    def costs(self, state, actions):
        contact = self.contact_cost_weight * np.sum(np.square(state["cfrc_ext"]), axis=(1, 2))
        return super().costs(state, state["ctrl"]) | {"reward_contact": np.clip(contact, *self.contact_cost_range)}

    def where(self, state):
        return {"x_position": state["qpos"][:, 0], "y_position": state["qpos"][:, 1],
                "tendon_length": state["ten_length"], "tendon_velocity": state["ten_velocity"],
                "distance_from_origin": _norm(state["qpos"])}


TASKS = {task.__name__: task for task in (Ant, HalfCheetah, Hopper, Walker2d, Humanoid)}
