"""The way back: up, to above home, and a wait before the landing."""

from __future__ import annotations

import math
from enum import Enum, auto

from controller.ground.flight.limits.fence_zones import Place
from controller.ground.flight.motion.geometry import above
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple

_NEAR = 0.5
"""m, near enough to go on to the next step"""


class Step(Enum):
    """What the vehicle does now."""

    CLIMB = auto()
    CRUISE = auto()
    WAIT = auto()


def nearest_rally_point(points: tuple[Place, ...], here: Triple, home: Triple, p: Parameters) -> Place | None:
    """East and north (m) of the rally point to return to, by RTL_TYPE; None: home."""
    kind = p.integer("RTL_TYPE")
    if kind not in (0, 1, 3) or not points:
        return None
    nearest = min(points, key=lambda place: math.dist(place, here[:2]))
    nearer = math.dist(nearest, here[:2]) < math.dist(home[:2], here[:2])
    return nearest if kind == 1 or nearer else None


class ReturnHome:
    """One way back, of the load if there is one, else of the vehicle; it begins at `point` (m)."""

    def __init__(self, home: Triple, home_load: Triple, point: Triple, stand: Triple | None) -> None:
        self.stand = stand
        """m, where the vehicle is to stand after the landing; None: beside the load"""
        self.point = point
        """m, where the controlled body is to go now"""
        self.step = Step.CLIMB
        self._home = home
        self._home_load = home_load
        self._since = 0.0

    def place(self, view: VehicleView) -> Triple:
        """Where the controlled body belongs, m."""
        return self._home_load if view.load_attached else self._home

    def without_load(self, hanging: float) -> None:
        """The load is lost: the vehicle goes home at its own height, `hanging` (m) above the load's."""
        self.point = above(self.point, hanging)
        if self.step is not Step.CLIMB:  # home is elsewhere than where the load lay
            self.step = Step.CRUISE
            self.point = (self._home[0], self._home[1], self.point[2])

    def arrived(self, view: VehicleView, p: Parameters, profile: Profile) -> bool:
        """Go on; whether it is time to land."""
        over = self.place(view)
        here = view.load_position if view.load_attached else view.position
        if self.step is Step.CLIMB:
            self._climb(here, over, view, p, profile)
        elif self.step is Step.CRUISE:
            if math.dist(here, self.point) < _NEAR:
                self.step = Step.WAIT
                self._since = view.time
        else:
            return 0 <= p["RTL_LAND_DELAY"] <= view.time - self._since and profile.has_ground
        return False

    def _climb(self, here: Triple, over: Triple, view: VehicleView, p: Parameters, profile: Profile) -> None:
        hanging = profile.hover_length if view.load_attached else 0.0
        near = math.hypot(here[0] - over[0], here[1] - over[1]) < p["RTL_MIN_DIST"]
        height = here[2] if near else max(here[2], self._home[2] + p["RTL_RETURN_ALT"] - hanging)
        self.point = (*(over if near else self.point)[:2], height)
        if near or abs(here[2] - height) < _NEAR:
            self.step = Step.CRUISE
            self.point = (over[0], over[1], height)
