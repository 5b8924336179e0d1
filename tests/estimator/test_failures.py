"""What a flight survives on the estimate: lost, jumping, stuck or saturated sensors, a slack cable."""

import dataclasses

import numpy as np
import pytest

from controller.design.estimated_weights import estimated_weights
from controller.estimator.filter import Estimator
from controller.estimator.records import LOAD_ON_CABLE, LOAD_RELEASED, SENSORS
from sitl_bridge.frames import rotate_inverse
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speed
from tests.estimator.flights import CONSUMER, HELD_TICKS, PERIOD, RATE_HZ, Flight, Sample, fly
from tests.estimator.test_accuracy import paper

GRAVITY_FREE = dataclasses.replace(CONSUMER, has_ground=False)


def on_estimate(
    spoil: object, vehicle: Vehicle | None = None, duration: float = 25.0, **more: object
) -> Flight:
    vehicle = vehicle or paper(1.0)
    return fly(vehicle, estimated_weights(vehicle), duration, 3, on_truth=False, spoil=spoil, **more)  # type: ignore[arg-type]


def error(flight: Flight, time: float) -> np.ndarray:
    row = round(time * RATE_HZ)
    return flight.estimate[row] - flight.truth[row]


@pytest.mark.parametrize("rest_length", [1.0, 10.0])
def test_gps_outage(rest_length: float) -> None:
    """10 s without GPS: the drift stays within what the filter says, and the load returns."""

    def outage(sample: Sample) -> None:
        if 5.0 <= sample.time < 15.0:
            sample.gps = None

    flight = on_estimate(outage, paper(rest_length), 30.0)
    row = round(14.9 * RATE_HZ)
    assert np.all(np.abs(error(flight, 14.9)[0:3]) < 3.0 * flight.std[row // 10][0:3])
    assert np.linalg.norm(error(flight, 14.9)[0:3]) < 5.0
    # The load is still seen by the accelerometer.
    assert np.all(np.abs(error(flight, 14.9)[3:6] - error(flight, 14.9)[0:3]) < 0.2)
    assert flight.nees[100:-1].max() < 3.0
    assert np.abs(flight.truth[-500:, 3:6]).max() < 0.6


def test_feedback_does_not_jump_when_gps_returns() -> None:
    def outage(sample: Sample) -> None:
        if 5.0 <= sample.time < 15.0:
            sample.gps = None

    flight = on_estimate(outage, duration=17.0)
    steps = np.abs(np.diff(flight.estimate[1250:, 0:3], axis=0))
    assert steps.max() < 0.3
    assert np.abs(error(flight, 14.9)[0:3]).max() > 1.0  # so there was something to correct


def test_gps_jump_is_refused() -> None:
    def jump(sample: Sample) -> None:
        if 5.0 <= sample.time < 10.0 and sample.gps:
            time, position, velocity = sample.gps
            sample.gps = (time, position + np.array([20.0, 0.0, 0.0]), velocity)

    flight = on_estimate(jump)
    assert flight.estimator.memory["rejected"][SENSORS.index("gps_position")] == 50
    assert np.abs(flight.estimate[:, 0:3] - flight.truth[:, 0:3]).max() < 1.0
    assert np.abs(flight.truth[:, 3:6]).max() < 0.5


def test_a_gps_that_repeats_itself_is_no_gps() -> None:
    """The same fix to the last digit, time after time: as if there were none, and back when it lives."""
    last: list[tuple[np.ndarray, np.ndarray]] = []

    def stuck(sample: Sample) -> None:
        if 5.0 <= sample.time < 15.0 and sample.gps:
            last[:] = last or [sample.gps[1:]]
            sample.gps = (sample.gps[0], *last[0])

    flight = on_estimate(stuck, duration=30.0)
    assert flight.estimator.memory["rejected"][SENSORS.index("gps_position")] > 90
    row = round(14.9 * RATE_HZ)
    assert np.all(np.abs(error(flight, 14.9)[0:3]) < 3.0 * flight.std[row // 10][0:3])
    assert np.abs(error(flight, 29.9)[0:3]).max() < 1.0


@pytest.mark.parametrize("gap", [0.5, 1.0, 2.0])
def test_after_a_gap_a_fall_is_believed(gap: float) -> None:
    """Nothing was heard for so long, and the vehicle fell meanwhile: GPS says so, and is not refused."""
    flight = on_estimate(lambda sample: None, duration=5.0)
    estimator, truth = flight.estimator, flight.truth[-1]
    now = (HELD_TICKS + 5.0 * RATE_HZ - 1) * PERIOD + gap
    estimator.tick(now)
    estimator.tick(now + PERIOD)
    fallen = truth[0:3] - np.array([0.0, 0.0, 0.5 * 9.81 * gap**2])
    rejected = estimator.memory["rejected"].copy()
    for tick in range(2, 60):
        if tick % 25 == 0:
            estimator.gps(
                now + tick * PERIOD, fallen, np.array([0.0, 0.0, -9.81 * gap]), *2 * [(0.5, 0.5, 0.8)]
            )
        estimator.tick(now + tick * PERIOD)
    assert np.all(estimator.memory["rejected"] == rejected)
    assert estimator.state()[8] < -5.0 * gap


def test_magnetometer_stuck() -> None:
    """It is found out by its silence, and the heading drifts slowly from then on."""
    last: list[np.ndarray] = []

    def stuck(sample: Sample) -> None:
        if sample.time >= 5.0:
            last[:] = last or [np.array(sample.magnetometer)]
            sample.magnetometer = last[0]

    flight = on_estimate(stuck)
    assert flight.estimator.memory["rejected"][SENSORS.index("magnetometer")] > 4900
    assert np.abs(flight.estimate[:, 17] - flight.truth[:, 17]).max() < 0.15
    assert flight.nees[100:-1].max() < 4.0
    assert flight.estimator.health().sensors["magnetometer"].age > 15.0


def test_barometer_drift() -> None:
    """0.1 m/s for 20 s: GPS holds the height to within a metre, and the load's place stays unhurt."""

    def drift(sample: Sample) -> None:
        assert sample.altitude is not None
        sample.altitude += 0.1 * max(0.0, sample.time - 5.0)

    flight = on_estimate(drift)
    assert np.abs(flight.estimate[:, 2] - flight.truth[:, 2]).max() < 1.0
    relative = (flight.estimate - flight.truth)[:, 3:6] - (flight.estimate - flight.truth)[:, 0:3]
    assert np.abs(relative[500:]).max() < 0.1


def test_imu_saturation() -> None:
    """0.2 s at the accelerometer's limit: not used, and the model carries on."""

    def saturated(sample: Sample) -> None:
        if 5.0 <= sample.time < 5.2:
            sample.accelerometer = np.full(3, CONSUMER.accelerometer_range)

    flight = on_estimate(saturated, duration=10.0)
    assert flight.estimator.memory["rejected"][SENSORS.index("accelerometer")] == 50
    assert flight.nees[100:-1].max() < 3.0


def test_garbage_is_no_measurement() -> None:
    """What is not a number, from every sensor, also during alignment, is refused and leaves no trace."""

    def garbage(sample: Sample) -> None:
        if 5.0 <= sample.time < 5.1:
            sample.accelerometer = sample.gyroscope = sample.magnetometer = np.full(3, np.nan)
            sample.altitude = np.nan
            if sample.gps:
                sample.gps = (sample.gps[0], np.full(3, np.nan), np.full(3, np.nan))

    flight = on_estimate(garbage, duration=8.0)
    assert np.all(np.isfinite(flight.estimate))
    assert flight.nees[100:-1].max() < 3.0
    rejected = flight.estimator.memory["rejected"]
    assert np.all(rejected[[0, 1, 2, 3]] >= 25)


def test_tracker_sharpens_the_load() -> None:
    """A camera that sees the load 0.1 s late: better than without, and consistent."""
    vehicle = paper(10.0)
    noise = np.random.default_rng(1).standard_normal((10000, 3)) * 0.05
    pictures: list[tuple[float, np.ndarray]] = []

    def tracked(sample: Sample) -> None:
        tick = round(sample.time * RATE_HZ)
        if tick % 10 == 0 and sample.state is not None:
            state = sample.state
            seen = rotate_inverse(tuple(state[6:10]), tuple(state[13:16] - state[0:3]))  # type: ignore[arg-type]
            pictures.append((sample.time + 1.0, np.array(seen) + noise[tick]))
        if tick >= 25 and (tick - 25) % 10 == 0 and len(pictures) > 2:
            sample.tracker = pictures[(tick - 25) // 10]

    tuning = dataclasses.replace(CONSUMER, tracker_period=0.04)
    flight = on_estimate(tracked, vehicle, 40.0, tuning=tuning)
    rms = flight.load_relative_error(10.0)
    assert np.all(rms < [0.04, 0.04, 0.01])
    m = flight.estimator.memory
    assert m["nis_sum"][6] / m["nis_count"][6] == pytest.approx(1.0, abs=0.1)
    assert m["nis_count"][6] > 2500


@pytest.mark.parametrize("rest_length", [1.0, 10.0])
def test_starts_in_flight(rest_length: float) -> None:
    """A controller that is started again in mid-flight: the load is known again within seconds."""
    flight = on_estimate(None, paper(rest_length), 15.0, in_flight=True)
    relative = error(flight, 5.0)[3:6] - error(flight, 5.0)[0:3]
    assert np.all(np.abs(relative) < [0.2, 0.2, 0.05])
    assert np.abs(error(flight, 5.0)[15:18]).max() < 0.05
    assert flight.nees[250:-1].max() < 4.0


def test_slack_at_the_start_and_snatch() -> None:
    """The filter believes the load to hang; it is thrown up on a slack cable, and falls into it."""
    start = (
        "cable.model=tension-only",
        "initial.vehicle_position=[0.3,0,0.8]",
        "initial.load_velocity=[0,0,2]",
    )
    believed = paper(1.0, "cable.model=tension-only")
    vehicle = paper(1.0, *start)
    flight = fly(
        vehicle,
        estimated_weights(vehicle),
        12.0,
        3,
        believed=believed,
        tuning=GRAVITY_FREE,
    )
    relative = (flight.estimate - flight.truth)[:, 3:6] - (flight.estimate - flight.truth)[:, 0:3]
    assert np.abs(relative[:25]).max() > 0.2  # it was wrong
    assert np.abs(relative[3 * 250 :]).max() < 0.1  # and found out
    assert flight.estimator.memory["load_mode"] == LOAD_ON_CABLE


def test_released_load_is_noticed_and_caught_again() -> None:
    """Two seconds without any pull in the air: the load is gone. A pull again: it is there."""
    vehicle = paper(1.0, "cable.model=tension-only")
    estimator = Estimator(vehicle, PERIOD, GRAVITY_FREE)
    generator = np.random.default_rng(0)
    mass, hover = vehicle.airframe.mass, vehicle.hover_thrust

    def run(first: int, ticks: int, thrust: float, pull: float) -> None:
        for k in range(first, first + ticks):
            noise = generator.standard_normal(9)
            estimator.imu(np.array([0, 0, (thrust - pull) / mass]) + 0.35 * noise[:3], 0.015 * noise[3:6])
            estimator.magnetometer(np.array(CONSUMER.field) + 0.02 * noise[6:9])
            estimator.barometer(0.3 * float(noise[0]))
            if k % 25 == 0:
                estimator.gps(k * PERIOD, np.zeros(3), np.zeros(3))
            estimator.tick(k * PERIOD)
            speed = hover_rotor_speed(vehicle) * np.sqrt(thrust / hover)
            estimator.command(np.full(4, speed))

    run(0, 200, hover, hover / 2)
    assert estimator.aligned
    estimator.take_off()
    run(200, 250, hover, hover / 2)
    assert estimator.health().load
    run(450, 600, hover / 2, 0.0)
    assert estimator.memory["load_mode"] == LOAD_RELEASED
    assert not estimator.health().load
    assert np.all(np.linalg.eigvalsh(estimator.error_covariance) > -1e-12)
    run(1050, 250, hover, hover / 2)
    assert estimator.memory["load_mode"] == LOAD_ON_CABLE
    assert estimator.health().load
