"""The parameter protocol message by message, without a station around it."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import Packed
from controller.ground.link.peers import Address
from controller.ground.parameters.protocol import (
    HASH_CHECK,
    LIST_RATE,
    Parameters,
    as_own_type,
    single,
)
from controller.ground.parameters.table import BY_NAME, TABLE

PEER, OTHER = Address(0, "127.0.0.1", 14550), Address(1, "127.0.0.1", 14540)
INT32, REAL32, UINT32 = (
    mavlink.MAV_PARAM_TYPE_INT32,
    mavlink.MAV_PARAM_TYPE_REAL32,
    mavlink.MAV_PARAM_TYPE_UINT32,
)
UNKNOWN, OUT_OF_RANGE, WRONG_TYPE = 1, 2, 7
PERIOD = 1.0 / LIST_RATE
INDEX = {parameter.name: index for index, parameter in enumerate(TABLE)}


def fields(message: Packed) -> tuple[bytes, int, int, str, int]:
    """Value, count, index, name and type of a PARAM_VALUE."""
    assert message.message_id == mavlink.MAVLINK_MSG_ID_PARAM_VALUE
    assert message.crc_extra == mavlink.MAVLink_param_value_message.crc_extra
    value, count, index, name, kind = struct.unpack("<4sHH16sB", message.payload)
    return value, count, index, name.rstrip(b"\0").decode(), kind


def error(message: Any) -> tuple[str, int, int]:
    """Name, index and MAV_PARAM_ERROR of a PARAM_ERROR to whoever asked."""
    assert message.get_type() == "PARAM_ERROR"
    assert (message.target_system, message.target_component) == (0, 0)
    name = message.param_id
    return (name if isinstance(name, str) else name.decode(), message.param_index, message.error)


class Asked:
    """Parameters, what they reply and say."""

    def __init__(self) -> None:
        self.parameters = Parameters()
        self.replies: list[Any] = []
        self.said: list[str] = []

    def read(self, name: str, index: int = -1) -> Any:
        self.parameters.request_read(name, index, self.replies.append, self.said.append)
        return self.replies[-1]

    def set(self, name: str, kind: int, raw: bytes) -> bool:
        return self.parameters.request_set(name, kind, raw, self.replies.append, self.said.append)

    def due(self, now: float, *peers: Address) -> list[tuple[Address, str]]:
        return [(peer, fields(m)[3]) for peer, m in self.parameters.to_send(peers or (PEER, OTHER), now)]


# Reading


def test_a_value_is_read_by_name_and_by_index() -> None:
    asked = Asked()
    float_value = struct.pack("<f", 2.5)
    expected = (float_value, len(TABLE), INDEX["MIS_TAKEOFF_ALT"], "MIS_TAKEOFF_ALT", REAL32)
    assert fields(asked.read("MIS_TAKEOFF_ALT")) == expected
    assert fields(asked.read("", INDEX["MIS_TAKEOFF_ALT"])) == expected
    assert fields(asked.parameters.value_message("MIS_TAKEOFF_ALT")) == expected
    assert fields(asked.read("GF_ACTION"))[0::4] == (struct.pack("<i", 3), INT32)
    for index in (0, len(TABLE) - 1):
        assert fields(asked.read("GF_ACTION", index))[2:4] == (index, TABLE[index].name)  # the index counts
    assert asked.said == []


def test_what_there_is_not_cannot_be_read() -> None:
    asked = Asked()
    assert error(asked.read("NO_SUCH")) == ("NO_SUCH", -1, UNKNOWN)
    assert error(asked.read("", len(TABLE))) == ("", len(TABLE), UNKNOWN)
    assert error(asked.read("A_NAME_OF_MORE_THAN_16"))[0] == "A_NAME_OF_MORE_T"
    assert error(asked.read("Größe"))[0] == "Gr??e"
    assert asked.said[:2] == [
        "NO_SUCH: no such parameter; docs/parameters.md lists them",
        f"Parameter {len(TABLE)}: no such index; there are {len(TABLE)}",
    ]


def test_the_hash_is_read_by_its_name() -> None:
    asked = Asked()
    value, count, index, name, kind = fields(asked.read(HASH_CHECK))
    assert value == struct.pack("<I", asked.parameters.hash())
    assert (count, index, name, kind) == (len(TABLE), 0xFFFF, HASH_CHECK, UINT32)


def test_the_hash_is_the_crc_of_names_and_values_that_does_not_invert() -> None:
    data = b"".join(
        p.name.encode() + (struct.pack("<i", p.default) if p.is_integer else struct.pack("<f", p.default))  # type: ignore[str-bytes-safe]
        for p in sorted(TABLE, key=lambda p: p.name)
    )
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    assert Parameters().hash() == crc


# Setting


def test_a_value_is_set_and_nothing_is_replied_by_itself() -> None:
    asked = Asked()
    assert asked.set("MIS_TAKEOFF_ALT", REAL32, struct.pack("<f", 5.5))
    assert asked.set("GF_ACTION", INT32, struct.pack("<i", 2))
    assert (asked.parameters["MIS_TAKEOFF_ALT"], asked.parameters.integer("GF_ACTION")) == (5.5, 2)
    assert (asked.replies, asked.said) == ([], [])


@pytest.mark.parametrize(
    ("name", "kind", "raw", "why", "said"),
    [
        ("NO_SUCH", REAL32, bytes(4), UNKNOWN, "NO_SUCH: no such parameter; docs/parameters.md lists them"),
        (
            "GF_ACTION",
            REAL32,
            struct.pack("<f", 2.0),
            WRONG_TYPE,
            "GF_ACTION is INT32, not MAV_PARAM_TYPE 9",
        ),
        (
            "MIS_TAKEOFF_ALT",
            INT32,
            struct.pack("<i", 5),
            WRONG_TYPE,
            "MIS_TAKEOFF_ALT is REAL32, not MAV_PARAM_TYPE 6",
        ),
        (
            "MIS_TAKEOFF_ALT",
            REAL32,
            struct.pack("<f", 100.0),
            OUT_OF_RANGE,
            "MIS_TAKEOFF_ALT = 100 m: allowed: 0.5 to 80 m",
        ),
        (
            "COM_RCL_EXCEPT",
            INT32,
            struct.pack("<i", 32),
            OUT_OF_RANGE,
            "COM_RCL_EXCEPT = 32: allowed: 0 to 31",
        ),
        (
            "BAT_LOW_THR",
            REAL32,
            struct.pack("<f", math.nan),
            OUT_OF_RANGE,
            "BAT_LOW_THR = nan: not a finite number; allowed: 0.02 to 0.8",
        ),
    ],
)
def test_what_cannot_be_set_is_refused(name: str, kind: int, raw: bytes, why: int, said: str) -> None:
    asked = Asked()
    before = asked.parameters.values()
    assert not asked.set(name, kind, raw)
    (reply,) = asked.replies
    assert error(reply) == (name, INDEX.get(name, -1), why)
    assert asked.said == [said]
    assert asked.parameters.values() == before
    assert asked.parameters.take_changed() == set()


def test_faults_of_values() -> None:
    p = Parameters()
    assert p.fault("NO_SUCH", 1.0) == "NO_SUCH: no such parameter"
    assert p.fault("COM_RCL_EXCEPT", 2.5) == "COM_RCL_EXCEPT = 2.5: not an integer; allowed: 0 to 31"
    assert p.fault("NAV_DLL_ACT", 4.0).startswith("NAV_DLL_ACT = 4: allowed: 0 none, 1 hold")
    assert p.fault("NAV_DLL_ACT", 5.0) == ""
    assert p.fault("MIS_TAKEOFF_ALT", 2.25) == ""
    for name in ("MIS_TAKEOFF_ALT", "COM_RCL_EXCEPT"):
        assert p.fault(name, BY_NAME[name].minimum) == ""
        assert p.fault(name, BY_NAME[name].maximum) == ""
        assert p.fault(name, BY_NAME[name].minimum - 1) != ""
        assert p.fault(name, BY_NAME[name].maximum + 1) != ""


def test_the_ends_of_a_range_count_as_float32_has_them() -> None:
    p = Parameters()
    assert single(0.1) != 0.1
    for name in ("LND_CLEARANCE", "MPC_LAND_SPEED"):  # at least 0.1
        assert p.fault(name, single(0.1)) == ""
    assert p.fault("MPC_THR_HOVER", single(0.8)) == ""  # at most 0.8
    assert p.fault("MPC_THR_HOVER", math.nextafter(single(0.8), 1.0)) != ""


def test_only_values_that_differ_have_changed() -> None:
    p = Parameters()
    assert p.set("GF_ACTION", 3.0) == ""  # as it is
    assert p.take_changed() == set()
    assert p.set("GF_ACTION", 2.0) == ""
    assert p.set("GF_ACTION", 9.0) != ""
    assert p["GF_ACTION"] == 2.0
    assert p.take_changed() == {"GF_ACTION"}
    assert p.take_changed() == set()
    p.reset()
    assert p["GF_ACTION"] == 3.0
    assert p.take_changed() == {"GF_ACTION"}


def test_defaults_are_float32_and_the_vehicles_own_come_first() -> None:
    p = Parameters({"MPC_THR_HOVER": 0.25, "BAT1_N_CELLS": 6.0})
    assert p["BAT_LOW_THR"] == single(0.15) != 0.15
    assert (p["MPC_THR_HOVER"], p["BAT1_N_CELLS"]) == (0.25, 6.0)
    p.set("MPC_THR_HOVER", 0.5)
    assert p.defaults()["MPC_THR_HOVER"] == 0.25
    assert p.values()["MPC_THR_HOVER"] == 0.5
    for values in (p.values(), p.defaults()):
        assert list(values) == [parameter.name for parameter in TABLE]
        assert isinstance(values["BAT1_N_CELLS"], int)
        assert values["BAT1_N_CELLS"] == 6
        assert isinstance(values["MPC_THR_HOVER"], float)
    p.reset()
    assert p["MPC_THR_HOVER"] == 0.25


def test_a_file_is_taken_value_by_value() -> None:
    p = Parameters()
    faults = p.load(
        {
            "BAT_LOW_THR": 0.2,
            "GF_ACTION": 2,
            "MIS_TAKEOFF_ALT": "x",
            "RTL_RETURN_ALT": True,
            "GONE": 1,
            "MPC_XY_CRUISE": 10**400,
            "MPC_LAND_SPEED": -(10**400),
            "NAV_ACC_RAD": 1e39,
            "LND_CLEARANCE": None,
        }
    )
    assert p["BAT_LOW_THR"] == single(0.2)
    assert p["GF_ACTION"] == 2
    assert faults == [
        "MIS_TAKEOFF_ALT: not a number",
        "RTL_RETURN_ALT: not a number",
        "GONE: no such parameter",
        "MPC_XY_CRUISE = inf: not a finite number; allowed: 0.1 to 20 m/s",
        "MPC_LAND_SPEED = -inf: not a finite number; allowed: 0.1 to 2 m/s",
        "NAV_ACC_RAD = 1e+39 m: allowed: 0.05 to 200 m",
        "LND_CLEARANCE: not a number",
    ]
    assert p.load({"CAL_GYRO0_ID": 16777217}) == []
    assert p.integer("CAL_GYRO0_ID") == 16777217  # no float32


@pytest.mark.parametrize(
    ("name", "kind", "value", "expected"),
    [
        ("GF_ACTION", REAL32, 2.0, (INT32, struct.pack("<i", 2))),
        ("GF_ACTION", REAL32, -2.0, (INT32, struct.pack("<i", -2))),
        ("CAL_GYRO0_ID", REAL32, 1.5 * 2.0**30, (INT32, struct.pack("<i", 3 * 2**29))),
        ("GF_ACTION", REAL32, 2.5, None),
        ("GF_ACTION", REAL32, math.nan, None),
        ("GF_ACTION", REAL32, 2.0**31, None),
        ("GF_ACTION", REAL32, -(2.0**31), None),
        ("GF_ACTION", INT32, 2.0, None),
        ("MIS_TAKEOFF_ALT", REAL32, 2.0, None),
        ("NO_SUCH", REAL32, 2.0, None),
    ],
)
def test_a_float_for_an_integer_parameter_is_taken_as_that_integer(
    name: str, kind: int, value: float, expected: tuple[int, bytes] | None
) -> None:
    raw = struct.pack("<f", value)
    assert as_own_type(name, kind, raw) == (expected or (kind, raw))


# Lists


def test_a_list_begins_with_the_hash_and_has_every_parameter_once() -> None:
    asked = Asked()
    asked.parameters.request_list(PEER, 10.0)
    sent, now = [], 10.0
    while asked.parameters.next_deadline() < math.inf:
        now = asked.parameters.next_deadline()
        sent += asked.due(now)
    assert sent == [(PEER, name) for name in (HASH_CHECK, *INDEX)]
    assert now - 10.0 == pytest.approx((len(TABLE) - 1) * PERIOD)  # the first goes with the hash


def test_a_list_keeps_its_pace() -> None:
    asked = Asked()
    asked.parameters.request_list(PEER, 10.0)
    assert asked.due(9.999) == []
    assert asked.parameters.next_deadline() == 10.0
    assert len(asked.due(10.0)) == 2
    assert asked.parameters.next_deadline() == pytest.approx(10.0 + PERIOD)
    assert asked.due(10.0 + 0.9 * PERIOD) == []
    assert asked.parameters.next_deadline() == pytest.approx(10.0 + PERIOD)
    assert len(asked.due(10.0 + 1.1 * PERIOD)) == 1
    assert len(asked.due(10.0 + 5.2 * PERIOD)) == 4  # late by three periods


def test_after_a_pause_a_list_goes_on_at_its_pace_and_not_in_a_burst() -> None:
    asked = Asked()
    asked.parameters.request_list(PEER, 10.0)
    asked.due(10.0)
    assert len(asked.due(15.0)) == 1 + round(0.02 * LIST_RATE)
    assert asked.due(15.0 + 0.5 * PERIOD) == []
    assert len(asked.due(15.0 + 1.5 * PERIOD)) == 1


def test_two_lists_at_once_go_each_at_its_own_pace() -> None:
    asked = Asked()
    asked.parameters.request_list(PEER, 10.0)
    asked.due(10.0)
    asked.parameters.request_list(OTHER, 10.001)
    assert asked.parameters.next_deadline() == 10.001
    assert asked.due(10.0021) == [(PEER, TABLE[1].name), (OTHER, HASH_CHECK), (OTHER, TABLE[0].name)]


def test_a_list_asked_for_again_begins_again() -> None:
    asked = Asked()
    asked.parameters.request_list(PEER, 10.0)
    asked.due(10.0)
    asked.parameters.request_list(PEER, 11.0)
    assert asked.due(11.0) == [(PEER, HASH_CHECK), (PEER, TABLE[0].name)]


def test_a_list_ends_when_it_is_stopped_or_its_peer_has_gone() -> None:
    asked = Asked()
    for peer in (PEER, OTHER):
        asked.parameters.request_list(peer, 10.0)
    asked.parameters.stop_list(PEER)
    asked.parameters.stop_list(PEER)  # nothing to stop
    assert [peer for peer, _ in asked.due(10.0)] == [OTHER, OTHER]
    assert asked.due(11.0, PEER) == []
    assert asked.parameters.next_deadline() == math.inf
