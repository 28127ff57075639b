"""Names of an environment's flags."""

from .. import _core

#: Names by bit.
FLAGS = tuple(_core.flag_names())
