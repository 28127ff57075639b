"""A function of another package in whose place one of ours stands for a while."""

import contextlib


@contextlib.contextmanager
def replaced(module, name, function):
    """Within it, module.name is `function`. For the whole process, and not for a thread."""
    before = getattr(module, name)
    setattr(module, name, function)
    try:
        yield
    finally:
        setattr(module, name, before)
