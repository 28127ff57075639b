"""engine="lanes": hulls and cylinders on all shapes but height fields, beside MuJoCo.

MuJoCo is asked for all digits: it stops at a millionth of a length by default, which a rounded normal shows by its root.
"""

import numpy as np
import pytest
from lanes_models import apart, mujoco
from lanes_pairs import MESHES, assets, encounters, geom_of, model_of_pair

import stiction.mujoco

COUNT = 150
FLAT = [(a, b) for a in ("sphere", "capsule", "box", *MESHES) for b in MESHES if a not in MESHES or a <= b]
ROUND = [("sphere", "cylinder"), ("capsule", "cylinder"), ("cylinder", "cylinder"), ("cylinder", "box"),
         *[("cylinder", mesh) for mesh in MESHES]]


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **options)


def accurate(model):
    model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-13, 300
    model.opt.iterations, model.opt.tolerance, model.opt.ls_tolerance = 500, 1e-15, 1e-6
    return model


def differences(model, data, found):
    """Contacts of each, and how far the nearest of the lanes' is from each of MuJoCo's where both have as many."""
    counts = np.array([sum(contact.efc_address >= 0 for contact in one.contact) for one in data])
    same, far = counts == found["contacts"], []
    for i in np.flatnonzero(same & (counts > 0)):
        mine = found["contact"][i, :counts[i]]
        theirs = np.array([[one.dist, *one.pos, *one.frame[:3]] for one in data[i].contact if one.efc_address >= 0])
        far.append(np.abs(mine[None] - theirs[:, None]).max(2).min(1).max())
    return counts, same, np.array(far)


def name_of(pair):
    return "-".join(pair) if isinstance(pair, tuple) else None


@pytest.mark.parametrize("is_along", [False, True], ids=["apart", "along"])
@pytest.mark.parametrize("margin", [0.01, 0.0])
@pytest.mark.parametrize("pair", FLAT, ids=name_of)
def test_contacts_of_hulls_are_mujocos(pair, margin, is_along):
    model = accurate(model_of_pair(*pair, margin))
    data = encounters(model, COUNT, is_along, seed=1)
    counts, same, far = differences(model, data, lanes(model, data).probe())
    assert (counts > 0).sum() > COUNT // 3 and counts.max() >= min({"sphere": 1, "capsule": 2}.get(pair[0], 4), 4 if is_along else 2)
    # Two ways out that are as short leave a choice. MuJoCo takes a capsule's side from the directions that it tried.
    assert same.mean() > .96, np.flatnonzero(~same)
    assert np.quantile(far, .9 if pair[0] == "capsule" else .96) < 1e-6, np.sort(far)[-9:]


@pytest.mark.parametrize("margin", [0.01, 0.0])
@pytest.mark.parametrize("pair", ROUND, ids=name_of)
def test_contacts_of_cylinders_are_near_mujocos(pair, margin):
    """Both search on a rounded surface: points and normals have the root of the digits of a depth."""
    model = accurate(model_of_pair(*pair, margin))
    data = encounters(model, COUNT, False, seed=2)
    counts, same, far = differences(model, data, lanes(model, data).probe())
    assert (counts > 0).sum() > COUNT // 3 and same.mean() > .96, np.flatnonzero(~same)
    assert np.median(far) < 1e-6 and np.quantile(far, .96) < 2e-4, np.sort(far)[-9:]


@pytest.mark.parametrize("pair", FLAT + ROUND, ids=name_of)
def test_contacts_in_single_precision_are_near(pair):
    model = model_of_pair(*pair)
    data = encounters(model, COUNT, False, seed=3)
    narrow, wide = (lanes(model, data, dtype=dtype).probe() for dtype in ("float32", "float64"))
    same = narrow["contacts"] == wide["contacts"]
    assert same.mean() > 0.96, np.flatnonzero(~same)
    near = [np.abs(narrow["contact"][i] - wide["contact"][i]).max() < 5e-3 for i in np.flatnonzero(same)]
    assert np.mean(near) > 0.9


def dropped(on, falls, top=.1, count=12):
    """Bodies that fall flat on one that stands still, at random places and turns about the upright."""
    model = accurate(mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.002"/>{assets()}<worldbody>
<geom {on}/><body name="b"><freejoint/><geom {falls}/></body></worldbody></mujoco>"""))
    rng, found = np.random.default_rng(5), [mujoco.MjData(model) for _ in range(count)]
    for data in found:
        turn, lean = rng.uniform(0, np.pi), np.array([1.0, *.01 * rng.standard_normal(3)])
        orientation = np.empty(4)
        mujoco.mju_mulQuat(orientation, np.array([np.cos(turn), 0, 0, np.sin(turn)]), lean / np.linalg.norm(lean))
        if model.geom_dataid[1] >= 0:
            mujoco.mju_mulQuat(orientation, orientation.copy(), np.array(model.mesh_quat[model.geom_dataid[1]]))
        data.qpos[:] = [*rng.uniform(-top / 2, top / 2, 2), top + .05, *orientation]
        mujoco.mj_forward(model, data)
    return model, found


@pytest.mark.parametrize("on, top", [('type="box" size=".4 .3 .1"', .1), (geom_of("block"), .05)], ids=["a box", "a hull"])
def test_a_hull_that_falls_moves_as_in_mujoco_and_comes_to_rest(on, top):
    model, data = dropped(on, geom_of("prism"), top)
    simulation = lanes(model, data, tolerance=1e-11)
    for _ in range(20):
        simulation.step(nstep=5)
        for i, one in enumerate(data):
            mujoco.mj_step(model, one, 5)
            assert apart(simulation.qpos[i], one.qpos) < 1e-6, i
    simulation.step(nstep=1500)
    for one in data:
        mujoco.mj_step(model, one, 1500)
    rests = [i for i, one in enumerate(data) if np.abs(one.qvel).max() < 1e-3]  # others fall off
    assert len(rests) > (2 if top < .1 else 11) and np.abs(simulation.qvel[rests]).max() < 1e-3
    assert max(abs(simulation.qpos[i][2] - data[i].qpos[2]) for i in rests) < 1e-4
    assert simulation.probe()["contacts"][rests].min() >= 3


ON_EACH_OTHER = {"a hull on a cap": (geom_of("cylinder", ".4 .1"), geom_of("block")), "a cap on a box": (geom_of("box", ".4 .3 .1"), geom_of("cylinder")),
                 "a cap on a cap": (geom_of("cylinder", ".4 .1"), geom_of("cylinder"))}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("pair", ON_EACH_OTHER)
def test_bodies_come_to_rest_on_each_other(pair, dtype):
    model, data = dropped(*ON_EACH_OTHER[pair])
    simulation = lanes(model, data, dtype=dtype)
    simulation.step(nstep=1500)
    assert not simulation.failed.size and np.abs(simulation.qvel).max() < 1e-2, np.abs(simulation.qvel).max(1)
    found = simulation.probe()
    assert found["contacts"].min() >= 3 and -.005 < found["contact"][:, 0, 0].min()


def test_a_hull_on_a_height_field_and_hulls_without_all_their_points_are_refused():
    field = """<mujoco><asset><hfield name="f" nrow="2" ncol="2" size="1 1 .1 .1"/></asset><worldbody><geom type="hfield" hfield="f"/>
<body pos="0 0 1"><freejoint/><geom type="cylinder" size=".1 .1"/></body></worldbody></mujoco>"""
    with pytest.raises(ValueError, match="a cylinder or mesh and a height field"):
        lanes(mujoco.MjModel.from_xml_string(field), 1)
    for flag in ("NATIVECCD", "MULTICCD"):
        model = model_of_pair("cylinder", "box")
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
        with pytest.raises(ValueError, match=f"with {flag.lower()} disabled"):
            lanes(model, 1)
