"""Names of an environment's flags; two of them had other names before numerics epoch 2."""

from .. import _core

#: Older names, which are taken until 1.0.
OLDER = {"capacity": "contacts_dropped", "no_room": "over_capacity"}


class FlagNames(tuple):
    """Names by bit. `index` and `in` take older names too; none of them is listed."""

    def index(self, name, *bounds):
        """Bit of the flag with that name."""
        return super().index(OLDER.get(name, name), *bounds)

    def __contains__(self, name):
        return super().__contains__(OLDER.get(name, name))


class FlagCounts(dict):
    """Counts by name. An older name reads the count of the flag's name today."""

    def __missing__(self, name):
        if OLDER.get(name) in self:
            return self[OLDER[name]]
        raise KeyError(name)

    def __contains__(self, name):
        return super().__contains__(OLDER.get(name, name))

    def get(self, name, default=None):
        """The count of that flag, or the default where none was seen."""
        return super().get(OLDER.get(name, name), default)


FLAGS = FlagNames(_core.flag_names())
