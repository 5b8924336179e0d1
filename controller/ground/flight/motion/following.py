"""Set-points of an offboard client or a pilot, as targets that keep the load off the ground."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.ground.commands.result import WARNING
from controller.ground.commands.setpoints import Setpoint
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.motion.geometry import (
    controlled_body,
    controlled_point,
    hanging_under,
    limited_velocity,
    too_deep,
)
from controller.ground.flight.motion.setpoint_types import Follow, Goto
from controller.ground.flight.motion.trajectory import motion_pole
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple

_AT_FLOOR = 0.01
"""m, by which a set-point's height may be below the floor without a word"""
_LONGEST_DRIVE = 0.2
"""s between two looks for which an acceleration drives on"""
_STAY_AT_FLOOR = 0.3
"""m above the room that a stop needs, within which a body that stops at the floor goes on to"""


class Following:
    """Follows one set-point after another."""

    def __init__(
        self,
        profile: Profile,
        parameters: Parameters,
        fence: Callable[[bool], Fence],
        say: Callable[[int, str], None],
    ) -> None:
        """fence: with a load or without; say: a STATUSTEXT."""
        self._profile = profile
        self._parameters = parameters
        self._fence, self._say = fence, say
        self._pole = motion_pole(profile.hover_length, profile.gravity)
        self._driven_speed: Triple = (math.nan, math.nan, math.nan)
        self._driven_at = -math.inf
        """m/s and s of the plant's time, of axes that only an acceleration drives"""
        self.start()

    def start(self) -> None:
        """Somebody else's set-points, from now on."""
        self._at_floor = False
        """The client asks for less height than there may be, and has been told"""

    def target(self, asked: Setpoint, view: VehicleView, heading: float) -> Goto | Follow:
        """Where to go for a set-point; heading: rad, of one that names no other."""
        position, velocity = asked.position, limited_velocity(asked.velocity, self._parameters)
        if view.load_attached is not asked.of_load:  # a lost load's: from above where it would be
            under = hanging_under(asked.acceleration, self._profile)
            way = -1.0 if view.load_attached else 1.0
            x, y, z = (p + way * d for p, d in zip(position, under, strict=True))
            position = (x, y, z)
        acceleration = asked.acceleration
        velocity = self._driven(position, velocity, acceleration, view)
        if math.isnan(position[2]):
            deep = self._goes_too_deep(velocity[2], view)
        else:
            deep = self._note_depth(position[2] < self.floor(view) - _AT_FLOOR, view)
        if deep:
            position = (position[0], position[1], self.floor(view))
            velocity, acceleration = (*velocity[:2], 0.0), (*acceleration[:2], math.nan)
        plain = all(math.isnan(v) for v in (*asked.velocity, *asked.acceleration, asked.yaw_rate))
        body = controlled_body(view)
        if plain:
            return Goto(body, position, heading, self._parameters["MPC_XY_VEL_MAX"])
        return Follow(body, position, velocity, acceleration, asked.yaw, asked.yaw_rate)

    def _driven(self, position: Triple, velocity: Triple, acceleration: Triple, view: VehicleView) -> Triple:
        """Velocities, also on axes that only have an acceleration: what there was, driven on by it."""
        own = view.load_velocity if view.load_attached else view.velocity
        step = view.time - self._driven_at
        before = self._driven_speed if 0.0 <= step <= _LONGEST_DRIVE else (math.nan,) * 3
        step = min(max(step, 0.0), _LONGEST_DRIVE)
        driven = []
        for p, v, a, last, now in zip(position, velocity, acceleration, before, own, strict=True):
            alone = math.isnan(p) and math.isnan(v) and not math.isnan(a)
            driven.append((now if math.isnan(last) else last + a * step) if alone else math.nan)
        x, y, z = (v if math.isnan(d) else d for v, d in zip(velocity, driven, strict=True))
        limited = limited_velocity((x, y, z), self._parameters)
        a, b, c = (math.nan if math.isnan(d) else v for d, v in zip(driven, limited, strict=True))
        self._driven_speed, self._driven_at = (a, b, c), view.time
        return limited

    def floor(self, view: VehicleView) -> float:
        """Least height of the controlled body, m ENU; -inf without a ground."""
        fence = self._fence(view.load_attached)
        return controlled_point((0.0, 0.0, fence.home[2] + fence.least_height), view, self._profile)[2]

    def _goes_too_deep(self, velocity: float, view: VehicleView) -> bool:
        """Whether a set-point's upward velocity (m/s) has to end at the floor now; says so once."""
        room = height_of(view) - self.floor(view) - (_STAY_AT_FLOOR if self._at_floor else 0.0)
        own = (view.load_velocity if view.load_attached else view.velocity)[2]
        return self._note_depth(too_deep(velocity, own, room, self._parameters, self._pole), view)

    def _note_depth(self, deep: bool, view: VehicleView) -> bool:
        """Whether a set-point is too deep, told once for each time that it becomes so."""
        if deep and not self._at_floor:
            least = self._fence(view.load_attached).least_height
            text = f"Set-point goes down too far: held {least:.1f} m above home (LND_CLEARANCE)"
            self._say(WARNING, text)
        self._at_floor = deep
        return deep


def height_of(view: VehicleView) -> float:
    """Of the controlled body, m ENU."""
    return (view.load_position if view.load_attached else view.position)[2]
