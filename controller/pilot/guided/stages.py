"""A tick under ground control as a list of named stages, each with the rule that says when it is due.

`GuidedAutopilot` has the list, in the order in which things happen; `plant.stages` is its counterpart. A tick
is answered in one of two ways, with the same rotor commands: stage by stage, in Python, or whole, in the one
compiled call of `hil.estimate_tick` or `hil.truth_tick`, which flies the law and no more. Whatever else a
stage does now and then, its due rule announces. The whole tick is taken only while no stage is due, so
nothing can be skipped because somebody elsewhere does not know of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from controller.feedback.assessment import Contact
from controller.ground.flight.motion.setpoint_types import Target
from controller.ground.telemetry.vehicle_state import VehicleView
from controller.law.state import Array

AT_ONCE, NEVER = -math.inf, math.inf
"""Due at every tick, or at none: there it does nothing but what the compiled tick does, or `refresh`."""


@dataclass(slots=True)
class Moment:
    """What the stages of one tick hand on."""

    estimate: Array
    """(18,), eq. 31, as the law is to have it"""
    view: VehicleView
    contact: Contact
    now: float
    target: Target
    first: bool
    """Nothing was known of the vehicle before"""


class Stage(NamedTuple):
    """One thing that happens in a tick."""

    name: str
    run: Callable[[Moment], None]
    """Do it in this tick, all of it."""
    due: Callable[[], float]
    """The due rule: the plant's time, s, from which on it has more to do than the compiled tick does."""


def never_due() -> float:
    """The due rule of a stage that the compiled tick does entirely."""
    return NEVER


def run(stages: Sequence[Stage], moment: Moment) -> None:
    """One after the other."""
    for stage in stages:
        stage.run(moment)


def due(stages: Sequence[Stage]) -> float:
    """The plant's time, s, before which ticks may be answered whole."""
    return min([stage.due() for stage in stages if stage.due is not never_due], default=NEVER)
