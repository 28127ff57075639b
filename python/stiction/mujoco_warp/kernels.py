"""Warp kernels of `stiction.mujoco_warp`: MuJoCo Warp's rows as a batch, and answers back. One thread has one world,
one row or one degree of freedom, and adds in a fixed order."""

# No postponed annotations: Warp reads them.
import warp as wp

_EQUALITY, _FRICTION_DOF, _FRICTION_TENDON = 0, 1, 2  # mjtConstraint
_PYRAMID, _ELLIPTIC = 6, 7
_FREE, _UNILATERAL, _BOX, _FRICTION = 0, 1, 2, 3  # kinds of cones
_SATISFIED, _QUADRATIC, _LINEARNEG, _LINEARPOS, _CONE = 0, 1, 2, 3, 4  # mjtConstraintState
_CONTACTS_DROPPED = 1 << 7
#: A force this near to the border of its cone lies on it: a few roundings of float32.
_BORDER = wp.constant(float(1.0 - 1e-6))

wp.set_module_options({"enable_backward": False})


@wp.func
def is_friction_loss(kind: int) -> bool:
    return kind == _FRICTION_DOF or kind == _FRICTION_TENDON


@wp.func
def rows_of_cone(kind: int, object: int, contact_dim: wp.array[int]) -> int:
    """Rows that belong together, from the first of them."""
    if kind == _ELLIPTIC:
        return contact_dim[object]
    if kind == _PYRAMID:
        return 2 * (contact_dim[object] - 1)
    return 1


@wp.kernel
def fill_cones(nefc: wp.array[int], room: int, efc_type: wp.array2d[int], efc_id: wp.array2d[int],
               contact_dim: wp.array[int], contacts: wp.array[int], pairs: wp.array[int], contact_room: int,
               overflow: wp.array[int], lost: int,
               # outputs
               row_count: wp.array[int], cone_count: wp.array[int], flags: wp.array[int],
               cone_kind: wp.array[wp.uint8], cone_row: wp.array[wp.int64]):
    """Cones of one world, behind one another. A contact that the room has cut is left out, and so are its followers."""
    world = wp.tid()
    limit = wp.min(nefc[world], room)
    dropped = nefc[world] > room or contacts[0] > contact_room or pairs[0] > contact_room
    dropped = dropped or (overflow[world] & lost) != 0
    place = world * (room + 1)
    first = wp.int64(world) * wp.int64(room)
    row = int(0)
    cone = int(0)
    while row < limit:
        kind = efc_type[world, row]
        size = rows_of_cone(kind, efc_id[world, row], contact_dim)
        if size < 1 or row + size > limit:
            dropped = True
            break
        # Edges of a pyramid are rows of their own.
        count = wp.where(kind == _ELLIPTIC, 1, size)
        shape = int(_UNILATERAL)
        if kind == _EQUALITY:
            shape = _FREE
        if is_friction_loss(kind):
            shape = _BOX
        if kind == _ELLIPTIC:
            shape = _FRICTION
        for k in range(count):
            cone_kind[place + cone] = wp.uint8(shape)
            cone_row[place + cone] = first + wp.int64(row + k)
            cone += 1
        row += size
    row_count[world] = row
    cone_count[world] = cone
    flags[world] = wp.where(dropped, _CONTACTS_DROPPED, 0)
    for k in range(cone, room + 1):  # where the last one ends, and offsets that lead forward behind it
        cone_row[place + k] = first + wp.int64(row)


@wp.kernel
def fill_rows(row_count: wp.array[int], efc_type: wp.array2d[int], efc_id: wp.array2d[int], D: wp.array2d[float],
              frictionloss: wp.array2d[float], contact_friction: wp.array2d[float], contact_row: wp.array2d[int],
              # outputs
              R: wp.array2d[float], mu: wp.array2d[float], lo: wp.array2d[float], hi: wp.array2d[float]):
    """Numbers of a row beside J and its target."""
    world, row = wp.tid()
    if row >= row_count[world]:
        return
    kind = efc_type[world, row]
    R[world, row] = 1.0 / D[world, row]
    loss = float(0.0)
    if is_friction_loss(kind):
        loss = frictionloss[world, row]
    lo[world, row] = -loss
    hi[world, row] = loss
    slope = float(0.0)
    if kind == _ELLIPTIC:
        contact = efc_id[world, row]
        axis = row - contact_row[contact, 0]
        if axis > 0:
            slope = contact_friction[contact, axis - 1]
    mu[world, row] = slope


@wp.kernel
def fill_mass(rownnz: wp.array[int], rowadr: wp.array[int], colind: wp.array[int], M: wp.array2d[float],
              place: wp.array2d[int], frozen: bool,
              # outputs
              dense: wp.array3d[float]):
    """Lower triangle of the mass matrix. A frozen degree of freedom is alone, with a mass of 1."""
    world, i = wp.tid()
    for k in range(rownnz[i]):
        j = colind[rowadr[i] + k]
        entry = M[world, rowadr[i] + k]
        if frozen and (place[world, i] < 0 or place[world, j] < 0):
            entry = wp.where(i == j, 1.0, 0.0)
        dense[world, i, j] = entry


@wp.kernel
def fill_mass_column(column: int, product: wp.array2d[float], place: wp.array2d[int], frozen: bool,
                     # outputs
                     dense: wp.array3d[float]):
    """One column of a mass matrix that is known by its products, in the lower triangle."""
    world, i = wp.tid()
    if i < column:
        return
    entry = product[world, i]
    if frozen and (place[world, i] < 0 or place[world, column] < 0):
        entry = wp.where(i == column, 1.0, 0.0)
    dense[world, i, column] = entry


@wp.kernel
def unit_vector(column: int,
                # outputs
                vector: wp.array2d[float]):
    world, i = wp.tid()
    vector[world, i] = wp.where(i == column, 1.0, 0.0)


@wp.kernel
def fill_jacobian(row_count: wp.array[int], sparse: bool, rownnz: wp.array2d[int], rowadr: wp.array2d[int],
                  colind: wp.array3d[int], J: wp.array3d[float], place: wp.array2d[int], frozen: bool,
                  # outputs
                  dense: wp.array3d[float]):
    """One row of J, dense, without entries of frozen degrees of freedom."""
    world, row = wp.tid()
    if row >= row_count[world]:
        return
    dofs = dense.shape[2]
    if sparse:
        for j in range(dofs):
            dense[world, row, j] = 0.0
        for k in range(rownnz[world, row]):
            entry = rowadr[world, row] + k
            dense[world, row, colind[world, 0, entry]] = J[world, 0, entry]
    else:
        for j in range(dofs):
            dense[world, row, j] = J[world, row, j]
    if frozen:
        for j in range(dofs):
            if place[world, j] < 0:
                dense[world, row, j] = 0.0


@wp.kernel
def fill_awake(dof_tree: wp.array[int], tree_awake: wp.array2d[int],
               # outputs
               place: wp.array2d[int]):
    """Which degrees of freedom sleep: those with a place below 0, as in MuJoCo Warp's dof_cdof."""
    world, i = wp.tid()
    place[world, i] = wp.where(tree_awake[world, dof_tree[i]] == 0, -1, i)


@wp.kernel
def write_forces(row_count: wp.array[int], J: wp.array3d[float], force: wp.array2d[float],
                 # outputs
                 qfrc: wp.array2d[float]):
    """J' force, of one degree of freedom."""
    world, i = wp.tid()
    total = float(0.0)
    for row in range(row_count[world]):
        total += J[world, row, i] * force[world, row]
    qfrc[world, i] = total


@wp.kernel
def write_states(nefc: wp.array[int], row_count: wp.array[int], efc_type: wp.array2d[int], efc_id: wp.array2d[int],
                 contact_dim: wp.array[int], contact_row: wp.array2d[int], contact_friction: wp.array2d[float],
                 frictionloss: wp.array2d[float],
                 # outputs
                 force: wp.array2d[float], state: wp.array2d[int]):
    """Place of each row's force in its cone. Rows that were left out have none."""
    world, row = wp.tid()
    if row >= wp.min(nefc[world], force.shape[1]):
        return
    if row >= row_count[world]:
        force[world, row] = 0.0
        state[world, row] = _SATISFIED
        return
    kind = efc_type[world, row]
    own = force[world, row]
    found = int(_QUADRATIC)
    if is_friction_loss(kind):
        loss = frictionloss[world, row]
        if own >= loss * _BORDER:
            found = _LINEARNEG
        elif own <= -loss * _BORDER:
            found = _LINEARPOS
    elif kind == _ELLIPTIC:
        contact = efc_id[world, row]
        first = contact_row[contact, 0]
        normal = force[world, first]
        squares = float(0.0)
        for axis in range(1, contact_dim[contact]):
            slope = contact_friction[contact, axis - 1]
            if slope > 0.0:
                ratio = force[world, first + axis] / slope
                squares += ratio * ratio
        if not normal > 0.0:
            found = _SATISFIED
        elif wp.sqrt(squares) >= normal * _BORDER:
            found = _CONE
    elif kind != _EQUALITY and not own > 0.0:
        found = _SATISFIED
    state[world, row] = found


@wp.kernel
def judge_numbers(qacc: wp.array2d[float], solved: int, numerical: int,
                  # outputs
                  status: wp.array2d[int]):
    """Takes `solved` from a world whose accelerations are no numbers: without rows it would be, whatever they are."""
    world = wp.tid()
    finite = bool(True)
    for i in range(qacc.shape[1]):
        finite = finite and wp.isfinite(qacc[world, i])
    if not finite and (status[world, 6] & 255) == solved:
        status[world, 6] = (status[world, 6] & ~255) | numerical


@wp.kernel
def write_counts(status: wp.array2d[int], unfinished: int, more: bool,
                 # outputs
                 niter: wp.array[int], overflow: wp.array[int]):
    """Iterations of each world, and the bit of those that ended at the limit. status: records as eight words each."""
    world = wp.tid()
    niter[world] = wp.where(more, niter[world], 0) + status[world, 5]
    if (status[world, 6] & 255) == 1:  # max_iterations
        overflow[world] = overflow[world] | unfinished


# -- noslip -------------------------------------------------------------------------------------------------------


@wp.func
def is_pyramid_pair(kind: int, row: int, first: int) -> bool:
    return kind == _PYRAMID and (row - first) % 2 == 0


@wp.kernel
def hold_forces(row_count: wp.array[int], efc_type: wp.array2d[int], efc_id: wp.array2d[int],
                contact_row: wp.array2d[int], force: wp.array2d[float],
                # outputs
                held: wp.array2d[float]):
    """Forces that noslip leaves as they are: all but friction. For a pair of edges it is half their sum, on each."""
    world, row = wp.tid()
    if row >= row_count[world]:
        return
    kind = efc_type[world, row]
    keep = force[world, row]
    if is_friction_loss(kind):
        keep = 0.0
    if kind == _ELLIPTIC and row > contact_row[efc_id[world, row], 0]:
        keep = 0.0
    if kind == _PYRAMID:
        first = contact_row[efc_id[world, row], 0]
        other = wp.where((row - first) % 2 == 0, row + 1, row - 1)
        keep = 0.5 * (force[world, row] + force[world, other])
    held[world, row] = keep


@wp.kernel
def fill_friction(row_count: wp.array[int], efc_type: wp.array2d[int], efc_id: wp.array2d[int],
                  contact_row: wp.array2d[int], frictionloss: wp.array2d[float], aref: wp.array2d[float],
                  held: wp.array2d[float], J: wp.array3d[float],
                  # outputs
                  own_J: wp.array3d[float], target: wp.array2d[float], R: wp.array2d[float], lo: wp.array2d[float],
                  hi: wp.array2d[float]):
    """Rows of friction alone. A normal force is that of a row that nothing moves, so that w = force - held = 0 there.
    A pair of edges is one row of their difference, within their sum. Every other row is empty."""
    world, row = wp.tid()
    if row >= row_count[world]:
        return
    dofs = own_J.shape[2]
    kind = efc_type[world, row]
    first = int(0)
    if kind == _PYRAMID or kind == _ELLIPTIC:
        first = contact_row[efc_id[world, row], 0]
    moves = is_friction_loss(kind) or (kind == _ELLIPTIC and row > first)
    pair = is_pyramid_pair(kind, row, first)
    aim = float(0.0)
    bound = float(0.0)
    own_R = float(1.0)
    for j in range(dofs):
        entry = float(0.0)
        if moves:
            entry = J[world, row, j]
        if pair:
            entry = J[world, row, j] - J[world, row + 1, j]
        own_J[world, row, j] = entry
    if moves:
        aim = aref[world, row]
        own_R = 0.0
    if pair:
        aim = aref[world, row] - aref[world, row + 1]
        own_R = 0.0
        bound = wp.max(held[world, row], 0.0)
    if is_friction_loss(kind):
        bound = frictionloss[world, row]
    if kind == _ELLIPTIC and row == first:
        aim = held[world, row]
    target[world, row] = aim
    R[world, row] = own_R
    lo[world, row] = -bound
    hi[world, row] = bound


@wp.kernel
def fill_friction_cones(row_count: wp.array[int], cone_count: wp.array[int], efc_type: wp.array2d[int],
                        kinds: wp.array[wp.uint8], rows: wp.array[wp.int64], room: int,
                        # outputs
                        friction_kind: wp.array[wp.uint8], held_kind: wp.array[wp.uint8],
                        held_row: wp.array[wp.int64]):
    """Cones of the friction problem, and boxes of one row each for the forces that are held."""
    world = wp.tid()
    place = world * (room + 1)
    for cone in range(cone_count[world]):
        is_cone = kinds[place + cone] == wp.uint8(_FRICTION)
        friction_kind[place + cone] = wp.where(is_cone, wp.uint8(_FRICTION), wp.uint8(_BOX))
    for row in range(room + 1):
        held_kind[place + row] = wp.uint8(_BOX)
        held_row[place + row] = wp.int64(world) * wp.int64(room) + wp.int64(wp.min(row, row_count[world]))


@wp.kernel
def join_forces(row_count: wp.array[int], efc_type: wp.array2d[int], efc_id: wp.array2d[int],
                contact_row: wp.array2d[int], held: wp.array2d[float], friction: wp.array2d[float],
                # outputs
                force: wp.array2d[float]):
    """Forces of friction beside those that were held."""
    world, row = wp.tid()
    if row >= row_count[world]:
        return
    kind = efc_type[world, row]
    found = held[world, row]
    if is_friction_loss(kind):
        found = friction[world, row]
    if kind == _ELLIPTIC and row > contact_row[efc_id[world, row], 0]:
        found = friction[world, row]
    if kind == _PYRAMID:
        first = contact_row[efc_id[world, row], 0]
        if (row - first) % 2 == 0:
            found = held[world, row] + friction[world, row]
        else:
            found = held[world, row] - friction[world, row - 1]
    force[world, row] = found
