"""Take-off with a load that lies on the ground: lift, go above it, take up the slack, carry."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto

from controller.ground.flight.motion.setpoint_types import Body, Goto
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple, euler_from_quaternion

_SLACK = 0.8
"""Share of the cable's length that is used while it has to stay slack."""
_NEAR = 0.2
"""m, near enough to go on to the next step"""
_SLOW = 0.4
"""m/s, at rest enough to go on to the next step"""


class Step(Enum):
    """What the vehicle does now."""

    LIFT = auto()
    """Straight up, the cable slack."""
    OVER = auto()
    """To above the load, the cable still slack."""
    TAKE_UP = auto()
    """Up until the cable is taut."""
    CARRY = auto()
    """Up with the load, the load controlled."""
    ALONE = auto()
    """Straight up without a load: it was lost."""
    DONE = auto()


class Ascent:
    """One take-off to a height of the vehicle (m ENU), from wherever vehicle and load are."""

    def __init__(self, height: float, speed: float, profile: Profile, view: VehicleView) -> None:
        self.height = height
        self.step = Step.LIFT
        self._speed = speed
        self._profile = profile
        self._yaw = euler_from_quaternion(view.attitude)[2]
        self._target = self._lift(view)
        if not view.load_attached:
            self._go_alone(view)
        elif view.cable_taut and not view.load_on_ground:
            self._carry(view)

    @property
    def carries(self) -> bool:
        """Whether the load is controlled already."""
        return self.step in (Step.CARRY, Step.DONE)

    def change_height(self, height: float) -> None:
        """End at another height of the vehicle, m ENU."""
        if self.step in (Step.CARRY, Step.ALONE):
            x, y, z = self._target.position
            self._target = replace(self._target, position=(x, y, z + height - self.height))
        self.height = height

    def target(self, view: VehicleView) -> Goto:
        """Where to go now; moves on to the next step when this one is done."""
        if not view.load_attached and self.step not in (Step.ALONE, Step.DONE):
            self._go_alone(view)
        elif self.step is Step.ALONE and view.position[2] >= self.height - _NEAR:
            self.step = Step.DONE
        elif self.step is Step.LIFT and self._arrived(view):
            self.step = Step.OVER
            load = view.load_position
            height = max(view.position[2], load[2] + 0.5 * self._profile.rest_length)
            highest = load[2] + _SLACK * self._profile.rest_length
            self._target = self._vehicle((load[0], load[1], min(height, highest)))
        elif self.step is Step.OVER and self._arrived(view):
            self.step = Step.TAKE_UP
            load = view.load_position
            above = load[2] + self._profile.hover_length + _NEAR
            self._target = self._vehicle((load[0], load[1], above), 0.5 * self._speed)
        elif self.step is Step.TAKE_UP and view.cable_taut:
            self._carry(view)
        elif self.step is Step.CARRY and view.position[2] >= self.height - _NEAR and not view.load_on_ground:
            self.step = Step.DONE
        return self._target

    def _lift(self, view: VehicleView) -> Goto:
        """Up as far as the cable stays slack, at most 1 m."""
        load, here = view.load_position, view.position
        reach = _SLACK * self._profile.rest_length
        aside = math.hypot(load[0] - here[0], load[1] - here[1])
        room = math.sqrt(max(0.0, reach**2 - aside**2)) + load[2] - here[2]
        return self._vehicle((here[0], here[1], here[2] + min(max(room, 0.3), 1.0)))

    def _carry(self, view: VehicleView) -> None:
        self.step = Step.CARRY
        here = view.load_position
        height = self.height - self._profile.hover_length
        self._target = Goto(Body.LOAD, (here[0], here[1], height), self._yaw, self._speed)

    def _go_alone(self, view: VehicleView) -> None:
        self.step = Step.ALONE
        self._target = self._vehicle((view.position[0], view.position[1], self.height))

    def _vehicle(self, position: Triple, speed: float | None = None) -> Goto:
        return Goto(Body.VEHICLE, position, self._yaw, speed or self._speed)

    def _arrived(self, view: VehicleView) -> bool:
        return math.dist(view.position, self._target.position) < _NEAR and math.hypot(*view.velocity) < _SLOW
