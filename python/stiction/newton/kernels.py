"""Warp kernels of `stiction.newton`: motion without contact, rows of contacts, steps of joints. One thread has one
articulation, contact or joint, reads nothing of another one's and adds in a fixed order."""

# No postponed annotations: Warp reads them.
import newton
import warp as wp

_FREE, _BALL, _D6 = (int(kind) for kind in (newton.JointType.FREE, newton.JointType.BALL, newton.JointType.D6))
_FIXED = int(newton.JointType.FIXED)
_ZERO = wp.constant(wp.float64(0.0))

wp.set_module_options({"enable_backward": False})


@wp.func
def anchor_rotation(j: int, joint_parent: wp.array[int], joint_X_p: wp.array[wp.transform],
                    body_q: wp.array[wp.transform]):
    """Rotation of the joint's frame on its parent, in world axes."""
    X = joint_X_p[j]
    if joint_parent[j] >= 0:
        X = body_q[joint_parent[j]] * X
    return wp.transform_get_rotation(X)


@wp.kernel
def joint_forces(joint_type: wp.array[int], joint_parent: wp.array[int], joint_X_p: wp.array[wp.transform],
                 joint_q_start: wp.array[int], joint_qd_start: wp.array[int], body_q: wp.array[wp.transform],
                 joint_q: wp.array[float], joint_qd: wp.array[float], joint_f: wp.array[float],
                 gravity: wp.array[float], coriolis: wp.array[float], target_q: wp.array[float],
                 target_qd: wp.array[float], mode: wp.array[int], ke: wp.array[float], kd: wp.array[float],
                 effort: wp.array[float], stiffness: wp.array[float], rest_q: wp.array[float],
                 damping: wp.array[float], dt: wp.float64,
                 # outputs
                 force: wp.array[wp.float64], softness: wp.array[wp.float64]):
    """Forces of each degree of freedom [N, N m] at the start of the step. Springs, dampers and drives are implicit:
    softness is their addition to the diagonal of the mass matrix. A drive at its effort limit adds nothing to it."""
    j = wp.tid()
    first = joint_qd_start[j]
    count = joint_qd_start[j + 1] - first
    for i in range(count):
        d = first + i
        force[d] = wp.float64(joint_f[d]) - wp.float64(gravity[d]) - wp.float64(coriolis[d])
        softness[d] = dt * wp.float64(damping[d])
    if joint_type[j] == _FREE:  # Newton has these wrenches in world axes, velocities in those of the parent
        turn = anchor_rotation(j, joint_parent, joint_X_p, body_q)
        back = wp.quatd(wp.float64(turn[0]), wp.float64(turn[1]), wp.float64(turn[2]), wp.float64(turn[3]))
        for part in range(2):
            d = first + 3 * part
            f = wp.quat_rotate_inv(back, wp.vec3d(force[d], force[d + 1], force[d + 2]))
            force[d] = f[0]
            force[d + 1] = f[1]
            force[d + 2] = f[2]
        return
    if joint_type[j] == _BALL:
        return
    for i in range(count):
        d = first + i
        at = joint_q_start[j] + i
        q = wp.float64(joint_q[at])
        # Targets of a feature that is switched off are not read: they may be anything, and 0 times infinity is NaN.
        spring = wp.float64(stiffness[d])
        if spring != wp.float64(0.0):
            force[d] = force[d] + spring * (wp.float64(rest_q[at]) - q)
            softness[d] = softness[d] + dt * dt * spring
        follows = mode[d]
        k = wp.float64(0.0)
        c = wp.float64(0.0)
        speed = wp.float64(0.0)
        if follows == 1 or follows == 3:
            k = wp.float64(ke[d])
        if follows >= 1 and follows <= 3:
            c = wp.float64(kd[d])
        if follows == 2 or follows == 3:
            speed = wp.float64(target_qd[d])
        drive = wp.float64(0.0)
        if k != wp.float64(0.0):
            drive = k * (wp.float64(target_q[at]) - q)
        if c != wp.float64(0.0):
            drive = drive + c * speed
        felt = drive - c * wp.float64(joint_qd[d])
        most = wp.float64(effort[d])
        if wp.abs(felt) > most:
            force[d] = force[d] + wp.clamp(felt, -most, most)
        else:
            force[d] = force[d] + drive
            softness[d] = softness[d] + dt * (c + dt * k)


@wp.kernel
def free_motion(articulation_start: wp.array[int], articulation_end: wp.array[int], joint_qd_start: wp.array[int],
                joint_child: wp.array[int], H: wp.array3d[float], J: wp.array3d[float], joint_qd: wp.array[float],
                force: wp.array[wp.float64], softness: wp.array[wp.float64], prescribed: wp.array[wp.uint8],
                body_f: wp.array[wp.spatial_vector], dt: wp.float64, mass_start: wp.array[int],
                mass_stride: wp.array[int],
                # outputs
                factor: wp.array[wp.float64], v_free: wp.array[wp.float64]):
    """Cholesky factor of each articulation's mass matrix, and its velocity at the end of a step without contact.
    Prescribed degrees of freedom keep their velocity, and the others see them as a moving base."""
    a = wp.tid()
    first = joint_qd_start[articulation_start[a]]
    count = joint_qd_start[articulation_end[a]] - first
    start = mass_start[a]
    stride = mass_stride[a]
    for i in range(count):
        total = wp.float64(0.0)
        for k in range(count):
            entry = wp.float64(H[a, i, k])
            if i == k:
                entry += softness[first + i]
            if prescribed[first + i] != wp.uint8(0) or prescribed[first + k] != wp.uint8(0):
                entry = wp.where(i == k, wp.float64(1.0), _ZERO)
            # Drives and springs see the velocity at the step's end: their part has no momentum before it.
            inertia = entry
            if i == k and prescribed[first + i] == wp.uint8(0):
                inertia = wp.float64(H[a, i, k])
            total += inertia * wp.float64(joint_qd[first + k])
            if k <= i:
                factor[start + i * stride + k] = entry
        if prescribed[first + i] == wp.uint8(0):
            felt = force[first + i]
            for link in range(articulation_end[a] - articulation_start[a]):
                f = body_f[joint_child[articulation_start[a] + link]]
                for k in range(6):
                    felt += wp.float64(J[a, 6 * link + k, i]) * wp.float64(f[k])
            total += dt * felt
        v_free[first + i] = total
    for i in range(count):
        for k in range(i + 1):
            s = factor[start + i * stride + k]
            for m in range(k):
                s -= factor[start + i * stride + m] * factor[start + k * stride + m]
            if k == i:
                factor[start + i * stride + i] = wp.sqrt(s)
            else:
                factor[start + i * stride + k] = s / factor[start + k * stride + k]
    for i in range(count):
        s = v_free[first + i]
        for k in range(i):
            s -= factor[start + i * stride + k] * v_free[first + k]
        v_free[first + i] = s / factor[start + i * stride + i]
    for back in range(count):
        i = count - 1 - back
        s = v_free[first + i]
        for k in range(i + 1, count):
            s -= factor[start + k * stride + i] * v_free[first + k]
        v_free[first + i] = s / factor[start + i * stride + i]


@wp.func
def tangent_of(n: wp.vec3):
    """A unit vector across n that depends on n alone."""
    axis = wp.vec3(1.0, 0.0, 0.0)
    if wp.abs(n[0]) > 0.7:
        axis = wp.vec3(0.0, 1.0, 0.0)
    return wp.normalize(wp.cross(n, axis))


@wp.func
def pose_of(body: int, body_q: wp.array[wp.transform]):
    """Pose of a body, or of the world."""
    X = wp.transform_identity()
    if body >= 0:
        X = body_q[body]
    return X


@wp.func
def com_of(body: int, body_q: wp.array[wp.transform], body_com: wp.array[wp.vec3]):
    """Centre of mass of a body in the world; of the world, its origin."""
    x = wp.vec3(0.0, 0.0, 0.0)
    if body >= 0:
        x = wp.transform_point(body_q[body], body_com[body])
    return x


@wp.func
def along(J: wp.array3d[float], a: int, link: int, column: int, linear: wp.vec3, angular: wp.vec3):
    """Speed of a body along those directions for one degree of freedom."""
    s = wp.float64(0.0)
    for k in range(3):
        s += wp.float64(J[a, 6 * link + k, column]) * wp.float64(linear[k])
        s += wp.float64(J[a, 6 * link + 3 + k, column]) * wp.float64(angular[k])
    return s


@wp.func
def loose_motion(body: int, articulation: int, body_qd: wp.array[wp.spatial_vector], linear: wp.vec3,
                 angular: wp.vec3):
    """Motion of a body that its owner moves, and no joint does."""
    s = wp.float64(0.0)
    if body >= 0 and articulation < 0:
        v = body_qd[body]
        for k in range(3):
            s += wp.float64(v[k]) * wp.float64(linear[k]) + wp.float64(v[3 + k]) * wp.float64(angular[k])
    return s


@wp.kernel
def contact_rows(which: wp.array[int], row_start: wp.array[int], entry_start: wp.array[int], env_dof: wp.array[int],
                 rows: int, shape0: wp.array[int], shape1: wp.array[int], point0: wp.array[wp.vec3],
                 point1: wp.array[wp.vec3], offset0: wp.array[wp.vec3], offset1: wp.array[wp.vec3],
                 normals: wp.array[wp.vec3], margin0: wp.array[float], margin1: wp.array[float],
                 shape_body: wp.array[int], body_q: wp.array[wp.transform], body_qd: wp.array[wp.spatial_vector],
                 body_com: wp.array[wp.vec3], body_articulation: wp.array[int], body_link: wp.array[int],
                 dof_start: wp.array[int], dof_count: wp.array[int], J: wp.array3d[float], joint_qd: wp.array[float],
                 v_free: wp.array[wp.float64], prescribed: wp.array[wp.uint8], mu: wp.array[float], mu_torsional: wp.array[float],
                 mu_rolling: wp.array[float], restitution: wp.array[float], dt: wp.float64, erp: wp.float64,
                 slop: wp.float64, recovery: wp.float64, threshold: wp.float64,
                 # outputs
                 values: wp.array[wp.float64], columns: wp.array[int], target: wp.array[wp.float64],
                 friction: wp.array[wp.float64], b: wp.array[wp.float64]):
    """Rows of one contact: how fast shape 1 moves from shape 0 along the normal and two tangents, and turns about them.
    target is the velocity that the normal row may not fall below, b the excess of the row without reactions."""
    t = wp.tid()
    c = which[t]
    s0 = shape0[c]
    s1 = shape1[c]
    b0 = shape_body[s0]
    b1 = shape_body[s1]
    X0 = pose_of(b0, body_q)
    X1 = pose_of(b1, body_q)
    n = normals[c]
    gap = wp.float64(wp.dot(n, wp.transform_point(X1, point1[c]) - wp.transform_point(X0, point0[c]))
                     - (margin0[c] + margin1[c]))
    p = 0.5 * (wp.transform_point(X0, point0[c] + offset0[c]) + wp.transform_point(X1, point1[c] + offset1[c]))
    r0 = p - com_of(b0, body_q, body_com)
    r1 = p - com_of(b1, body_q, body_com)
    t1 = tangent_of(n)
    t2 = wp.cross(n, t1)
    a0 = int(-1)
    a1 = int(-1)
    if b0 >= 0:
        a0 = body_articulation[b0]
    if b1 >= 0:
        a1 = body_articulation[b1]
    first = a0
    second = a1
    if a1 == a0:
        second = -1
    if first >= 0 and second >= 0:
        if dof_start[second] < dof_start[first]:
            first = a1
            second = a0
    at = entry_start[t]
    for r in range(rows):
        axis = n
        if r == 1 or r == 4:
            axis = t1
        if r == 2 or r == 5:
            axis = t2
        linear = axis
        angular0 = wp.cross(r0, axis)
        angular1 = wp.cross(r1, axis)
        if r >= 3:
            linear = wp.vec3(0.0, 0.0, 0.0)
            angular0 = axis
            angular1 = axis
        # Adds the part of bodies whose motion is given; and, of the normal row, the speed at the start of the step.
        given = loose_motion(b1, a1, body_qd, linear, angular1) - loose_motion(b0, a0, body_qd, linear, angular0)
        speed = given
        free = wp.float64(0.0)
        for block in range(2):
            a = first
            if block == 1:
                a = second
            if a >= 0:
                for i in range(dof_count[a]):
                    d = dof_start[a] + i
                    value = wp.float64(0.0)
                    if a0 == a:
                        value -= along(J, a, body_link[b0], i, linear, angular0)
                    if a1 == a:
                        value += along(J, a, body_link[b1], i, linear, angular1)
                    speed += value * wp.float64(joint_qd[d])
                    if prescribed[d] != wp.uint8(0):
                        given += value * wp.float64(joint_qd[d])
                        value = wp.float64(0.0)
                    free += value * v_free[d]
                    values[at] = value
                    columns[at] = d - env_dof[t]
                    at += 1
        least = wp.float64(0.0)
        if r == 0:
            least = -gap / dt
            if gap < _ZERO:
                least = wp.min(erp * wp.max(-gap - slop, _ZERO) / dt, recovery)
            bounce = wp.float64(0.5) * wp.float64(restitution[s0] + restitution[s1])
            if bounce > _ZERO and speed < -threshold and gap + dt * speed <= _ZERO:
                least = wp.max(least, -bounce * speed)
        row = row_start[t] + r
        target[row] = least - given
        b[row] = free - target[row]
        if r == 1 or r == 2:
            friction[row] = wp.float64(0.5) * wp.float64(mu[s0] + mu[s1])
        if r == 3:
            friction[row] = wp.float64(0.5) * wp.float64(mu_torsional[s0] + mu_torsional[s1])
        if r >= 4:
            friction[row] = wp.float64(0.5) * wp.float64(mu_rolling[s0] + mu_rolling[s1])


@wp.kernel
def contact_forces(which: wp.array[int], row_start: wp.array[int], rows: int, shape0: wp.array[int],
                   shape1: wp.array[int], point0: wp.array[wp.vec3], point1: wp.array[wp.vec3],
                   offset0: wp.array[wp.vec3], offset1: wp.array[wp.vec3], normals: wp.array[wp.vec3],
                   shape_body: wp.array[int], body_q: wp.array[wp.transform], body_com: wp.array[wp.vec3],
                   reaction: wp.array[wp.float64], dt: wp.float64,
                   # outputs
                   contact_f: wp.array[wp.spatial_vector]):
    """Force and torque on body 0 by body 1, about the centre of mass of body 0, in world axes [N, N m]."""
    t = wp.tid()
    c = which[t]
    b0 = shape_body[shape0[c]]
    b1 = shape_body[shape1[c]]
    n = normals[c]
    t1 = tangent_of(n)
    t2 = wp.cross(n, t1)
    X0 = pose_of(b0, body_q)
    X1 = pose_of(b1, body_q)
    p = 0.5 * (wp.transform_point(X0, point0[c] + offset0[c]) + wp.transform_point(X1, point1[c] + offset1[c]))
    row = row_start[t]
    f = -(n * float(reaction[row] / dt) + t1 * float(reaction[row + 1] / dt) + t2 * float(reaction[row + 2] / dt))
    m = wp.cross(p - com_of(b0, body_q, body_com), f)
    if rows > 3:
        m -= n * float(reaction[row + 3] / dt)
    if rows > 4:
        m -= t1 * float(reaction[row + 4] / dt) + t2 * float(reaction[row + 5] / dt)
    contact_f[c] = wp.spatial_vector(f, m)


@wp.func
def turned(r: wp.quatd, spin: wp.vec3d, dt: wp.float64):
    """A rotation after a step of that spin, by the exponential map."""
    angle = wp.length(spin) * dt
    half = wp.float64(0.5) * angle
    scale = wp.float64(0.5) * dt
    if angle > wp.float64(1.0e-12):
        scale = wp.sin(half) / angle * dt
    return wp.normalize(wp.quatd(spin[0] * scale, spin[1] * scale, spin[2] * scale, wp.cos(half)) * r)


@wp.kernel
def move_joints(joint_type: wp.array[int], joint_child: wp.array[int], joint_q_start: wp.array[int],
                joint_qd_start: wp.array[int], joint_X_c: wp.array[wp.transform], body_com: wp.array[wp.vec3],
                joint_env: wp.array[int], held: wp.array[wp.uint8], joint_q: wp.array[float],
                velocity: wp.array[wp.float64], dt: wp.float64, good_q: wp.array[float], good_qd: wp.array[float],
                # outputs
                joint_q_new: wp.array[float], joint_qd_new: wp.array[float]):
    """Coordinates of a joint after a step of the velocity that the solve has found. Forces of held worlds are the last
    good ones."""
    j = wp.tid()
    q0 = joint_q_start[j]
    d0 = joint_qd_start[j]
    if held[joint_env[j]] != wp.uint8(0):
        for i in range(joint_q_start[j + 1] - q0):
            joint_q_new[q0 + i] = good_q[q0 + i]
        for i in range(joint_qd_start[j + 1] - d0):
            joint_qd_new[d0 + i] = good_qd[d0 + i]
        return
    if joint_type[j] == _FREE or joint_type[j] == _BALL:
        linear = int(0)
        if joint_type[j] == _FREE:
            linear = 3
        r = wp.quatd(wp.float64(joint_q[q0 + linear]), wp.float64(joint_q[q0 + linear + 1]),
                     wp.float64(joint_q[q0 + linear + 2]), wp.float64(joint_q[q0 + linear + 3]))
        spin = wp.vec3d(velocity[d0 + linear], velocity[d0 + linear + 1], velocity[d0 + linear + 2])
        r_new = turned(r, spin, dt)
        if joint_type[j] == _FREE:  # the centre of mass moves by the linear velocity, the frame turns about it
            com = wp.transform_point(wp.transform_inverse(joint_X_c[j]), body_com[joint_child[j]])
            arm = wp.vec3d(wp.float64(com[0]), wp.float64(com[1]), wp.float64(com[2]))
            shift = wp.quat_rotate(r, arm) - wp.quat_rotate(r_new, arm)
            for k in range(3):
                joint_q_new[q0 + k] = float(wp.float64(joint_q[q0 + k]) + dt * velocity[d0 + k] + shift[k])
        for k in range(4):
            joint_q_new[q0 + linear + k] = float(r_new[k])
    else:
        for i in range(joint_qd_start[j + 1] - d0):
            joint_q_new[q0 + i] = float(wp.float64(joint_q[q0 + i]) + dt * velocity[d0 + i])
    for i in range(joint_qd_start[j + 1] - d0):
        joint_qd_new[d0 + i] = float(velocity[d0 + i])
