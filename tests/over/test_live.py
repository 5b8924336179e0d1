"""Points live: what clients send to the load's own system, and the motion that comes of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import LOAD_POSITION, STATE_SIZE
from controller.over.live.load_system import LoadSystem
from controller.over.live.reference import LIMITS, LiveReference
from sitl_bridge.frames import Geodetic, LocalOrigin
from sitl_bridge.mavlink.framing import Packer, decode, split
from tests.over.played import IRIS

CLIENT = Packer(245, 190)
ORIGIN = LocalOrigin(47.397742, 8.545594, 488.0)
POSITION_ONLY = 0b1101_1111_1000
MOVING = 0b1101_1100_0000


class Load:
    def __init__(self, flying: bool = True) -> None:
        self.said: list[str] = []
        self.reference = LiveReference(IRIS)
        self.system = LoadSystem(0, self.reference, self.said.append)
        self.system.origin, self.system.home_altitude = ORIGIN, 488.0
        state = np.zeros(STATE_SIZE)
        state[LOAD_POSITION] = (1.0, 2.0, 3.0)
        self.system.show(state, 10.0)
        if flying:
            self.reference.start(state[LOAD_POSITION], 0.0)

    def send(self, message: Any) -> list[Any]:
        self.system.receive(CLIENT.pack(message))
        out = b"".join(self.system.to_send(0.0))
        return [decode(frame) for frame in split(out).frames]

    def goes_to(self, seconds: float = 15.0) -> list[float]:
        times = np.arange(0.0, seconds, 0.01)
        positions = np.array([self.reference.path(t)["motion"][0, 0].copy() for t in times])
        speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) / 0.01
        assert speeds.max() < LIMITS.speed + 0.1
        end: list[float] = positions[-1].tolist()
        return end


def local(north: float, east: float, down: float, frame: int = 1, system: int = 101) -> Any:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, system, 35, frame, POSITION_ONLY, north, east, down, *(0.0,) * 8
    )


def reposition(place: Geodetic, frame: int = 5, speed: float = -1.0) -> Any:
    return mavlink.MAVLink_command_int_message(
        *(101, 35, frame, 192, 0, 0, speed, 0, 0, math.nan),
        *(round(place.latitude * 1e7), round(place.longitude * 1e7), place.altitude),
    )


def test_a_local_point_is_gone_to() -> None:
    load = Load()
    load.send(local(5.0, 4.0, -6.0))
    assert load.goes_to() == pytest.approx([4.0, 5.0, 6.0], abs=0.01)


def test_an_offset_counts_from_the_load() -> None:
    load = Load()
    load.send(local(1.0, 0.0, 0.0, frame=mavlink.MAV_FRAME_LOCAL_OFFSET_NED))
    assert load.goes_to() == pytest.approx([1.0, 3.0, 3.0], abs=0.01)


@pytest.mark.parametrize(("frame", "altitude"), [(5, 494.0), (0, 494.0), (6, 6.0), (3, 6.0)])
def test_reposition_by_command_int(frame: int, altitude: float) -> None:
    load = Load()
    place = ORIGIN.geodetic((4.0, 5.0, 6.0))
    answers = load.send(reposition(place._replace(altitude=altitude), frame))
    [ack] = [m for m in answers if m.get_type() == "COMMAND_ACK"]
    assert (ack.command, ack.result, ack.target_system) == (192, mavlink.MAV_RESULT_ACCEPTED, 245)
    assert load.goes_to() == pytest.approx([4.0, 5.0, 6.0], abs=0.03)


def test_a_slow_reposition_is_slow() -> None:
    load = Load()
    load.send(reposition(ORIGIN.geodetic((21.0, 2.0, 3.0)), speed=1.0))
    assert 8.0 < load.goes_to(10.0)[0] - 1.0 < 10.0


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (local(1e9, 0.0, 0.0), "m away"),
        (local(math.nan, math.nan, math.nan), "neither a position nor a velocity"),
        (local(math.inf, 0.0, 0.0), "without bounds"),
        (local(0.0, 0.0, 0.0, frame=8), "expected LOCAL_NED"),
        (reposition(ORIGIN.geodetic((1e5, 0.0, 0.0))), "m away"),
        (reposition(ORIGIN.geodetic((1.0, 0.0, 0.0)), frame=1), "expected a global one"),
    ],
)
def test_what_cannot_be_flown_is_said(message: Any, words: str) -> None:
    load = Load()
    answers = load.send(message)
    assert words in load.said[-1]
    assert any(m.get_type() == "STATUSTEXT" for m in answers)
    assert load.goes_to(2.0) == pytest.approx([1.0, 2.0, 3.0])


def test_before_the_law_flies_points_are_refused() -> None:
    load = Load(flying=False)
    answers = load.send(reposition(ORIGIN.geodetic((4.0, 5.0, 6.0))))
    assert [m.result for m in answers if m.get_type() == "COMMAND_ACK"] == [mavlink.MAV_RESULT_DENIED]
    assert "does not fly yet" in load.said[-1]


def test_messages_for_others_are_left() -> None:
    load = Load()
    load.send(local(5.0, 4.0, -6.0, system=1))
    assert load.goes_to(2.0) == pytest.approx([1.0, 2.0, 3.0])


def test_it_shows_where_the_load_is() -> None:
    shown = {m.get_type(): m for m in Load().send(local(0.0, 0.0, -3.0))}
    assert shown["HEARTBEAT"].autopilot == mavlink.MAV_AUTOPILOT_INVALID
    place = shown["LOCAL_POSITION_NED"]
    assert (place.x, place.y, place.z) == (2.0, 1.0, -3.0)
    assert shown["GLOBAL_POSITION_INT"].relative_alt == pytest.approx(3000, abs=2)


def test_a_set_point_that_moves_is_followed_without_a_lag() -> None:
    load = Load()
    for k in range(600):
        t = 0.02 * k
        load.system.receive(
            CLIENT.pack(
                mavlink.MAVLink_set_position_target_local_ned_message(
                    0, 101, 35, 1, MOVING, 2.0, 1.0 + t, -3.0, 0.0, 1.0, 0.0, *(0.0,) * 5
                )
            )
        )
        position = load.reference.path(t)["motion"][0, 0]
    assert position[0] == pytest.approx(1.0 + t, abs=0.05)


@given(st.binary(max_size=300))
def test_no_datagram_upsets_it(data: bytes) -> None:
    load = Load()
    load.system.receive(data)
    load.system.to_send(1.0)
