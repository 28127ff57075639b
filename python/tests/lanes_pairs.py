"""Two shapes near each other, of every pair of kinds that is stepped in lanes: shared by tests of contacts."""

import numpy as np
from lanes_models import mujoco

SIZES = {"sphere": ".11", "capsule": ".06 .17", "box": ".2 .13 .08", "cylinder": ".1 .12"}
MESHES = ("stone", "prism", "block")
KINDS = ("sphere", "capsule", "box")
PAIRS = [(a, b) for i, a in enumerate(KINDS) for b in KINDS[i:]]
# Turns of the second shape against the first where both lie along each other.
TURNS = (np.array([1.0, 0, 0, 0]), np.array([0, 1.0, 0, 0]), np.sqrt([.5, .5, 0, 0]), np.sqrt([.5, 0, .5, 0]))

XML = """
<mujoco><size memory="1M"/>{assets}<option timestep="0.002" cone="elliptic"/><default><geom margin="{margin}" gap="{gap}"/></default><worldbody>
<body><freejoint/><geom {a} pos=".01 .02 0" euler="10 0 30"/></body>
<body><freejoint/><geom {b} pos="0 -.02 .03" euler="0 20 0"/></body></worldbody></mujoco>"""


def corners_of(shape):
    """Vertices of a mesh: one of triangles, one whose ends have nine corners, and a box, which is of two sizes."""
    rng = np.random.default_rng(11)
    if shape == "stone":
        return rng.standard_normal((24, 3)) * [.1, .08, .05]
    if shape == "block":
        return np.array([[x, y, z] for x in (-.1, .1) for y in (-.2, .2) for z in (-.05, .05)])
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    ring = .1 * np.stack([np.cos(angles), np.sin(angles)], 1)
    return np.concatenate([np.c_[ring, np.full(9, z)] for z in (-.03, .04)])


def assets():
    named = ((name, " ".join(f"{x:.9g}" for x in corners_of(name).ravel())) for name in MESHES)
    return "<asset>" + "".join(f'<mesh name="{name}" vertex="{places}"/>' for name, places in named) + "</asset>"


def geom_of(name, size=None):
    return f'type="mesh" mesh="{name}"' if name in MESHES else f'type="{name}" size="{size or SIZES[name]}"'


def model_of_pair(a, b, margin=0.01, gap=0.0, size_a=None):
    given = dict(assets=assets() if {a, b} & set(MESHES) else "", margin=margin, gap=gap)
    return mujoco.MjModel.from_xml_string(XML.format(a=geom_of(a, size_a), b=geom_of(b), **given))


def place_geom(model, data, geom, position, orientation):
    """Moves the free body of a geom to where its geom has this place."""
    place, turn, inverse = np.empty(3), np.empty(4), np.empty(4)
    mujoco.mju_negPose(place, inverse, model.geom_pos[geom], model.geom_quat[geom])
    at = np.empty(3)
    mujoco.mju_mulPose(at, turn, position, orientation, place, inverse)
    data.qpos[7 * geom:7 * geom + 7] = [*at, *turn]


def encounters(model, count, is_along, seed=0):
    """Data with both geoms at random, near or in each other. `is_along`: their axes are those of each other."""
    rng = np.random.default_rng(seed)
    found = [mujoco.MjData(model) for _ in range(count)]
    for i, data in enumerate(found):
        turns = rng.standard_normal((2, 4))
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        if is_along:
            mujoco.mju_mulQuat(turns[1], turns[0], TURNS[i % len(TURNS)])
        reach = model.geom_rbound.sum() * rng.uniform(0.05, 1.0)
        way = rng.standard_normal(3)
        place_geom(model, data, 0, np.array([.1, .2, .3]), turns[0])
        place_geom(model, data, 1, np.array([.1, .2, .3]) + reach * way / np.linalg.norm(way), turns[1])
        data.qvel[:] = 0.3 * rng.standard_normal(model.nv)
        mujoco.mj_forward(model, data)
    return found
