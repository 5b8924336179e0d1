"""The gains of a design for a loop whose commands act later than it was made for, within a millisecond.

What happens before a command can act is settled, so the optimum is the same gain on the state predicted so
much further ahead (`lqr.sampled_gain`). That takes the model over a period, and no new optimum.
"""

from __future__ import annotations

import numpy as np

from controller.design.model import actuated_model, with_integrator
from controller.design.softer_far_off import at_share, set_soft
from controller.law.control_law import Design, Memory
from controller.law.state import (
    LOAD_POSITION,
    LONGEST_DELAY,
    OWN_STATES,
    STATE_SIZE,
    VEHICLE_POSITION,
    WRENCH_SIZE,
    Array,
)
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

SERIES = 8
"""Terms of the exponential's series"""
HALVINGS = 6


def acting_later(design: Design, vehicle: Vehicle, delay: int, loaded: bool = True) -> Design:
    """A design (record (1,), see `law.DESIGN`) of this vehicle for a delay of so many ticks.

    A delay shorter than the design's changes nothing.
    """
    told, period = int(design["delay"][0]), float(design["period"][0])
    delay = min(delay, LONGEST_DELAY)
    later: Design = design.copy()
    if delay <= told:
        return later
    model = actuated_model(linearised(vehicle), loaded)
    states = list(range(STATE_SIZE)) if loaded else list(OWN_STATES)
    rigid, lagging = len(states), len(model.A)
    integrates = bool(np.any(design["integral_gain"]))
    if integrates:
        model = with_integrator(model, LOAD_POSITION if loaded else VEHICLE_POSITION)
    a, b = _sampled(model.A, model.B, period)
    gain = np.zeros((WRENCH_SIZE, len(a)))
    gain[:, :rigid] = design["state_gain"][0][:, states]
    gain[:, rigid:lagging] = design["lag_gain"][0][:, : lagging - rigid]
    if integrates:
        gain[:, lagging:] = design["integral_gain"][0]
    for age in range(told, delay):
        later["past_gain"][0, age] = gain @ b
        gain = gain @ a
    later["state_gain"][0][:, states] = gain[:, :rigid]
    later["lag_gain"][0][:, : lagging - rigid] = gain[:, rigid:lagging]
    if design["soft"]["far"][0] > 0.0:
        set_soft(later, acting_later(at_share(design, 0.0), vehicle, delay, loaded))
    later["delay"] = delay
    later["lead_time"] += (delay - told) * period
    return later


def follow(later: Design, memory: Memory) -> None:
    """Make a law's memory (1,) that of a loop with the delay of `later`: what the rotors give now."""
    decay, delay = float(later["lag_decay"][0]), int(later["delay"][0])
    past, rotors = memory["past"][0], np.zeros(WRENCH_SIZE)
    for command in past[max(0, delay - 1) :][::-1]:
        rotors = decay * rotors + (1.0 - decay) * command
    memory["rotors"][0] = rotors


def _sampled(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """(A, B) over a period with the input held, by the exponential's series on 1/64 of it, squared."""
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a, b
    block *= period / 2**HALVINGS
    total = term = np.eye(n + m)
    for k in range(1, SERIES + 1):
        term = term @ block / k
        total = total + term
    for _ in range(HALVINGS):
        total = total @ total
    return total[:n, :n], total[:n, n:]
