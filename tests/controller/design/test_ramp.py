"""Ramps within what the vehicle can do: however short the step and however long the cable."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.design.catalogue import design
from controller.design.motion.limits import limits_of
from controller.design.motion.ramp import demand, planned, smoothly_planned
from controller.law.flatness import STENCIL, body, flat_motion
from controller.law.reference import circle, setpoint
from controller.law.state import EULER_ANGLES, STATE_SIZE
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly
from tests.controller.fleet import FLEET

ORIGIN = (0.0, 0.0, 0.0)


def on_cable(length: float) -> Vehicle:
    return load_vehicle("paper", [f"cable.rest_length={length}"])


@pytest.mark.parametrize("length", [1.0, 5.0, 10.0, 20.0, 50.0])
@pytest.mark.parametrize("step", [0.01, 0.3, 1.0, 3.0, 20.0])
def test_any_step_on_any_cable_is_flown_upright(length: float, step: float) -> None:
    vehicle = on_cable(length)
    path = planned(setpoint((0.8 * step, -0.6 * step, 0.1 * step), ORIGIN), vehicle)
    duration = float(path["ramp_time"][0]) + 10.0
    flight = fly(vehicle, design("default", vehicle, 250.0), path, duration, 250.0)
    tilt = np.arccos(np.prod(np.cos(flight.states[:, EULER_ANGLES.start : EULER_ANGLES.start + 2]), axis=1))
    assert flight.metrics["settled"]
    assert tilt.max() < limits_of(vehicle).tilt + math.radians(10.0)
    beyond = flight.metrics["overshoot_pct"]
    assert beyond is None or beyond < 5.0


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_the_paper_sized_step_of_one_metre_is_flown_by_every_vehicle(vehicle: Vehicle) -> None:
    path = planned(setpoint((1.0, 0.0, 0.0), ORIGIN), vehicle)
    flight = fly(vehicle, design("default", vehicle, 250.0), path, 16.0, 250.0)
    assert flight.metrics["settled"]


@settings(max_examples=25, deadline=None)
@given(
    length=st.floats(0.5, 50.0),
    distance=st.floats(0.01, 200.0),
    heading=st.floats(0.0, 2 * math.pi),
    climb=st.floats(-0.9, 0.9),
    agility=st.floats(0.0, 1.0),
)
def test_a_planned_step_keeps_the_limits(
    length: float, distance: float, heading: float, climb: float, agility: float
) -> None:
    vehicle = on_cable(length)
    level = distance * math.sqrt(1.0 - climb * climb)
    target = (level * math.cos(heading), level * math.sin(heading), distance * climb)
    limits = limits_of(vehicle, agility)
    path = setpoint(target, ORIGIN)
    path["agility"] = agility
    path = planned(path, vehicle)
    ramp_time = float(path["ramp_time"][0])
    asked = demand(path, vehicle, ramp_time, np.linspace(0.0, ramp_time, 1001))
    assert asked.tilt <= limits.tilt + math.radians(1.0)
    assert asked.thrust <= 1.02 * limits.most_thrust
    assert asked.tension >= 0.99 * limits.tension * vehicle.load.mass * vehicle.gravity


@pytest.mark.parametrize("drag", ["", "airframe.drag.quadratic=3", "load.drag.quadratic=3"])
def test_the_demand_is_the_feed_forwards(drag: str) -> None:
    """Tilt and thrust along V.B, worked out by `law.flatness` with its own differences."""
    vehicle = load_vehicle("paper", ["cable.rest_length=10", *([drag] if drag else [])])
    path = planned(setpoint((3.0, 5.0, 2.0), ORIGIN), vehicle)
    ramp_time = float(path["ramp_time"][0])
    record = path.view(np.recarray)[0]
    stencil = np.zeros(1, STENCIL).view(np.recarray)[0]
    masses = np.array([body(vehicle)]).view(np.recarray)[0]
    state, wrench = np.zeros(STATE_SIZE), np.zeros(4)
    tilts, thrusts = [], []
    for t in np.linspace(0.0, ramp_time, 200):
        flat_motion(masses, record, float(t), 0.0, 0.0, np.array([1.0, 0.0]), stencil, state, wrench)
        tilts.append(math.acos(math.cos(state[15]) * math.cos(state[16])))
        thrusts.append(wrench[0])
    asked = demand(path, vehicle, ramp_time, np.linspace(0.0, ramp_time, 400))
    assert asked.tilt == pytest.approx(max(tilts), rel=0.02)
    full = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
    assert asked.thrust == pytest.approx(max(thrusts) / full, rel=0.05)


def test_shorter_cables_and_shorter_steps_are_faster() -> None:
    def ramp(length: float, distance: float) -> float:
        path = planned(setpoint((distance, 0.0, 0.0), ORIGIN), on_cable(length))
        return float(path["ramp_time"][0])

    assert ramp(1.0, 5.0) < ramp(10.0, 5.0) < ramp(30.0, 5.0)
    assert ramp(5.0, 1.0) < ramp(5.0, 10.0) < ramp(5.0, 100.0)


@pytest.mark.parametrize("name", ["iris", "heavy", "paper"])
@pytest.mark.parametrize("offset", [0.1, 0.5, 1.0])
def test_the_estimates_own_error_is_flown_back_gently(name: str, offset: float) -> None:
    """A hover on estimates begins with one, in whatever weather: nothing is to be gained by haste."""
    vehicle = load_vehicle(name)
    path = setpoint(ORIGIN, (0.6 * offset, -0.8 * offset, 0.0))
    hurried = planned(path, vehicle, estimated=True)
    path["unhurried"] = 1
    for plan in (planned(path, vehicle, estimated=True), smoothly_planned(path, vehicle)):
        ramp_time = float(plan["ramp_time"][0])
        asked = demand(plan, vehicle, ramp_time, np.linspace(0.0, ramp_time, 1001))
        assert asked.tilt < math.radians(4.0)
        assert ramp_time > float(hurried["ramp_time"][0])


def test_a_weak_vehicle_takes_longer() -> None:
    weak = load_vehicle("paper", [f"rotors.{i}.max_speed=24.0" for i in range(4)])
    path = setpoint((10.0, 0.0, 5.0), ORIGIN)
    assert planned(path, weak)["ramp_time"][0] > planned(path, on_cable(1.0))["ramp_time"][0]


def test_drag_is_fed_forward() -> None:
    """At 5.5 m/s drag is a sixth of the vehicle's weight; not fed forward, the load is 0.3 m off."""
    vehicle = load_vehicle(
        "iris", ["initial.start=hover", "initial.load_position=[0, 0, 50]", "cable.rest_length=3"]
    )
    path = planned(circle((0.0, 0.0, 50.0), 5.0, 1.1, (0.0, 0.0, 50.0)), vehicle)
    flight = fly(vehicle, design("default", vehicle, 250.0), path, 25.0, 250.0)
    assert flight.metrics["tracking_rms_m"] is not None
    assert flight.metrics["tracking_rms_m"] < 1e-3
