"""A progress bar for long calls: on a terminal, where tqdm is installed, and nowhere else."""

import sys


def _bar(total, title, unit):
    """tqdm's bar on stderr, or None where there is nothing to show it on."""
    try:
        shown = sys.stderr.isatty()
    except (AttributeError, ValueError):  # no stderr, or a closed one
        return None
    if not shown:
        return None
    try:
        from tqdm import tqdm
    except ImportError:
        return None
    return tqdm(total=total, desc=title, unit=unit, file=sys.stderr, dynamic_ncols=True)


class Progress:
    """Counts the steps of a long call, and shows them as a bar on stderr. Needs tqdm (`pip install tqdm`). Writes
    nothing where tqdm is missing, in logs and pipes (stderr is no terminal), and with quiet=True.

        for step in stiction.monitor.Progress(range(1000), title="rollout"):
            world.step()

        with stiction.monitor.Progress(total=1000, title="training", unit="step") as bar:
            bar.update(32)
            bar.print("a line that does not break the bar")

    items: the iterable; None: `update` counts. total: how many there will be; None: len(items), if it has one.
    """

    def __init__(self, items=None, *, total=None, title=None, unit="it", quiet=False):
        if total is None and hasattr(items, "__len__"):
            total = len(items)
        self._items = items
        self._bar = None if quiet else _bar(total, title, unit)

    @property
    def shown(self) -> bool:
        """True if there is a bar."""
        return self._bar is not None

    def update(self, count=1):
        """Counts that many more."""
        if self._bar is not None:
            self._bar.update(count)

    def print(self, text):
        """Prints a line on stdout, above the bar if there is one."""
        if self._bar is None:
            print(text, flush=True)
        else:
            self._bar.write(text, file=sys.stdout)

    def close(self):
        """Ends the bar; it stays on the screen."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def __iter__(self):
        try:
            for item in self._items:
                yield item
                self.update()
        finally:
            self.close()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()
