"""Flying a plan: which item now, when it is reached, what comes next."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.conditions import CONDITIONS, HeldBack, section_after
from controller.ground.flight.motion.region_of_interest import RegionOfInterest
from controller.ground.flight.payload.gripper import GRAB, PATIENCE, RELEASE
from controller.ground.flight.payload.payload import DELIVER, Payload
from controller.ground.missions.item_types import (
    CHANGE_SPEED,
    DELAYS,
    GRIPPER,
    JUMP,
    LAND,
    LOITER,
    LOITER_TIME,
    PAYLOAD_PLACE,
    POINTING,
    RETURN,
    SET_HOME,
    TAKEOFF,
    WAYPOINT,
    WINCH,
    WITH_POSITION,
)
from controller.ground.missions.mission_plan import Item
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import Triple, yaw_from_heading

NO_MISSION: int = mavlink.MISSION_STATE_NO_MISSION
NOT_STARTED: int = mavlink.MISSION_STATE_NOT_STARTED
ACTIVE: int = mavlink.MISSION_STATE_ACTIVE
PAUSED: int = mavlink.MISSION_STATE_PAUSED
COMPLETE: int = mavlink.MISSION_STATE_COMPLETE

Place = Callable[[Item], Triple]
SetHome = Callable[[Triple], None]
MOST_STEPS = 1000
"""Items without a place that are passed in one go; more are a loop that goes nowhere."""
_WITH_HEADING = (WAYPOINT, LOITER, LOITER_TIME, TAKEOFF, LAND)
AT_REST = 0.3
"""m/s, of the load at a way-point where it is to stop"""


class Then(Enum):
    """What a plan wants when it has no point to go to."""

    RETURN = auto()
    LAND = auto()
    DONE = auto()
    PAUSE = auto()
    LOST = auto()
    """The plan goes in circles without a place to go to."""


class Waypoint(NamedTuple):
    """Where the plan wants the vehicle now."""

    point: Triple | None
    """m ENU, of the vehicle; None: wait where it is"""
    yaw: float
    """rad ENU; NaN: as it is"""


class MissionFlight:
    """The plan's progress. It survives a pause, and starts again at the beginning when it was complete."""

    def __init__(self, payload: Payload) -> None:
        """payload: that items work; what of it there is not is passed over."""
        self._payload = payload
        self.refusals: list[str] = []
        """Why items had no effect, not yet announced."""
        self.replace(())

    def replace(self, items: tuple[Item, ...]) -> None:
        """A new plan, from its beginning."""
        self.items = items
        self.current = 0
        self.state = NOT_STARTED if items else NO_MISSION
        self.speed = math.nan
        """m/s, that the plan asked for; NaN: the default"""
        self.reached: list[int] = []
        """Items reached and not yet announced."""
        self.region = RegionOfInterest()
        self._jumps: dict[int, int] = {}
        self._since: float | None = None
        self._here: Triple | None = None
        """m, where the vehicle was when an item began that only has a height"""
        self._arrived = self._refused = self._placing = False
        self._held_back: HeldBack | None = None

    def jump(self, seq: int) -> str:
        """Go on with another item; returns why not, or an empty string.

        At a jump this is where the jump goes, and none of its repetitions is used up.
        """
        if not 0 <= seq < len(self.items):
            return f"Mission item {seq} does not exist; there are {len(self.items)}"
        while self.items[seq].command == JUMP and self.items[seq].p2 != 0:
            seq = int(self.items[seq].p1)
        if self.state == COMPLETE:
            self.state = NOT_STARTED
        self.current = seq
        self._leave()
        return ""

    def restart(self, seq: int) -> None:
        """As at the beginning, but at an item; a flight of the plan goes on."""
        state = self.state
        self.replace(self.items)
        self.current = seq
        self.state = NOT_STARTED if state == COMPLETE else state

    def start(self) -> None:
        """Begin, or go on after a pause."""
        if self.state == COMPLETE:
            self.replace(self.items)
        self.state = ACTIVE if self.items else NO_MISSION
        self._since = None

    def pause(self) -> None:
        """Stay at the item that is current."""
        if self.state == ACTIVE:
            self.state = PAUSED

    def advance(
        self,
        view: VehicleView,
        place: Place,
        hanging: float,
        radius: float,
        set_home: SetHome,
    ) -> Waypoint | Then:
        """What to do now. `hanging`: m, the load below the vehicle (0 without); `radius`: m, the default."""
        for _ in range(MOST_STEPS):
            if self.current >= len(self.items):
                self.state = COMPLETE
                self.current = max(0, len(self.items) - 1)
                return Then.DONE
            item = self.items[self.current]
            if item.command == RETURN:
                self._complete()
                return Then.RETURN
            section = section_after(self.items, self.current) if item.command in CONDITIONS else None
            if item.command == JUMP:
                self._take_jump(item)
            elif section is not None:
                self.current = section.place
                self._leave()
                self._held_back = HeldBack(section.held_back, view.time)
            elif item.command not in (*WITH_POSITION, *DELAYS):
                if not self._act(item, view, place, set_home):
                    return Waypoint(None, math.nan)
                self._next()
            else:
                self._act_on_the_way(item, view, place, set_home)
                stay = self._fly(item, view, place, hanging, radius)
                if stay is not None:
                    return stay
        return Then.LOST

    def _act(self, item: Item, view: VehicleView, place: Place, set_home: SetHome) -> bool:
        """Do what an item without a place says; whether it is done."""
        begins, self._since = self._since is None, view.time if self._since is None else self._since
        if begins:
            self._begin(item, view, place, set_home)
        gripper, winch = self._payload.gripper, self._payload.winch
        if item.command == GRIPPER and gripper is not None and item.p2 in (RELEASE, GRAB):
            return gripper.done or view.time - self._since >= PATIENCE
        return item.command != WINCH or winch is None or self._refused or not self._payload.reeling

    def _begin(self, item: Item, view: VehicleView, place: Place, set_home: SetHome) -> None:
        """Begin what an item without a place says; most of it is done at once."""
        self._refused = False
        gripper = self._payload.gripper
        if item.command == CHANGE_SPEED:
            self.speed = item.p2 if item.p1 in (0, 1) and item.p2 > 0 else self.speed
        elif item.command == SET_HOME:
            set_home(view.position if item.p1 == 1 else place(item))
        elif item.command in POINTING:
            self.region.point_at(item, self.items, place)
        elif item.command == GRIPPER and gripper is not None and item.p2 in (RELEASE, GRAB):
            gripper.act(int(item.p2))
        elif item.command == WINCH and self._payload.winch is not None:
            self._reel(item.p2, item.p3, item.p4, view)

    def _act_on_the_way(self, item: Item, view: VehicleView, place: Place, set_home: SetHome) -> None:
        """Begin those actions that a condition holds back no more."""
        if self._held_back is not None:
            point = self._point(item, view, place)
            distance = 0.0 if point is None else math.dist(view.position, point)
            for action in self._held_back.due(view.time, distance):
                self._begin(action, view, place, set_home)

    def _reel(self, action: float, length: float, rate: float, view: VehicleView) -> None:
        """Tell the winch; what it refuses is said, and passed over."""
        verdict = self._payload.work_winch(action, length, rate, view)
        self._refused = not verdict.ok
        if self._refused:
            self.refusals.append(f"Mission item {self.current}: {verdict.text}")

    def _places(self, view: VehicleView) -> bool:
        """At the place of a NAV_PAYLOAD_PLACE: whether the load has been delivered."""
        if not self._placing:
            self._placing = True
            self._reel(DELIVER, math.nan, math.nan, view)
        return self._refused or not self._payload.reeling

    def _fly(
        self, item: Item, view: VehicleView, place: Place, hanging: float, radius: float
    ) -> Waypoint | Then | None:
        """An item that takes time; None when it is over."""
        point = self._point(item, view, place)
        wait = 0.0
        if item.command == LOITER:
            wait = math.inf
        elif item.command in (WAYPOINT, LOITER_TIME, *DELAYS) and item.p1 > 0:
            wait = item.p1
        if point is not None and not self._arrived:
            last = not any(i.command in WITH_POSITION for i in self.items[self.current + 1 :])
            own = item.p2 if item.command == WAYPOINT and item.p2 > 0 else radius
            self._arrived = _is_there(
                view, point, hanging, own, stop=wait > 0 or last or item.command == LAND
            )
        elif point is None:
            self._arrived = True
        if self._arrived:
            if item.command == PAYLOAD_PLACE and self._payload.delivers:
                return self._over(item) if self._places(view) else Waypoint(None, math.nan)
            self._since = view.time if self._since is None else self._since
            if view.time - self._since >= wait:
                return self._over(item)
        return Waypoint(point, self._yaw(item, point, view))

    def _yaw(self, item: Item, point: Triple | None, view: VehicleView) -> float:
        """rad ENU; NaN: as it is. A region of interest goes before the item's own heading."""
        pointed = self.region.yaw(view.position, point)
        has_heading = item.command in _WITH_HEADING and point is not None
        if not math.isnan(pointed) or not has_heading or math.isnan(item.p4):
            return pointed
        return yaw_from_heading(math.radians(item.p4))

    def _point(self, item: Item, view: VehicleView, place: Place) -> Triple | None:
        """Where the vehicle has to be for an item, m ENU; None: where it is."""
        if item.has_place:
            return place(item)
        if item.command not in (TAKEOFF, PAYLOAD_PLACE):
            return None
        if self._here is None:
            self._here = view.position
        return (*self._here[:2], place(item)[2])

    def _over(self, item: Item) -> Then | None:
        self.reached.append(self.current)
        if item.command == LAND:
            self._complete()
            return Then.LAND
        self._next()
        if not item.autocontinue and self.current < len(self.items):
            self.state = PAUSED
            return Then.PAUSE
        return None

    def _complete(self) -> None:
        """The plan's flight ends with this item; it is complete if it is the last."""
        self.state = COMPLETE if self.current == len(self.items) - 1 else PAUSED

    def _take_jump(self, item: Item) -> None:
        taken = self._jumps.get(self.current, 0)
        if item.p2 == -1 or taken < item.p2:
            self._jumps[self.current] = taken + 1
            self.current = int(item.p1)
            self._leave()
        else:
            self._jumps[self.current] = 0
            self._next()

    def _next(self) -> None:
        self.current += 1
        self._leave()

    def _leave(self) -> None:
        self._here = self._held_back = None
        self._arrived = self._placing = False
        self._since = None


def _is_there(view: VehicleView, point: Triple, hanging: float, radius: float, stop: bool) -> bool:
    """Whether vehicle and load are within the radius, and at rest if they are to stop."""
    if math.dist(view.position, point) > radius:
        return False
    if not hanging:
        return not stop or math.hypot(*view.velocity) < AT_REST
    below = (point[0], point[1], point[2] - hanging)
    return math.dist(view.load_position, below) <= radius and (
        not stop or math.hypot(*view.load_velocity) < AT_REST
    )
