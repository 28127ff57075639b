"""The Gymnasium models that the MuJoCo benchmarks share, and the noise that drives them."""

import pathlib

import gymnasium
import mujoco

MODELS = {"Ant": "ant.xml", "HalfCheetah": "half_cheetah.xml", "Hopper": "hopper.xml", "Walker2d": "walker2d_v5.xml",
          "Humanoid": "humanoid.xml"}
OTHERS = {"Swimmer": "swimmer.xml"}
ROBOTS = {"ShadowHand": "hand/manipulate_block.xml", "Franka": "kitchen_franka/kitchen_assets/kitchen_env_model.xml"}
CONES = {"pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL, "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC}


def load(name, cone, robots=None):
    """A model as Gymnasium ships it (pyramidal, its own integrator), but with MuJoCo's Newton and that cone. robots: the
    folder of gymnasium_robotics, for those of its models. A name that ends with .xml is a file."""
    if name.endswith(".xml"):
        path = name
    elif name in ROBOTS:
        path = robots / "envs" / "assets" / ROBOTS[name]
    else:
        path = pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / {**MODELS, **OTHERS}[name]
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.cone = CONES[cone]
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return model


def noise(model, rng, count):
    """Controls (count, nu), uniform over each actuator's range."""
    low, high = model.actuator_ctrlrange.T
    return rng.uniform(low, high, (count, model.nu))


def start(model, rng):
    """A state near the model's own: positions and velocities disturbed by 0.01."""
    data = mujoco.MjData(model)
    mujoco.mj_integratePos(model, data.qpos, 0.01 * rng.standard_normal(model.nv), 1.0)
    return data.qpos.copy(), 0.01 * rng.standard_normal(model.nv)
