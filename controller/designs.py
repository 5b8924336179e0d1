"""The designs that a person can choose: the paper's two, and the one that flies by default."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from controller.flatness import body
from controller.law import DESIGN, FEEDFORWARD, INTEGRATOR, LONGEST_DELAY, STATE, Design
from controller.lqr import SampledGain, Weights, sampled_gain, sampled_model
from controller.model import LinearModel, linear_model, with_integrator
from controller.state import STATE_SIZE, WRENCH_SIZE
from sitl_bridge.vehicle import Vehicle

DESIGNS = ("default", "paper", "paper-lqr")

ANTI_WINDUP_TIME = 1.0
"""Time constant, s, with which the integral gives way while the rotors are at a limit."""


def paper_weights() -> Weights:
    """Section V.B: Q = 100·blkdiag(I18, 100·I3), R = I4."""
    return Weights(100.0 * linalg.block_diag(np.eye(STATE_SIZE), 100.0 * np.eye(3)), np.eye(WRENCH_SIZE))


def paper_lqr_weights() -> Weights:
    """Section V.A: Q = I18, R = I4."""
    return Weights(np.eye(STATE_SIZE), np.eye(WRENCH_SIZE))


def default_weights(vehicle: Vehicle) -> Weights:
    """Weights by largest acceptable deviation (Bryson's rule), the inputs scaled to the vehicle.

    Moments are weighed as angular accelerations and thrust as an acceleration of the whole, so that the
    bandwidth, and with it the delay margin, is the same for every size of vehicle.
    """
    position, velocity, integral = 0.5, 0.5, 0.6  # m, m/s, m s
    rate, tilt, yaw = 2.0, 0.5, 0.5  # rad/s, rad, rad
    acceleration, angular, turning = 2.0, 15.0, 4.0  # m/s², rad/s², rad/s²
    scales = np.array(
        [1e3] * 3 + [position] * 3 + [velocity] * 6 + [rate, rate, rate] + [tilt, tilt, yaw] + [integral] * 3
    )
    inertia = np.array(vehicle.airframe.inertia)
    mass = vehicle.airframe.mass + vehicle.load.mass
    inputs = np.array([mass * acceleration, *(inertia * [angular, angular, turning])])
    return Weights(np.diag(scales**-2.0), np.diag(inputs**-2.0))


def design(name: str, vehicle: Vehicle, rate_hz: float) -> Design:
    """A design by name for a vehicle and loop rate: a record of shape (1,), see `law.DESIGN`.

    The loop's delay is the vehicle description's `loop.delay_ticks`. Raises ValueError for an unknown name.
    """
    if name == "paper":
        return _integral_design(vehicle, rate_hz, paper_weights(), INTEGRATOR)
    if name == "default":
        return _integral_design(vehicle, rate_hz, default_weights(vehicle), FEEDFORWARD)
    if name == "paper-lqr":
        return _plain_design(vehicle, rate_hz, paper_lqr_weights())
    raise ValueError(f"no design {name!r}; expected one of {', '.join(DESIGNS)}")


def actuated_model(vehicle: Vehicle) -> LinearModel:
    """The linear model from commanded wrench on, with the rotors' lag where they have one."""
    return linear_model(vehicle)


def _integral_design(vehicle: Vehicle, rate_hz: float, weights: Weights, entry: int) -> Design:
    model = with_integrator(linear_model(vehicle))
    gain = sampled_gain(sampled_model(model, weights, 1.0 / rate_hz), vehicle.loop.delay_ticks)
    record = _record(vehicle, rate_hz, gain, entry)
    integral_gain = gain.state[:, -3:]
    record["integral_gain"] = integral_gain
    record["anti_windup"] = -np.linalg.pinv(integral_gain) / (ANTI_WINDUP_TIME * rate_hz)
    return record


def _plain_design(vehicle: Vehicle, rate_hz: float, weights: Weights) -> Design:
    gain = sampled_gain(
        sampled_model(linear_model(vehicle), weights, 1.0 / rate_hz), vehicle.loop.delay_ticks
    )
    return _record(vehicle, rate_hz, gain, STATE)


def _record(vehicle: Vehicle, rate_hz: float, gain: SampledGain, entry: int) -> Design:
    record = np.zeros(1, dtype=DESIGN)
    delay = len(gain.past)
    assert delay <= LONGEST_DELAY
    record["entry"] = entry
    record["period"] = 1.0 / rate_hz
    record["delay"] = delay
    record["lead_time"] = (delay + 0.5) / rate_hz
    record["state_gain"] = gain.state[:, :STATE_SIZE]
    record["past_gain"][0, :delay] = gain.past
    hover = np.zeros(STATE_SIZE)
    hover[2] = vehicle.hover_length
    record["hover_state"] = hover
    record["hover_wrench"][0, 0] = vehicle.hover_thrust
    record["body"] = body(vehicle)
    return record
