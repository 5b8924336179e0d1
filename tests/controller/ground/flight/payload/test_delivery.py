"""WINCH_DELIVER as command and mission item: the load is set down and released, the cable reeled in."""

from __future__ import annotations

import numpy as np
import pytest

from controller.ground.flight import client_requests, plans
from controller.ground.flight.payload.payload import DELIVER, LENGTH, RETRACT
from controller.ground.flight.px4_modes import Mode
from controller.ground.missions.mission_plan import Item
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flight.payload.test_gripper import ACCEPTED, DENIED, UNSUPPORTED, hovering
from tests.controller.ground.flight.payload.test_winch import DO_WINCH
from tests.controller.ground.flown import Designer
from tests.controller.ground.missions.test_missions import Uploader, other, waypoint
from tests.controller.ground.rig import NAN, Rig
from tests.estimator.guided import GuidedFlight

TEMPORARILY_REJECTED = 1
MOVING, CLUTCH, LOCKED, DROPPING, GROUND_SENSE, RETRACTING = 4, 8, 16, 32, 128, 256
DO_LOCK, RELAX = 3, 0


def test_the_load_is_set_down_below_the_hovering_vehicle_and_released() -> None:
    flight, client = hovering("iris", 5.0)
    before = flight.flown(0.1).vehicle[-1].copy()
    assert client.command(DO_WINCH, 1, DELIVER, NAN, NAN).result == ACCEPTED
    flight.run_until(lambda: "Delivered" in client.texts(), 60.0)
    told = [text for text in client.texts() if text in ("Load set down", "Load released", "Delivered")]
    assert told == ["Load set down", "Load released", "Delivered"]
    way = flight.flown(20.0)
    assert np.abs(way.vehicle - before).max() < 0.2
    assert way.load[-1] == pytest.approx((*before[:2], flight.vehicle.load.radius), abs=0.1)
    assert not flight.simulation.world.cable_holds
    assert flight.simulation.world.reel().length == pytest.approx(flight.vehicle.cable.rest_length, abs=0.03)
    at_touch = np.argmax(way.load[:, 2] < flight.vehicle.load.radius + 0.002)
    assert np.gradient(way.load[: at_touch + 1, 2], way.time[: at_touch + 1])[-1] > -0.4
    states = [message.status & ~MOVING for message in client.got("WINCH_STATUS")]
    order = [DROPPING, GROUND_SENSE, RETRACTING]
    assert [states.index(1 | bit) for bit in order] == sorted(states.index(1 | bit) for bit in order)
    # There is nothing more to deliver.
    assert client.command(DO_WINCH, 1, DELIVER, NAN, NAN).result == DENIED


@pytest.mark.parametrize(("vehicle", "height", "preset"), [("iris", 5.0, "consumer"), ("heavy", 12.0, "rtk")])
def test_a_mission_delivers_on_estimates_and_returns(vehicle: str, height: float, preset: str) -> None:
    described = load_vehicle(vehicle, [f"sensors.preset={preset}"])
    flight = GuidedFlight(described, 1, redesigner=Designer(described))
    flight.fly(lambda: not flight.machine.arming_faults(), 10.0, "ready to arm")
    plan = [waypoint(5, 0, height), other(DO_WINCH, 1.0, DELIVER), waypoint(0, 0, height), other(20)]
    assert plans.accept_mission(flight.machine, tuple(Item(*item) for item in plan)) is None
    assert flight.machine.arm(flight.now).ok
    assert client_requests.set_mode(flight.machine, Mode.MISSION, flight.now).ok
    flight.fly(lambda: "Delivered" in flight.said, 120.0, "delivered")
    assert not flight.simulation.world.cable_holds
    _, load = flight.truth()
    assert load == pytest.approx((0.0, 5.0, described.load.radius), abs=0.8)
    error = flight.errors()[-1]
    assert np.abs(error[3:6] - error[0:3]).max() < 0.5
    flight.fly(lambda: not flight.machine.armed, 90.0, "landed at home")
    at_home, _ = flight.truth()
    assert np.linalg.norm(at_home[:2]) < 1.2
    assert flight.largest_tilt() < 0.4
    assert not [text for text in flight.said if "lost" in text or "failed" in text]


def test_a_delivery_that_is_broken_off_comes_back_with_the_load() -> None:
    flight, client = hovering("iris", 5.0)
    assert client.command(DO_WINCH, 1, DELIVER, NAN, NAN).result == ACCEPTED
    flight.run(4.0)
    assert flight.simulation.world.reel().length > 2.5
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    assert "Delivery broken off: reeling in" in client.texts()
    flight.run(8.0)
    assert flight.simulation.world.cable_holds
    assert flight.simulation.world.reel().length == pytest.approx(flight.vehicle.cable.rest_length, abs=0.03)


def test_a_load_lowered_to_the_ground_is_lifted_by_the_winch() -> None:
    flight, client = hovering("iris", 4.0)
    before = flight.flown(0.1).vehicle[-1].copy()
    assert client.command(DO_WINCH, 1, LENGTH, 10.0, NAN).result == ACCEPTED
    flight.run(12.0)
    assert flight.flown(0.1).load[-1, 2] == pytest.approx(flight.vehicle.load.radius, abs=0.01)
    assert client.command(DO_WINCH, 1, RETRACT).result == ACCEPTED
    flight.run(16.0)
    way = flight.flown(28.0)
    assert np.abs(way.vehicle - before).max() < 0.5
    winch = flight.vehicle.winch
    assert winch is not None
    stretch = flight.vehicle.hover_length - flight.vehicle.cable.rest_length
    hanging = way.vehicle[-1, 2] - way.load[-1, 2]
    assert hanging == pytest.approx(winch.min_length + stretch, abs=0.05)


def test_what_cannot_be_delivered_is_denied() -> None:
    flight, client = hovering("iris", 9.0)
    assert client.command(DO_WINCH, 1, DELIVER).result == DENIED  # 6 m of cable
    assert any("of cable are left; go lower" in text for text in client.texts())
    assert client.command(DO_WINCH, 1, DO_LOCK).result == ACCEPTED
    flight.run(1.0)
    assert client.got("WINCH_STATUS")[-1].status & LOCKED
    assert client.command(DO_WINCH, 1, RELAX).result == ACCEPTED
    flight.run(1.0)
    assert client.got("WINCH_STATUS")[-1].status & CLUTCH


def test_on_the_ground_or_without_a_winch_there_is_no_delivery() -> None:
    rig = Rig()
    assert rig.client().command(DO_WINCH, 1, DELIVER).result == UNSUPPORTED


def test_a_winch_item_that_is_no_action_is_refused() -> None:
    client = Rig().client()
    for action in (-1.0, 0.5, 10.0, NAN):
        plan = [waypoint(4, 0, 6), other(DO_WINCH, 1.0, action)]
        assert Uploader(client, plan).run() == 7  # MAV_MISSION_INVALID_PARAM2
    assert any("Mission item 1: winch: action" in text for text in client.texts())
