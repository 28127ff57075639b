"""Frames as entities of a Rerun recording."""

import numpy as np

from .frame import colours, turned
from .writer import GROUND, Writer

_SHAPES = {"plane": "Boxes3D", "box": "Boxes3D", "sphere": "Ellipsoids3D", "ellipsoid": "Ellipsoids3D",
           "cylinder": "Cylinders3D", "capsule": "Capsules3D", "mesh": "Mesh3D"}


def load():
    """The module rerun; ImportError with the remedy where it is missing."""
    try:
        import rerun
    except ImportError:
        rerun = None
    if not hasattr(rerun, "RecordingStream"):
        raise ImportError("stiction.view needs Rerun, which is not installed: pip install rerun-sdk")
    return rerun


class RerunWriter(Writer):
    """A recording for Rerun's viewer.

    path: of the file; None: a viewer is opened, or connect names the address of one.
    """

    def __init__(self, path, connect):
        self._rr = load()
        self._out = self._rr.RecordingStream("stiction")
        self._colours = {}  # path -> the last one
        if path is not None:
            self._out.save(path)
        elif connect is not None:
            self._out.connect_grpc(connect)
        else:
            self._out.spawn()

    def close(self):
        self._out.flush()
        self._out.disconnect()

    def open(self, origin, middle, width):
        rr, views = self._rr, self._rr.blueprint
        self._log([origin], rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        eye = views.EyeControls3D(position=np.add(middle, np.multiply(width, (-0.35, -0.9, 0.8))), look_target=middle,
                                  eye_up=(0, 0, 1))
        title = {"world": "bodies and contacts", "batch": "cones, in their own axes"}[origin]
        series = [views.TimeSeriesView(origin="log10_residual", name="log10 of the relative residual"),
                  views.TimeSeriesView(origin="iterations", name="iterations")]
        if origin == "world":
            series.insert(1, views.TimeSeriesView(origin="slip", name="fastest slip [m/s]"))
        else:
            series += [views.GraphView(origin=origin, name="which cones are coupled"),
                       views.BarChartView(origin=origin, name="reactions by row")]
        self._out.send_blueprint(views.Blueprint(
            views.Horizontal(views.Spatial3DView(origin=origin, name=title, eye_controls=eye),
                             views.Vertical(*series, views.TextLogView(origin="log", name="log")), column_shares=[3, 2]),
            collapse_panels=True))

    def at(self, **times):
        for name, value in times.items():
            is_step = isinstance(value, (int, np.integer))
            self._out.set_time(name, **{"sequence" if is_step else "duration": value})

    def place(self, path, position, above):
        self._log(path, self._rr.Transform3D(translation=position), static=True)

    def geometry(self, path, shape, plane_size, is_ground):
        rr = self._rr
        colour = None if shape.body >= 0 else [GROUND]
        place = {"quaternions": [self._quaternion(shape.orientation)], "colors": colour}
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
            down = turned(shape.orientation, (0.0, 0.0, -size[1]))
            made = rr.Capsules3D(radii=[size[0]], lengths=[2 * size[1]],
                                 translations=[np.add(shape.position, down)], **place, **solid)
        else:
            turn = self._quaternion(shape.orientation)
            self._log(path, rr.Transform3D(translation=shape.position, quaternion=turn), static=True)
            made = rr.Mesh3D(vertex_positions=size[0], triangle_indices=size[1],
                             albedo_factor=None if shape.body >= 0 else [*GROUND, 255])
        self._log(path, made, static=True)

    def colour(self, path, kind, colour):
        colour = tuple(int(part) for part in colour)
        if self._colours.get(tuple(path)) == colour:
            return
        self._colours[tuple(path)] = colour
        archetype = getattr(self._rr, _SHAPES[kind])
        self._log(path, archetype.from_fields(albedo_factor=[*colour, 255]) if kind == "mesh" else
                  archetype.from_fields(colors=[colour]))

    def move(self, path, position, orientation):
        self._log(path, self._rr.Transform3D(translation=position, quaternion=self._quaternion(orientation)))

    def points(self, path, positions, colour, radius, values):
        self._log(path, self._rr.Points3D(positions, colors=colour, radii=radius))
        if len(positions):  # Rerun takes no empty ones
            self._log(path, self._rr.AnyValues(**values))

    def arrows(self, path, origins, vectors, colour, radius):
        self._log(path, self._rr.Arrows3D(origins=origins, vectors=vectors, colors=[colour], radii=radius))

    def lines(self, path, strips, colour, radius):
        self._log(path, self._rr.LineStrips3D(strips, colors=[colour], radii=radius))

    def scalar(self, path, value):
        self._log(path, self._rr.Scalars([value]))

    def warn(self, text):
        self._log(["log"], self._rr.TextLog(text, level=self._rr.TextLogLevel.WARN))

    def cones(self, path, title, reactions, positions, island, couplings):
        rr = self._rr
        self._log([*path, "name"], rr.TextDocument(title))
        self._log([*path, "reactions"], rr.BarChart(reactions))
        if couplings is not None:
            names = [str(i) for i in range(len(island))]
            self._log([*path, "graph"], rr.GraphNodes(names, colors=colours(island), show_labels=False),
                      rr.GraphEdges([(str(a), str(b)) for a, b in couplings]))

    def _log(self, path, *archetypes, static=False):
        self._out.log(list(path), *archetypes, static=static)

    def _quaternion(self, orientation):
        w, x, y, z = orientation
        return self._rr.Quaternion(xyzw=[x, y, z, w])
