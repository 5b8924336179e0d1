"""`@PARAM/param.pck`: every parameter in one file, in ArduPilot's format, which MAVProxy asks for."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping

MAGIC, MAGIC_WITH_DEFAULTS = 0x671B, 0x671C
_INT32, _FLOAT = 3, 4
_HAS_DEFAULT = 1
_LONGEST_SHARED = 15


def pack(values: Mapping[str, float], defaults: Mapping[str, float] | None = None) -> bytes:
    """The file; integers are those whose value is an `int`. With `defaults`, those that differ are in it."""
    count = len(values)
    magic = MAGIC if defaults is None else MAGIC_WITH_DEFAULTS
    return struct.pack("<HHH", magic, count, count) + b"".join(_rows(values, defaults))


def _rows(values: Mapping[str, float], defaults: Mapping[str, float] | None) -> Iterable[bytes]:
    last = ""
    for name in sorted(values):
        value = values[name]
        kind, layout = (_INT32, "<i") if isinstance(value, int) else (_FLOAT, "<f")
        # A name goes without what it has in common with the one before, but for at least one letter.
        shared = 0
        while shared < min(_LONGEST_SHARED, len(name) - 1, len(last)) and name[shared] == last[shared]:
            shared += 1
        rest = name[shared:].encode()
        default = value if defaults is None else defaults[name]
        flags = _HAS_DEFAULT if default != value else 0
        row = bytes((kind | flags << 4, shared | len(rest) - 1 << 4)) + rest + struct.pack(layout, value)
        last = name
        yield row + struct.pack(layout, default) if flags else row
