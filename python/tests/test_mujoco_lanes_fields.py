"""engine="lanes": spheres, capsules and boxes on height fields, beside MuJoCo and beside planes."""

import pathlib

import numpy as np
import pytest
from lanes_models import apart, fallen_states, mujoco
from lanes_pairs import place_geom

import stiction
import stiction.mujoco

COUNT = 300
SIZES = {"sphere": ".06", "capsule": ".03 .1", "box": ".1 .06 .04"}
XML = """
<mujoco><option timestep="0.002" cone="elliptic" integrator="implicitfast"/><default><geom margin="{margin}" gap="{gap}"/></default>
<asset><hfield name="field" nrow="9" ncol="7" size=".6 .8 .3 .1"/></asset><worldbody>
<body pos=".1 -.2 .3" euler="8 -12 30"><geom name="field" type="hfield" hfield="field" pos=".02 .01 -.03" euler="0 0 20"/></body>
<body><freejoint/><geom type="{kind}" size="{size}" pos=".01 .02 0" euler="10 0 30"/></body></worldbody></mujoco>"""


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **options)


def model_of(kind, margin=0.0, gap=0.0, size=None):
    model = mujoco.MjModel.from_xml_string(XML.format(kind=kind, size=size or SIZES[kind], margin=margin, gap=gap))
    model.hfield_data[:] = np.random.default_rng(1).uniform(0, 1, model.nhfielddata)
    # MuJoCo's search for nearest points stops here; its default is a millionth of a length.
    model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-10, 300
    model.opt.tolerance, model.opt.iterations = 1e-15, 500
    return model


def poses(model, count, low, high, seed=0):
    """Data with the shape at random over the field and beyond its edges, its height between two in the field's frame."""
    rng, found = np.random.default_rng(seed), [mujoco.MjData(model) for _ in range(count)]
    for data in found:
        mujoco.mj_kinematics(model, data)
        place = data.geom_xpos[0] + data.geom_xmat[0].reshape(3, 3) @ rng.uniform([-.65, -.85, low], [.65, .85, high])
        turn = rng.standard_normal(4)
        turn /= np.linalg.norm(turn)
        at, orientation, back, inverse = np.empty(3), np.empty(4), np.empty(3), np.empty(4)
        mujoco.mju_negPose(back, inverse, model.geom_pos[1], model.geom_quat[1])
        mujoco.mju_mulPose(at, orientation, place, turn, back, inverse)
        data.qpos[:] = [*at, *orientation]
        data.qvel[:] = 0.3 * rng.standard_normal(6)
        mujoco.mj_forward(model, data)
    return found


def theirs_of(one):
    """Distance, normal and point of contacts that have rows."""
    return np.array([[c.dist, *c.frame[:3], *c.pos] for c in one.contact if c.efc_address >= 0]).reshape(-1, 7)


def mine_of(found, i):
    return found["contact"][i, :found["contacts"][i]][:, [0, 4, 5, 6, 1, 2, 3]]


def unmatched(some, others, within):
    """Rows of `some` that no row of `others` is near in distance, normal and point."""
    if not len(some) or not len(others):
        return some
    errors = np.abs(some[:, None] - others[None])
    near = (errors[..., :1] < within[0]).all(2) & (errors[..., 1:4] < within[1]).all(2) & (errors[..., 4:] < within[2]).all(2)
    return some[~near.any(1)]


# Errors of MuJoCo's search at a tolerance of 1e-10. If a centre is inside, its points are those of a polyhedron that
# grows to a sphere: the square root of its tolerance.
WITHIN = (1e-9, 1e-7, 2e-5)


@pytest.mark.parametrize("margin, gap, size", [(0.0, 0.0, None), (0.01, 0.0, None), (0.01, 0.015, None), (0.01, 0.0, ".14")])
def test_contacts_of_spheres_are_mujocos(margin, gap, size):
    """Larger ones have the deepest eight, and records are flagged."""
    model = model_of("sphere", margin, gap, size=size)
    data = poses(model, 3 * COUNT, -.1, .4)
    simulation = lanes(model, data)
    found = simulation.probe()
    simulation.forward()
    full = simulation.status["flags"] != 0
    for i, one in enumerate(data):
        mine, theirs = mine_of(found, i), theirs_of(one)
        assert len(mine) == min(len(theirs), 8) and full[i] == (len(theirs) > 8), i
        assert not len(unmatched(mine, theirs, WITHIN)), (i, mine, theirs)
        left_out = unmatched(theirs, mine, WITHIN)
        assert not len(left_out) or (full[i] and left_out[:, 0].min() > mine[:, 0].max() - WITHIN[0]), (i, mine, theirs)
    counts = found["contacts"]
    assert full.any() == (size is not None)
    assert (counts > 0).mean() > 0.4 and counts.max() >= 6


@pytest.mark.parametrize("margin, size", [(0.0, None), (0.01, None), (0.0, ".02 .3")])
def test_contacts_of_capsules_are_mujocos_and_those_of_their_ends(margin, size):
    """MuJoCo has one in each prism. Lanes have that, and the ends that are over the prism, which planes have too."""
    model = model_of("capsule", margin, size=size)
    data = poses(model, COUNT, -.02, .4, seed=2)
    simulation = lanes(model, data)
    found = simulation.probe()
    simulation.forward()
    radius, half = model.geom_size[1, :2]
    matched = extra = 0
    for i, one in enumerate(data):
        if simulation.status["flags"][i]:
            continue
        mine, theirs = mine_of(found, i), theirs_of(one)
        assert not len(unmatched(theirs, mine, WITHIN)), (i, mine, theirs)
        own = unmatched(mine, theirs, WITHIN)
        middles = own[:, 4:] + own[:, 1:4] * (own[:, :1] / 2 + radius)
        ends = one.geom_xpos[1] + np.array([[-half], [half]]) * one.geom_xmat[1].reshape(3, 3)[:, 2]
        assert all(np.abs(middle - ends).max(1).min() < 1e-9 for middle in middles), (i, own)
        matched, extra = matched + len(theirs), extra + len(own)
    assert (simulation.status["flags"] != 0).mean() < 0.05
    assert matched > COUNT / 2 and extra < matched, (matched, extra)


def ridges(heights, base):
    """Points of a grid that are above the middle of neighbours in some direction of the cuts, and in none below it."""
    found = []
    for r, c in np.ndindex(heights.shape):
        rises = []
        for dr, dc in ((0, 1), (1, 0), (1, 1)):
            around = [(r - dr, c - dc), (r + dr, c + dc)]
            is_inside = all(0 <= i < heights.shape[0] and 0 <= j < heights.shape[1] for i, j in around)
            rises.append(heights[r, c] - (np.mean([heights[one] for one in around]) if is_inside else -base))
        if min(rises) > -1e-9 and max(rises) > 1e-9:
            found.append((r, c))
    return found


def test_boxes_touch_by_corners_over_the_field_and_by_its_ridges():
    """Heights and slopes of the field by interpolation in each triangle; ridges are near the box's nearest face."""
    model = model_of("box", 0.01)
    data = poses(model, COUNT, 0.0, .35, seed=3)
    found = lanes(model, data).probe()
    heights, (x, y, _, base) = model.hfield_data.reshape(9, 7) * model.hfield_size[0, 2], model.hfield_size[0]
    dx, dy, margin = 2 * x / 6, 2 * y / 8, model.geom_margin.sum()
    corners = np.array([[a, b, c] for c in (-1, 1) for b in (-1, 1) for a in (-1, 1)]) * model.geom_size[1]
    on_ridges, seen, peaks = ridges(heights, base), 0, 0
    for i, one in enumerate(data):
        R, turn = one.geom_xmat[0].reshape(3, 3), one.geom_xmat[1].reshape(3, 3)
        expected = []
        for corner in corners:
            p = R.T @ (one.geom_xpos[1] + turn @ corner - one.geom_xpos[0])
            if abs(p[0]) > x or abs(p[1]) > y or p[2] < -base or len(expected) == 4:
                continue
            c, r = int((p[0] + x) // dx), int((p[1] + y) // dy)
            u, v = (p[0] + x) / dx - c, (p[1] + y) / dy - r
            h00, h01, h10, h11 = heights[r, c], heights[r, c + 1], heights[r + 1, c], heights[r + 1, c + 1]
            slope = ((h11 - h10) / dx, (h10 - h00) / dy) if v > u else ((h01 - h00) / dx, (h11 - h01) / dy)
            n = np.array([-slope[0], -slope[1], 1.0])
            above = p[2] - (h00 + u * dx * slope[0] + v * dy * slope[1])
            distance, n = above / np.linalg.norm(n), n / np.linalg.norm(n)
            if distance < margin and n @ (R.T @ (turn @ corner)) <= 0:
                expected.append([distance, *(R @ n), *(one.geom_xpos[0] + R @ (p - n * distance / 2))])
        for r, c in on_ridges:
            p = one.geom_xpos[0] + R @ [c * dx - x, r * dy - y, heights[r, c]]
            q = turn.T @ (p - one.geom_xpos[1])
            over = np.abs(q) - model.geom_size[1]
            away = -np.sign(q) * (np.maximum(over, 0) if over.max() > 0 else -np.eye(3)[over.argmax()] * over.max())
            distance = np.linalg.norm(away) if over.max() > 0 else over.max()
            n = turn @ away / np.linalg.norm(away)
            if distance < margin:
                expected.append([distance, *n, *(p + n * distance / 2)])
                peaks += 1
        mine = mine_of(found, i)
        assert len(mine) == len(expected), i
        assert not len(unmatched(mine, np.array(expected).reshape(-1, 7), (1e-12,) * 3)), i
        seen += len(mine)
    assert seen > COUNT / 2 and peaks > COUNT / 10


def test_contacts_in_single_precision_are_near():
    for kind in SIZES:
        model = model_of(kind, 0.01)
        data = poses(model, COUNT, 0.0, .4, seed=4)
        narrow, wide = (lanes(model, data, dtype=dtype).probe() for dtype in ("float32", "float64"))
        assert (narrow["contacts"] == wide["contacts"]).all(), kind
        for i in range(COUNT):
            mine, theirs = mine_of(narrow, i), mine_of(wide, i)
            assert not len(unmatched(mine, theirs, (1e-6, 1e-4, 1e-6))), (kind, i, mine, theirs)


# A table on four posts, whose feet are spheres, and a log and a crate beside it.
STAND = """
<mujoco><option timestep="0.002" cone="elliptic" impratio="2"/><default><geom friction=".8 .02 .001"/></default>
<asset><hfield name="field" nrow="{rows}" ncol="{columns}" size="{width} {width} .04 .5"/></asset><worldbody>
<geom name="ground" {ground} pos="{at}" euler="{turn}"/>
<body pos="0 0 .25"><freejoint/><geom type="box" size=".2 .15 .03" mass="4"/>{feet}</body>
<body pos=".6 .1 .06" euler="90 0 20"><freejoint/><geom type="capsule" size=".05 .1"/></body>
<body pos="-.6 .1 .11" euler="0 0 40"><freejoint/><geom type="box" size=".1 .12 .1"/></body></worldbody></mujoco>"""
FEET = "".join(f'<geom type="sphere" size=".03" pos="{x} {y} -.2" mass=".2" margin=".002"/>'
               f'<geom type="capsule" fromto="{x} {y} 0 {x} {y} -.2" size=".015" mass=".1" contype="0" conaffinity="0"/>'
               for x in (-.17, .17) for y in (-.12, .12))


def stand(ground, rows=2, columns=2, width=100, at="0 0 0", turn="0 0 0"):
    model = mujoco.MjModel.from_xml_string(STAND.format(ground=ground, rows=rows, columns=columns, width=width, at=at,
                                                        turn=turn, feet=FEET))
    model.opt.tolerance, model.opt.iterations = 1e-15, 500
    return model


def test_on_level_ground_everything_moves_as_on_a_plane():
    """Within one triangle, which is tilted: contacts and steps of the same bodies on a plane."""
    turn = "3 -2 20"
    plane = stand('type="plane" size="0 0 1"', turn=turn)
    data = mujoco.MjData(plane)
    mujoco.mj_kinematics(plane, data)
    at = data.geom_xmat[0].reshape(3, 3) @ np.array([-40.0, 30, 0])
    field = stand('type="hfield" hfield="field"', at=" ".join(map(repr, at.tolist())), turn=turn)
    assert not field.hfield_data.any()
    start = fallen_states(plane, 7, seed=5)
    simulations = [lanes(model, len(start), tolerance=1e-12) for model in (plane, field)]
    for simulation in simulations:
        for i, one in enumerate(start):
            simulation.qpos[i], simulation.qvel[i], simulation.qacc[i] = one.qpos, one.qvel, one.qacc_warmstart
    contacts = [simulation.probe() for simulation in simulations]
    assert (contacts[0]["contacts"] == contacts[1]["contacts"]).all() and contacts[0]["contacts"].min() > 3
    for i in range(len(start)):
        on_plane, on_field = (mine_of(found, i) for found in contacts)
        assert not len(unmatched(on_plane, on_field, (1e-12,) * 3)), i
    for name in ("M", "bias", "qacc_smooth"):
        assert apart(contacts[1][name], contacts[0][name]) < 1e-12
    for steps in (1, 49):
        for simulation in simulations:
            simulation.step(nstep=steps)
        assert apart(simulations[1].qpos, simulations[0].qpos) < 1e-9
        assert apart(simulations[1].qvel, simulations[0].qvel) < 1e-7


def test_what_stands_on_rough_ground_stands_as_in_mujoco():
    """Feet are spheres, whose contacts are equal. A log that rolls and a crate have more, and stay within millimetres."""
    model = stand('type="hfield" hfield="field"', 12, 12, 1.5)
    model.hfield_data[:] = np.random.default_rng(6).uniform(0, 1, model.nhfielddata)
    simulation, one = lanes(model, 2, tolerance=1e-10), mujoco.MjData(model)
    simulation.step(nstep=1000)
    mujoco.mj_step(model, one, 1000)
    assert simulation.solved.all() and (simulation.qpos[0] == simulation.qpos[1]).all()
    assert np.abs(simulation.qpos[0, :7] - one.qpos[:7]).max() < 1e-9
    assert np.abs(simulation.qvel[0, :6]).max() < 1e-3
    assert np.abs(simulation.qpos[0, 7:10] - one.qpos[7:10]).max() < 5e-3
    assert np.abs(simulation.qpos[0, 14:17] - one.qpos[14:17]).max() < 5e-3


def test_a_wide_crate_rests_on_peaks():
    """Its corners are over valleys. MuJoCo holds it by its edges over ridges too, some millimetres higher."""
    model = mujoco.MjModel.from_xml_string("""
<mujoco><option timestep="0.002" cone="elliptic"/><asset><hfield name="field" nrow="24" ncol="24" size="1.5 1.5 .07 .1"/></asset>
<worldbody><geom type="hfield" hfield="field"/><body pos="0 0 .2" euler="5 -4 20"><freejoint/>
<geom type="box" size=".3 .25 .05" mass="5"/></body></worldbody></mujoco>""")
    for seed in range(3):
        model.hfield_data[:] = np.random.default_rng(seed).uniform(0, 1, model.nhfielddata)
        simulation, one = lanes(model, 1), mujoco.MjData(model)
        simulation.step(nstep=1000)
        mujoco.mj_step(model, one, 1000)
        assert np.abs(simulation.qvel).max() < 0.01
        assert np.abs(simulation.qpos[0, :3] - one.qpos[:3]).max() < 0.01


def test_the_quadruped_walks_over_its_rubble_as_in_mujoco():
    path = pathlib.Path(__file__).resolve().parents[2] / "examples" / "data" / "models" / "quadruped_rough.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.tolerance, model.opt.iterations = 1e-12, 200
    one = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, one, 0)
    one.ctrl[:] = one.qpos[7:]
    for _ in range(100):
        mujoco.mj_step(model, one)
    simulation = lanes(model, [one], tolerance=1e-10)
    for _ in range(50):
        one.ctrl[1::3] += 0.01
        simulation.step(one.ctrl[None])
        mujoco.mj_step(model, one)
    assert one.ncon > 3 and simulation.solved.all() and not simulation.status["flags"].any()
    assert np.abs(simulation.qpos[0] - one.qpos).max() < 1e-7


def test_what_is_no_field_of_lanes_is_refused():
    text = XML.format(kind="sphere", size=".06", margin=0, gap=0)
    moving = text.replace('<geom name="field"', '<freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom name="field"')
    round_one = text.replace('type="sphere" size=".06"', 'type="ellipsoid" size=".06 .05 .04"')
    rod = text.replace('type="sphere" size=".06"', 'type="cylinder" size=".06 .05"')
    for xml, reason in ((moving, "height field on a body that moves"), (round_one, "are not both planes"), (rod, "a cylinder or mesh and")):
        with pytest.raises(stiction.mujoco.UnsupportedModel, match=reason):
            lanes(mujoco.MjModel.from_xml_string(xml), 1)
    model = model_of("sphere")
    model.hfield_data[5] = np.nan
    with pytest.raises(stiction.Error, match=r"fields\[0\].heights = nan: must be finite"):
        lanes(model, 1)
    model = model_of("sphere")
    model.hfield_size[0, 1] = -1
    with pytest.raises(stiction.Error, match=r"fields\[0\].half = -1: must be > 0"):
        lanes(model, 1)
