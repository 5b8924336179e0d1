"""The loop of a sampled law: its spectral radius, the smallest rate that it bears, its delay margins."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.interpolate import pade
from scipy.linalg import expm
from scipy.optimize import brentq

from controller.design.lqr import SampledGain
from controller.design.model import LinearModel
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle


def held(model: LinearModel, period: float) -> tuple[Array, Array]:
    """Transition of state and of input held over a period (zero-order hold)."""
    n, m = model.B.shape
    both = np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = model.A, model.B
    exponential = expm(both * period)
    return exponential[:n, :n], exponential[:n, n:]


def spectral_radius(model: LinearModel, gain: SampledGain, period: float, delay: int) -> float:
    """Of the sampled loop u[k] = -K x[k] - ΣK_past u[k-1-i], each command acting `delay` periods late."""
    a, b = held(model, period)
    n, m = b.shape
    if delay == 0:
        return float(np.abs(np.linalg.eigvals(a - b @ gain.state)).max())
    # State: x, then the inputs under way, the oldest first.
    loop = np.zeros((n + delay * m, n + delay * m))
    loop[:n, :n], loop[:n, n : n + m] = a, b
    for age in range(delay - 1):
        loop[n + age * m : n + (age + 1) * m, n + (age + 1) * m : n + (age + 2) * m] = np.eye(m)
    last = slice(n + (delay - 1) * m, n + delay * m)
    loop[last, :n] = -gain.state
    for age in range(len(gain.past)):  # the newest past input is the last under way
        at = n + (delay - 1 - age) * m
        loop[last, at : at + m] -= gain.past[age]
    return float(np.abs(np.linalg.eigvals(loop)).max())


def smallest_stable_rate(radius: Callable[[float], float]) -> float:
    """The rate, Hz, above which the loop is stable: from 4 kHz down to one that is not, then bisected."""
    stable = 4000.0
    assert radius(stable) < 1.0
    while radius(stable / 1.05) < 1.0:
        stable /= 1.05
    unstable = stable / 1.05
    while stable - unstable > 0.1:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if radius(middle) < 1.0 else (stable, middle)
    return stable


def roll_loop_radius(vehicle: Vehicle, gain: Array, period: float, delay: int) -> float:
    """Spectral radius of roll rate and roll alone, by their characteristic polynomial: a check on the whole.

    z^d (z-1)² + h K_p/I (z-1) + h² K_φ/2I (z+1), K_p and K_φ the gains from p and φ to M_x.
    """
    rate = period * gain[1, 12] / vehicle.airframe.inertia[0]
    angle = period**2 * gain[1, 15] / (2.0 * vehicle.airframe.inertia[0])
    free = np.polymul([1.0, -2.0, 1.0], [1.0] + [0.0] * delay)
    return float(np.abs(np.roots(np.polyadd(free, [rate + angle, angle - rate]))).max())


def _radius_at(model: LinearModel, gain: SampledGain, delay: int, rate_hz: float) -> float:
    return spectral_radius(model, gain, 1.0 / rate_hz, delay)


def _roll_radius_at(vehicle: Vehicle, gain: Array, delay: int, rate_hz: float) -> float:
    return roll_loop_radius(vehicle, gain, 1.0 / rate_hz, delay)


def delay_margins(model: LinearModel, gain: Array) -> list[float]:
    """Delay, s, that each input bears on its own before the loop is unstable, the others without delay."""
    margins = []
    frequencies = np.geomspace(1e-2, 1e5, 1000)
    for i in range(gain.shape[0]):
        others = [j for j in range(gain.shape[0]) if j != i]
        a = model.A - model.B[:, others] @ gain[others]

        def loop(w: float, a: Array = a, i: int = i) -> complex:
            return complex(gain[i] @ np.linalg.solve(1j * w * np.eye(len(a)) - a, model.B[:, i]))

        sizes = np.array([math.log(abs(loop(float(w)))) for w in frequencies])
        margin = math.inf
        for k in np.flatnonzero(np.diff(np.sign(sizes)) != 0).tolist():
            w = brentq(lambda w: math.log(abs(loop(w))), frequencies[k], frequencies[k + 1])
            phase = (np.angle(loop(w)) + math.pi) % (2.0 * math.pi)
            margin = min(margin, float(phase) / w)
        margins.append(margin)
    return margins


PADE_ORDER = 6


def delayed_growth(model: LinearModel, gain: Array, late: int, delay: float) -> float:
    """Largest real part, 1/s, of the loop with the input `late` delayed (s), by Padé's all-pass."""
    series = [(-1.0) ** k / math.factorial(k) for k in range(2 * PADE_ORDER + 1)]
    p, q = pade(series, PADE_ORDER)  # exp(-s), with s in units of 1/delay
    through = float(p.coeffs[0] / q.coeffs[0])
    rest = (p.coeffs - through * q.coeffs)[1:] / q.coeffs[0]
    n, k = len(model.A), PADE_ORDER
    # Controllable canonical form, driven by what the law asks of this input.
    chain = np.diag(np.ones(k - 1), -1)
    chain[0] = -q.coeffs[1:] / q.coeffs[0]
    prompt = np.array([through if i == late else 1.0 for i in range(gain.shape[0])])
    loop = np.zeros((n + k, n + k))
    loop[:n, :n] = model.A - model.B @ (prompt[:, None] * gain)
    loop[:n, n:] = np.outer(model.B[:, late], rest)
    loop[n, :n] = -gain[late] / delay
    loop[n:, n:] = chain / delay
    return float(np.linalg.eigvals(loop).real.max())


def delay_until_unstable(model: LinearModel, gain: Array, late: int) -> float:
    """The delay margin (s) of an input a second time: no frequency response, but the poles with a Padé delay.

    From 0.1 ms up until the loop grows, then bisected.
    """
    bad = 1e-4
    while delayed_growth(model, gain, late, bad) < 0.0:
        bad *= 1.1
        if bad > 10.0:
            return math.inf
    good = bad / 1.1
    while bad - good > 1e-6 * bad:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if delayed_growth(model, gain, late, middle) < 0.0 else (good, middle)
    return good
