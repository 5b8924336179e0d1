"""A mission paused, resumed, jumped about in, not replaced by halves; then a fence that is flown through."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from sitl.testing import flying_vehicle
from tests.loopback import swing
from tests.loopback.clients import Texts, Vehicle, mavsdk_vehicle, until
from tests.loopback.flights import BRISK, METRES_PER_DEGREE, WAITS_ARMED, ready, refused
from tests.loopback.pymav import PyMav
from tests.patience import LONG_PATIENCE

PLACES = ((5.0, 0.0), (5.0, 60.0), (-60.0, 60.0), (0.0, 6.0))
"""m north and east of home; the second so far away that it is never reached before the jump to the last"""
FENCE = 15.0
"""m"""


def plan_of(home: Any, places: tuple[tuple[float, float], ...]) -> Any:
    """A MAVSDK plan through places, m north and east of home, 5 m above it."""
    from mavsdk.plugins.mission import MissionItem, MissionPlan

    east_scale = METRES_PER_DEGREE * math.cos(math.radians(home.latitude_deg))
    return MissionPlan(
        [
            MissionItem(
                latitude_deg=home.latitude_deg + north / METRES_PER_DEGREE,
                longitude_deg=home.longitude_deg + east / east_scale,
                relative_altitude_m=5.0,
                speed_m_s=2.0,
                is_fly_through=True,
                acceptance_radius_m=1.0,
            )
            for north, east in places
        ]
    )


def contents(plan: Any) -> list[tuple[float, ...]]:
    """What of a plan has to survive the way to the vehicle and back."""
    return [
        (
            round(item.latitude_deg, 7),
            round(item.longitude_deg, 7),
            item.relative_altitude_m,
            item.speed_m_s,
            item.acceptance_radius_m,
            item.is_fly_through,
        )
        for item in plan.mission_items
    ]


class Progress:
    """MAVSDK's stream of (current, total), each once."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.seen: list[tuple[int, int]] = []
        self._task = asyncio.create_task(self._follow(vehicle))

    async def _follow(self, vehicle: Vehicle) -> None:
        async for progress in vehicle.mission.subscribe_mission_progress():
            now = (progress.current, progress.total)
            if not self.seen or now != self.seen[-1]:
                self.seen.append(now)

    async def latest(self) -> tuple[int, int]:
        return self.seen[-1] if self.seen else (-1, -1)

    def stop(self) -> None:
        self._task.cancel()


class Uploads:
    """Plans from pymavlink: halves, which MAVSDK does not send, and others that are not taken.

    (MAVSDK counts its progress in the plan that it sent last, even if that was refused.)
    """

    def __init__(self, client: PyMav) -> None:
        self._client = client
        client.listen(0.3)  # what has waited in the socket since it was last looked at

    def count(self, items: int) -> None:
        self._client.link.mav.mission_count_send(1, 1, items, mavlink.MAV_MISSION_TYPE_MISSION)

    def item(self, seq: int, command: int = 16, p1: float = 0.0, north: float = 0.0) -> None:
        """An item when it is asked for; `north` of where iris starts, m, where it is a place."""
        self._client.wait(
            lambda m: m.get_type() == "MISSION_REQUEST_INT" and m.seq == seq, f"request of {seq}"
        )
        x = round(1e7 * (47.397742 + north / METRES_PER_DEGREE))
        rest = (0.0, 0.0, math.nan, x, 85455940, 5.0, mavlink.MAV_MISSION_TYPE_MISSION)
        self._client.link.mav.mission_item_int_send(1, 1, seq, 6, command, 0, 1, p1, *rest)

    def ends_with(self, result: int, words: str) -> None:
        assert self._client.wait_for("MISSION_ACK").type == result
        self._client.wait_for_text(words)


def upload_what_changes_nothing(client: PyMav) -> None:
    """Two of three items and silence; a jump to an item that there is not; a place outside the fence."""
    uploads = Uploads(client)
    uploads.count(3)
    uploads.item(0)
    uploads.item(1)
    uploads.ends_with(mavlink.MAV_MISSION_OPERATION_CANCELLED, "stopped at item 2 of 3; nothing has changed")
    uploads.count(2)
    uploads.item(0)
    uploads.item(1, mavlink.MAV_CMD_DO_JUMP, 7.0)
    uploads.ends_with(mavlink.MAV_MISSION_INVALID_PARAM1, "jump to item 7 of 2")
    uploads.count(1)
    uploads.item(0, north=900.0)
    uploads.ends_with(mavlink.MAV_MISSION_DENIED, "outside the geofence of 500 m")


async def mission(vehicle: Vehicle, texts: Texts, client: PyMav) -> None:
    """From the ground to its end, by way of a pause and a jump."""
    home = await vehicle.telemetry.position()
    plan = plan_of(home, PLACES)
    await vehicle.param.set_param_float("GF_MAX_HOR_DIST", 500.0)
    await vehicle.mission.upload_mission(plan)
    assert contents(await vehicle.mission.download_mission()) == contents(plan)
    progress = Progress(vehicle)
    await vehicle.action.set_takeoff_altitude(5.0)
    await vehicle.action.arm()
    await vehicle.mission.start_mission()  # which takes off first
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == "MISSION", "mission mode")

    await until(progress.latest, lambda p: p == (1, 4), "on the way to the second place", LONG_PATIENCE)
    await vehicle.mission.pause_mission()
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == "HOLD", "pause")
    await until(
        vehicle.telemetry.velocity_ned, lambda v: math.hypot(v.north_m_s, v.east_m_s) < 0.3, "standstill"
    )
    await asyncio.to_thread(upload_what_changes_nothing, client)
    assert contents(await vehicle.mission.download_mission()) == contents(plan)

    await vehicle.mission.start_mission()
    await until(vehicle.telemetry.velocity_ned, lambda v: v.east_m_s > 1.0, "onwards to the second place")
    assert await progress.latest() == (1, 4)
    await refused(lambda: vehicle.mission.set_current_mission_item(9), "INVALID_ARGUMENT")
    await vehicle.mission.set_current_mission_item(3)
    await until(vehicle.mission.is_mission_finished, bool, "mission finished", LONG_PATIENCE)
    await until(progress.latest, lambda p: p == (4, 4), "all progress")
    progress.stop()
    assert [current for current, _ in progress.seen] == [0, 1, 3, 4]

    await vehicle.mission.clear_mission()
    assert (await vehicle.mission.download_mission()).mission_items == []
    await refused(vehicle.mission.start_mission, "DENIED")
    await texts.wait_for("upload one first")


async def fence(vehicle: Vehicle, texts: Texts) -> None:
    """A point beyond it is refused; who flies out all the same is taken home."""
    from mavsdk.plugins.offboard import VelocityNedYaw

    await vehicle.param.set_param_float("GF_MAX_HOR_DIST", FENCE)
    here = await vehicle.telemetry.position()
    beyond = here.latitude_deg + 2.0 * FENCE / METRES_PER_DEGREE
    altitude = here.absolute_altitude_m
    await refused(lambda: vehicle.action.goto_location(beyond, here.longitude_deg, altitude, 0.0), "DENIED")
    await texts.wait_for("outside the geofence of 15 m (GF_MAX_HOR_DIST)")
    assert (await vehicle.telemetry.flight_mode()).name == "HOLD"
    await vehicle.offboard.set_velocity_ned(VelocityNedYaw(3.0, 0.0, 0.0, 0.0))
    await vehicle.offboard.start()
    await texts.wait_for("outside the geofence of 15 m (GF_MAX_HOR_DIST): returning")
    await until(
        vehicle.telemetry.flight_mode, lambda m: m.name == "RETURN_TO_LAUNCH", "return from the fence"
    )
    await until(vehicle.telemetry.armed, lambda armed: not armed, "disarmed after return", LONG_PATIENCE)


async def mission_and_fence(connection: str, client: PyMav) -> None:
    async with mavsdk_vehicle(connection) as vehicle, Texts(vehicle) as texts:
        await ready(vehicle)
        await mission(vehicle, texts, client)
        await fence(vehicle, texts)


def test_a_mission_with_a_pause_and_a_jump_then_a_fence(tmp_path: Path) -> None:
    patient = WAITS_ARMED | {"COM_OF_LOSS_T": 20.0}  # a busy client is no lost one
    with flying_vehicle(tmp_path, BRISK, patient) as vehicle:
        client = PyMav(vehicle.mavproxy, system=244)
        asyncio.run(mission_and_fence(vehicle.mavsdk, client))
        client.close()
    flown = swing.read(vehicle.state_log)
    north_east = flown.vehicle[:, [1, 0]]
    for place, near in zip(PLACES, (True, False, False, True), strict=True):
        nearest = float(np.linalg.norm(north_east - place, axis=1).min())
        assert (nearest < 1.5) == near, (place, nearest)
    farthest = float(np.linalg.norm(north_east - north_east[0], axis=1).max())
    assert 0.8 * FENCE < farthest < FENCE  # it brakes in time
    assert np.linalg.norm(flown.load[-1, :2] - flown.load[0, :2]) < 2.0  # back where it lay
    assert flown.load[-1, 2] < 0.06
