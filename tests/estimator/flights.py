"""Offline flights for the estimator: plant, noisy sensors, estimator and law in one process, seeded.

The plant is the real one; the sensors are drawn here, so that each test says what they are like. The loop is
that of lockstep: sensors of tick k, estimate, command from tick k on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from controller.design.lqr import Weights, sampled_gain, sampled_model
from controller.design.model import linear_model, with_integrator
from controller.estimator.filter import Estimator
from controller.estimator.records import ACCELEROMETER, GPS_POSITION, PARTS
from controller.estimator.tuning import Tuning
from sitl_bridge.frames import euler_from_quaternion
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]
CONSUMER = Tuning()
RTK = replace(CONSUMER, gps_position_std=(0.02, 0.02, 0.03), gps_velocity_std=(0.05, 0.05, 0.05))
RATE_HZ = 250.0
PERIOD = 1.0 / RATE_HZ
HELD_TICKS = 250
"""Ticks for which the vehicle is held at rest before it flies: alignment."""
NEES_PARTS = ("position", "velocity", "attitude", "load", "load_velocity")
NEES_ROWS = np.r_[tuple(PARTS[name] for name in NEES_PARTS)]
"""15 error states. Rates are left out: the filter allows for unknown moments, the plant has none."""


@dataclass(frozen=True)
class Sensors:
    """Standard deviation of each sensor's sample, and its bias; GPS arrives `gps_delay` s late."""

    tuning: Tuning = CONSUMER
    accel_bias: float = 0.02
    gyro_bias: float = 0.002
    gps_delay: float = 0.11
    gps_every: int = 25
    """ticks"""


@dataclass
class Sample:
    """What the sensors read at one tick; a test's `spoil` may change it. None: no reading."""

    time: float
    accelerometer: Array
    gyroscope: Array
    magnetometer: Array | None
    altitude: float | None
    gps: tuple[float, Array, Array] | None
    """(time it belongs to, position, velocity)"""
    tracker: tuple[float, Array] | None = None
    state: Array | None = None
    """the plant's, for tests that add a sensor"""


Spoil = Callable[[Sample], None]


@dataclass
class Flight:
    """What a flight left: rows of 18 (eq. 31) at every tick in flight, and consistency every tenth tick."""

    estimator: Estimator
    time: Array
    truth: Array
    estimate: Array
    std: Array
    """(n, 18) standard deviations of the estimate, every tenth tick"""
    nees: Array
    """(n,) of NEES_ROWS, per degree of freedom, every tenth tick"""
    load_nees: Array
    gps_innovations: list[Array] = field(default_factory=list)
    """(3,) normalised innovations of the position, at each fix"""
    accelerometer_innovations: list[Array] = field(default_factory=list)
    """(3,) normalised, every seventh tick: out of step with the held force and with GPS"""

    def load_relative_error(self, skip: float = 20.0) -> Array:
        """Root mean square error of the load relative to the vehicle, (3,) m."""
        rows = self.time >= skip
        error = self.estimate[rows] - self.truth[rows]
        return np.asarray(np.sqrt(np.mean((error[:, 3:6] - error[:, 0:3]) ** 2, axis=0)))

    def load_error(self, reference: Array, skip: float = 20.0) -> Array:
        """Root mean square distance of the load from the reference, (3,) m."""
        rows = self.time >= skip
        return np.asarray(np.sqrt(np.mean((self.truth[rows, 3:6] - reference) ** 2, axis=0)))


def truth_of(state: Array) -> Array:
    """The plant's state (19,) in the order of eq. 31 (18,)."""
    attitude = euler_from_quaternion(tuple(state[6:10]))  # type: ignore[arg-type]
    return np.concatenate([state[0:3], state[13:16], state[3:6], state[16:19], state[10:13], attitude])


class Law:
    """Integral LQR on an estimate, with a plain allocation."""

    def __init__(self, vehicle: Vehicle, weights: Weights, reference: Array) -> None:
        model = with_integrator(linear_model(vehicle))
        self.gain = sampled_gain(sampled_model(model, weights, PERIOD), vehicle.loop.delay_ticks).state
        self.hover = np.zeros(18)
        self.hover[0:3] = self.hover[3:6] = reference
        self.hover[2] += vehicle.hover_length
        self.integral = np.zeros(3)
        self.thrust = vehicle.hover_thrust
        effect = []
        for rotor in vehicle.rotors:
            sign = -1.0 if rotor.direction == "ccw" else 1.0
            yaw = sign * rotor.torque_coefficient / rotor.thrust_coefficient
            effect.append((1.0, rotor.position[1], -rotor.position[0], yaw))
        self.inverse = np.linalg.pinv(np.array(effect).T)
        self.coefficient = np.array([rotor.thrust_coefficient for rotor in vehicle.rotors])
        self.largest = np.array([rotor.max_speed for rotor in vehicle.rotors])

    def __call__(self, estimate: Array) -> Array:
        """Rotor speeds, rad/s (n,)."""
        deviation = estimate - self.hover
        deviation[17] = math.remainder(deviation[17], 2.0 * math.pi)
        self.integral += PERIOD * deviation[3:6]
        wrench = -self.gain @ np.concatenate([deviation, self.integral])
        wrench[0] += self.thrust
        lift = np.maximum(self.inverse @ wrench, 0.0)
        return np.asarray(np.minimum(np.sqrt(lift / self.coefficient), self.largest))


def attitude_error(truth: Array, nominal: Array) -> Array:
    """The rotation vector e, body, with R_true = R_nominal exp([e]x), from two quaternions."""
    w, x, y, z = nominal
    conjugate = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    difference = conjugate @ truth
    return np.asarray(2.0 * np.sign(difference[0]) * difference[1:])


def error_state(world_state: Array, nominal: Array) -> Array:
    """True minus estimated, of NEES_ROWS: (15,)."""
    return np.concatenate(
        [
            world_state[0:3] - nominal[0:3],
            world_state[3:6] - nominal[3:6],
            attitude_error(world_state[6:10], nominal[6:10]),
            world_state[13:16] - world_state[0:3] - nominal[20:23],
            world_state[16:19] - world_state[3:6] - nominal[23:26],
        ]
    )


def give(estimator: Estimator, sample: Sample) -> None:
    """Hand one tick's readings to the estimator."""
    estimator.imu(sample.accelerometer, sample.gyroscope)
    if sample.magnetometer is not None:
        estimator.magnetometer(sample.magnetometer)
    if sample.altitude is not None:
        estimator.barometer(sample.altitude)
    if sample.gps is not None:
        estimator.gps(*sample.gps)
    if sample.tracker is not None:
        estimator.load_seen(sample.tracker[0], sample.tracker[1], (0.05, 0.05, 0.05))


def fly(
    vehicle: Vehicle,
    weights: Weights,
    duration: float,
    seed: int,
    *,
    sensors: Sensors | None = None,
    tuning: Tuning | None = None,
    on_truth: bool = True,
    spoil: Spoil | None = None,
    believed: Vehicle | None = None,
    in_flight: bool = False,
    reference: Array | None = None,
) -> Flight:
    """Fly `duration` seconds and keep the load where it starts; the law flies on truth or on the estimate.

    sensors: what the plant's sensors are like; tuning: what the filter assumes, by default the same.
    believed: the description that the filter has, by default the true one. in_flight: the filter starts when
    the flight does (the law then flies on truth for the first two seconds).
    """
    sensors = sensors or Sensors()
    like = sensors.tuning
    world = World(vehicle, RATE_HZ, seed)
    estimator = Estimator(believed or vehicle, PERIOD, tuning or like)
    estimator.reset(in_flight=in_flight)
    reference = np.array(vehicle.initial.load_position) if reference is None else reference
    law = Law(vehicle, weights, reference)
    generator = np.random.default_rng([seed, 6])
    ticks = HELD_TICKS + round(duration * RATE_HZ)
    noise = generator.standard_normal((ticks, 11))
    gps_noise = generator.standard_normal((ticks // sensors.gps_every + 2, 6))
    biases = generator.standard_normal(6) * np.r_[[sensors.accel_bias] * 3, [sensors.gyro_bias] * 3]
    position_std, velocity_std = np.array(like.gps_position_std), np.array(like.gps_velocity_std)
    late = round(sensors.gps_delay * RATE_HZ)
    waiting: list[tuple[int, tuple[float, Array, Array]]] = []
    field_strength = np.array(like.field) / math.hypot(*like.field[:2])
    count = ticks - HELD_TICKS
    flight = Flight(
        estimator,
        np.arange(count) * PERIOD,
        np.zeros((count, 18)),
        np.zeros((count, 18)),
        np.zeros((count // 10 + 1, 18)),
        np.zeros(count // 10 + 1),
        np.zeros(count // 10 + 1),
    )
    for k in range(ticks):
        now, held = k * PERIOD, k < HELD_TICKS
        world.measure(k, held)  # with the description's sensors, which are ideal
        ideal = world.measurement[0]
        state = world.state
        w, x, y, z = state[6:10]
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        if k % sensors.gps_every == 0:
            draw = gps_noise[k // sensors.gps_every]
            fix = (now, state[0:3] + position_std * draw[:3], state[3:6] + velocity_std * draw[3:])
            waiting.append((k + late, fix))
        sample = Sample(
            now,
            ideal["accelerometer"] + biases[:3] + like.accelerometer_std * noise[k, 0:3],
            ideal["gyroscope"] + biases[3:] + like.gyroscope_std * noise[k, 3:6],
            field_strength @ rotation + like.magnetometer_std * noise[k, 6:9],
            state[2] + 0.3 + like.barometer_std * noise[k, 9],
            waiting.pop(0)[1] if waiting and waiting[0][0] == k else None,
            state=state,
        )
        if spoil and not held:
            sample.time -= HELD_TICKS * PERIOD
            spoil(sample)
            sample.time += HELD_TICKS * PERIOD
        if not (held and in_flight):
            give(estimator, sample)
            estimator.tick(now)
        if held:
            continue
        if k == HELD_TICKS and not in_flight:
            estimator.take_off()
        row = k - HELD_TICKS
        if sample.gps is not None:
            flight.gps_innovations.append(estimator.memory["normalised"][GPS_POSITION].copy())
        if row % 7 == 0:
            flight.accelerometer_innovations.append(estimator.memory["normalised"][ACCELEROMETER].copy())
        truth = truth_of(state)
        flight.truth[row] = truth
        flight.estimate[row] = estimator.state()
        if row % 10 == 0 and estimator.aligned:
            cov = estimator.error_covariance[np.ix_(NEES_ROWS, NEES_ROWS)]
            error = error_state(state, estimator.nominal)
            flight.nees[row // 10] = error @ np.linalg.solve(cov, error) / len(error)
            load = slice(9, 12)
            flight.load_nees[row // 10] = error[load] @ np.linalg.solve(cov[load, load], error[load]) / 3.0
            flight.std[row // 10] = np.sqrt(np.diag(estimator.covariance()))
        blind = in_flight and row < 2.0 * RATE_HZ
        speeds = law(truth if on_truth or blind else np.array(estimator.state()))
        estimator.command(speeds)
        world.command([*(speeds / law.largest), *[0.0] * (16 - len(speeds))])
        world.advance(world.steps_per_tick)
    return flight
