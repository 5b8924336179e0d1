"""Our frames are pymavlink's, byte for byte."""

from __future__ import annotations

import random
import subprocess
import sys
from typing import Any

import pytest
from pymavlink.dialects.v10 import common as v1
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.dialects.v20 import development

from controller.ground.link.packing import (
    AvailableModes,
    CurrentMode,
    Packed,
    checksum,
    frame,
    frame_v1,
    packed,
)
from sitl_bridge.mavlink.framing import split
from tests.patience import PATIENCE


def _random_message(number: int, seed: int) -> Any:
    generator = random.Random(number * 1000 + seed)
    size = mavlink.mavlink_map[number].unpacker.size
    payload = bytes(generator.randrange(256) for _ in range(size))
    raw = frame(payload, number, mavlink.mavlink_map[number].crc_extra, 0, 1, 1, False)
    return mavlink.MAVLink(None).decode(bytearray(raw))


@pytest.mark.parametrize("number", sorted(mavlink.mavlink_map))
def test_every_message_is_framed_as_pymavlink_does(number: int) -> None:
    message = _random_message(number, 0)
    writer = mavlink.MAVLink(None, srcSystem=7, srcComponent=9)
    writer.seq = 200
    ours = packed(message)
    assert ours is not None
    expected = message.pack(writer)
    assert frame(*ours, 200, 7, 9, False) == expected


def test_checksum_of_the_standard_check_string() -> None:
    assert checksum(b"123456789") == 0x6F91  # CRC-16/MCRF4XX


def test_mavlink_1_has_no_extension_fields() -> None:
    message = mavlink.MAVLink_command_ack_message(400, 0, 5, 6, 7, 8)
    ours = packed(message)
    assert ours is not None
    writer = v1.MAVLink(None, srcSystem=1, srcComponent=1)
    expected = v1.MAVLink_command_ack_message(400, 0).pack(writer)
    assert frame_v1(*ours, 0, 1, 1) == expected


def test_nothing_is_imported_for_the_first_frame_of_mavlink_1() -> None:
    """Imports take longer than the control loop has."""
    program = """
import sys
from controller.pilot.guided.link import GroundLink
from controller.ground.link.packing import frame_v1
before = set(sys.modules)
assert frame_v1(bytes(9), 0, 50, 0, 1, 1)
assert set(sys.modules) == before, set(sys.modules) - before
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=PATIENCE)


def test_mavlink_1_cannot_say_everything() -> None:
    assert frame_v1(b"\0" * 20, 345, 209, 0, 1, 1) is None


def test_a_number_that_does_not_fit_is_not_sent() -> None:
    assert packed(mavlink.MAVLink_attitude_message(0, 1e300, 0, 0, 0, 0, 0)) is None


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (
            AvailableModes(6, 2, 8, 0x02040000, 1, "Takeoff"),
            development.MAVLink_available_modes_message(6, 2, 8, 0x02040000, 1, b"Takeoff"),
        ),
        (CurrentMode(6, 4 << 16, 5 << 16), development.MAVLink_current_mode_message(6, 4 << 16, 5 << 16)),
    ],
)
def test_messages_of_the_newer_dialect(ours: Any, theirs: Any) -> None:
    writer = development.MAVLink(None, srcSystem=1, srcComponent=1)
    as_packed = packed(ours)
    assert isinstance(as_packed, Packed)
    assert frame(*as_packed, 0, 1, 1, False) == theirs.pack(writer)


def test_frames_are_found_again() -> None:
    as_packed = packed(mavlink.MAVLink_statustext_message(6, b"hello", 0, 0))
    assert as_packed is not None
    found = split(b"\xfd\x09junk" + frame(*as_packed, 3, 1, 1, False)).frames
    assert [f.message_id for f in found] == [mavlink.MAVLINK_MSG_ID_STATUSTEXT]
