"""Drag, wind, gusts and turbulence."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from sitl_bridge.plant.physics.air import WIND_HOLD, Wind, gust_velocity
from sitl_bridge.plant.physics.disturbance import HELD, HeldWind
from sitl_bridge.plant.physics.parameters import step_count
from sitl_bridge.plant.physics.state import CABLE_HOLDS
from sitl_bridge.plant.physics.turbulence import Turbulent, dryden
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.vehicle.description import Gust, Turbulence, Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.flying import flight, flight_without_cable

TURBULENCE = Turbulence(wind_at_6_m=15.4, height=10.0, airspeed=8.0)


def windy(*overrides: str) -> Vehicle:
    return load_vehicle("iris", ["air.turbulence.wind_at_6_m=15.4", *overrides])


def test_terminal_velocity() -> None:
    """Falling without thrust the load reaches the speed at which its drag is its weight."""
    plant = flight_without_cable(
        "iris",
        "initial.start=hover",
        "initial.load_position=[0,0,2000]",
        "load.drag.linear=0.02",
    )
    plant.x[:3] = 0.2, 0.0, 3000.0
    plant.inner[CABLE_HOLDS] = 0.0
    plant.run(30.0)
    speed, drag = -plant.x[18], plant.vehicle.load.drag
    assert drag.linear * speed + drag.quadratic * speed**2 == pytest.approx(0.3 * 9.81, rel=1e-3)


def test_drag_is_of_the_velocity_through_the_air() -> None:
    """A vehicle that drifts with the wind feels none of it."""
    plant = flight(
        "iris", "initial.start=hover", "initial.vehicle_velocity=[4,-2,0]", "initial.load_velocity=[4,-2,0]"
    )
    plant.winds[:] = 4.0, -2.0, 0.0, 4.0, -2.0, 0.0
    plant.command[:4] = plant.inner[:4]
    plant.run(5.0)
    np.testing.assert_allclose(plant.x[3:6], [4.0, -2.0, 0.0], atol=1e-9)


def spectrum(length: float, intensity: float, airspeed: float, omega: np.ndarray, along: bool) -> np.ndarray:
    """MIL-F-8785C's Dryden spectra in time, one-sided in rad/s: the integral from 0 is the variance."""
    x = (length * omega / airspeed) ** 2
    level = intensity**2 * length / (math.pi * airspeed)
    return 2.0 * level / (1.0 + x) if along else level * (1.0 + 3.0 * x) / (1.0 + x) ** 2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_dryden_spectrum(axis: int) -> None:
    """Welch's estimate of fifty minutes against the formula, octave by octave."""
    figures = dryden(TURBULENCE)
    winds = [
        Turbulent(TURBULENCE, WIND_HOLD, stream(seed, "test")).draw(60_000)[:, axis] for seed in range(5)
    ]
    frequency, densities = welch(np.array(winds), 1.0 / WIND_HOLD, nperseg=8192)
    density = densities.mean(axis=0)
    formula = (
        2
        * math.pi
        * spectrum(
            figures.length[axis],
            figures.intensity[axis],
            TURBULENCE.airspeed,
            2 * math.pi * frequency,
            axis == 0,
        )
    )
    for low, spread in ((0.1, 0.2), (0.2, 0.15), (0.4, 0.12), (0.8, 0.08), (1.6, 0.06), (3.2, 0.05)):
        band = (frequency >= low) & (frequency < 2 * low)
        assert density[band].mean() / formula[band].mean() == pytest.approx(1.0, abs=spread)


@pytest.mark.parametrize("hold", [0.001, 0.05, 1.0])
def test_turbulence_has_its_variance_at_any_hold_from_the_start(hold: float) -> None:
    """Exact discretisation: over many seeds, first and later samples have the specified intensity."""
    draws = np.array([Turbulent(TURBULENCE, hold, stream(seed, "t")).draw(5) for seed in range(3000)])
    wanted = np.array(dryden(TURBULENCE).intensity)
    for sample in (0, 4):
        np.testing.assert_allclose(draws[:, sample].std(axis=0), wanted, rtol=0.05)


def test_low_altitude_figures() -> None:
    """At the boundary of the model, 1000 ft, all scales are 1000 ft and all intensities equal."""
    figures = dryden(Turbulence(wind_at_6_m=10.0, height=300.0))
    assert figures.length[0] == pytest.approx(300.0, rel=0.02)
    assert figures.intensity[0] == pytest.approx(1.0, rel=0.01)
    assert figures.intensity[2] == pytest.approx(1.0)


def test_vehicle_and_load_share_what_their_distance_leaves() -> None:
    vehicle = windy()
    rows = np.empty((100_000, 6))
    Wind(vehicle, 3).fill(rows)
    assert vehicle.air.turbulence is not None
    expected = math.exp(-vehicle.hover_length / vehicle.air.turbulence.height)
    vertical = np.corrcoef(rows[:, 2], rows[:, 5])[0, 1]
    assert vertical == pytest.approx(expected, abs=0.05)
    assert rows[:, 5].std() == pytest.approx(rows[:, 2].std(), rel=0.1)


def test_wind_does_not_depend_on_how_it_is_drawn() -> None:
    at_once, in_parts = np.empty((200, 6)), np.empty((200, 6))
    Wind(windy(), 3).fill(at_once)
    wind = Wind(windy(), 3)
    wind.fill(in_parts[:50])
    wind.fill(in_parts[50:])
    np.testing.assert_allclose(at_once, in_parts, rtol=0, atol=1e-12)


def test_gust_is_one_minus_cosine() -> None:
    gust = Gust(start=1.0, duration=2.0, peak=(3.0, 0.0, -1.0))
    time = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0])
    expected = np.outer([0.0, 0.0, 0.5, 1.0, 0.0, 0.0], gust.peak)
    np.testing.assert_allclose(gust_velocity(gust, time), expected, atol=1e-12)


@pytest.mark.parametrize(("rate_hz", "stiffness"), [(250.0, 1e2), (330.0, 1e2), (70.0, 1e2), (250.0, 1e5)])
def test_a_gust_blows_at_its_time_whatever_the_step(rate_hz: float, stiffness: float) -> None:
    """Also where no whole number of steps is 10 ms: at any time within a row of what it should be then."""
    gust = Gust(start=5.0, duration=2.0, peak=(8.0, 0.0, 0.0))
    vehicle = load_vehicle("iris", [f"cable.stiffness={stiffness}"])
    vehicle = vehicle.model_copy(update={"air": vehicle.air.model_copy(update={"gusts": (gust,)})})
    step = 1.0 / (rate_hz * step_count(vehicle, 1.0 / rate_hz))
    held = HeldWind(vehicle, step, 1, np.zeros(1, dtype=HELD)[0])
    times, blown = [], []
    for index in range(round(8.0 / step)):
        times.append(index * step)
        blown.append(held.now[0])
        held.advance(1)
    steepest = math.pi * gust.peak[0] / gust.duration
    expected = gust_velocity(gust, np.array(times))[:, 0]
    assert np.abs(np.array(blown) - expected).max() < 1.01 * steepest * 0.5 * held.hold
