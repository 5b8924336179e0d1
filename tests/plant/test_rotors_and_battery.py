"""Rotor lag, any layout; the battery."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sitl_bridge.plant.battery import drained, electric_power, reading
from sitl_bridge.plant.world import World
from sitl_bridge.vehicle import Battery, hover_rotor_speeds, load_vehicle
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
    plant.inner[-1] = 0.0
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


def test_hover_power_is_torque_times_speed() -> None:
    vehicle = load_vehicle("iris")
    assert vehicle.battery is not None
    speeds = hover_rotor_speeds(vehicle)
    shaft = 4 * 2.92e-7 * speeds[0] ** 3
    assert electric_power(vehicle, vehicle.battery, speeds) == pytest.approx(shaft / 0.75 + 5.0)
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
