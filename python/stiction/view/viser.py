"""Frames as nodes of a viser scene: served to browsers, or written as a page or a recording."""

import contextlib
import pathlib

import numpy as np

from .shapes import capsule, square
from .timeline import Timeline
from .writer import CONE, GROUND, Writer

SUFFIXES = (".html", ".viser")
_OPACITY = 0.6  # of bodies, since contacts lie on and within them
_PAUSE = 0.5  # from one environment of a batch to the next, whose steps have no time [s]
_SAID = {"title": "{}", "residual": "residual {:.1e}", "iterations": "{:.0f} iterations", "slip": "slip {:.2g} m/s"}

#: Function that makes a node that moves, from its first properties.
_MAKERS = {
    "frame": lambda scene, name, own: scene.add_frame(name, show_axes=False, **own),
    "points": lambda scene, name, own: scene.add_point_cloud(name, point_shape="circle", precision="float32", **own),
    "arrows": lambda scene, name, own: scene.add_arrows(name, **own),
    "lines": lambda scene, name, own: scene.add_line_segments(name, **own),
    "label": lambda scene, name, own: scene.add_label(name, anchor="bottom-center", **own),
}


def load():
    """The module viser; ImportError with the remedy where it is missing."""
    try:
        import viser
    except ImportError:
        viser = None
    if not hasattr(viser, "ViserServer"):
        raise ImportError("stiction.view with viser needs viser, which is not installed: pip install viser")
    return viser


class ViserWriter(Writer):
    """A recording for viser's viewer.

    path: of the file: .html, a page that needs nothing else, or .viser, for a page of viser's client. None: browsers of
    this machine are served at a port, or at the next one that is free.
    """

    def __init__(self, path, port):
        viser = load()
        self._path = None if path is None else pathlib.Path(path)
        if path is not None and self._path.suffix not in SUFFIXES:
            raise ValueError(f"path: expected a name that ends in {' or '.join(SUFFIXES)}, got {str(path)!r}")
        # viser writes a file through a server, too, whose port is any that is free.
        with _quiet():
            self._server = viser.ViserServer("127.0.0.1", port if path is None else 0, label="stiction", verbose=False)
        self._scene, self._handles, self._labels = self._server.scene, {}, {}
        self._state, self._numbers, self._warnings = {}, {}, []
        self._times, self._seconds = None, None
        self._timeline = Timeline(self._server, self._show) if path is None else None
        self._recording = None if path is None else self._server.get_scene_serializer()

    def open(self, origin, middle, width):
        camera = self._server.initial_camera
        camera.look_at = tuple(map(float, middle))
        camera.position = tuple(map(float, np.add(middle, np.multiply(width, (-0.35, -0.9, 0.8)))))
        self._scene.add_frame(_name([origin]), show_axes=False)
        for k, part in enumerate(("all", "log")):
            self._labels[part] = [origin, part]
            self._set([origin, part], "label", position=tuple(map(float, np.add(middle, (0, 0, (0.6 + 0.1 * k) * width)))))

    def close(self):
        self._commit()
        if self._path is not None and self._path.suffix == ".html":
            self._path.write_text(self._recording.as_html(), encoding="utf-8")
        elif self._path is not None:
            self._path.write_bytes(self._recording.serialize())
        with _quiet():
            self._server.stop()

    def wait(self):
        self._commit()
        if self._timeline is not None:
            print(f"http://127.0.0.1:{self._server.get_port()} shows the recording until Ctrl-C", flush=True)
            self._timeline.run()

    def at(self, **times):
        if times == self._times:
            return
        self._commit()
        seconds = float(times.get("time", _PAUSE * next(iter(times.values()))))
        if self._recording is not None and self._seconds is not None:
            self._recording.insert_sleep(max(0.0, seconds - self._seconds))
        self._times, self._seconds = times, seconds

    # -- what stays ---------------------------------------------------------------------------------------------------

    def place(self, path, position, above):
        self._scene.add_frame(_name(path), show_axes=False, position=position)
        self._labels[path[-1]] = [*path, "label"]
        self._set([*path, "label"], "label", position=tuple(map(float, above)))

    def geometry(self, path, shape, plane_size, is_ground):
        if shape.body >= 0:
            self._body(path[:-1])
        scene, name, size = self._scene, _name(path), shape.size
        place = {"position": shape.position, "wxyz": shape.orientation}
        look = {**place, "color": GROUND, "opacity": None if shape.body < 0 else _OPACITY}
        if shape.kind == "plane" and is_ground:
            made = scene.add_grid(name, 2 * plane_size, 2 * plane_size, cell_size=plane_size / 8,
                                  section_size=plane_size / 2, plane_color=GROUND, plane_opacity=0.3, **place)
        elif shape.kind == "plane":
            made = scene.add_line_segments(name, _segments([square(plane_size)]), GROUND, thickness=0.01 * plane_size,
                                           **place)
        elif shape.kind == "box":
            made = scene.add_box(name, dimensions=tuple(2 * float(half) for half in size), **look)
        elif shape.kind == "sphere":
            made = scene.add_icosphere(name, float(size[0]), **look)
        elif shape.kind == "ellipsoid":
            made = scene.add_icosphere(name, 1.0, scale=tuple(map(float, size)), **look)
        elif shape.kind == "cylinder":
            made = scene.add_cylinder(name, float(size[0]), 2 * float(size[1]), **look)
        else:
            made = scene.add_mesh_simple(name, *(capsule(*size) if shape.kind == "capsule" else size), **look)
        self._handles[name] = made

    # -- what moves ---------------------------------------------------------------------------------------------------

    def colour(self, path, kind, colour):
        if kind != "plane":
            self._set(path, kind, color=tuple(int(part) for part in colour))

    def move(self, path, position, orientation):
        self._body(path)
        self._set(path, "frame", position=np.array(position), wxyz=np.array(orientation), visible=True)

    def points(self, path, positions, colour, radius, values):
        self._set(path, "points", points=np.asarray(positions, np.float32), colors=colour, point_size=2 * radius)

    def arrows(self, path, origins, vectors, colour, radius):
        ends = np.stack([origins, np.add(origins, vectors)], axis=1).astype(np.float32)
        self._set(path, "arrows", points=ends, colors=np.array(colour, np.uint8), shaft_radius=radius,
                  head_radius=2.5 * radius, head_length=5 * radius)

    def lines(self, path, strips, colour, radius):
        self._set(path, "lines", points=_segments(strips), colors=np.array(colour, np.uint8), thickness=2 * radius)

    def scalar(self, path, value):
        self._numbers[tuple(path)] = value

    def warn(self, text):
        self._warnings.append(text)

    def cones(self, path, title, reactions, positions, island, couplings):
        self._numbers["title", path[-1]] = title
        if couplings is not None:
            self.lines([*path, "couplings"], list(np.asarray(positions)[couplings]), CONE, 0.01)

    # -- the scene ----------------------------------------------------------------------------------------------------

    def _body(self, path):
        """The node of a body, which is hidden until it is moved somewhere."""
        if _name(path) not in self._handles:
            self._handles[_name(path)] = self._scene.add_frame(_name(path), show_axes=False, visible=False)

    def _set(self, path, kind, **properties):
        """Properties of a node, from the time that is recorded on."""
        self._state.setdefault(_name(path), (kind, {}))
        self._state[_name(path)] = kind, {**self._state[_name(path)][1], **properties}

    def _commit(self):
        """Ends the recorded time: shows its known state."""
        if self._times is None:
            return
        self._label()
        if self._timeline is None:
            self._show(self._state)
        else:
            self._timeline.append(self._times, self._seconds, dict(self._state), {
                entity: value for (what, entity), value in self._numbers.items() if what == "log10_residual"})
        self._times, self._numbers, self._warnings = None, {}, []

    def _show(self, state):
        with self._server.atomic():
            for name, (kind, properties) in state.items():
                if name not in self._handles:
                    self._handles[name] = _MAKERS[kind](self._scene, name, properties)
                else:
                    for key, value in properties.items():
                        setattr(self._handles[name], key, value)

    def _label(self):
        """Says residual, iterations and slip above every environment, and those of all and the log above everything."""
        said = {entity: [form.format(self._numbers[kind, entity]) for kind, form in _SAID.items()
                         if (kind, entity) in self._numbers] for entity in [*self._labels, "median", "largest"]}
        said["all"] = [f"{entity} {text}" for entity in ("median", "largest") for text in said[entity]]
        said["log"] = self._warnings
        for entity, path in self._labels.items():
            text = ", ".join(said[entity])
            self._set(path, "label", text=text if entity == "log" else f"{entity}: {text}" if text else "")


def _name(path):
    """A node's name; a part of it may hold a slash of its own."""
    return "/" + "/".join(part.replace("/", "_") for part in path)


def _segments(strips):
    """Broken lines as segments (n, 2, 3)."""
    pieces = [np.stack([strip[:-1], strip[1:]], axis=1) for strip in strips]
    return np.concatenate([np.zeros((0, 2, 3)), *pieces]).astype(np.float32)


@contextlib.contextmanager
def _quiet():
    """viser prints on standard output that a server begins and ends, whatever `verbose` is."""
    import rich
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
