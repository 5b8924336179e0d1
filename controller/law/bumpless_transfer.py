"""From one law to another in flight: what the rotors give goes on as it is."""

from __future__ import annotations

import math

import numpy as np

from controller.law.control_law import Design, Memory, Work
from controller.law.state import Array


def other_body(before: Design, after: Design, old: Memory, new: Memory) -> None:
    """From the vehicle's law to the load's, or back: deviations from the old u* as seen from the new u*."""
    change = before["hover_wrench"][0] - after["hover_wrench"][0]
    new["rotors"][0] = old["rotors"][0] + change
    new["past"][0] = old["past"][0] + change


def from_wrench(after: Design, achieved: Array, new: Memory) -> None:
    """From a law of another kind, whose rotors give `achieved` (4,), N and N m."""
    under_way = achieved - after["hover_wrench"][0]
    new["rotors"][0] = under_way
    new["past"][0] = under_way


def other_gains(before: Design, after: Design, memory: Memory, work: Work, yaw: float) -> None:
    """From one set of gains to another for the same body: the integral becomes what gives the same wrench.

    It has the three degrees of freedom that a constant disturbance has; what the heading needs is left over.
    """
    missing = _without_integral(before, memory, work) - _without_integral(after, memory, work)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    to_heading = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    integral = to_heading @ memory["integral"][0]
    wanted = before["integral_gain"][0] @ integral + missing
    memory["integral"][0] = to_heading.T @ (np.linalg.pinv(after["integral_gain"][0]) @ wanted)


def _without_integral(design: Design, memory: Memory, work: Work) -> Array:
    """The feedback (4,) on everything but the integral, at the last step."""
    delay = int(design["delay"][0])
    feedback: Array = (
        design["state_gain"][0] @ work["deviation"][0]
        + design["lag_gain"][0] @ memory["rotors"][0]
        + np.einsum("akj,aj->k", design["past_gain"][0, :delay], memory["past"][0, :delay])
    )
    return feedback
