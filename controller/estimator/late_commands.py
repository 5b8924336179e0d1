"""How late the commands act, seen in the gyroscope: nobody has to tell.

The rotors' moments turn the vehicle, and the moments are known from the commands. What the gyroscope says of
the last hundredths of a second is compared with the turn that the commands of so many ticks ago would have
given, for each delay that may be. The delay that fits, when the one reckoned with does not, is the loop's: a
slow link, a slow computer, or rotors with so much more lag.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.estimator.correct.live_samples import failed
from controller.estimator.records import (
    BODY_RATES_OUT,
    DELAY_HISTORY,
    DELAY_STEP,
    DELAYS,
    FILTER,
    FLYING,
    GYROSCOPE,
    MOST_ROTORS,
    OUTPUT_SIZE,
    STANDING,
    Array,
    Filter,
)
from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.ids import ACTUATOR_CONTROLS

WINDOW = 10
"""Ticks from one turn to the next that it is compared with: a lasting moment (a weak rotor) is in both, and
says nothing of time. Of a shorter time the gyroscope's noise is all that is seen."""
LONGEST = DELAY_STEP * (DELAYS - 1)
"""Ticks, of the delays that are compared"""
FEWEST = 8
"""Ticks that have to be compared before any verdict"""
MEMORY_TIME = 0.4
"""s, in which what was seen is forgotten"""
EVIDENCE = 40.0
"""Twice the logarithm of how much likelier another delay has to be."""
BETTER = 0.15
"""Of the present delay's misfit: another has to leave less, or neither explains what is seen."""
LEAST_CHANGE = 0.024
"""s; a smaller difference is within what gains bear."""
LEAST_ON_TRUTH = 0.012
"""s; likewise on truth, whose gains are stiffer and where commands that act late mislead what adapts."""
NOISE_ON_TRUTH = 1e-3
"""rad/s, standard deviation: rates without noise would make evidence of rounding."""
CLEAR = 0.3
"""m above its place on the ground: below it legs may have a part in how a vehicle turns."""


@kernel
def watch_delay(f: Filter, measured: Any, ticks: int, least_change: float) -> None:
    """Take in a tick: gyroscope (3,), rad/s; ticks: so many since the one before.

    least_change: s, by which another delay has to differ from the one reckoned with.
    """
    p, m = f.p, f.m
    if m.vehicle_mode != FLYING or ticks != 1 or failed(f, GYROSCOPE):
        m.delay_ticks_watched = m.delay_ticks_compared = 0
        m.delay_found = -1
        if m.vehicle_mode == STANDING and not m.grounded:
            # Held, its rotors as in hover: nothing has turned it, and that is known.
            m.delay_ticks_watched = DELAY_HISTORY
            for k in range(DELAY_HISTORY):
                for axis in range(2):
                    m.turned[k, axis] = m.rates[k, axis] = 0.0
            for i in range(p.rotor_count):
                m.prompt_speed[i] = m.rotor_speed[i]
        return
    n = m.delay_ticks_watched
    here, before = n % DELAY_HISTORY, (n - 1) % DELAY_HISTORY
    if n == 0:
        for i in range(p.rotor_count):
            m.prompt_speed[i] = m.rotor_speed[i]
        for axis in range(2):
            m.turned[before, axis] = 0.0
    about_x, about_y = _moments(f)
    m.turned[here, 0] = m.turned[before, 0] + about_x / p.inertia[0] * p.period
    m.turned[here, 1] = m.turned[before, 1] + about_y / p.inertia[1] * p.period
    for axis in range(2):
        m.rates[here, axis] = measured[axis]
    m.delay_ticks_watched = n + 1
    if n >= 2 * WINDOW + LONGEST and p.command_delay + 2 * WINDOW < DELAY_HISTORY:
        _compare(f, n, least_change)


@entry_point(
    Buffer(FILTER, (1,)),
    Buffer(np.float64, (OUTPUT_SIZE,)),
    Buffer(np.float64, (ACTUATOR_CONTROLS,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    int,
)
def watch_truth(record: Any, state: Array, controls: Array, largest_speed: Array, ticks: int) -> int:
    """The same on truth: take in a tick and the controls (16,) with which it was answered.

    Of the filter only parameters, commands and what belongs to the watch are used. state: (18,), eq. 31;
    largest_speed: (16,), rad/s; ticks: since the tick before. Returns the delay that was found, -1: none.
    """
    f = record[0]
    p, m = f.p, f.m
    if m.vehicle_mode == FLYING and p.has_ground and state[2] < p.standing_height + CLEAR:
        ticks = 0  # on the ground, or nearly: as if it had been missed
    watch_delay(f, state[BODY_RATES_OUT : BODY_RATES_OUT + 3], ticks, LEAST_ON_TRUTH)
    row = m.command_count % m.commands.shape[0]
    for i in range(MOST_ROTORS):
        m.commands[row, i] = controls[i] * largest_speed[i]
    m.command_count += 1
    return int(m.delay_found)


@kernel
def _compare(f: Filter, n: int, least_change: float) -> None:
    """Add tick n to the misfit of each delay, and judge: all of them have seen the same ticks."""
    p, m = f.p, f.m
    kept = 1.0 - p.period / MEMORY_TIME if m.delay_ticks_compared > 0 else 0.0
    now, earlier = n % DELAY_HISTORY, (n - WINDOW) % DELAY_HISTORY
    earliest = (n - 2 * WINDOW) % DELAY_HISTORY
    own, best = DELAYS, 0
    for c in range(DELAYS + 1):
        delay = p.command_delay if c == own else c * DELAY_STEP
        end, middle = (n - delay) % DELAY_HISTORY, (n - delay - WINDOW) % DELAY_HISTORY
        start, squares = (n - delay - 2 * WINDOW) % DELAY_HISTORY, 0.0
        for axis in range(2):
            seen = m.rates[now, axis] - 2.0 * m.rates[earlier, axis] + m.rates[earliest, axis]
            given = m.turned[end, axis] - 2.0 * m.turned[middle, axis] + m.turned[start, axis]
            squares += (seen - given) ** 2
        m.delay_misfit[c] = kept * m.delay_misfit[c] + squares
        if c != own and m.delay_misfit[c] < m.delay_misfit[best]:
            best = c
    m.delay_ticks_compared += 1
    if m.delay_ticks_compared < FEWEST:
        return
    ours, least = m.delay_misfit[own], m.delay_misfit[best]
    # Windows overlap: of so many ticks one is news. The noise of a second difference is in each.
    unit = 6.0 * p.sensor_std[GYROSCOPE] ** 2 * WINDOW
    if best == DELAYS - 1:
        return  # later still, or nothing of the kind: a backlog after a stall
    far = abs(best * DELAY_STEP - p.command_delay) * p.period >= least_change
    if far and ours - least > EVIDENCE * unit and least < BETTER * ours:
        m.delay_found = best * DELAY_STEP


@kernel
def _moments(f: Filter) -> tuple[float, float]:
    """Mean moments about x and y, N m, over the last tick if the newest command had acted at once."""
    p, m = f.p, f.m
    row = (m.command_count - 1) % m.commands.shape[0]
    lag = p.rotor_time_constant
    # Of the first-order lag over a period, to second order in the shorter of both.
    share = p.period / (lag + 0.5 * p.period) if lag > 0.0 else 1.0
    about_x, about_y = 0.0, 0.0
    for i in range(p.rotor_count):
        start = m.prompt_speed[i]
        end = start + min(1.0, share) * (m.commands[row, i] - start)
        m.prompt_speed[i] = end
        lift = (
            p.thrust_coefficient[i] * (0.5 * (start + end)) ** 2
            if lag > 0.0
            else p.thrust_coefficient[i] * end * end
        )
        about_x += p.rotor_y[i] * lift
        about_y -= p.rotor_x[i] * lift
    return about_x, about_y
