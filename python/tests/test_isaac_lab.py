"""The class of docs/howto/newton.md inside Isaac Lab itself, without Isaac Sim: boxes that fall, rest and slide. The
page names the packages to install.
"""

import importlib.util
import re
import sys
import types

import numpy as np
import pytest
from conftest import ROOT

if importlib.util.find_spec("isaaclab_newton") is None:
    pytest.skip("the page's lines are NOT run in Isaac Lab: isaaclab 3.0.0 is not installed (docs/howto/newton.md)",
                allow_module_level=True)

import isaaclab.sim as sim_utils  # noqa: E402
import torch  # noqa: E402
from isaaclab.assets import AssetBaseCfg, RigidObjectCfg  # noqa: E402
from isaaclab.cloner import CloneCfg, clone_plan_from_env_0, replicate  # noqa: E402
from isaaclab.sensors import ContactSensorCfg  # noqa: E402
from isaaclab_newton.assets import RigidObject  # noqa: E402
from isaaclab_newton.physics import NewtonCfg, NewtonManager  # noqa: E402
from isaaclab_newton.sensors import ContactSensor  # noqa: E402

from stiction.newton import SolverStiction  # noqa: E402

pytestmark = pytest.mark.warp
G, DT, WORLDS = 9.81, 1 / 200, 3


@pytest.fixture
def page(monkeypatch):
    """The page's lines as a module."""
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)  # where Isaac Lab's configclass looks for annotations
    text = (ROOT / "docs" / "howto" / "newton.md").read_text(encoding="utf-8")
    exec(re.search(r"```python\n(from isaaclab.*?)```", text, re.DOTALL).group(1), vars(module))
    return module


def box(path, size, height, **more):
    spawn = sim_utils.CuboidCfg(size=size, collision_props=sim_utils.UsdPhysicsCollisionCfg(), **more)
    kind = RigidObjectCfg if more else AssetBaseCfg
    return kind(prim_path=path, spawn=spawn, init_state=kind.InitialStateCfg(pos=(0.0, 0.0, height)))


@pytest.mark.quick
def test_boxes_fall_rest_and_slide_in_isaac_lab(page):
    """Every world has a box of 2 kg, 0.2 m high, which falls from 0.3 m on a floor that all worlds share; mu = 1."""
    physics = NewtonCfg(solver_cfg=page.StictionSolverCfg(), use_cuda_graph=False)
    config = sim_utils.SimulationCfg(dt=DT, device="cpu", gravity=(0.0, 0.0, -G), physics=physics)
    with sim_utils.build_simulation_context(sim_cfg=config, device="cpu") as sim:
        sim_utils.create_prim("/World/Env_0", "Xform")
        floor = box("/World/floor", (20.0, 20.0, 1.0), -0.5)
        cube = box("/World/Env_[^/]*/cube", (0.2, 0.2, 0.2), 0.3, rigid_props=sim_utils.UsdPhysicsRigidBodyCfg(),
                   mass_props=sim_utils.MassPropertiesCfg(mass=2.0))
        touch = ContactSensorCfg(prim_path="/World/Env_[^/]*/cube")
        places = np.zeros((WORLDS, 3), np.float32)
        places[:, 0] = np.arange(WORLDS)
        plan = clone_plan_from_env_0(CloneCfg(clone_template="/World/Env_{}"), (floor, cube, touch), WORLDS, 1.0,
                                     positions=places)
        floor.spawn.func(floor.prim_path, floor.spawn, translation=floor.init_state.pos)
        boxes, sensor = RigidObject(cube), ContactSensor(touch)
        replicate(plan)
        sim.reset()
        assert type(NewtonManager._solver) is SolverStiction and NewtonManager._solver.law == "coulomb"

        def step(count):
            for _ in range(count):
                sim.step(render=False)
                boxes.update(DT)
                sensor.update(DT)
            return boxes.data.root_pos_w.torch.numpy(), boxes.data.root_lin_vel_w.torch.numpy()

        np.testing.assert_allclose(step(10)[0][:, 2], 0.3 - G * DT**2 * 55, atol=1e-5)  # 1 + 2 + ... + 10
        np.testing.assert_allclose(step(190)[0][:, 2], 0.1, atol=1e-4)
        assert not NewtonManager._solver.status["code"].any() and NewtonManager._solver.solver.stats()["solves"] == 200
        np.testing.assert_allclose(sensor.data.net_forces_w.torch.numpy()[:, 0], [[0, 0, 2 * G]] * WORLDS, atol=1e-2)
        speed = torch.tensor([[3.0, 0, 0, 0, 0, 0]])
        boxes.write_root_velocity_to_sim_index(root_velocity=speed, env_ids=torch.tensor([1], dtype=torch.int32))
        _, velocity = step(20)
        np.testing.assert_allclose(velocity[1, 0], 3 - G * 20 * DT, atol=1e-2)  # slides, by mu g; it does not tip in that time
        np.testing.assert_allclose(velocity[[0, 2]], 0, atol=1e-5)
