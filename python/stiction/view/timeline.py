"""The panel of a recording that viser serves: a slider over its times, a box that lets it play, a plot of residuals."""

import threading
import time

import numpy as np

from .frame import PALETTE

_SHORTEST = 1 / 30  # between two frames that play [s]


class Timeline:
    """Frames that a browser moves between. show: draws the state of one."""

    def __init__(self, server, show):
        self._gui, self._draw, self._lock = server.gui, show, threading.RLock()
        self._frames = []  # (name, seconds, state, residuals)
        self._title = self._gui.add_markdown("nothing is recorded yet")
        self._slider = self._gui.add_slider("frame", min=0, max=1, step=1, initial_value=0)
        self._play = self._gui.add_checkbox("play", False)
        self._plot = None
        self._slider.on_update(lambda event: self.show(int(self._slider.value)))

    def append(self, times, seconds, state, residuals):
        """Another frame, which is shown where the last one was."""
        with self._lock:
            name = ", ".join(f"{key} {value:.6g}" for key, value in times.items())
            self._frames.append((name, seconds, state, residuals))
            last = len(self._frames) - 1
            self._slider.max = max(last, 1)
            if self._slider.value >= last - 1:
                self._slider.value = last
                self.show(last)
            self._plot_residuals()

    def show(self, index):
        """Draws a frame."""
        with self._lock:
            if 0 <= index < len(self._frames):
                self._title.content, _, state, _ = self._frames[index]
                self._draw(state)

    def run(self):
        """Plays, if the box is ticked, until the program is interrupted."""
        try:
            while True:
                time.sleep(self._advance())
        except KeyboardInterrupt:
            print()

    def _advance(self):
        """Goes to the next frame; returns for how long that one is seen [s]."""
        with self._lock:
            count = len(self._frames)
            if not self._play.value or count < 2:
                return 0.1
            index = (int(self._slider.value) + 1) % count
            self._slider.value = index
            after = self._frames[min(index + 1, count - 1)][1] - self._frames[index][1]
            return max(after, _SHORTEST)

    def _plot_residuals(self):
        names = list(dict.fromkeys(name for frame in self._frames for name in frame[3]))
        data = (np.arange(len(self._frames), dtype=float),
                *(np.array([frame[3].get(name, np.nan) for frame in self._frames]) for name in names))
        if self._plot is not None and len(self._plot.data) == len(data):
            self._plot.data = data
            return
        if self._plot is not None:
            self._plot.remove()
        series = ({"label": "frame"}, *({"label": name, "stroke": "rgb({}, {}, {})".format(*PALETTE[i % len(PALETTE)])}
                                        for i, name in enumerate(names)))
        self._plot = self._gui.add_uplot(data, series, title="log10 of the relative residual", aspect=1.5,
                                         scales={"x": {"time": False}}) if names else None
