"""Rotor lag, any layout; the battery."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sitl_bridge.plant.physics.battery import (
    drained,
    electric_power,
    power_coefficients,
    reading,
    shaft_coefficient,
)
from sitl_bridge.plant.physics.state import CABLE_HOLDS
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Battery, Vehicle, hover_rotor_speeds
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.flying import Flight, flight

BATTERY = Battery(cells=4, capacity=5.0, resistance=0.05)


@pytest.mark.parametrize("step", [1e-3, 2.5e-4])
def test_lag_is_exact(step: float) -> None:
    plant = flight("iris", "initial.start=hover")
    start = plant.inner[:4].copy()
    plant.command[:4] = 300.0, 500.0, 0.0, 1100.0
    for elapsed in (0.02, 0.06):
        plant.run(elapsed if elapsed == 0.02 else 0.04, step)
        expected = plant.command[:4] + (start - plant.command[:4]) * math.exp(-elapsed / 0.02)
        np.testing.assert_allclose(plant.inner[:4], expected, rtol=1e-12)


def test_thrust_follows_the_lagging_speed() -> None:
    """Climb after a step of all rotors, in empty air, against an adaptive integrator."""
    plant = flight("iris", "initial.start=hover", "airframe.drag.linear=0", "airframe.drag.quadratic=0")
    plant.inner[CABLE_HOLDS] = 0.0
    hover, high = plant.inner[0], 900.0
    plant.command[:4] = high
    start = plant.x[2]
    plant.run(0.3)

    def climb(t: float, y: np.ndarray) -> list[float]:
        speed = high + (hover - high) * math.exp(-t / 0.02)
        return [y[1], 4 * 5.84e-6 * speed**2 / 1.5 - 9.81]

    exact = solve_ivp(climb, (0, 0.3), [0.0, 0.0], rtol=1e-12, atol=1e-14).y[:, -1]
    assert plant.x[2] - start == pytest.approx(exact[0], abs=1e-9)


@pytest.mark.parametrize("name", ["paper", "iris", "heavy"])
def test_hover_speeds_hover(name: str) -> None:
    plant = Flight(load_vehicle(name, ["initial.start=hover"]))
    plant.command[: len(plant.vehicle.rotors)] = hover_rotor_speeds(plant.vehicle)
    start = plant.x.copy()
    plant.run(5.0)
    np.testing.assert_allclose(plant.x, start, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.05, 1.0), st.floats(0.0, 800.0))
def test_battery_obeys_ohm_and_conserves_power(remaining: float, power: float) -> None:
    now = reading(BATTERY, remaining, power)
    source = 4 * (3.5 + 0.7 * remaining)
    assert now.voltage == pytest.approx(source - 0.05 * now.current)
    if power <= source**2 / 0.2:
        assert now.voltage * now.current == pytest.approx(power, rel=1e-9, abs=1e-9)
    else:
        assert now.current == pytest.approx(source / 0.1)


def test_battery_empties_in_its_time() -> None:
    """Charge left is the integral of the current; 5 A h last an hour at 5 A."""
    remaining = 1.0
    for _ in range(1800):
        remaining = drained(BATTERY, remaining, 5.0, 1.0)
    assert remaining == pytest.approx(0.5)
    assert drained(BATTERY, 0.01, 1000.0, 10.0) == 0.0


def hover_power(vehicle: Vehicle, load: bool = True) -> float:
    """W in hover, with the load or after it was dropped."""
    assert vehicle.battery is not None
    share = 1.0 if load else vehicle.airframe.mass / (vehicle.airframe.mass + vehicle.load.mass)
    speeds = [speed * math.sqrt(share) for speed in hover_rotor_speeds(vehicle)]
    return electric_power(vehicle.battery, power_coefficients(vehicle, vehicle.battery), speeds)


@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_hover_takes_the_ideal_power_over_the_efficiencies(name: str) -> None:
    """Momentum theory: T sqrt(T / 2 rho A) is the least that any rotor of that disc can hover on."""
    vehicle = load_vehicle(name)
    battery = vehicle.battery
    assert battery is not None
    density = 1.225 * (1.0 - 0.0065 * 488.0 / 288.15) ** 4.2559  # ISA at home
    ideal = 0.0
    for rotor, speed in zip(vehicle.rotors, hover_rotor_speeds(vehicle), strict=True):
        assert rotor.diameter is not None
        thrust, disc = rotor.thrust_coefficient * speed**2, math.pi * (rotor.diameter / 2.0) ** 2
        ideal += thrust * math.sqrt(thrust / (2.0 * density * disc))
    shaft = (hover_power(vehicle) - battery.avionics_power) * battery.drive_efficiency
    assert shaft * battery.figure_of_merit == pytest.approx(ideal, rel=1e-3)


def test_without_a_disc_power_is_torque_times_speed() -> None:
    rotor = load_vehicle("paper").rotors[0]
    assert rotor.diameter is None
    assert shaft_coefficient(rotor, 0.6, 1.2) == rotor.torque_coefficient


def test_hover_draws_what_such_vehicles_draw() -> None:
    """A 1.5 kg quadrotor on 3S takes about 10 A/kg; the Iris+ was sold with 16 to 22 minutes."""
    vehicle = load_vehicle("iris")
    battery = vehicle.battery
    assert battery is not None
    power = hover_power(vehicle, load=False)
    now = reading(battery, 1.0, power)
    assert 10.0 < now.current < 18.0
    assert 0.2 < battery.cells * battery.full_cell_voltage - now.voltage < 0.6
    remaining, minutes = 1.0, 0.0
    while remaining > 0.0:
        remaining = drained(battery, remaining, reading(battery, remaining, power).current, 6.0)
        minutes += 0.1
    assert 16.0 < minutes < 22.0
    assert 15.0 < reading(battery, 1.0, hover_power(vehicle)).current < 22.0


def test_power_grows_as_weight_to_the_three_halves() -> None:
    vehicle = load_vehicle("heavy")
    assert vehicle.battery is not None
    idle = vehicle.battery.avionics_power
    ratio = (hover_power(vehicle) - idle) / (hover_power(vehicle, load=False) - idle)
    assert ratio == pytest.approx((27.5 / 19.5) ** 1.5, rel=1e-6)


def test_the_world_drains_its_battery() -> None:
    world = World(load_vehicle("iris", ["initial.start=hover"]), 250.0, 1)
    first = world.battery(0.0)
    assert first is not None
    later = world.battery(60.0)
    assert later is not None
    assert first.remaining == 1.0
    last = world.battery(0.0)
    assert last is not None
    assert last.remaining == pytest.approx(1.0 - first.current / 60 / 5.1, rel=1e-3)
    assert World(load_vehicle("paper"), 250.0, 1).battery(1.0) is None
