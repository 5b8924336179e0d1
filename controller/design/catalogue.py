"""The designs that a person can choose: the paper's two, the one that flies by default, a nonlinear one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.design.estimated_weights import estimated_weights
from controller.design.lqr import Weights, block_diagonal, sampled_gain, sampled_model
from controller.design.model import actuated_model, rotor_time_constant, with_integrator
from controller.design.names import DESIGNS, FOR_ESTIMATES
from controller.design.remembered import remembered
from controller.design.softer_far_off import at_share, softened
from controller.design.stiffness import BETWEEN, FASTEST, MARGIN, bears, lag_in_answer, stiffest
from controller.law.control_law import DESIGN, FEEDFORWARD, INTEGRATOR, STATE, Design
from controller.law.flatness import body
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    LONGEST_DELAY,
    OWN_STATES,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    WRENCH_SIZE,
    Array,
)
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

LARGEST_LEAN = math.radians(30.0)
"""rad away from the reference's attitude, that errors of places and velocities may ask for."""
ANTI_WINDUP_TIME = 1.0
"""Time constant, s, with which the integral gives way while the rotors are at a limit."""


def paper_weights() -> Weights:
    """Section V.B: Q = 100·blkdiag(I18, 100·I3), R = I4."""
    return Weights(100.0 * block_diagonal(np.eye(STATE_SIZE), 100.0 * np.eye(3)), np.eye(WRENCH_SIZE))


def paper_lqr_weights() -> Weights:
    """Section V.A: Q = I18, R = I4."""
    return Weights(np.eye(STATE_SIZE), np.eye(WRENCH_SIZE))


class Emphasis(NamedTuple):
    """Factors on the default design's weights."""

    vehicle_position: float = 1.0
    load_position: float = 1.0
    vehicle_velocity: float = 1.0
    load_velocity: float = 1.0
    body_rates: float = 1.0
    attitude: float = 1.0
    integral: float = 1.0
    thrust: float = 1.0
    moments: float = 1.0


EVEN = Emphasis()
STIFFEST = Emphasis(
    load_position=16.0,
    vehicle_velocity=0.01,
    load_velocity=4.0,
    body_rates=0.1,
    attitude=0.1,
    integral=16.0,
    thrust=0.1,
    moments=0.1,
)
"""A stiff law; from `EVEN` to it, and beyond, factors go geometrically."""
MOST_STIFF = 1.15
"""With it `paper` holds its load against 5 N of noise within 17 mm on 1 m of cable, 30 mm on 10 m."""

SOFT_STIFFNESS = {"default": 0.0, "geometric": 0.25}
"""Far from the reference, and along fast motions: stiffer ones lose a load that swings widely, the
nonlinear law from 0.5 on."""


def default_weights(vehicle: Vehicle, emphasis: Emphasis = EVEN, loaded: bool = True) -> Weights:
    """Weights by largest acceptable deviation (Bryson's rule), the inputs scaled to the vehicle.

    Without its load the vehicle's own position takes the place of the load's. Moments are weighed as angular
    accelerations and thrust as an acceleration of the whole, so that the bandwidth, and with it the delay
    margin, is much the same for every size of vehicle.
    """
    nowhere = 1e3  # m: the vehicle's own position matters only through the load's
    position, velocity, integral = 0.5, 0.5, 0.6  # m, m/s, m s
    rate, tilt, yaw = 2.0, 0.5, 0.5  # rad/s, rad, rad
    acceleration, angular, turning = 2.0, 15.0, 4.0  # m/s², rad/s², rad/s²
    deviations = np.zeros(STATE_SIZE + 3)
    deviations[VEHICLE_POSITION], deviations[LOAD_POSITION] = nowhere, position
    deviations[VEHICLE_VELOCITY] = deviations[LOAD_VELOCITY] = velocity
    deviations[BODY_RATES], deviations[EULER_ANGLES] = rate, (tilt, tilt, yaw)
    deviations[STATE_SIZE:] = integral
    mass = vehicle.airframe.mass + vehicle.load.mass
    if not loaded:
        deviations[VEHICLE_POSITION], mass = position, vehicle.airframe.mass
    inertia = np.array(vehicle.airframe.inertia)
    efforts = np.array([mass * acceleration, *(inertia * (angular, angular, turning))])
    on_states, on_inputs = _factors(emphasis, loaded)
    return Weights(np.diag(deviations**-2.0 * on_states), np.diag(efforts**-2.0 * on_inputs))


def _factors(e: Emphasis, loaded: bool = True) -> tuple[Array, Array]:
    """Factors on the weights of the states with the integral (21,), and on those of the inputs (4,)."""
    own = e.vehicle_position if loaded else e.load_position  # the position that matters
    on_states = np.repeat(
        [own, e.load_position, e.vehicle_velocity, e.load_velocity, e.body_rates, e.attitude, e.integral], 3
    )
    return on_states, np.array([e.thrust, e.moments, e.moments, e.moments])


def emphasised(weights: Weights, emphasis: Emphasis) -> Weights:
    """Diagonal weights, each times its factor."""
    on_states, on_inputs = _factors(emphasis)
    return Weights(weights.Q * on_states[: len(weights.Q)], weights.R * on_inputs)


def times(one: Emphasis, other: Emphasis) -> Emphasis:
    """Factors on top of factors."""
    return Emphasis(*(a * b for a, b in zip(one, other, strict=True)))


def stiffened(share: float) -> Emphasis:
    """The factors of a stiffness, see `stiffness`."""
    return Emphasis(*(factor**share for factor in STIFFEST))


def stiffness(vehicle: Vehicle, rate_hz: float) -> float:
    """How stiff a law on truth is for a vehicle, a loop rate and the delay that it is told of."""
    return float(_stiffness(linearised(vehicle), rate_hz)[0])


@remembered(64)
def _stiffness(vehicle: Vehicle, rate_hz: float) -> Array:
    model = actuated_model(vehicle)
    soft = design_for(vehicle, rate_hz, default_weights(vehicle), FEEDFORWARD)

    def good(share: float) -> bool:
        record = design_for(vehicle, rate_hz, default_weights(vehicle, stiffened(share)), FEEDFORWARD)
        if lag_in_answer(record, vehicle.gravity) > FASTEST or not bears(model, record, MARGIN):
            return False
        record = softened(record, soft, model)
        return all(bears(model, at_share(record, between), MARGIN) for between in BETWEEN)

    return np.array([stiffest(good, MOST_STIFF)])


def emphasis_of(vehicle: Vehicle) -> Emphasis:
    """The factors of a vehicle description's `[law]`."""
    return Emphasis(**vehicle.law.model_dump())


def design(name: str, vehicle: Vehicle, rate_hz: float) -> Design:
    """A design by name for a vehicle and loop rate: a record of shape (1,), see `law.DESIGN`.

    The loop's delay is the vehicle description's `loop.delay_ticks`. Raises ValueError for an unknown name,
    and when the weights of the description's `[law]` have no solution.
    """
    emphasis = emphasis_of(vehicle)
    if name in FOR_ESTIMATES:
        record = _stiff_near_by(vehicle, rate_hz, emphasis, SOFT_STIFFNESS[name])
        record["adapts"] = 1
        record["geometric"] = name == "geometric"
        return record
    if name in FOR_ESTIMATES.values():
        record = design_for(vehicle, rate_hz, emphasised(estimated_weights(vehicle), emphasis), FEEDFORWARD)
        record["geometric"] = name == FOR_ESTIMATES["geometric"]
        return record
    if name == "paper":
        return design_for(vehicle, rate_hz, emphasised(paper_weights(), emphasis), INTEGRATOR)
    if name == "paper-lqr":
        return design_for(vehicle, rate_hz, emphasised(paper_lqr_weights(), emphasis), STATE)
    raise ValueError(f"no design {name!r}; expected one of {', '.join(DESIGNS)}")


@remembered(64)
def _stiff_near_by(vehicle: Vehicle, rate_hz: float, emphasis: Emphasis, softest: float) -> Design:
    """As stiff as margin and rotors let it be near its reference, no stiffer than `softest` far from it."""
    share = stiffness(vehicle, rate_hz)
    stiff, soft = (
        design_for(vehicle, rate_hz, default_weights(vehicle, times(emphasis, stiffened(s))), FEEDFORWARD)
        for s in (share, min(share, softest))
    )
    return softened(stiff, soft, actuated_model(linearised(vehicle))) if share > softest else soft


def on_cable(vehicle: Vehicle, rest_length: float) -> Vehicle:
    """The vehicle, its cable reeled to another rest length, m."""
    cable = vehicle.cable.model_copy(update={"rest_length": rest_length})
    return vehicle.model_copy(update={"cable": cable})


def guided_designs(vehicle: Vehicle, rate_hz: float, emphasis: Emphasis = EVEN) -> tuple[Design, Design]:
    """What flies under ground control: the default design, and its like for the vehicle on a slack cable.

    emphasis: on top of the description's `[law]`.
    """
    emphasis = times(emphasis, emphasis_of(vehicle))
    loaded, alone = (
        design_for(vehicle, rate_hz, default_weights(vehicle, emphasis, with_load), FEEDFORWARD, with_load)
        for with_load in (True, False)
    )
    return loaded, alone


@remembered(64)
def design_for(vehicle: Vehicle, rate_hz: float, weights: Weights, entry: int, loaded: bool = True) -> Design:
    """The design that minimises a cost in the sampled loop of a vehicle: a record of shape (1,).

    A cable that is no spring and damper is linearised about hover.

    weights: Q (18, 18), or (21, 21) with the integral of the load's position, and R (4, 4).
    entry: how the reference enters, see `law`. Not loaded: the vehicle alone, the integral being of its own
    position; the load's weights have no effect.
    """
    vehicle = linearised(vehicle)
    period, delay = 1.0 / rate_hz, vehicle.loop.delay_ticks
    assert delay <= LONGEST_DELAY
    model = actuated_model(vehicle, loaded)
    size = model.A.shape[0]
    states = list(range(STATE_SIZE)) if loaded else list(OWN_STATES)
    rigid = len(states)
    lag, integral = slice(rigid, size), slice(size, size + len(weights.Q) - STATE_SIZE)
    if integral.stop > size:
        model = with_integrator(model, LOAD_POSITION if loaded else VEHICLE_POSITION)
    used = [*states, *range(STATE_SIZE, len(weights.Q))]
    weights = Weights(weights.Q[np.ix_(used, used)], weights.R)
    gain = sampled_gain(sampled_model(model, _with_lag(weights, rigid, size), period), delay)

    record = np.zeros(1, dtype=DESIGN)
    record["entry"], record["period"], record["delay"] = entry, period, delay
    record["controlled"] = (LOAD_POSITION if loaded else VEHICLE_POSITION).start
    record["state_gain"][0][:, states] = gain.state[:, :rigid]
    record["past_gain"][0, :delay] = gain.past
    time_constant = rotor_time_constant(vehicle)
    # A command acts, on average over its period, half a period after the delay; lagging rotors later still.
    record["largest_lean"] = LARGEST_LEAN if entry == FEEDFORWARD else 0.0
    record["lead_time"], record["rotor_lag"] = (delay + 0.5) * period, time_constant
    if time_constant > 0.0:
        record["lag_gain"] = gain.state[:, lag]
        record["lag_decay"] = math.exp(-period / time_constant)
    if integral.stop > size:
        integral_gain = gain.state[:, integral]
        record["integral_gain"] = integral_gain
        record["anti_windup"] = -np.linalg.pinv(integral_gain) * period / ANTI_WINDUP_TIME
    record["hover_state"][0, VEHICLE_POSITION] = (0.0, 0.0, vehicle.hover_length)
    mass = vehicle.airframe.mass + (vehicle.load.mass if loaded else 0.0)
    record["hover_wrench"][0, 0] = mass * vehicle.gravity
    record["body"] = body(vehicle, loaded)
    return record


def _with_lag(weights: Weights, rigid: int, size: int) -> Weights:
    """Weights for a model of `rigid` states, `size` with the lag: what lagging rotors give costs nothing."""
    state, integral = weights.Q[:rigid, :rigid], weights.Q[rigid:, rigid:]
    lag = np.zeros((size - rigid, size - rigid))
    return Weights(block_diagonal(state, lag, integral), weights.R)
