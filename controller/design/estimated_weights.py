"""Weights of the integral LQR for feedback from the estimator."""

from __future__ import annotations

import numpy as np

from controller.design.lqr import Weights
from controller.law.state import EULER_ANGLES, LOAD_POSITION, STATE_SIZE
from sitl_bridge.vehicle.description import Vehicle


def estimated_weights(vehicle: Vehicle) -> Weights:
    """Weights for feedback from the estimate: the load's place counts, and how far the vehicle leans for it.

    With a Kalman filter in front, the quadratic cost is met best by the gain of that cost, whatever the noise
    (separation); so the cost is what is wanted, the load at its place, and the inputs' price only sets the
    bandwidth. A price on the vehicle's velocity or rates, which helps damping on truth, here turns noise of
    the estimate into motion of the load. Without a price on tilt, a metre's error of the estimate is answered
    by 45 degrees, far beyond what is linear: `heavy` turned over on a circle.
    """
    load, tilt, yaw, integral = 1.0, 0.6, 1.0, 4.5  # m, rad, rad, m s
    angular, turning, acceleration = 50.0, 20.0, 5.0  # rad/s², rad/s², m/s²
    state = np.zeros(STATE_SIZE)
    state[LOAD_POSITION] = load**-2
    state[EULER_ANGLES] = (tilt**-2, tilt**-2, yaw**-2)
    inertia = np.array(vehicle.airframe.inertia)
    mass = vehicle.airframe.mass + vehicle.load.mass
    inputs = np.array([mass * acceleration, *(inertia * [angular, angular, turning])])
    return Weights(np.diag([*state, *[integral**-2] * 3]), np.diag(inputs**-2.0))
