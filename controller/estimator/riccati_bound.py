"""What no linear filter can beat: the steady-state Riccati bound of the linear model at hover.

Independent of the filter's own equations: `design.model`'s A, the sensors' variances, and a Riccati
solver. Design time only (scipy).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from controller.design.model import linear_model
from controller.estimator.tuning import Tuning, parameters
from controller.law.state import (
    EULER_ANGLES,
    LOAD_POSITION,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from sitl_bridge.vehicle.description import Vehicle

# Behind the 18 states of eq. 31: unmodelled force, accelerometer and gyroscope bias, barometer offset.
_FORCE, _ACCEL_BIAS, _GYRO_BIAS, _BARO = slice(18, 21), slice(21, 24), slice(24, 27), slice(27, 28)
_SIZE = 28


def load_relative_bound(vehicle: Vehicle, period: float, tuning: Tuning) -> Array:
    """Smallest steady-state standard deviation (3,) m of the load's place relative to the vehicle.

    GPS noise is spread over the ticks between two fixes, and GPS arrives without delay.
    """
    p = parameters(vehicle, period, tuning)[0]
    model = linear_model(vehicle)
    a = np.zeros((_SIZE, _SIZE))
    a[:STATE_SIZE, :STATE_SIZE] = model.A
    a[VEHICLE_VELOCITY, _FORCE] = np.eye(3)
    a[_FORCE, _FORCE] = -np.eye(3) / p["force_time"]
    noise = np.zeros((_SIZE, _SIZE))
    noise[_FORCE, _FORCE] = np.eye(3) * 2.0 * p["force_std"] ** 2 / p["force_time"]
    noise[9:12, 9:12] = np.eye(3) * p["load_force_density"] ** 2
    noise[12:15, 12:15] = np.diag((p["torque_density"] / np.array(p["inertia"])) ** 2)
    noise[_ACCEL_BIAS, _ACCEL_BIAS] = np.eye(3) * p["accel_bias_walk"] ** 2
    noise[_GYRO_BIAS, _GYRO_BIAS] = np.eye(3) * p["gyro_bias_walk"] ** 2
    noise[_BARO, _BARO] = p["baro_walk"] ** 2

    accelerometer = a[VEHICLE_VELOCITY].copy()
    accelerometer[0, EULER_ANGLES.start + 1] -= vehicle.gravity
    accelerometer[1, EULER_ANGLES.start] += vehicle.gravity
    accelerometer[:, _ACCEL_BIAS] = np.eye(3)
    gyroscope = np.zeros((3, _SIZE))
    gyroscope[:, 12:15] = gyroscope[:, _GYRO_BIAS] = np.eye(3)
    heading, height = np.zeros((1, _SIZE)), np.zeros((1, _SIZE))
    heading[0, 17] = height[0, 2] = height[0, 27] = 1.0
    position, velocity = np.zeros((3, _SIZE)), np.zeros((3, _SIZE))
    position[:, VEHICLE_POSITION] = velocity[:, VEHICLE_VELOCITY] = np.eye(3)
    rows = np.vstack([accelerometer, gyroscope, heading, height, position, velocity])
    spread = tuning.gps_period / period
    variances = [
        *[tuning.accelerometer_std**2] * 3,
        *[tuning.gyroscope_std**2] * 3,
        tuning.magnetometer_std**2,
        tuning.barometer_std**2,
        *(spread * np.square(tuning.gps_position_std)),
        *(spread * np.square(tuning.gps_velocity_std)),
    ]
    transition, drive = _sampled(a, noise, period)
    prior = linalg.solve_discrete_are(transition.T, rows.T, drive, np.diag(variances))
    innovation = rows @ prior @ rows.T + np.diag(variances)
    posterior = prior - prior @ rows.T @ np.linalg.solve(innovation, rows @ prior)
    relative = np.zeros((3, _SIZE))
    relative[:, LOAD_POSITION] = np.eye(3)
    relative[:, VEHICLE_POSITION] -= np.eye(3)
    return np.asarray(np.sqrt(np.diag(relative @ posterior @ relative.T)))


def _sampled(a: Array, noise: Array, period: float) -> tuple[Array, Array]:
    """Transition over a period and the covariance that white noise adds in it (Van Loan 1978)."""
    n = len(a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, noise, a.T
    exponential = linalg.expm(block * period)
    transition = exponential[n:, n:].T
    return transition, transition @ exponential[:n, n:]
