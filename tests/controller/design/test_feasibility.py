"""What cannot be flown, and what would do: the reasons against flights and closed formulas."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.design.catalogue import design
from controller.design.feasibility import LEAST_THRUST, path_faults, vehicle_faults
from controller.design.motion.ramp import demand_of_circle, planned
from controller.law.reference import circle, setpoint
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly
from tests.controller.fleet import FLEET

HIGH = (0.0, 0.0, 50.0)
IN_THE_AIR = ["initial.start=hover", "initial.load_position=[0, 0, 50]"]
SHIPPED = {
    "paper": load_vehicle("paper", IN_THE_AIR),
    "paper, 10 m": load_vehicle("paper", ["cable.rest_length=10", *IN_THE_AIR]),
    "iris": load_vehicle("iris", IN_THE_AIR),
    "heavy": load_vehicle("heavy", IN_THE_AIR),
}


def with_thrust(vehicle: Vehicle, ratio: float) -> Vehicle:
    """The vehicle with rotors that give `ratio` times hover thrust."""
    full = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
    factor = math.sqrt(ratio * vehicle.hover_thrust / full)
    rotors = tuple(r.model_copy(update={"max_speed": factor * r.max_speed}) for r in vehicle.rotors)
    return vehicle.model_copy(update={"rotors": rotors})


def with_lag(vehicle: Vehicle, lag: float) -> Vehicle:
    rotors = tuple(r.model_copy(update={"time_constant": lag}) for r in vehicle.rotors)
    return vehicle.model_copy(update={"rotors": rotors})


@pytest.mark.parametrize("vehicle", [*SHIPPED.values(), *FLEET.values()], ids=[*SHIPPED, *FLEET])
def test_who_can_fly_is_not_refused(vehicle: Vehicle) -> None:
    assert vehicle_faults(vehicle) == []


@pytest.mark.parametrize("vehicle", SHIPPED.values(), ids=SHIPPED)
def test_no_thrust_to_spare(vehicle: Vehicle) -> None:
    assert vehicle_faults(with_thrust(vehicle, 1.01 * LEAST_THRUST)) == []
    (fault,) = vehicle_faults(with_thrust(vehicle, 1.02))
    assert "max_speed" in fault
    assert "98 %" in fault
    # What would do, does: the speed, and the mass.
    speed = float(re.search(r"expected ([0-9.]+) rad/s", fault)[1])  # type: ignore[index]
    rotors = tuple(r.model_copy(update={"max_speed": 1.001 * speed}) for r in vehicle.rotors)
    assert vehicle_faults(vehicle.model_copy(update={"rotors": rotors})) == []


@pytest.mark.parametrize("vehicle", SHIPPED.values(), ids=SHIPPED)
def test_rotors_slower_than_the_vehicle_falls_over(vehicle: Vehicle) -> None:
    (fault,) = vehicle_faults(with_lag(vehicle, 1000.0))
    lag = float(re.search(r"expected up to ([0-9.]+) s", fault)[1])  # type: ignore[index]
    assert vehicle_faults(with_lag(vehicle, lag)) == []
    assert vehicle_faults(with_lag(vehicle, 2.0 * lag)) != []


def test_an_inertia_that_the_rotors_do_not_move() -> None:
    vehicle = load_vehicle("iris", ["airframe.inertia=[5, 0.03, 5]"])
    (fault,) = vehicle_faults(vehicle)
    assert fault.startswith("airframe.inertia.0 = 5 kg m²")


def test_a_setpoint_in_the_ground() -> None:
    vehicle = load_vehicle("iris")
    (fault,) = path_faults(setpoint((1.0, 0.0, -1.0), HIGH), vehicle)
    assert "position.2 = -1 m" in fault
    assert path_faults(setpoint((1.0, 0.0, 0.05), HIGH), vehicle) == []
    assert path_faults(setpoint((1.0, 0.0, -1.0), HIGH), SHIPPED["paper"]) == []  # there is no ground


@pytest.mark.parametrize("vehicle", SHIPPED.values(), ids=SHIPPED)
@pytest.mark.parametrize("radius", [1.0, 5.0, 20.0])
def test_circles_are_flown_up_to_the_limit_that_is_said(vehicle: Vehicle, radius: float) -> None:
    """Just within it without a fall, and on the circle to a few millimetres."""
    (fault,) = path_faults(circle(HIGH, radius, 6.0, HIGH), vehicle)
    rate = float(re.search(r"angular_rate up to ([0-9.]+)", fault)[1])  # type: ignore[index]
    assert rate > 0.4 * math.sqrt(9.81 / radius)
    path = circle(HIGH, radius, rate, HIGH)
    assert path_faults(path, vehicle) == []
    path = planned(path, vehicle)
    flight = fly(vehicle, design("default", vehicle, 250.0), path, float(path["ramp_time"][0]) + 20.0, 250.0)
    late = np.linalg.norm(flight.states[-500:, 3:6] - HIGH, axis=1)
    np.testing.assert_allclose(late, radius, atol=0.02)


@settings(max_examples=40, deadline=None)
@given(radius=st.floats(0.5, 50.0), sideways=st.floats(0.1, 30.0))
def test_a_reason_names_what_is_too_much(radius: float, sideways: float) -> None:
    vehicle = SHIPPED["paper, 10 m"]
    path = circle(HIGH, radius, math.sqrt(sideways / radius), HIGH)
    faults = path_faults(path, vehicle)
    asked = demand_of_circle(path, vehicle)
    if asked.tilt > math.radians(35.5) or asked.thrust > 0.86:
        assert len(faults) == 1
    slow = sideways / radius < (1.4**2) * 9.81 / vehicle.hover_length
    if slow and asked.tilt < math.radians(20.0) and asked.thrust < 0.6 and sideways < 5.0:
        assert faults == []
