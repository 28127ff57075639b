"""Frames as entities of a Rerun recording."""

import numpy as np

from ._view_frame import colours, cone_lines

_GROUND, _CONE = (110, 115, 120), (200, 200, 200)
_NUMERICAL = 3  # codes from here on: the answer is no answer


def load():
    """The module rerun; ImportError with the remedy where it is missing."""
    try:
        import rerun
    except ImportError:
        rerun = None
    if not hasattr(rerun, "RecordingStream"):
        raise ImportError("stiction.view needs Rerun, which is not installed: pip install rerun-sdk")
    return rerun


def rotated(orientation):
    """Rerun's quaternion of (w, x, y, z)."""
    w, x, y, z = orientation
    return load().Quaternion(xyzw=[x, y, z, w])


class Stream:
    """A recording that is written to a file or shown by a viewer.

    path: of the file; None: a viewer is opened, or connect names the address of one.
    """

    def __init__(self, path, connect):
        self.rr = load()
        self._out = self.rr.RecordingStream("stiction")
        self._colours = {}  # path -> the last one
        if path is not None:
            self._out.save(path)
        elif connect is not None:
            self._out.connect_grpc(connect)
        else:
            self._out.spawn()

    def close(self):
        """Writes what is still in memory, and ends the recording."""
        self._out.flush()
        self._out.disconnect()

    def at(self, **times):
        """The time of what is logged next: integers are steps, others seconds."""
        for name, value in times.items():
            is_step = isinstance(value, (int, np.integer))
            self._out.set_time(name, **{"sequence" if is_step else "duration": value})

    def log(self, path, *archetypes, static=False):
        """Logs archetypes at a path, a list of its parts."""
        self._out.log(list(path), *archetypes, static=static)

    def scene(self, origin, name, middle, width):
        """A view in three dimensions of something that wide, seen from the front and above."""
        blueprint = self.rr.blueprint
        eye = np.add(middle, np.multiply(width, (-0.35, -0.9, 0.8)))
        return blueprint.Spatial3DView(origin=origin, name=name, eye_controls=blueprint.EyeControls3D(
            position=eye, look_target=middle, eye_up=(0, 0, 1)))

    def layout(self, *views):
        """Arranges the views: the first one large, the others in a column."""
        blueprint = self.rr.blueprint
        self._out.send_blueprint(blueprint.Blueprint(
            blueprint.Horizontal(views[0], blueprint.Vertical(*views[1:]), column_shares=[3, 2]), collapse_panels=True))

    # -- pieces -------------------------------------------------------------------------------------------------------

    def geometry(self, path, shape, plane_size, is_ground):
        """A shape, once for all times. Its colour follows, unless it is the world's."""
        rr = self.rr
        colour = None if shape.body >= 0 else [_GROUND]
        place = {"quaternions": [rotated(shape.orientation)], "colors": colour}
        modes = rr.components.FillMode
        solid = {"fill_mode": modes.Solid if shape.body < 0 else modes.TransparentFillMajorWireframe}
        size = shape.size
        if shape.kind == "plane":
            fill = solid if is_ground else {"fill_mode": modes.MajorWireframe}
            made = rr.Boxes3D(half_sizes=[[plane_size, plane_size, 0]], centers=[shape.position], **place, **fill)
        elif shape.kind == "box":
            made = rr.Boxes3D(half_sizes=[size], centers=[shape.position], **place, **solid)
        elif shape.kind in ("sphere", "ellipsoid"):
            sizes = [size[0]] * 3 if shape.kind == "sphere" else size
            made = rr.Ellipsoids3D(half_sizes=[sizes], centers=[shape.position], **place, **solid)
        elif shape.kind == "cylinder":
            made = rr.Cylinders3D(radii=[size[0]], lengths=[2 * size[1]], centers=[shape.position], **place, **solid)
        elif shape.kind == "capsule":  # Rerun's begins at its lower end
            down = _turn(shape.orientation, (0.0, 0.0, -size[1]))
            made = rr.Capsules3D(radii=[size[0]], lengths=[2 * size[1]],
                                 translations=[np.add(shape.position, down)], **place, **solid)
        else:
            self.log(path, rr.Transform3D(translation=shape.position, quaternion=rotated(shape.orientation)), static=True)
            made = rr.Mesh3D(vertex_positions=size[0], triangle_indices=size[1],
                             albedo_factor=None if shape.body >= 0 else [*_GROUND, 255])
        self.log(path, made, static=True)

    def colour(self, path, kind, colour):
        """The colour of a shape from now on."""
        rr, colour = self.rr, tuple(int(part) for part in colour)
        if self._colours.get(tuple(path)) == colour:
            return
        self._colours[tuple(path)] = colour
        archetype = {"plane": rr.Boxes3D, "box": rr.Boxes3D, "sphere": rr.Ellipsoids3D, "ellipsoid": rr.Ellipsoids3D,
                     "cylinder": rr.Cylinders3D, "capsule": rr.Capsules3D}.get(kind)
        self.log(path, rr.Mesh3D.from_fields(albedo_factor=[*colour, 255]) if archetype is None else
                 archetype.from_fields(colors=[colour]))

    def pose(self, path, position, orientation):
        """Where a body is, if that is finite."""
        if np.isfinite(position).all() and np.isfinite(orientation).all():
            self.log(path, self.rr.Transform3D(translation=position, quaternion=rotated(orientation)))

    def contacts(self, path, contacts, force_scale, slip_scale, radius):
        """Points, forces, friction cones and slip of an environment's contacts; what is not finite is left out."""
        rr = self.rr
        contacts = contacts.finite()
        colour, force = colours(contacts.island), contacts.world_force()
        self.log([*path, "contacts"], rr.Points3D(contacts.point, colors=colour, radii=radius))
        if len(colour):  # what the viewer says of a point; Rerun takes no empty ones
            self.log([*path, "contacts"], rr.AnyValues(
                normal_force=contacts.force[:, 0], mu=contacts.mu[:, 0], island=contacts.island,
                slip=np.linalg.norm(contacts.slip, axis=1)))
        self.log([*path, "forces"], rr.Arrows3D(origins=contacts.point, vectors=force_scale * force,
                                                colors=[(220, 40, 40)], radii=0.4 * radius))
        self.log([*path, "cones"], rr.LineStrips3D(cone_lines(contacts, force_scale), colors=[_CONE],
                                                   radii=0.12 * radius))
        self.log([*path, "slip"], rr.Arrows3D(origins=contacts.point, vectors=slip_scale * contacts.slip,
                                              colors=[(250, 180, 0)], radii=0.4 * radius))

    def number(self, path, value):
        """A point of a time series, if it is finite."""
        if np.isfinite(value):
            self.log(path, self.rr.Scalars([float(value)]))

    def residual(self, name, value):
        """A residual, and its logarithm, which is what plots show; zero stands at 1e-17 there."""
        self.number(["residual", name], value)
        self.number(["log10_residual", name], np.log10(max(value, 1e-17)) if value >= 0 else np.nan)

    def trouble(self, name, record, code_names, flags):
        """A line for an environment whose solve gave no answer."""
        if record["code"] < _NUMERICAL:
            return
        raised = [flag for bit, flag in enumerate(flags) if int(record["flags"]) >> bit & 1]
        text = f"{name} ended as {code_names[record['code']]}" + (f": {', '.join(raised)}" if raised else "")
        self.log(["log"], self.rr.TextLog(text, level=self.rr.TextLogLevel.WARN))

    def graph(self, path, island, couplings):
        """Cones as a graph: joined where they are coupled."""
        rr = self.rr
        names = [str(i) for i in range(len(island))]
        self.log([*path, "graph"], rr.GraphNodes(names, colors=colours(island), show_labels=False),
                 rr.GraphEdges([(str(a), str(b)) for a, b in couplings]))


def _turn(orientation, vector):
    """A vector turned by a quaternion (w, x, y, z)."""
    w, *v = orientation
    v, vector = np.array(v, float), np.array(vector, float)
    return vector + 2 * np.cross(v, np.cross(v, vector) + w * vector)
