"""Landing with a load: set it down, slacken the cable, go beside it, land."""

from __future__ import annotations

import math
from enum import Enum, auto

from controller.ground.flight.motion.setpoint_types import Body, Goto, Land
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple, euler_from_quaternion

_LOW = 1.5
"""m, height of the load above the ground at which the slow part of the descent begins"""
_BESIDE = 0.6
"""Largest distance from the load at which the vehicle lands, as a share of the cable's length."""
_NEAR = 0.2
"""m"""
_OF_REACH = 0.25
"""How near the vehicle comes to its place beside the load before it goes down, as a share of the way there: a
winch may have left it no more than decimetres of cable."""
_SLOW = 0.4
"""m/s"""


class Step(Enum):
    """What the vehicle does now."""

    ABOVE = auto()
    """The load goes to low above its place."""
    LOAD_DOWN = auto()
    BESIDE = auto()
    """The vehicle, alone, goes beside the load on a slack cable."""
    VEHICLE_DOWN = auto()
    DONE = auto()


class Descent:
    """One landing. The load comes down on `place` (x, y), the vehicle at `stand` or beside it."""

    def __init__(
        self,
        place: Triple,
        ground: float,
        speed: float,
        fast: float,
        beside: float,
        profile: Profile,
        view: VehicleView,
        stand: Triple | None = None,
    ) -> None:
        self.step = Step.ABOVE
        self._place = place
        self._ground = ground
        self._speed = speed
        self._reach = min(beside, _BESIDE * profile.rest_length)
        self._profile = profile
        self._stand = stand
        self._yaw = euler_from_quaternion(view.attitude)[2]
        low = (place[0], place[1], min(view.load_position[2], ground + _LOW))
        self._target: Goto | Land = Goto(Body.LOAD, low, self._yaw, fast)
        if not view.load_attached:
            self._go_down(view.position)
        elif view.load_on_ground or not view.cable_taut:
            self._go_beside(view)

    @property
    def hangs(self) -> bool:
        """Whether the load still hangs, so that the landing can be broken off as it is."""
        return self.step in (Step.ABOVE, Step.LOAD_DOWN)

    def target(self, view: VehicleView) -> Goto | Land:
        """Where to go now; moves on to the next step when this one is done."""
        if self.hangs and not view.load_attached:
            self._go_down(view.position)
        elif self.hangs and view.load_on_ground:
            self._go_beside(view)
        elif self.step is Step.ABOVE and self._arrived(view.load_position, view.load_velocity):
            self.step = Step.LOAD_DOWN
            self._target = Land(Body.LOAD, self._place, self._yaw, self._speed)
        elif self.step is Step.BESIDE and self._is_beside(view):
            self._go_down(self._target.position)
        elif self.step is Step.VEHICLE_DOWN and view.vehicle_on_ground:
            self.step = Step.DONE
        return self._target

    def _go_beside(self, view: VehicleView) -> None:
        self.step = Step.BESIDE
        x, y = self._landing_place(view)
        height = view.load_position[2] + _BESIDE * self._profile.rest_length
        self._target = Goto(Body.VEHICLE, (x, y, height), self._yaw, 2 * self._speed)

    def _landing_place(self, view: VehicleView) -> tuple[float, float]:
        """Where the vehicle stood before, if in reach of the cable and not on the load; else behind it."""
        load = view.load_position
        if self._stand is not None:
            away = math.hypot(self._stand[0] - load[0], self._stand[1] - load[1])
            if 0.5 * self._reach <= away <= _BESIDE * self._profile.rest_length:
                return self._stand[0], self._stand[1]
        return load[0] - self._reach * math.cos(self._yaw), load[1] - self._reach * math.sin(self._yaw)

    def _go_down(self, position: Triple) -> None:
        self.step = Step.VEHICLE_DOWN
        self._target = Land(Body.VEHICLE, position, self._yaw, self._speed)

    def _is_beside(self, view: VehicleView) -> bool:
        return self._arrived(view.position, view.velocity, min(_NEAR, _OF_REACH * self._reach))

    def _arrived(self, position: Triple, velocity: Triple, near: float = _NEAR) -> bool:
        away = math.dist(position, self._target.position)
        return away < near and math.hypot(*velocity) < _SLOW
