"""The sampled loop as it runs, for the linear model: is it stable, and how much more delay does it bear?

Nothing is approximated: inputs are held, the law keeps the memory that it has in flight (trapezoidal
integral, past commands, estimated rotors), and an extra delay of any length splits the hold in two.
"""

from __future__ import annotations

import numpy as np

from controller.design.model import LinearModel
from controller.law.control_law import STATE, Design
from controller.law.state import LOAD_POSITION, STATE_SIZE, Array

STRIDE = 2e-3
"""Steps, s, in which `delay_margin` looks for the loss of stability."""


def held_input(model: LinearModel, duration: float) -> tuple[Array, Array]:
    """(A, B) over `duration` seconds with the input held: x(t + duration) = A x + B u."""
    # Here, because a flight whose gains are kept (`kept`) takes no scipy.
    from scipy import linalg

    n, m = model.B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = model.A, model.B
    exponential = linalg.expm(block * duration)
    return exponential[:n, :n], exponential[:n, n:]


def closed_loop_matrix(
    model: LinearModel, design: Design, extra_delay: float = 0.0, inputs: tuple[int, ...] = (0, 1, 2, 3)
) -> Array:
    """Transition over one period of plant and law together, away from limits.

    model: `model.actuated_model`; design: record (1,); extra_delay: s, that the law is not told of, at the
    listed inputs. Its state: the plant's (n), wrench that the law thinks the rotors give (4), commands under
    way (4 each, newest first), integral and last error of the load's position (3 each, with an integrator).
    """
    law = design[0]
    period, told = float(law["period"]), int(law["delay"])
    ticks = int(extra_delay / period)
    rest = extra_delay - ticks * period
    n, m = model.B.shape
    history = told + ticks + 1
    whole, all_of_it = held_input(model, period)
    to_end, late = held_input(model, period - rest)
    _, early = held_input(model, rest)
    early = to_end @ early  # of the command before, that still acts for the first `rest` seconds

    integrates = int(law["entry"]) != STATE
    rotors = slice(n, n + m)
    past = [slice(n + m * (1 + age), n + m * (2 + age)) for age in range(history)]
    integral = slice(past[-1].stop, past[-1].stop + (3 if integrates else 0))
    error = slice(integral.stop, integral.stop + (3 if integrates else 0))
    size = error.stop

    # The command of this tick, as a function of everything before it.
    command = np.zeros((m, size))
    command[:, :STATE_SIZE] = -law["state_gain"]
    command[:, rotors] = -law["lag_gain"]
    for age in range(told):
        command[:, past[age]] = -law["past_gain"][age]
    if integrates:
        half = 0.5 * period * law["integral_gain"]
        command[:, integral] = -law["integral_gain"]
        command[:, LOAD_POSITION] -= half
        command[:, error] = -half

    def command_of(age: int) -> Array:
        """The command of so many ticks ago (0: this one)."""
        return command if age == 0 else np.eye(size)[past[age - 1]]

    matrix = np.zeros((size, size))
    matrix[:n, :n] = whole
    delayed = np.isin(np.arange(m), inputs)
    matrix[:n] += (all_of_it * ~delayed) @ command_of(told)
    matrix[:n] += (late * delayed) @ command_of(told + ticks)
    matrix[:n] += (early * delayed) @ command_of(told + ticks + 1)
    decay = float(law["lag_decay"])
    matrix[rotors] = (1.0 - decay) * command_of(told)
    matrix[rotors, rotors] += decay * np.eye(m)
    for age in range(history):
        matrix[past[age]] = command_of(age)
    if integrates:
        matrix[integral, integral] = np.eye(3)
        matrix[integral, LOAD_POSITION] = matrix[integral, error] = 0.5 * period * np.eye(3)
        matrix[error, LOAD_POSITION] = np.eye(3)
    return matrix


def spectral_radius(matrix: Array) -> float:
    """Largest magnitude of an eigenvalue; a sampled loop is stable below 1."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def delay_margin(
    model: LinearModel,
    design: Design,
    inputs: tuple[int, ...] = (0, 1, 2, 3),
    longest: float = 0.2,
    resolution: float = 1e-4,
) -> float:
    """The extra delay at the listed inputs, s, up to which the loop stays stable; at most `longest`.

    Found to `resolution` (s), from below. A loop that is unstable as it is has margin 0.
    """

    def stable(delay: float) -> bool:
        return spectral_radius(closed_loop_matrix(model, design, delay, inputs)) < 1.0

    # Stability can come back with more delay, so the first loss is looked for in steps.
    if not stable(0.0):
        return 0.0
    low, high = 0.0, min(STRIDE, longest)
    while stable(high):
        if high == longest:
            return longest
        low, high = high, min(high + STRIDE, longest)
    while high - low > resolution:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
