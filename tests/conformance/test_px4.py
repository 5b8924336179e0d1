"""The plant against a PX4 played from its fact sheet, over TCP and UDP, the plant a real process.

What is checked is what PX4 needs: connecting, boot in silence, one answer a tick, units, signs, order, noise.
The vehicle heads east (yaw 0 in ENU), so that no two axes of world and body can be mistaken for each other.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from tests.conformance.px4 import Plant, Px4
from tests.patience import PATIENCE

HOVER_THRUST = (1.5 + 0.3) * 9.81  # N, iris with its load
LARGEST_THRUST = 4 * 5.84e-6 * 1100.0**2  # N
HOVER = (HOVER_THRUST / LARGEST_THRUST) ** 0.5
# Of airframe 10016 in body FRD: roll is -y T, pitch x T, yaw 0.05 T, plus for CCW.
ROTORS = np.array([(0.1515, 0.245, 1), (-0.1515, -0.1875, 1), (0.1515, -0.245, -1), (-0.1515, 0.1875, -1)])
INERTIA = np.array([0.029125, 0.029125, 0.055225])
PERIOD_US = 4000
Attach = Callable[..., Px4]


@pytest.fixture(params=["tcp", "udp"])
def attach(request: pytest.FixtureRequest) -> Iterator[Attach]:
    """Start a plant and connect a PX4 to it."""
    everything: list[Any] = []

    def run(*arguments: str, start: str = "hover") -> Px4:
        px4 = Px4(request.param)
        everything.append(px4)
        line = ("--vehicle", "iris", "--set", f"initial.start={start}", "--hil", px4.address)
        line += ("--clock", "lockstep")
        everything.append(Plant(*line, *arguments))
        px4.connect()
        return px4

    yield run
    for one in everything:
        one.close()


def boot(px4: Px4, silent: int = 12) -> None:
    """The first HIL_SENSORs get no answer."""
    for _ in range(silent):
        px4.tick()


def fly(px4: Px4, ticks: int, controls: list[float] | None = None, armed: bool = True) -> list[Any]:
    """Answer so many ticks one for one; the HIL_SENSORs that came of it."""
    out = []
    for _ in range(ticks):
        before = px4.last_time
        px4.answer(controls or [HOVER] * 4, armed)
        out.append(px4.tick()[-1])
        assert out[-1].time_usec == before + PERIOD_US
    return out


def vector(message: Any, kind: str) -> np.ndarray[Any, Any]:
    return np.array([getattr(message, f"{axis}{kind}") for axis in "xyz"])


def mean(messages: list[Any], kind: str) -> np.ndarray[Any, Any]:
    return np.mean([vector(message, kind) for message in messages], axis=0)


@pytest.mark.parametrize("silent", [9, 29])
def test_freewheels_before_the_first_answer_and_freezes_after_it(attach: Attach, silent: int) -> None:
    px4 = attach()
    boot(px4, silent)
    times = [message.time_usec for message in px4.of("HIL_SENSOR")]
    assert times[0] > 0
    assert set(np.diff(times)) == {PERIOD_US}
    while px4.heard(0.0):  # what it sent before it could have our answer
        px4.tick()
    px4.answer()
    while px4.heard(0.3):
        px4.tick()
    frozen_at = px4.last_time
    assert not px4.heard(0.7)  # not a tick without an answer, repeats aside
    px4.answer()
    assert px4.tick()[-1].time_usec == frozen_at + PERIOD_US
    fly(px4, 50, armed=False)
    for k in range(3):  # one for one: nothing more until the next answer
        assert not px4.heard(0.05), k
        fly(px4, 1, armed=False)


def test_whoever_waits_on_tcp_keeps_time_with_px4() -> None:
    """`sitl plant --vehicle iris --hil tcpin:…` and no more: a tick for an answer, at a person's pace."""
    px4 = Px4("tcp")
    plant = Plant("--vehicle", "iris", "--hil", px4.address)
    try:
        px4.connect()
        boot(px4)
        px4.answer()
        while px4.heard(0.3):
            px4.tick()
        began = time.monotonic()
        fly(px4, 125, armed=False)
        assert time.monotonic() - began > 0.45  # half a second of flight, at speed 1
        assert not px4.heard(0.3)  # frozen until it is answered
    finally:
        plant.close()
        px4.close()


def test_at_rest_on_the_ground(attach: Attach) -> None:
    px4 = attach(start="ground")
    boot(px4)
    px4.answer()
    while px4.heard(0.3):
        px4.tick()
    fly(px4, 100, armed=False)
    sensed = fly(px4, 500, [0.0] * 4)  # armed, rotors at rest: the scenario runs, the legs carry it
    assert {message.fields_updated for message in sensed} == {0x7 | 0x38 | 0x1C0 | 0x1A00 | 0x400}
    assert {message.id for message in sensed} == {0}
    # Bias and mean of noise: consumer sensors.
    assert mean(sensed, "acc") == pytest.approx([0.0, 0.0, -9.81], abs=0.15)
    assert mean(sensed, "gyro") == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
    # World Magnetic Model at Zurich: 21.4 uT north, 1.3 east, 43.4 down; in gauss; it heads east.
    assert mean(sensed, "mag") == pytest.approx([0.013, -0.214, 0.434], abs=0.015)
    pressure = 1013.25 * (1 - 2.25577e-5 * 488.1) ** 5.25588  # hPa, standard atmosphere
    assert np.mean([message.abs_pressure for message in sensed]) == pytest.approx(pressure, abs=0.2)
    assert sensed[0].temperature == pytest.approx(15.0 - 0.0065 * 488.1, abs=0.5)
    assert sensed[0].diff_pressure == pytest.approx(0.0, abs=0.5)
    # Noise on each magnetometer sample: PX4 takes what repeats itself to 1e-6 a hundred times for dead.
    field = np.array([vector(message, "mag") for message in sensed])
    same = np.abs(np.diff(field, axis=0)) <= 1e-6
    assert same.mean() < 0.05
    assert not any(same[k : k + 10, axis].all() for k in range(len(same) - 10) for axis in range(3))

    fixes = px4.of("HIL_GPS")
    flown = (px4.last_time - px4.of("HIL_SENSOR")[0].time_usec) / 1e6
    assert 5 * flown - 2 <= len(fixes) <= 10 * flown + 2
    for fix in fixes:
        assert fix.fix_type >= 3
        assert fix.satellites_visible >= 6
        assert 1 <= fix.eph <= 300  # cm
        assert 1 <= fix.epv <= 500
        assert (fix.lat / 1e7, fix.lon / 1e7) == pytest.approx((47.397742, 8.545594), abs=4e-5)
        assert fix.alt / 1e3 == pytest.approx(488.1, abs=4.0)
        assert (fix.vn, fix.ve, fix.vd) == pytest.approx((0, 0, 0), abs=75)
    kinds = [message.get_type() for message in px4.messages]
    for kind, following in pairwise(kinds):  # slow ones first, HIL_SENSOR last
        assert kind != "HIL_GPS" or following in ("HIL_SENSOR", "HIL_STATE_QUATERNION")
    states = px4.of("HIL_STATE_QUATERNION")
    assert 0.7 * 200 * flown <= len(states) <= 200 * flown + 2  # asked for at 5 ms
    assert (states[-1].lat / 1e7, states[-1].lon / 1e7) == pytest.approx((47.397742, 8.545594), abs=1e-6)
    load = [message for message in px4.of("HEARTBEAT") if message.get_srcSystem() == 101]
    assert load
    assert {message.get_srcComponent() for message in load} == {35}


def test_signs_of_rotation_and_thrust(attach: Attach) -> None:
    px4 = attach("--sensors", "ideal")  # what noise does is tested elsewhere
    boot(px4)
    px4.answer()
    while px4.heard(0.3):
        px4.tick()
    fly(px4, 3)
    effects = np.array([-ROTORS[:, 1], ROTORS[:, 0], 0.05 * ROTORS[:, 2]])
    for axis, effect in enumerate(effects):
        before = mean(fly(px4, 5), "gyro")
        more = 0.1 * effect / np.abs(effect).max()
        pulse = (HOVER + more).tolist()
        torque = effects @ (LARGEST_THRUST / 4 * ((HOVER + more) ** 2 - HOVER**2))
        fly(px4, 8, pulse)
        fly(px4, 10)  # the rotors come back to speed
        change = mean(fly(px4, 5), "gyro") - before
        expected = torque / INERTIA * 8 * PERIOD_US * 1e-6
        assert expected[axis] > 0.1
        # The layout is not symmetric: a command in yaw rolls it too, as the table of rotors has it.
        assert change == pytest.approx(expected, rel=0.35, abs=0.03), axis
    carried = 0.3 * 9.81
    level = mean(fly(px4, 5), "acc")
    up = mean(fly(px4, 25, [1.15 * HOVER] * 4)[-5:], "acc")
    assert level[2] == pytest.approx(-(HOVER_THRUST - carried) / 1.5, abs=0.8)
    # The rotors' share, less what the stretching cable takes back.
    more_thrust = (1.15**2 - 1) * HOVER_THRUST / 1.5
    assert -1.1 * more_thrust < up[2] - level[2] < -0.5 * more_thrust


def test_signs_of_acceleration_and_velocity(attach: Attach) -> None:
    # The load 0.9 m ahead (east), 0.7 m to the right (south), 1.3 m below: the cable pulls that way.
    place = (
        "--set",
        "initial.load_position=[0.9, -0.7, 1.0]",
        "--set",
        "initial.vehicle_position=[0, 0, 2.3]",
    )
    moves = ("--set", "initial.vehicle_velocity=[3.0, 2.0, 1.0]", "--set", "sensors.gps.delay=0")
    px4 = attach("--sensors", "rtk", *place, *moves)
    boot(px4)
    px4.answer()
    while px4.heard(0.3):
        px4.tick()
    length = np.linalg.norm([0.9, 0.7, 1.3])
    pull = 60.0 * (length - 1.5) / 1.5  # m/s², without damping
    sensed = fly(px4, 2)[-1]
    felt = vector(sensed, "acc")
    assert pull * 0.9 / length > 3.0
    # Damping (the cable shortens at up to 3 m/s) and drag take from it, but turn no sign.
    assert 0.3 * pull * 0.9 / length < felt[0] < 1.2 * pull * 0.9 / length
    assert 0.3 * pull * 0.7 / length < felt[1] < 2.0 * pull * 0.7 / length
    before = len(px4.of("HIL_GPS"))
    fly(px4, 26)
    fix = px4.of("HIL_GPS")[before]
    truth = next(m for m in px4.of("HIL_STATE_QUATERNION")[::-1] if m.time_usec <= fix.time_usec + PERIOD_US)
    assert fix.ve > 150 > 0 < fix.vn  # cm/s: it went east and north
    assert (fix.vn, fix.ve, fix.vd) == pytest.approx((truth.vx, truth.vy, truth.vz), abs=40)
    assert fix.vel == pytest.approx(np.hypot(fix.vn, fix.ve), abs=1)
    assert fix.cog == pytest.approx(np.degrees(np.arctan2(fix.ve, fix.vn)) % 360 * 100, abs=40)


def test_the_load_is_shown_to_a_station_where_the_autopilot_does_not(attach: Attach) -> None:
    """--load-to: the load's own system on the station's port, and traffic from the vehicle's system."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(PATIENCE)
        px4 = attach("--load-to", f"127.0.0.1:{station.getsockname()[1]}", start="ground")
        boot(px4)
        heard: dict[str, Any] = {}
        wire = mavlink.MAVLink(None)
        while {"HEARTBEAT", "GLOBAL_POSITION_INT", "ADSB_VEHICLE"} - set(heard):
            for message in wire.parse_buffer(station.recvfrom(65536)[0]) or []:
                heard[message.get_type()] = message
    assert not any(message.get_type() == "ADSB_VEHICLE" for message in px4.messages)
    place = heard["GLOBAL_POSITION_INT"]
    assert (place.get_srcSystem(), place.get_srcComponent()) == (101, 35)
    east = (place.lon / 1e7 - 8.545594) * 111_320.0 * np.cos(np.radians(47.397742))
    assert east == pytest.approx(1.0, abs=0.05)  # it lies 1 m beside the vehicle
    assert place.lat / 1e7 == pytest.approx(47.397742, abs=1e-6)
    assert place.relative_alt == pytest.approx(50, abs=5)  # mm, its radius
    assert heard["HEARTBEAT"].get_srcSystem() == 101
    assert heard["ADSB_VEHICLE"].get_srcSystem() == 1
