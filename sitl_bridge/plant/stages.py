"""A tick as a list of named stages, each with the rule that says when it is due.

`Simulation` has the list, in the order in which things happen. A tick is flown in one of two ways, with the
same states, rows and bytes. Stage by stage, in Python; or whole, in one compiled call
(`tick.fly_whole_tick`), which does what every tick needs. What a stage does only now and then (draw random
numbers, apply a fault, read GPS) is announced by its due rule. The whole tick is taken only while no stage is
due. A stage without a due rule cannot be built, so no effect can be skipped by mistake.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sitl_bridge.plant.physics.state import Array

EVER = 2**62
"""Ticks left of a stage that is never due: the compiled tick does all of it."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One thing that happens in a tick."""

    name: str
    run: Callable[[], None]
    """Do it in the current tick, all of it."""
    ticks_left: Callable[[], int]
    """The due rule: how many ticks, from the current one on, leave it nothing to do but what the compiled
    tick does; 0 or less: it is due now."""
    count: Callable[[], None] | None = None
    """Note that the compiled tick has done its part."""


def run(stages: Sequence[Stage]) -> None:
    """One after the other."""
    for stage in stages:
        stage.run()


def never_due() -> int:
    """The due rule of a stage that the compiled tick does entirely."""
    return EVER


def always_due() -> int:
    """The due rule of a stage that the compiled tick cannot do."""
    return 0


def due_rules(stages: Sequence[Stage]) -> list[Callable[[], int]]:
    """The rules of all stages that are ever due."""
    return [stage.ticks_left for stage in stages if stage.ticks_left is not never_due]


def ticks_left(rules: Sequence[Callable[[], int]]) -> int:
    """How many ticks from the current one on may be flown whole: until the first stage is due."""
    return min([rule() for rule in rules], default=EVER)


def interval_ticks_left(every: int, tick: int) -> int:
    """Due rule of what happens at each multiple of `every` ticks, when it has just been done up to `tick`."""
    return every - 1 - tick % every


class Command(NamedTuple):
    """Rotor controls within a tick."""

    step: int
    """Number of the tick's integration step from which they act."""
    controls: Array
    """(16,) of 0..1"""


class LoopDelay:
    """Holds each command back for a number of ticks (`loop.delay_ticks`)."""

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks
        self._under_way: deque[Array] = deque()

    def restart(self, controls: Array) -> None:
        """At the scenario's beginning: the rotors do as these controls say until the first command is due."""
        self._under_way.clear()
        self._under_way.extend(controls.copy() for _ in range(self.ticks))

    def passed(self, controls: Array) -> Array:
        """Take this tick's command; the one that acts now."""
        if not self.ticks:
            return controls
        self._under_way.append(controls.copy())
        return self._under_way.popleft()

    @property
    def due_rule(self) -> Callable[[], int]:
        """Due at every tick, where there is a delay."""
        return always_due if self.ticks else never_due
