"""Functions of PTX that leave a trace of a lane's execution, for its replay in lock-step (tests/ptx/replay.hpp)."""

from ptx_function import Function
from ptx_text import BYTES

#: Instructions that wait for other lanes.
MEETS = ("bar", "barrier", "shfl", "redux")


def components(nodes, leads):
    """Strongly connected components, predecessors first. The last node of each is where it is entered (Tarjan,
    "Depth-first search and linear graph algorithms")."""
    allowed, found, low, number, held, done = set(nodes), [], {}, {}, [], set()
    for root in nodes:
        stack = [] if root in number else [(root, None)]
        while stack:
            node, rest = stack.pop()
            if rest is None:
                number[node] = low[node] = len(number)
                held.append(node)
                rest = iter([to for to in leads[node] if to in allowed])
            for to in rest:
                if to not in number:
                    stack += [(node, rest), (to, None)]
                    break
                if to not in done:
                    low[node] = min(low[node], low[to])
            else:
                if stack:
                    low[stack[-1][0]] = min(low[stack[-1][0]], low[node])
                if low[node] == number[node]:
                    at = held.index(node)
                    found.append(held[at:][::-1])
                    done.update(held[at:])
                    del held[at:]
    return found[::-1]


def in_order(nodes, leads):
    """Pieces in an order of control in which all of a loop comes before its successors (Bourdoncle, "Efficient chaotic
    iteration strategies with widenings")."""
    order = []
    for component in components(nodes, leads):
        order.append(component[-1])
        if len(component) > 1:
            order += in_order(component[-2::-1], leads)
    return order


class TracedFunction(Function):
    """A function whose straight pieces, memory accesses and calls are recorded."""

    def __init__(self, module, symbols):
        super().__init__(module, symbols)
        self.instructions = []  # of each piece
        self.leads = []  # labels, or numbers of pieces, that control goes to behind it
        self.begins = {}  # label -> piece
        self.sites = []  # bytes of the memory accesses of each piece
        self.own_sites = []

    def count(self, label=None, stays=True):
        """Ends a piece, behind which control goes on (`stays`) or to `label`."""
        if not self.counted:
            return
        leads = [len(self.leads) + 1] if stays else []
        if label is not None:
            leads.append(label)
        self.code.append(f"lane.trace_piece({self.module.piece_count() + len(self.leads) + 1});")
        self.instructions.append(self.counted)
        self.leads.append(leads)
        self.sites.append(self.own_sites)
        self.counted, self.own_sites = 0, []

    def label(self, name):
        super().label(name)
        self.begins[name] = len(self.leads)

    def called(self, text):
        return f"lane.trace_call(true); {text} lane.trace_call(false);"

    def instruction(self, statement):
        super().instruction(statement)
        words = statement.split()
        if words[words[0].startswith("@")].split(".")[0] in MEETS:
            self.count()

    def place(self, m, operand):
        address = super().place(m, operand)
        if "param" in m or "const" in m:
            return address
        self.own_sites.append(BYTES[m[-1]] * (2 if "v2" in m else 4 if "v4" in m else 1))
        return f"lane.trace_access({len(self.own_sites) - 1}, {address})"

    def pieces(self):
        """(instructions, position in the order of control, accesses) of each piece."""
        count = len(self.leads)
        targets = [[self.begins.get(lead, lead) for lead in leads] for leads in self.leads]
        order = in_order(range(count), [[lead for lead in leads if lead < count] for leads in targets])
        position = {piece: at for at, piece in enumerate(order)}
        return [(self.instructions[i], position[i], self.sites[i]) for i in range(count)]
