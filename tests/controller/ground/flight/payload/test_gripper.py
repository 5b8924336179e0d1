"""DO_GRIPPER as a command and as a mission item, flown on the real plant."""

from __future__ import annotations

import numpy as np
import pytest

from controller.estimator.records import LOAD_DROPPED
from controller.ground.flight import client_requests
from controller.ground.flight.client_requests import Reposition
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flown import Flown
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.missions.test_missions import Uploader, other, waypoint
from tests.controller.ground.rig import NAN, Client, Rig
from tests.estimator.guided import GuidedFlight

ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
DO_GRIPPER, REPOSITION = 211, 192
RELEASE, GRAB, HOLD = 0, 1, 2


def hovering(vehicle: str = "iris", height: float = 6.0) -> tuple[Flown, Client]:
    flight = Flown(vehicle=vehicle)
    client = flight.client()
    flight.run(0.5)
    assert client.command(400, 1).result == ACCEPTED
    assert client.command(22, *(NAN,) * 6, ZURICH[2] + height).result == ACCEPTED
    flight.run_until(lambda: flight.station.machine.mode.name == "HOLD", 90.0)
    flight.run(3.0)
    return flight, client


def go_above_the_load(flight: Flown, client: Client, height: float) -> None:
    load = flight.simulation.world.state[13:16]
    place = flight.profile.origin.geodetic((float(load[0]), float(load[1]), height))
    verdict = client.command(REPOSITION, 1.0, 1, 0, NAN, place.latitude, place.longitude, place.altitude)
    assert verdict.result == ACCEPTED, client.texts()


@pytest.mark.parametrize(("vehicle", "height"), [("iris", 6.0), ("heavy", 14.0)])
def test_a_release_in_hover_leaves_the_vehicle_where_it_is(vehicle: str, height: float) -> None:
    flight, client = hovering(vehicle, height)
    before = flight.flown(0.1).vehicle[-1].copy()
    assert client.command(DO_GRIPPER, 1, RELEASE).result == ACCEPTED
    flight.run(8.0)
    after = flight.flown(8.0)
    assert not flight.simulation.world.cable_holds
    assert "Load released" in client.texts()
    # Upwards it goes for as long as the rotors take to follow: the load's share of the thrust for a moment.
    assert np.abs(after.vehicle - before).max() < 0.5
    assert after.vehicle[-1] == pytest.approx(before, abs=0.05)
    assert after.load[-1, 2] == pytest.approx(flight.vehicle.load.radius, abs=0.01)


@pytest.mark.parametrize(("vehicle", "height"), [("iris", 6.0), ("heavy", 14.0)])
def test_a_released_load_is_taken_again_and_flown(vehicle: str, height: float) -> None:
    flight, client = hovering(vehicle, height)
    assert client.command(DO_GRIPPER, 1, RELEASE).result == ACCEPTED
    flight.run(6.0)
    rest = flight.vehicle.cable.rest_length
    assert client.command(DO_GRIPPER, 1, GRAB).result == ACCEPTED
    flight.run(0.5)
    assert not flight.simulation.world.cable_holds  # far above it
    go_above_the_load(flight, client, flight.vehicle.load.radius + rest - 0.15)
    flight.run_until(lambda: flight.simulation.world.cable_holds, 40.0)
    flight.run(0.5)
    assert "Load taken" in client.texts()
    go_above_the_load(flight, client, height)
    flight.run(25.0)
    end = flight.flown(1.0)
    hanging = end.vehicle[-1, 2] - end.load[-1, 2]
    assert end.vehicle[-1, 2] == pytest.approx(height, abs=0.2)
    assert hanging == pytest.approx(flight.vehicle.hover_length, abs=0.05)


def test_a_mission_releases_the_load_and_goes_on_without_it() -> None:
    flight, client = hovering()
    plan = [waypoint(4, 0, 6), other(DO_GRIPPER, 1.0, RELEASE), waypoint(0, 0, 6)]
    assert Uploader(client, plan).run() == ACCEPTED, client.texts()
    assert not [text for text in client.texts() if "No gripper" in text]
    assert client.command(300, 0, 0).result == ACCEPTED
    flight.run_until(lambda: flight.station.machine.mission.current == 2, 40.0)
    assert not flight.simulation.world.cable_holds
    flight.run_until(lambda: flight.station.machine.mode.name == "HOLD", 40.0)
    flight.run(5.0)
    end = flight.flown(0.5)
    assert end.vehicle[-1] == pytest.approx((0.0, 0.0, 6.1), abs=0.3)
    assert end.load[-1, 1] == pytest.approx(4.0, abs=0.5)


@pytest.mark.parametrize(("vehicle", "height"), [("iris", 6.0), ("heavy", 14.0)])
def test_on_estimates_the_load_is_released_and_the_vehicle_stays(vehicle: str, height: float) -> None:
    flight = GuidedFlight(load_vehicle(vehicle))
    flight.arm_and_take_off(height)
    flight.wait(5.0)
    assert client_requests.grip(flight.machine, RELEASE).ok
    first = len(flight.rows)
    flight.wait(15.0)
    _, states, estimates = zip(*flight.rows[first:], strict=True)
    truth, estimate = np.array(states)[:, 0:3], np.array(estimates)[:, 0:3]
    assert not flight.simulation.world.cable_holds
    assert "Load released" in flight.said
    # The consumer receiver's wander is the vehicle's, too; by its own estimate it stays.
    assert np.abs(estimate - estimate[0]).max() < 0.5
    assert np.ptp(truth[:, 2]) < 1.0
    assert flight.largest_tilt() < 0.6


@pytest.mark.parametrize(("vehicle", "height", "preset"), [("iris", 6.0, "consumer"), ("heavy", 14.0, "rtk")])
def test_on_estimates_a_dropped_load_is_taken_again(vehicle: str, height: float, preset: str) -> None:
    """The hook goes to where the load must have fallen; its pull shows that it has been taken."""
    flight = GuidedFlight(load_vehicle(vehicle, [f"sensors.preset={preset}"]), 1)
    flight.arm_and_take_off(height)
    flight.wait(3.0)
    for action in (RELEASE, GRAB):
        assert client_requests.grip(flight.machine, action).ok
        flight.wait(3.0)
    assert flight.feedback.estimator.load_mode == LOAD_DROPPED
    believed = flight.feedback.estimator.state()[3:6]
    _, load = flight.truth()
    assert np.abs(believed - load).max() < 0.6
    low = flight.vehicle.load.radius + flight.vehicle.cable.rest_length - 0.15
    for aim in (low, height):
        above = Reposition(False, (float(believed[0]), float(believed[1]), aim), NAN, NAN)
        assert client_requests.reposition(flight.machine, above, True).ok
        assert "Load taken" not in flight.said
        flight.wait(height / 0.7 + 8.0)
    assert "Load taken" in flight.said
    assert not [text for text in flight.said if "lost" in text]
    vehicle_at, load = flight.truth()
    assert vehicle_at[2] - load[2] == pytest.approx(flight.vehicle.hover_length, abs=0.05)
    assert vehicle_at[2] == pytest.approx(height, abs=0.4)
    error = flight.errors()[-1]
    assert np.abs(error[3:6] - error[0:3]).max() < 0.35


def test_a_release_before_the_take_off_waits_for_the_outputs() -> None:
    flight = Flown()
    client = flight.client()
    flight.run(0.5)
    assert client.command(DO_GRIPPER, 1, RELEASE).result == ACCEPTED
    flight.run(1.0)
    assert flight.simulation.world.cable_holds
    assert client.command(400, 1).result == ACCEPTED
    flight.run(1.0)
    assert not flight.simulation.world.cable_holds
    assert "Load released" in client.texts()


def test_hold_changes_nothing_and_other_actions_are_refused() -> None:
    flight = Flown()
    client = flight.client()
    flight.run(0.5)
    assert client.command(DO_GRIPPER, 1, HOLD).result == ACCEPTED
    for action in (3, -1, 0.5, NAN):
        assert client.command(DO_GRIPPER, 1, action).result == DENIED


def test_a_vehicle_without_a_gripper_says_so() -> None:
    client = Rig().client()
    assert client.command(DO_GRIPPER, 1, RELEASE).result == UNSUPPORTED
    assert client.command(DO_GRIPPER, 1, HOLD).result == UNSUPPORTED
