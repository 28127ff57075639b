"""stiction as a solver of Newton's (newton of PyPI, on the CPU), against answers worked out by hand."""

import math

import numpy as np
import pytest
from newton_scenes import Run, SolverStiction, box, hinge, newton, on_ground, quat, rod, wp

pytestmark = pytest.mark.warp
G = 9.81
MISSES = {"atol": 2e-5, "rtol": 2e-5}  # Newton's state is float32, and a test steps some hundred times


# -- contacts ---------------------------------------------------------------------------------------------------------

@pytest.mark.quick
def test_a_box_rests_and_its_contacts_carry_its_weight():
    run = Run(on_ground(box()))
    seen = run.solver.observables({"contact_f"}, contacts=run.contacts)
    run.step(100, 0.005, observables=seen)
    np.testing.assert_allclose(run.q, [0, 0, 0.1, 0, 0, 0, 1], **MISSES)
    np.testing.assert_allclose(run.qd, 0, atol=1e-4)
    assert run.solver.status["code"] == 0 and run.solver.status["residual"] < 1e-6
    # The plane is shape 0, so the forces are those on the world by the box.
    forces = seen.contact_f.numpy()
    np.testing.assert_allclose(forces[:, :3].sum(axis=0), [0, 0, -8 * G], rtol=1e-4, atol=1e-3)
    count = int(run.contacts.rigid_contact_count.numpy()[0])
    assert count == 4 and not forces[count:].any()


def test_contacts_are_given_their_forces_as_newton_1_6_asks():
    model = on_ground(box())
    run = Run(model)
    with pytest.raises(ValueError, match="contacts, state: expected contacts with forces"):
        run.solver.update_contacts(run.contacts, run.state)
    model.request_contact_attributes("force")
    run = Run(model).step(100, 0.005)
    run.contacts.force.fill_(7.0)
    run.solver.update_contacts(run.contacts, run.state)
    forces = run.contacts.force.numpy()
    np.testing.assert_allclose(forces[:4, :3].sum(axis=0), [0, 0, -8 * G], rtol=1e-4, atol=1e-3)
    assert (forces[:4, 2] < 0).all() and not forces[4:].any()


def test_a_sliding_box_slows_by_mu_g():
    run = Run(on_ground(box(speed=(2, 0, 0), mu=0.5), mu=0.3))  # the mean of both shapes: 0.4
    run.step(100, 0.002)
    v, x = 2 - 0.4 * G * 0.2, sum(2 - 0.4 * G * 0.002 * k for k in range(1, 101)) * 0.002
    np.testing.assert_allclose(run.qd[0], v, **MISSES)
    np.testing.assert_allclose(run.q[:3], [x, 0, 0.1], **MISSES)


def test_the_convex_law_lifts_a_sliding_box_and_coulombs_does_not():
    heights, climbs = {}, {}
    for law in ("coulomb", "convex"):
        run = Run(on_ground(box(speed=(2, 0, 0), mu=0.5), mu=0.5), law=law)
        run.step(1, 0.002)
        climbs[law], heights[law] = run.qd[2], run.step(49, 0.002).q[2]
    np.testing.assert_allclose(climbs["coulomb"], 0, atol=1e-6)
    # The associated law makes w, and not the friction alone, orthogonal to the cone: it rises at mu times its slip.
    assert climbs["convex"] > 0.5
    assert abs(heights["coulomb"] - 0.1) < 1e-5 and heights["convex"] > 0.11


@pytest.mark.quick
@pytest.mark.parametrize("slope, slides", [(0.49, False), (0.51, True)])
def test_a_box_sticks_to_a_slope_below_its_friction_and_slides_above(slope, slides):
    angle = math.atan(slope)
    model = on_ground(box(mu=0.5), mu=0.5)
    model.set_gravity((G * math.sin(angle), 0, -G * math.cos(angle)))
    run = Run(model).step(200, 0.005)
    expected = G * (math.sin(angle) - 0.5 * math.cos(angle)) * 1.0 if slides else 0.0
    np.testing.assert_allclose(run.qd[0], expected, atol=2e-4)
    if not slides:
        np.testing.assert_allclose(run.q[0], 0, atol=1e-5)


def test_a_sphere_that_slides_ends_rolling_at_five_sevenths():
    def add(builder, world):
        body = builder.add_body(xform=wp.transform((0, 0, 0.1), wp.quat_identity()))
        builder.add_shape_sphere(body, radius=0.1)
        builder.joint_qd[-6] = 1.0
    run = Run(on_ground(add, mu=0.5)).step(100, 0.002)
    np.testing.assert_allclose(run.qd, [5 / 7, 0, 0, 0, 50 / 7, 0], rtol=1e-4, atol=1e-5)


def test_a_ball_bounces_to_its_share_of_the_height():
    def add(builder, world):
        builder.default_shape_cfg.restitution = 0.6
        body = builder.add_body(xform=wp.transform((0, 0, 0.6), wp.quat_identity()))
        builder.add_shape_sphere(body, radius=0.1)
    heights = []
    Run(on_ground(add, restitution=0.6)).step(600, 0.001, lambda run: heights.append(run.q[2]))
    lowest = int(np.argmin(heights))
    # It meets the plane within a step of 3.1 m/s and 1 ms.
    np.testing.assert_allclose(max(heights[lowest:]) - 0.1, 0.36 * 0.5, atol=5e-3)


def test_torsional_friction_stops_a_spinning_ball():
    def add(builder, world):
        builder.default_shape_cfg.mu_torsional = 0.02
        body = builder.add_body(xform=wp.transform((0, 0, 0.1), wp.quat_identity()))
        builder.add_shape_sphere(body, radius=0.1)
        builder.joint_qd[-1] = 10.0
    spins = {}
    for rows in (3, 4, 6):
        model = on_ground(add, mu_torsional=0.02, mu_rolling=0.0)
        spins[rows] = Run(model, contact_dim=rows).step(100, 0.001).qd[5]
    # Torque mu m g against inertia 2/5 m r2: 49 rad/s2 over 0.1 s.
    np.testing.assert_allclose(spins[3], 10, rtol=1e-5)
    np.testing.assert_allclose([spins[4], spins[6]], 10 - 0.02 * G / (0.4 * 0.01) * 0.1, rtol=1e-4)


def test_a_kinematic_body_carries_what_lies_on_it():
    def add(builder, world):
        belt = builder.add_body(xform=wp.transform((0, 0, 0.5), wp.quat_identity()), is_kinematic=True)
        builder.add_shape_plane(body=belt, width=0.0, length=0.0)
        builder.joint_qd[-6] = 0.5
        box(height=0.6)(builder, world)
    run = Run(on_ground(add)).step(200, 0.005)
    np.testing.assert_allclose(run.qd, [0.5, 0, 0, 0, 0, 0] * 2, atol=1e-4)
    np.testing.assert_allclose(run.q[0], 0.5, atol=1e-4)


# -- joints -----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("joint", ["revolute", "ball", "d6"])
def test_a_pendulum_has_its_period_and_keeps_its_energy(joint):
    builder = newton.ModelBuilder()
    axis = newton.ModelBuilder.JointDofConfig
    options = {"revolute": {"axis": (1, 0, 0)}, "ball": {},
               "d6": {"angular_axes": [axis(axis=(1, 0, 0)), axis(axis=(0, 1, 0))]}}[joint]
    rod(builder, joint, **options)
    swing = 0.1
    if joint == "ball":
        builder.joint_q[-4:] = list(quat((1, 0, 0), swing))
    else:
        builder.joint_q[0] = swing
    dt, places, energies = 0.004, [], []

    def each(run):
        pose, v = run.state.body_q.numpy()[0], run.state.body_qd.numpy()[0].astype(float)
        com = wp.transform_point(wp.transform(*pose), wp.vec3(0, 0, -1))
        places.append(com[1])
        energies.append(0.5 * v[:3] @ v[:3] + 0.005 * v[3:] @ v[3:] + G * com[2])

    Run(builder.finalize(device="cpu")).step(900, dt, each)
    places = np.array(places)
    ups = np.flatnonzero((places[:-1] < 0) & (places[1:] >= 0))
    times = [(k + places[k] / (places[k] - places[k + 1])) * dt for k in ups]
    period = 2 * math.pi * math.sqrt(1.01 / G) * (1 + swing ** 2 / 16)
    np.testing.assert_allclose(np.diff(times), period, rtol=1e-5)
    # Symplectic Euler's energy swings by half a step of its greatest change, and does not drift.
    swung = G * (1 - math.cos(swing))
    assert np.ptp(energies) < 0.02 * swung


def test_the_energy_of_a_spatial_double_pendulum_errs_by_the_step():
    inertia = np.diag([0.1, 0.12, 0.05])

    def lost(dt):
        builder = newton.ModelBuilder()
        links = [builder.add_link(mass=1.0, com=wp.vec3(0, 0.05 * i, -0.5), inertia=wp.mat33(inertia)) for i in (0, 1)]
        first = builder.add_joint_ball(-1, links[0])
        second = builder.add_joint_ball(links[0], links[1], parent_xform=wp.transform((0, 0, -1), wp.quat_identity()))
        builder.joint_q[:] = [*quat((1, 0, 0), 1.0), *quat((0, 1, 0), 0.6)]
        builder.joint_qd[:] = [0.5, 1, 2, 0.5, -1, 1]
        builder.add_articulation([first, second])
        model, found = builder.finalize(device="cpu"), []

        def each(run):
            energy = 0.0
            for pose, v, com in zip(run.state.body_q.numpy(), run.state.body_qd.numpy().astype(float),
                                    model.body_com.numpy()):
                X = wp.transform(*pose)
                spin = np.array(wp.quat_to_matrix(X.q)).reshape(3, 3).T @ v[3:]
                energy += 0.5 * (v[:3] @ v[:3] + spin @ inertia @ spin) + G * wp.transform_point(X, wp.vec3(*com))[2]
            found.append(energy)

        Run(model).step(round(0.5 / dt), dt, each)
        return np.ptp(found)

    coarse, fine = lost(0.002), lost(0.001)
    assert fine < 0.05 and 1.7 < coarse / fine < 2.3


def test_a_free_body_tumbles_about_its_centre_of_mass_and_keeps_its_angular_momentum():
    builder = newton.ModelBuilder(gravity=(0, 0, 0))
    inertia = np.diag([0.1, 0.2, 0.3])
    builder.add_body(mass=1.0, inertia=wp.mat33(inertia), com=wp.vec3(0.1, 0.2, 0.3))
    builder.joint_qd[:] = [0, 0, 0, 0.1, 5, 0.1]
    model, moments = builder.finalize(device="cpu"), []

    def each(run):
        X = wp.transform(*run.state.body_q.numpy()[0])
        turn = np.array(wp.quat_to_matrix(X.q)).reshape(3, 3)
        moments.append(turn @ inertia @ turn.T @ run.state.body_qd.numpy()[0, 3:])
        np.testing.assert_allclose(list(wp.transform_point(X, wp.vec3(0.1, 0.2, 0.3))), [0.1, 0.2, 0.3], atol=1e-5)

    Run(model).step(500, 0.001, each)
    np.testing.assert_allclose(moments[-1], [0.01, 1, 0.03], atol=0.02)


def test_a_limit_stops_a_joint():
    run = Run(hinge(0.0, 3.0, limit_lower=-0.2, limit_upper=0.4))
    angles = []
    run.step(300, 0.002, lambda run: angles.append(run.q[0]))
    assert max(angles) < 0.4 + 1e-5 and max(angles) > 0.39 and min(angles) > -0.2 - 1e-5


def test_a_velocity_limit_holds():
    run = Run(hinge(1.5, 0.0, velocity_limit=0.5))
    speeds = []
    run.step(300, 0.002, lambda run: speeds.append(run.qd[0]))
    assert min(speeds) > -0.5 - 1e-5 and min(speeds) < -0.499


@pytest.mark.parametrize("share, moves", [(0.99, True), (1.01, False)])
def test_dry_friction_of_a_joint_holds_up_to_its_torque(share, moves):
    torque = G * math.sin(0.3)
    run = Run(hinge(0.3, friction=share * torque)).step(50, 0.002)
    assert (abs(run.qd[0]) > 1e-4) == moves


def test_drives_springs_and_their_effort_limit():
    mode = newton.JointTargetMode.POSITION
    # At rest ke (target - q) = m g sin q, however stiff the drive: q = 0.2 for a target of 0.2 + m g sin(0.2) / ke.
    for ke, kd in ((100.0, 10.0), (1e6, 1.0)):
        target = 0.2 + G * math.sin(0.2) / ke
        run = Run(hinge(0.0, target_q=target, target_ke=ke, target_kd=kd, actuator_mode=mode)).step(400, 0.005)
        np.testing.assert_allclose(run.q[0], 0.2, atol=1e-4)
    run = Run(hinge(0.0, target_q=1.0, target_ke=1e4, target_kd=10.0, effort_limit=2.0, actuator_mode=mode,
                    armature=0.5)).step(10, 0.001)
    np.testing.assert_allclose(run.qd[0], 2.0 / (1.01 + 0.5) * 0.01, rtol=2e-3)
    run = Run(hinge(0.0, target_qd=0.7, target_kd=1e4, actuator_mode=newton.JointTargetMode.VELOCITY)).step(100, 0.005)
    np.testing.assert_allclose(run.qd[0], 0.7, rtol=1e-3)


def test_forces_of_control_and_state_act_in_newtons_frames():
    builder = newton.ModelBuilder(gravity=(0, 0, 0))
    body = builder.add_link(mass=2.0, inertia=wp.mat33(np.eye(3) * 0.5))
    # The joint's frame on the world is turned: coordinates are in it, forces in world axes.
    joint = builder.add_joint_free(body, parent_xform=wp.transform((0, 0, 0), quat((0, 0, 1), math.pi / 2)))
    builder.add_articulation([joint])
    run = Run(builder.finalize(device="cpu"))
    run.control.joint_f.assign(np.array([1, 0, 0, 0, 0.5, 0], np.float32))
    run.state.body_f.assign(np.array([[0, 3, 0, 0, 0, 0.25]], np.float32))
    run.step(1, 0.01)
    v = run.state.body_qd.numpy()[0]
    np.testing.assert_allclose(v, [0.005, 0.015, 0, 0, 0.01, 0.005], atol=1e-6)


def one_sided(lower, upper, stiffness=0.0):
    """A slider of 1 kg with such limits, a spring or none, and targets as Newton's builder leaves them."""
    builder = newton.ModelBuilder(gravity=(0, 0, 0))
    body = builder.add_link(mass=1.0, inertia=wp.mat33(np.eye(3)))
    joint = builder.add_joint_prismatic(-1, body, axis=(1, 0, 0), limit_lower=lower, limit_upper=upper)
    builder.add_articulation([joint])
    return builder.finalize(device="cpu")


@pytest.mark.parametrize("lower, upper", [(None, 0.5), (-0.5, None), (0.5, np.inf), (-np.inf, -0.5)])
@pytest.mark.parametrize("solver", ["auto", "npgs"])
def test_the_targets_of_drives_that_are_off_are_not_read(lower, upper, solver):
    model = one_sided(lower, upper)
    model.joint_target_q.fill_(np.inf)
    run = Run(model, solver=solver)
    run.control.joint_target_q.fill_(np.inf)
    run.control.joint_target_qd.fill_(np.nan)
    run.state.joint_qd.fill_(2.0)
    run.step(50, 0.01)
    assert np.isfinite(run.state.joint_q.numpy()).all() and np.isfinite(run.state.joint_qd.numpy()).all()
    assert (run.solver.status["code"] == 0).all()


def test_a_world_that_is_not_finite_is_not_solved():
    model = one_sided(None, None)
    run = Run(model)
    run.state.joint_qd.fill_(np.nan)
    run.step(1, 0.01)
    assert run.solver.failed.tolist() == [0]
    assert (run.solver.status["code"] != 0).all()
