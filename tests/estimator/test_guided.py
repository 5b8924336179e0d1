"""Under ground control on the estimate: from the ground and back, without GPS, and taken over in flight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common
from scipy.stats import chi2

from controller.estimator.records import LOAD_ON_CABLE, LOAD_ON_GROUND, PARTS, X_LOAD, Array
from controller.ground.flight import client_requests
from controller.ground.flight.client_requests import Reposition
from controller.ground.flight.px4_modes import Mode
from controller.ground.telemetry.messages import build
from sitl_bridge.plant.physics.state import BODY_RATES
from sitl_bridge.plant.sensors.instruments import LOST, WORKS
from sitl_bridge.vehicle.files import load_vehicle
from tests.estimator.guided import RATE_HZ, GuidedFlight

NAN = math.nan


def iris(seed: int = 1) -> GuidedFlight:
    return GuidedFlight(load_vehicle("iris"), seed)


def test_take_off_with_pick_up_a_way_and_landing() -> None:
    flight = iris()
    estimator = flight.feedback.estimator
    flight.fly(lambda: not flight.machine.arming_faults(), 10.0, "ready to arm")
    assert estimator.grounded
    assert estimator.load_mode == LOAD_ON_GROUND
    flight.arm_and_take_off(5.0)
    assert estimator.load_mode == LOAD_ON_CABLE
    vehicle, load = flight.truth()
    assert vehicle[2] > 4.5
    assert load[2] > 3.0
    assert client_requests.reposition(flight.machine, Reposition(False, (8.0, 5.0, NAN), NAN, NAN), True).ok
    flight.wait(10.0)
    vehicle, _ = flight.truth()
    assert np.linalg.norm(vehicle[:2] - (8.0, 5.0)) < 0.5
    assert np.abs(flight.errors()[-1]).max() < 0.5
    assert client_requests.set_mode(flight.machine, Mode.LAND, flight.now).ok
    flight.fly(lambda: not flight.machine.armed, 60.0, "landed and disarmed")
    assert "Landed" in flight.said
    vehicle, load = flight.truth()
    assert vehicle[2] < 0.15
    assert load[2] < 0.06
    assert np.linalg.norm(vehicle[:2] - load[:2]) > 0.3  # not on its load
    assert flight.largest_tilt() < 0.35
    assert estimator.grounded
    assert estimator.load_mode == LOAD_ON_GROUND


def test_arming_needs_gps_and_says_so() -> None:
    flight = iris()
    flight.fly(lambda: not flight.machine.arming_faults(), 10.0, "ready to arm")
    flight.simulation.world.gps.doing = LOST
    flight.wait(3.0)
    verdict = flight.machine.arm(flight.now)
    assert not verdict.ok
    assert "GPS" in verdict.text
    assert "GPS lost: position and velocity drift" in flight.said
    flight.simulation.world.gps.doing = WORKS
    flight.wait(1.0)
    assert flight.machine.arm(flight.now).ok
    assert "GPS is back" in flight.said


def test_lands_when_the_position_is_lost() -> None:
    flight = iris()
    flight.arm_and_take_off(5.0)
    flight.simulation.world.gps.doing = LOST
    flight.fly(lambda: flight.machine.mode is Mode.LAND, 30.0, "landing")
    assert any("Position estimate lost: landing" in text for text in flight.said)
    # What it touches down with sideways may tip it over; then the rotors stop, which is the end as well.
    flight.fly(lambda: not flight.machine.armed or flight.machine.terminated, 60.0, "down, rotors stopped")
    vehicle, load = flight.truth()
    assert vehicle[2] < 0.5
    assert load[2] < 0.06


def test_a_controller_that_comes_in_flight_holds_there() -> None:
    flight = iris()
    flight.arm_and_take_off(12.0)
    before, _ = flight.truth()
    flight.start_controller()
    flight.fly(lambda: flight.machine.armed, 1.0, "taken over")
    assert "the vehicle is in flight: aligning there" in flight.said
    assert "Started in flight: holding" in flight.said
    flight.wait(15.0)
    after, _ = flight.truth()
    assert flight.machine.flying
    assert np.linalg.norm(after - before) < 4.0
    assert np.abs(flight.errors()[-1]).max() < 0.6
    assert np.linalg.norm(flight.simulation.world.state[3:6]) < 0.6


def test_a_controller_that_comes_on_the_ground_stays_there() -> None:
    flight = iris()
    flight.fly(lambda: not flight.machine.arming_faults(), 10.0, "ready to arm")
    flight.start_controller()
    flight.wait(1.5)
    assert not flight.machine.armed
    assert flight.machine.arming_faults() == []
    assert flight.feedback.estimator.grounded


@pytest.mark.parametrize(
    ("name", "preset", "seed"),
    [("iris", "consumer", 4), ("iris", "rtk", 1), ("heavy", "consumer", 1), ("heavy", "consumer", 4)],
)
def test_pick_up_and_set_down_leave_no_false_certainty(name: str, preset: str, seed: int) -> None:
    """The load's place, believed and true, agree within what the covariance says, in the air and after."""
    flight = GuidedFlight(load_vehicle(name, [f"sensors.preset={preset}"]), seed)
    estimator = flight.feedback.estimator

    def off() -> tuple[Array, Array]:
        vehicle, load = flight.truth()
        covariance = estimator.error_covariance[PARTS["load"], PARTS["load"]]
        return load - vehicle - estimator.nominal[X_LOAD : X_LOAD + 3], covariance

    def normalised() -> float:
        error, covariance = off()
        return float(error[:2] @ np.linalg.solve(covariance[:2, :2], error[:2]) / 2.0)

    flight.arm_and_take_off(5.0)
    squares = []
    for _ in range(20):
        flight.wait(0.5)
        squares.append(normalised())
    # One draw of two numbers, seen again and again as it fades: chi-square with two degrees of freedom.
    assert np.mean(squares) < chi2.ppf(0.997, 2) / 2.0
    assert client_requests.set_mode(flight.machine, Mode.LAND, flight.now).ok
    flight.fly(lambda: not flight.machine.armed, 60.0, "landed and disarmed")
    landing = flight.errors()[-round(5.0 * RATE_HZ) :]
    assert np.abs(landing[:, 2]).max() < 0.25  # a touch-down is no reason to lose the height
    assert normalised() < chi2.ppf(0.997, 2) / 2.0
    assert abs(off()[0][2]) < 0.05


FAULT_AT = 30.0
"""s after arming: the vehicle holds at 5 m by then"""


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        ({"sensor": [{"sensor": "accelerometer", "failure": "stuck", "at": FAULT_AT}]}, "Accelerometer lost"),
        ({"sensor": [{"sensor": "gyroscope", "failure": "stuck", "at": FAULT_AT}]}, "Gyroscope lost"),
        (
            {"sensor": [{"sensor": "accelerometer", "failure": "garbage", "at": FAULT_AT}]},
            "Accelerometer lost",
        ),
        ({"sensor": [{"sensor": "gyroscope", "failure": "garbage", "at": FAULT_AT}]}, "Gyroscope lost"),
        ({"rotor": [{"rotor": 1, "thrust": 0.7, "at": FAULT_AT}]}, ""),
        ({"rotor": [{"rotor": 1, "thrust": 0.0, "at": FAULT_AT, "duration": 0.1}]}, ""),
    ],
    ids=[
        "stuck accelerometer",
        "stuck gyroscope",
        "garbage of the accelerometer",
        "garbage of the gyroscope",
        "weak rotor",
        "rotor off for a moment",
    ],
)
def test_hold_outlives_what_the_model_can_bridge(faults: dict[str, Any], said: str) -> None:
    """Inertial sensors that are stuck or show garbage are done without; unknown moments are followed."""
    flight = GuidedFlight(load_vehicle("iris"), 2, faults)
    flight.arm_and_take_off(5.0)
    began = flight.now
    place, _ = flight.truth()
    flight.wait(FAULT_AT - began + 15.0)
    assert flight.machine.flying
    assert any(said in text for text in flight.said)
    later = [state[:3] for now, state, _ in flight.rows if now > FAULT_AT + 2.0]
    assert np.linalg.norm(np.array(later) - place, axis=1).max() < 1.5
    assert np.abs(flight.errors()[-1]).max() < 0.6


def test_a_vehicle_that_fell_over_has_no_estimate() -> None:
    """Its place is then that of GPS; the filter's own height was wrong by hundreds of metres."""
    flight = iris()
    flight.arm_and_take_off(5.0)
    assert flight.machine.terminate().ok
    flight.simulation.world.state[BODY_RATES] = (7.0, 1.0, 0.0)
    flight.wait(12.0)
    assert flight.said.count("Fallen over: no estimate, position is the GPS receiver's") == 1
    view = flight.machine.view
    assert view is not None
    vehicle, _ = flight.truth()
    assert np.linalg.norm(np.subtract(view.position, vehicle)) < 5.0
    place, local, status, state = (
        build(number, flight.machine)
        for number in (
            common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
            common.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
            common.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
            common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        )
    )
    assert abs(place.relative_alt) < 5_000
    assert abs(local.z) < 5.0
    assert status.flags == 0
    assert state.landed_state == common.MAV_LANDED_STATE_UNDEFINED
    assert build(common.MAVLINK_MSG_ID_HEARTBEAT, flight.machine).system_status == (
        common.MAV_STATE_FLIGHT_TERMINATION
    )
    healthy = build(common.MAVLINK_MSG_ID_SYS_STATUS, flight.machine).onboard_control_sensors_health
    assert not healthy & common.MAV_SYS_STATUS_AHRS
    assert flight.machine.disarm(force=True).ok
    flight.wait(1.0)
    assert flight.machine.arming_faults() == ["the vehicle fell over; restart the plant"]


@pytest.mark.parametrize("seed", [1, 2])
def test_ground_that_is_met_on_the_way_does_not_mislead_it(seed: int) -> None:
    """Home is said to be 5 m too low: the vehicle, without its load, is flown into the ground and slides.

    There it tries to go on, tips on its legs, and at last is sent up again.
    """
    flight = GuidedFlight(load_vehicle("iris", ["sensors.preset=consumer"]), seed)
    flight.arm_and_take_off(6.0)
    assert client_requests.grip(flight.machine, 0).ok
    flight.wait(3.0)
    x, y, _ = flight.truth()[0]
    home = flight.machine.guidance.home
    assert home.position is not None
    home.position = home.load = (home.position[0], home.position[1], -5.0)
    there = Reposition(False, (x + 5.0, y - 3.0, -2.0), NAN, NAN)
    assert client_requests.reposition(flight.machine, there, True).ok
    flight.fly(lambda: flight.truth()[0][2] < 0.2, 20.0, "on the ground")
    flight.wait(5.0)
    assert flight.truth()[0][2] < 0.3
    up = Reposition(False, (x, y, 6.0), NAN, NAN)
    assert client_requests.reposition(flight.machine, up, True).ok
    flight.wait(15.0)
    assert flight.truth()[0] == pytest.approx((x, y, 6.0), abs=1.0)
    assert flight.machine.armed
    assert not [text for text in flight.said if "GPS" in text or "lost" in text], flight.said
    assert flight.largest_tilt() < math.radians(45.0)
