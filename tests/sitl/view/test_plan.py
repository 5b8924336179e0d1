"""Mission, geofence and rally points in the view: downloaded from the vehicle, and where they are drawn."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.limits.fence_zones import Zone
from controller.ground.missions.mission_plan import Item
from controller.ground.missions.plans import Plans
from controller.ground.missions.transfer import Client
from sitl.view.listener import Listener
from sitl.view.plan import NO_PLAN, outline, plan_of
from sitl.view.plan_download import LOOK_INTERVAL, MOST_REQUESTS
from sitl_bridge.frames import LocalOrigin
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split

HOME = LocalOrigin(47.0, 8.0, 400.0)
AUTOPILOT = Packer(1, 1)
RELATIVE, AMSL = 6, 0


def at(command: int, east: float, north: float, up: float, p1: float = 0.0, frame: int = RELATIVE) -> Item:
    """An item at ENU metres from home."""
    point = HOME.geodetic((east, north, up))
    height = up if frame == RELATIVE else point.altitude
    places = (round(1e7 * point.latitude), round(1e7 * point.longitude))
    return Item(frame, command, 1, p1, 0.0, 0.0, 0.0, *places, height)


JUMP = Item(2, 178, 1, 1, 3, -1, 0, 0, 0, 0)
MISSION = (at(22, 0, 0, 5), at(16, 10, 0, 5), JUMP, at(16, 10, 20, 8, frame=AMSL))
CORNERS = ((-50, -50), (50, -50), (50, 50), (-50, 50))
FENCE = (*(at(5001, x, y, 0, 4) for x, y in CORNERS), at(5004, 20, 5, 0, 7))
RALLY = (at(5100, -20, 10, 15),)
RESOLUTION = 0.02  # m, of a degree's seventh digit


def test_items_are_drawn_where_they_are() -> None:
    plan = plan_of(MISSION, FENCE, RALLY, HOME)
    assert [number for number, _ in plan.waypoints] == [0, 1, 3]
    places = np.array([place for _, place in plan.waypoints])
    assert places == pytest.approx(np.array([[0, 0, 5], [10, 0, 5], [10, 20, 8]]), abs=RESOLUTION)
    square, circle = plan.zones
    assert (square.inclusion, circle.inclusion, circle.radius) == (True, False, 7.0)
    assert plan.rally[0] == pytest.approx((-20, 10), abs=RESOLUTION)


def test_a_border_is_closed_and_lies_where_the_fence_does() -> None:
    circle = outline(Zone(False, ((20.0, 5.0),), 7.0), 1.5)
    assert circle[0] == pytest.approx(circle[-1])
    assert np.hypot(circle[:, 0] - 20.0, circle[:, 1] - 5.0) == pytest.approx(np.full(len(circle), 7.0))
    assert set(circle[:, 2]) == {1.5}
    triangle = outline(Zone(True, ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)), 0.0), 0.0)
    assert triangle.tolist() == [[0, 0, 0], [4, 0, 0], [0, 3, 0], [0, 0, 0]]


def test_an_item_without_a_meaning_leaves_its_plan_out() -> None:
    nowhere = at(16, 0, 0, 5)._replace(z=math.nan)
    plan = plan_of((nowhere,), FENCE[:3], (at(16, 0, 0, 0),), HOME)
    assert plan == NO_PLAN


class Vehicle:
    """An autopilot with three plans, and a view that listens to it."""

    def __init__(self) -> None:
        self.plans = Plans(lambda items: None, lambda items: None, lambda items: None, lambda item, low: None)
        self.listener = Listener(HOME)
        self.now = 0.0
        self.asked: list[str] = []
        self.loses: Callable[[], bool] = lambda: False
        """Whether the next message is lost"""
        self._tell(mavlink.MAVLink_heartbeat_message(2, 12, 129, 0, 4, 3))

    def _tell(self, message: Any) -> None:
        if not self.loses():
            self.listener.receive(AUTOPILOT.pack(message), self.now)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now += 0.05
            for datagram in self.listener.to_send(self.now):
                for frame in split(datagram).frames:
                    message = decode(frame)
                    if message.get_type().startswith("MISSION") and not self.loses():
                        self.asked.append(message.get_type())
                        client = Client(("127.0.0.1", 1), frame.system, frame.component)
                        self.plans.receive(message, client, self.now, self._tell, print)


def with_plans(vehicle: Vehicle) -> None:
    plans = vehicle.plans
    plans.mission.items, plans.fence.items, plans.rally.items = MISSION, FENCE, RALLY


def test_what_is_on_board_is_shown_and_what_is_uploaded_later_too() -> None:
    vehicle = Vehicle()
    vehicle.run(1.0)
    assert vehicle.listener.view.plan == NO_PLAN
    with_plans(vehicle)
    vehicle.run(LOOK_INTERVAL + 1.0)
    assert vehicle.listener.view.plan == plan_of(MISSION, FENCE, RALLY, HOME)
    vehicle.plans.mission.items = MISSION[:2]
    vehicle.run(LOOK_INTERVAL + 1.0)
    assert vehicle.listener.view.plan == plan_of(MISSION[:2], FENCE, RALLY, HOME)


def test_a_link_that_loses_a_fifth_of_everything_is_enough() -> None:
    losing = random.Random(4)
    vehicle = Vehicle()
    vehicle.loses = lambda: losing.random() < 0.2
    with_plans(vehicle)
    vehicle.run(60.0)
    assert vehicle.listener.view.plan == plan_of(MISSION, FENCE, RALLY, HOME)


def test_an_autopilot_without_plans_is_asked_seldom() -> None:
    vehicle = Vehicle()
    vehicle.plans.receive = lambda *arguments: None  # type: ignore[method-assign]
    vehicle.run(60.0)
    assert len(vehicle.asked) <= MOST_REQUESTS * (60.0 / LOOK_INTERVAL + 1)


def current(fence_id: int) -> Frame:
    """MISSION_CURRENT with ids, as PX4 sends it."""
    payload = struct.pack("<HHBBII", 0, 2, 1, 1, 7, fence_id)
    return Frame(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 1, 1, payload, b"")


def test_with_ids_plans_are_read_again_only_when_an_id_changes() -> None:
    vehicle = Vehicle()
    with_plans(vehicle)
    vehicle.listener._on_mission_current(current(1), None, 0.0)
    vehicle.run(1.0)
    asked = len(vehicle.asked)
    vehicle.listener._on_mission_current(current(1), None, vehicle.now)
    vehicle.run(3.0 * LOOK_INTERVAL)
    assert len(vehicle.asked) == asked
    vehicle.plans.fence.items = FENCE[:4]
    vehicle.listener._on_mission_current(current(2), None, vehicle.now)
    vehicle.run(1.0)
    assert len(vehicle.listener.view.plan.zones) == 1
