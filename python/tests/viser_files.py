"""Reads recordings of viser by its file format alone, and returns the scene at a time."""

import base64
import re

import numpy as np
from frameworks import framework

WHAT = "stiction.view with viser is"
framework("viser", WHAT)
msgspec = framework("msgspec", WHAT)
zstandard = framework("zstandard", WHAT)


def _bytes_of(path):
    """Reads the contents of a .viser file, or of a page's first script."""
    if path.suffix == ".viser":
        return path.read_bytes()
    return base64.b64decode(re.search(r'__VISER_EMBED_DATA__="([^"]+)"', path.read_text(encoding="utf-8")).group(1))


class Recording:
    """Messages of a recording, and its duration [s]."""

    def __init__(self, path):
        data = _bytes_of(path)
        inner = zstandard.ZstdDecompressor().decompress(data[8:], max_output_size=int.from_bytes(data[:8], "little"))
        end = 8 + int.from_bytes(inner[:8], "little")
        head = msgspec.msgpack.decode(inner[8:end])
        self.duration, self._messages, self._buffers = head["durationSeconds"], head["messages"], []
        for length in head["binaryBufferLengths"]:
            end += -end % 8
            self._buffers.append(inner[end:end + length])
            end += length
        assert end == len(inner)

    def _value(self, value):
        if isinstance(value, dict) and "__binary_index" in value:
            return np.frombuffer(self._buffers[value["__binary_index"]], value["dtype"])
        return value

    def at(self, seconds):
        """{name: properties} of all nodes, as they are shown at that time."""
        nodes = {}
        for when, message in self._messages:
            if when > seconds + 1e-9:
                break
            if message.get("virtual"):  # a parent that no one asked for
                continue
            kind, node = message["type"], nodes.setdefault(message.get("name"), {})
            if kind.startswith("Set"):
                node.update({key: message[key] for key in ("position", "wxyz", "visible") if key in message})
            elif "props" in message or "updates" in message:
                node.update({key: self._value(value) for key, value in message.get("props", message.get("updates")).items()},
                            kind=node.get("kind", kind))
        return {name: node for name, node in nodes.items() if "kind" in node}
