"""The parameter protocol: PARAM_REQUEST_LIST, _READ, _SET, answered by PARAM_VALUE or PARAM_ERROR."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import Packed
from controller.ground.link.peers import Address
from controller.ground.parameters.parameter import Parameter
from controller.ground.parameters.table import BY_NAME, TABLE

ERROR_DOES_NOT_EXIST: int = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
ERROR_OUT_OF_RANGE: int = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
ERROR_TYPE_MISMATCH = 7
"""MAV_PARAM_ERROR_TYPE_MISMATCH of the current dialect"""
HASH_CHECK = "_HASH_CHECK"
"""Not a parameter: by this name PX4 gives the hash over all of them, and clients tell it to stop a list"""
_NO_INDEX = 0xFFFF
LIST_RATE = 500.0
"""Hz, at which a list goes out: a burst would overflow a client's socket buffer"""

Reply = Callable[[Any], None]
Say = Callable[[str], None]

_INDEX = {parameter.name: index for index, parameter in enumerate(TABLE)}


class Parameters:
    """The values, by name, and what is left to send of the lists that peers have asked for."""

    def __init__(self, own_defaults: Mapping[str, float] | None = None) -> None:
        """own_defaults: those that are the vehicle's and not the table's."""
        self._defaults: dict[str, float] = {p.name: _float32(p) for p in TABLE} | dict(own_defaults or {})
        self._values = dict(self._defaults)
        self._changed: set[str] = set()
        self._lists: dict[Address, tuple[int, float]] = {}

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def integer(self, name: str) -> int:
        """An INT32 parameter's value."""
        return int(self._values[name])

    def take_changed(self) -> set[str]:
        """Names whose values have changed since the last call."""
        changed, self._changed = self._changed, set()
        return changed

    def fault(self, name: str, value: float) -> str:
        """Why a value cannot be set, or an empty string."""
        p = BY_NAME.get(name)
        if p is None:
            return f"{name}: no such parameter"
        if not math.isfinite(value):
            return f"{name} = {value:g}: not a finite number; {_allowed(p)}"
        if p.is_integer and value != int(value):
            return f"{name} = {value:g}: not an integer; {_allowed(p)}"
        inside = int(value) in dict(p.choices) if p.choices else _inside(p, value)
        return "" if inside else f"{name} = {p.shown(value)} {p.unit}".rstrip() + f": {_allowed(p)}"

    def set(self, name: str, value: float) -> str:
        """Set a value; returns why not, or an empty string."""
        fault = self.fault(name, value)
        if not fault and self._values[name] != value:
            self._values[name] = value
            self._changed.add(name)
        return fault

    def reset(self) -> None:
        """All defaults."""
        for name, value in self._defaults.items():
            self.set(name, value)

    def values(self) -> dict[str, float]:
        """Every value by name, integers as `int`."""
        return {p.name: int(self[p.name]) if p.is_integer else self[p.name] for p in TABLE}

    def defaults(self) -> dict[str, float]:
        """Every default by name, integers as `int`."""
        own = self._defaults
        return {p.name: int(own[p.name]) if p.is_integer else own[p.name] for p in TABLE}

    def load(self, values: Mapping[str, Any]) -> list[str]:
        """Take values from a file; returns a line for each that is not taken."""
        faults = []
        for name, value in values.items():
            number = _number(value)
            fault = f"{name}: not a number" if number is None else self.set(name, _in_float32(name, number))
            faults += [fault] if fault else []
        return faults

    # The protocol

    def request_list(self, peer: Address, now: float) -> None:
        """PARAM_REQUEST_LIST: from the beginning, also when a list is under way."""
        self._lists[peer] = (0, now)

    def request_read(self, name: str, index: int, reply: Reply, say: Say) -> None:
        """PARAM_REQUEST_READ: by name if the index is -1."""
        if index >= 0:
            if index < len(TABLE):
                reply(self._value_message(TABLE[index]))
            else:
                say(f"Parameter {index}: no such index; there are {len(TABLE)}")
                reply(_error("", index, ERROR_DOES_NOT_EXIST))
        elif name == HASH_CHECK:
            reply(self._hash_message())
        elif name in BY_NAME:
            reply(self._value_message(BY_NAME[name]))
        else:
            say(f"{name}: no such parameter; docs/parameters.md lists them")
            reply(_error(name, index, ERROR_DOES_NOT_EXIST))

    def request_set(self, name: str, kind: int, raw: bytes, reply: Reply, say: Say) -> bool:
        """PARAM_SET; `raw` is the value's four bytes, of a float or of an INT32. True if it was set."""
        p = BY_NAME.get(name)
        if p is None:
            say(f"{name}: no such parameter; docs/parameters.md lists them")
            reply(_error(name, -1, ERROR_DOES_NOT_EXIST))
            return False
        if kind != _kind(p):
            say(f"{name} is {'INT32' if p.is_integer else 'REAL32'}, not MAV_PARAM_TYPE {kind}")
            reply(_error(name, _INDEX[name], ERROR_TYPE_MISMATCH))
            return False
        (value,) = struct.unpack("<i" if p.is_integer else "<f", raw)
        fault = self.set(name, float(value))
        if fault:
            say(fault)
            reply(_error(name, _INDEX[name], ERROR_OUT_OF_RANGE))
            return False
        return True

    def stop_list(self, peer: Address) -> None:
        """The peer has what is still to come (PARAM_SET of `HASH_CHECK`)."""
        self._lists.pop(peer, None)

    def hash(self) -> int:
        """CRC-32 over the names and the four-byte values of all parameters by name, as PX4 computes it."""
        crc = 0
        for name in sorted(BY_NAME):
            # PX4 begins with 0 and does not invert at the end; zlib inverts at both.
            crc = zlib.crc32(name.encode() + self._value_bytes(BY_NAME[name]), crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
        return crc

    def _hash_message(self) -> Packed:
        """PARAM_VALUE of the hash."""
        name, kind = HASH_CHECK.encode(), mavlink.MAV_PARAM_TYPE_UINT32
        message = mavlink.MAVLink_param_value_message
        payload = struct.pack("<IHH16sB", self.hash(), len(TABLE), _NO_INDEX, name, kind)
        return Packed(payload, message.id, message.crc_extra)

    def value_message(self, name: str) -> Packed:
        """PARAM_VALUE of a parameter."""
        return self._value_message(BY_NAME[name])

    def _value_message(self, p: Parameter) -> Packed:
        value = self._value_bytes(p)
        rest = struct.pack("<HH16sB", len(TABLE), _INDEX[p.name], p.name.encode(), _kind(p))
        message = mavlink.MAVLink_param_value_message
        return Packed(value + rest, message.id, message.crc_extra)

    def _value_bytes(self, p: Parameter) -> bytes:
        # Packed here: an INT32's bytes are no float that Python would pass on unchanged (signalling NaN).
        return struct.pack("<i", int(self[p.name])) if p.is_integer else struct.pack("<f", self[p.name])

    # What is due of lists

    def to_send(self, peers: Iterable[Address], now: float) -> list[tuple[Address, Any]]:
        """PARAM_VALUE messages that are due, of lists of peers that are still there."""
        known = set(peers)
        out: list[tuple[Address, Any]] = []
        for peer, (index, due) in list(self._lists.items()):
            if peer not in known:
                del self._lists[peer]
                continue
            if now < due:
                continue
            count = 1 + int(min(now - due, 0.02) * LIST_RATE)
            if index == 0:
                out.append((peer, self._hash_message()))
            for p in TABLE[index : index + count]:
                out.append((peer, self._value_message(p)))
            index += count
            if index >= len(TABLE):
                del self._lists[peer]
            else:
                self._lists[peer] = (index, now + 1.0 / LIST_RATE)
        return out

    def next_deadline(self) -> float:
        """When the next PARAM_VALUE of a list is due; inf if none is."""
        return min((due for _, due in self._lists.values()), default=math.inf)


def as_own_type(name: str, kind: int, raw: bytes) -> tuple[int, bytes]:
    """Type and bytes of a value that a client sends as a float whatever the parameter is."""
    p = BY_NAME.get(name)
    (value,) = struct.unpack("<f", raw)
    if p is None or not p.is_integer or kind != mavlink.MAV_PARAM_TYPE_REAL32:
        return kind, raw
    if not abs(value) < 2**31 or value != int(value):
        return kind, raw
    return int(mavlink.MAV_PARAM_TYPE_INT32), struct.pack("<i", int(value))


def _inside(p: Parameter, value: float) -> bool:
    """Within the range, whose ends count although they are no float32 numbers."""
    return bool(single(p.minimum) <= value <= single(p.maximum))


def _number(value: object) -> float | None:
    """A number of a file, infinite if it is too large; None if it is none."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def single(value: float) -> float:
    """A number as a float32 keeps it."""
    (kept,) = struct.unpack("<f", struct.pack("<f", value))
    return float(kept)


def _float32(p: Parameter) -> float:
    return p.default if p.is_integer else single(p.default)


def _in_float32(name: str, value: float) -> float:
    p = BY_NAME.get(name)
    keep = p is None or p.is_integer or not math.isfinite(value) or abs(value) > 1e30
    return value if keep else single(value)


def _kind(p: Parameter) -> int:
    return int(mavlink.MAV_PARAM_TYPE_INT32 if p.is_integer else mavlink.MAV_PARAM_TYPE_REAL32)


def _allowed(p: Parameter) -> str:
    return f"allowed: {p.range} {p.unit}".rstrip()


def _error(name: str, index: int, error: int) -> Any:
    # Target 0/0: the sender is filled in by the station, which knows it.
    return mavlink.MAVLink_param_error_message(0, 0, name.encode("ascii", "replace")[:16], index, error)
