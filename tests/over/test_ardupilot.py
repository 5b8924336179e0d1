"""A stack that answers as ArduCopter's documentation says. The companion has not flown a real one."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.over.law import LARGEST_RATE
from controller.over.states import State
from tests.over.played import Played, PlayedStack

GUIDED, LAND_MODE, BRAKE, STABILIZE = 4, 9, 17, 0


class PlayedCopter(PlayedStack):
    """Mode numbers in parameter 2, altitudes of take-off above home, no ODOMETRY, GUID_OPTIONS."""

    def __init__(self) -> None:
        super().__init__()
        self.autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        self.mode = STABILIZE
        self.parameters = {"GUID_OPTIONS": 8.0, "GUID_TIMEOUT": 0.3}

    def obey(self, message: Any) -> int:
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = self.mode == GUIDED
            return int(mavlink.MAV_RESULT_ACCEPTED if self.armed else mavlink.MAV_RESULT_FAILED)
        if message.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            if self.mode != GUIDED or not self.armed:
                return int(mavlink.MAV_RESULT_FAILED)
            self.height = message.param7
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            assert int(message.param3) == 0
            self.mode = int(message.param2)
            self.armed = self.armed and self.mode != LAND_MODE
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def state(self) -> list[Any]:
        milliseconds = round(1e3 * self.now)
        level = (1.0, 0.0, 0.0, 0.0)
        return [
            mavlink.MAVLink_attitude_quaternion_message(milliseconds, *level, 0.0, 0.0, 0.0),
            mavlink.MAVLink_local_position_ned_message(milliseconds, 0.0, 0.0, -self.height, 0.0, 0.0, 0.0),
        ]


def test_a_whole_flight() -> None:
    flight = Played(stack=PlayedCopter())
    flight.run(60.0, lambda: flight.companion.over)
    assert flight.flight.state is State.DONE, (flight.flight.state, flight.said)
    assert "ArduCopter is there (system 1)" in flight.said
    modes = [int(m.param2) for m in flight.stack.commands if m.command == mavlink.MAV_CMD_DO_SET_MODE]
    assert modes == [GUIDED, BRAKE, LAND_MODE]
    assert all(abs(m.body_roll_rate) <= LARGEST_RATE for m in flight.stack.setpoints)
    assert flight.flight.steps > 150


def test_set_points_act_at_once_so_none_comes_before_the_law_flies() -> None:
    flight = Played(stack=PlayedCopter())
    flight.run(60.0, lambda: bool(flight.stack.setpoints))
    assert flight.flight.state is State.STEADYING


def test_thrust_is_linear() -> None:
    flight = Played(stack=PlayedCopter())
    flight.run(60.0, lambda: len(flight.stack.setpoints) > 20)
    full = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in flight.flight.vehicle.rotors)
    hover = flight.flight.vehicle.hover_thrust / full
    assert flight.stack.setpoints[0].thrust == pytest.approx(hover, rel=0.05)


def test_without_thrust_as_thrust_it_is_not_armed() -> None:
    stack = PlayedCopter()
    stack.parameters["GUID_OPTIONS"] = 1.0
    flight = Played(stack=stack)
    flight.run(20.0, lambda: flight.companion.over)
    assert flight.flight.failure == "GUID_OPTIONS is 1: the thrust of a set-point is a climb rate; expected 9"
    assert not any(m.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM for m in stack.commands)
