"""Take-off with the load and landing that sets it down, flown with the kinematic vehicle."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.guidance import Stage
from controller.ground.flight.motion.setpoint_types import Body, Goto
from tests.controller.ground.in_flight import (
    ACCEPTED,
    DENIED,
    HOME_HEIGHT,
    flying,
    local_setpoint,
    mode,
    stream,
)
from tests.controller.ground.kinematic import PROFILE, ZURICH
from tests.controller.ground.rig import NAN, Rig


@pytest.mark.parametrize("arm_first", [True, False])
def test_take_off_in_both_orders(arm_first: bool) -> None:
    """MAVSDK arms first; QGroundControl takes off (p7 above mean sea level) and arms then."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    commands = [(400, (1.0,)), (22, (NAN,) * 6 + (488.0 + HOME_HEIGHT + 4.0,))]
    for number, params in commands if arm_first else reversed(commands):
        assert client.command(number, *params).result == ACCEPTED
    steps = []
    while mode(rig) == "TAKEOFF" or not steps:
        rig.run(0.02)
        steps.append(rig.target)
        assert len(steps) < 3000
    bodies = [s.body for s in steps if isinstance(s, Goto)]
    assert bodies[0] is Body.VEHICLE
    assert bodies[-1] is Body.LOAD
    assert bodies == sorted(bodies, key=lambda b: b is Body.LOAD)  # goes over once
    rig.run(5.0)
    assert mode(rig) == "HOLD"
    assert rig.view.position[2] == pytest.approx(4.0 + HOME_HEIGHT, abs=0.25)
    assert not rig.view.load_on_ground


def test_the_cable_stays_slack_until_the_vehicle_is_above_the_load() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22)
    start = rig.view.load_position
    rig.run_until(lambda: rig.view.cable_taut)
    assert math.dist(start, rig.view.load_position) < 0.02
    assert math.hypot(rig.view.position[0] - start[0], rig.view.position[1] - start[1]) < 0.3


def test_a_take_off_too_low_for_the_load_goes_higher_and_says_so() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1.0, 9))
    rig.fly(client)
    rig.run(3.0)
    assert rig.view.load_position[2] > 0.4
    assert any("so that the load leaves the ground" in text for text in client.texts())


@pytest.mark.parametrize("asked_in", ["LIFT", "CARRY"])
@pytest.mark.parametrize("height", [3.0, 6.0])
def test_another_altitude_while_climbing_is_climbed_to(asked_in: str, height: float) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    assert client.command(22, *(NAN,) * 6, 488.0 + HOME_HEIGHT + 4.0).result == ACCEPTED
    body = Body.LOAD if asked_in == "CARRY" else Body.VEHICLE
    rig.run_until(lambda: getattr(rig.target, "body", None) is body)
    assert client.command(22, *(NAN,) * 6, 488.0 + HOME_HEIGHT + height).result == ACCEPTED
    assert client.command(22).result == ACCEPTED  # without an altitude: it stays
    rig.run_until(lambda: mode(rig) == "HOLD")
    rig.run(5.0)
    assert rig.view.position[2] == pytest.approx(height + HOME_HEIGHT, abs=0.25)


def test_the_altitude_of_a_take_off_is_not_another_modes() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(22, *(NAN,) * 6, 488.0 + HOME_HEIGHT + 1.0).result == ACCEPTED  # too low
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    assert client.command(400, 1).result == ACCEPTED
    stream(rig, client, local_setpoint(0, 0, -4), 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, local_setpoint(0, 0, -4), 12.0)
    assert rig.view.position[2] == pytest.approx(4.0, abs=0.25)
    assert not any("so that the load leaves the ground" in text for text in client.texts())


@pytest.mark.parametrize("altitude", [math.inf, 5000.0])
def test_take_off_to_nowhere_is_refused(altitude: float) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    rig.station.parameters.set("GF_MAX_VER_DIST", 120.0)
    assert client.command(22, *(NAN,) * 6, altitude).result == DENIED
    assert "Take-off denied" in client.texts()[-1]


def test_a_take_off_to_below_home_goes_as_high_as_the_load_needs() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    assert client.command(22, *(NAN,) * 6, 10.0).result == ACCEPTED
    assert "below home (it is above mean sea level)" in "".join(client.texts())
    rig.run_until(lambda: mode(rig) == "HOLD")
    assert not rig.view.load_on_ground


@pytest.mark.parametrize(("number", "params"), [(176, (1, 4, 6)), (21, ()), (176, (1, 4, 5)), (20, ())])
def test_land_and_return_set_the_load_down_first(number: int, params: tuple[float, ...]) -> None:
    rig, client = flying()
    assert client.command(number, *params).result == ACCEPTED
    rig.run_until(lambda: rig.view.load_on_ground)
    assert not rig.view.vehicle_on_ground
    down = rig.view.load_position
    rig.run_until(lambda: not rig.station.armed)
    assert rig.view.vehicle_on_ground
    apart = math.hypot(rig.view.position[0] - down[0], rig.view.position[1] - down[1])
    assert 0.3 < apart <= 0.6 * PROFILE.rest_length + 0.2
    assert math.dist(down, rig.view.load_position) < 0.05
    assert "Disarmed" in client.texts()[-1]


def test_return_climbs_and_brings_the_load_home() -> None:
    rig, client = flying()
    start = (1.0, 0.0)  # where the load lay
    assert (
        client.command(192, -1, 1, 0, NAN, ZURICH[0] + 2e-4, ZURICH[1] + 2e-4, 488 + 3.0).result == ACCEPTED
    )
    rig.run_until(lambda: rig.view.position[1] > 20)
    assert client.command(20).result == ACCEPTED
    highest = 0.0
    while rig.station.armed:
        rig.run(0.02)
        highest = max(highest, rig.view.position[2])
    assert highest == pytest.approx(6.0 + HOME_HEIGHT, abs=0.6)
    assert math.dist(rig.view.load_position[:2], start) < 0.5


@pytest.mark.parametrize("number", [21, 20])
def test_a_landing_is_broken_off_by_a_point_to_go_to(number: int) -> None:
    rig, client = flying()
    client.command(number)
    rig.run_until(lambda: rig.station.machine.stage is Stage.DESCENT)
    rig.run(0.5)
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0] + 1e-4, ZURICH[1], 488.0 + 4.0).result == ACCEPTED
    rig.run(15.0)
    assert rig.view.position == pytest.approx((0.0, 11.12, 4.0), abs=0.05)
    assert mode(rig) == "HOLD"


def test_a_landing_with_the_load_down_is_broken_off_by_a_take_off() -> None:
    rig, client = flying()
    client.command(21)
    rig.run_until(lambda: rig.view.load_on_ground)
    rig.run(0.1)
    assert client.command(22, *(NAN,) * 6, 488.0 + HOME_HEIGHT + 4.0).result == ACCEPTED
    rig.run_until(lambda: mode(rig) == "HOLD")
    assert "Landing broken off: taking off again" in client.texts()
    rig.run(3.0)
    assert rig.view.position[2] == pytest.approx(4.0 + HOME_HEIGHT, abs=0.25)
    assert not rig.view.load_on_ground


def test_a_landing_is_broken_off_by_hold() -> None:
    rig, client = flying()
    client.command(21)
    rig.run(0.5)
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    rig.run(1.0)
    height = rig.view.position[2]
    rig.run(5.0)
    assert rig.view.position[2] == pytest.approx(height, abs=0.05)
    assert mode(rig) == "HOLD"
