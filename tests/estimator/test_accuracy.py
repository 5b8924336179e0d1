"""The load without a load sensor: accuracy against the Riccati bound, consistency, flight on the estimate."""

import dataclasses
import functools

import numpy as np
import pytest

from controller.design.estimated_weights import estimated_weights
from controller.estimator.records import PARTS, X_LOAD_WIND
from controller.estimator.riccati_bound import load_relative_bound
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.estimator.flights import CONSUMER, PERIOD, RTK, Flight, Sensors, fly

TUNINGS = {"consumer": CONSUMER, "rtk": RTK}


def paper(rest_length: float, *overrides: str) -> Vehicle:
    return load_vehicle("paper", ["disturbance.force_std=5", f"cable.rest_length={rest_length}", *overrides])


@functools.cache
def flight(rest_length: float, sensors: str, on_truth: bool, seed: int) -> Flight:
    vehicle = paper(rest_length)
    return fly(
        vehicle,
        estimated_weights(vehicle),
        60.0,
        seed,
        sensors=Sensors(tuning=TUNINGS[sensors]),
        on_truth=on_truth,
    )


@pytest.mark.parametrize(("rest_length", "limit"), [(1.0, (2.0, 2.0, 1.0)), (10.0, (7.0, 7.0, 1.0))])
def test_load_relative_to_vehicle(rest_length: float, limit: tuple[float, float, float]) -> None:
    """Within the limits (cm), and at the bound: neither far above it, nor below what chance allows."""
    errors = np.array([flight(rest_length, "consumer", True, seed).load_relative_error() for seed in (1, 2)])
    rms = np.sqrt(np.mean(errors**2, axis=0))
    bound = load_relative_bound(paper(rest_length), PERIOD, CONSUMER)
    assert np.all(rms <= np.array(limit) / 100.0)
    assert np.all(rms <= 1.2 * bound)
    assert np.all(rms >= 0.75 * bound)


@pytest.mark.parametrize("rest_length", [1.0, 10.0])
def test_covariance_is_the_riccati_solution(rest_length: float) -> None:
    """The filter's own standard deviation in hover against the bound of an independent linear model."""
    cov = flight(rest_length, "consumer", True, 1).estimator.error_covariance
    bound = load_relative_bound(paper(rest_length), PERIOD, CONSUMER)
    assert np.sqrt(np.diag(cov))[19:22] == pytest.approx(bound, rel=0.05)


@pytest.mark.parametrize(
    ("rest_length", "sensors", "limit"),
    [(1.0, "consumer", 0.15), (10.0, "consumer", 0.18), (1.0, "rtk", 0.04), (10.0, "rtk", 0.09)],
)
def test_flies_on_the_estimate(rest_length: float, sensors: str, limit: float) -> None:
    """The load's rms from its reference, each axis, the law seeing only the estimate."""
    assert np.all(flight(rest_length, sensors, False, 1).load_error(np.zeros(3)) <= limit)


@pytest.mark.parametrize("rest_length", [1.0, 10.0])
def test_consistent(rest_length: float) -> None:
    """Normalised errors near one, and within the chi-square bounds of their degrees of freedom.

    Errors stay the same for seconds, so time averages have few degrees of freedom: 10 s hold one independent
    sample of 15. Innovations are white, and there are thousands; theirs are biased down by a few percent
    since the filter takes the held force for an Ornstein-Uhlenbeck one.
    """
    flights = [flight(rest_length, "consumer", True, seed) for seed in (1, 2)]
    nees = np.mean([f.nees[500:-1].mean() for f in flights])
    samples = 2 * 4 * 15
    assert abs(nees - 1.0) < 1.96 * np.sqrt(2.0 / samples)
    load = np.mean([f.load_nees[500:-1].mean() for f in flights])
    assert load == pytest.approx(1.0, abs=0.25)
    for f in flights:
        m = f.estimator.memory
        assert np.sum(m["rejected"]) <= 5
        nis = m["nis_sum"][:6] / m["nis_count"][:6]
        assert nis == pytest.approx(np.ones(6), abs=0.12)
        ninety_five = 1.96 * np.sqrt(2.0 / m["nis_count"][4:6])
        assert np.all(np.abs(nis[4:6] - 1.0) < ninety_five)


def test_same_seed_same_estimate() -> None:
    vehicle = paper(1.0)
    first, second = (fly(vehicle, estimated_weights(vehicle), 1.0, 5) for _ in range(2))
    assert np.array_equal(first.estimate, second.estimate)
    assert np.array_equal(first.estimator.error_covariance, second.estimator.error_covariance)


def test_a_lasting_error_of_the_magnetometer_is_in_the_headings_uncertainty() -> None:
    """What the filter says of its heading is the lasting error, not the white noise that averages out."""
    bias = 0.004  # of the whole field: 9 mrad of heading
    tuning = dataclasses.replace(CONSUMER, magnetometer_bias_std=bias)
    vehicle = paper(1.0)
    flown = fly(vehicle, estimated_weights(vehicle), 20.0, 1, tuning=tuning)
    level = np.hypot(*CONSUMER.field[:2]) / np.linalg.norm(CONSUMER.field)
    yaw = np.sqrt(flown.estimator.covariance()[17, 17])
    assert yaw == pytest.approx(bias / level, rel=0.1)


def test_an_unknown_load_mass_is_found() -> None:
    """The load is a fifth heavier than described: with the state for it, the filter knows within 2 %."""
    vehicle, believed = paper(1.0, "load.mass=12"), paper(1.0)
    tuning = dataclasses.replace(CONSUMER, estimate_load_mass=True)
    flown = fly(vehicle, estimated_weights(vehicle), 20.0, 1, tuning=tuning, believed=believed)
    mass = believed.load.mass * np.exp(flown.estimator.nominal[32])
    assert mass == pytest.approx(12.0, rel=0.02)


def test_an_unknown_wind_on_the_load_is_found() -> None:
    """A steady side force of 5 N on the load alone, with accelerometers whose bias is known to be small."""
    vehicle, believed = paper(1.0, "load.drag.linear=1.0", "air.wind=[5.0, 0.0, 0.0]"), paper(1.0)
    tuning = dataclasses.replace(CONSUMER, estimate_load_wind=True, accel_bias_std=1e-3, accel_bias_walk=1e-6)
    flown = fly(
        vehicle,
        estimated_weights(vehicle),
        40.0,
        1,
        sensors=Sensors(accel_bias=0.0),
        tuning=tuning,
        believed=believed,
    )
    cov = flown.estimator.error_covariance[PARTS["load_wind"], PARTS["load_wind"]]
    off = flown.estimator.nominal[X_LOAD_WIND : X_LOAD_WIND + 3] - np.array([5.0, 0.0, 0.0])
    assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diag(cov)))
    assert np.all(np.sqrt(np.diag(cov))[:2] < 1.0)
