"""The autopilot between its links: it arms when it knows where it is, and flies its reference. No I/O."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from controller.design.catalogue import design
from controller.design.later import acting_later, follow
from controller.design.motion.prepared import PreparedMotion
from controller.design.motion.ramp import planned
from controller.design.names import FOR_ESTIMATES
from controller.feedback.truth import PathFrom
from controller.hil.ticks import TickReader
from controller.law.allocation import allocation
from controller.law.control_law import WORK, Law, Memory, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import Path
from controller.law.state import LOAD_POSITION, Array
from controller.pilot.legs import Legs, OnLeg, no_legs, planned_legs
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.vehicle.description import Vehicle


def planned_from(path_from: PathFrom, estimate: Array, plan: Callable[[Path], Path]) -> Path:
    """The path (1,), the reference's first leg, of a law that takes over at an estimate (18,), planned."""
    load = estimate[LOAD_POSITION]
    return plan(path_from((float(load[0]), float(load[1]), float(load[2])))[:1])


class Autopilot:
    """Control law and allocation of one vehicle; `controls` (16,) are its rotor commands, 0..1."""

    def __init__(
        self,
        vehicle: Vehicle,
        design_name: str,
        rate_hz: float,
        path_from: PathFrom,
        controls: Array,
        on_leg: OnLeg = no_legs,
    ) -> None:
        self.armed = False
        self.law: Law | None = None
        """While it flies: the arrays of `control_step` in front of estimate and controls."""
        self.terms: Array | None = None
        """See `terms_log.Termed`."""
        self._controls = controls
        expected = path_from(vehicle.initial_load_position)
        estimated = design_name in FOR_ESTIMATES.values()
        self._motion = PreparedMotion(expected[:1], vehicle, estimated)
        following = planned_legs(expected[1:], lambda leg: planned(leg, vehicle, estimated))
        self.legs = Legs(following, rate_hz, on_leg)
        self._leg_due = math.inf
        self._path_from = path_from
        self._vehicle = vehicle
        self._told = design(design_name, vehicle, rate_hz)
        self._design = self._told.copy()
        self._allocation = allocation(vehicle)
        self._step: Callable[[], int] | None = None

    def attend(self, reader: TickReader) -> None:
        """The estimate is all that the law needs."""

    def disarm(self) -> None:
        """Stop the rotors; the next step arms and starts afresh."""
        self.armed = False
        self._step = None
        self.law = self.terms = None
        self._leg_due = math.inf

    def whole_until(self, now: float) -> float:
        """A law that flies has nothing else to do until its next leg begins."""
        return self._leg_due

    def flown_whole(self, time_usec: int, now: float) -> None:
        """Nothing here depends on it."""

    def act_late(self, ticks: int) -> None:
        """Gains that predict over the longer delay, from the next step on."""
        self._design[:] = acting_later(self._told, self._vehicle, ticks)
        if self.law is not None:
            follow(self._design, self.law[3])

    def hear(self, frame: Frame, now: float) -> None:
        """Anything else from the plant has no effect."""

    def step(self, estimate: Array, time_usec: int, now: float) -> None:
        """One control step on an estimate (18,), eq. 31; the first one arms and engages the law."""
        if self._step is None:
            path = planned_from(self._path_from, estimate, partial(self._motion.planned, estimate=estimate))
            self.legs.begin(time_usec)
            memory = engaged_memory(estimate[LOAD_POSITION])
            work = np.zeros(1, dtype=WORK)
            law = (self._design, self._allocation, path, memory, work)
            self._step = control_step.bind(*law, estimate, self._controls)
            self.law = law
            self.terms = work["terms"].reshape(-1)
            self.armed = True
        assert self.law is not None
        *_, path, memory, _ = self.law
        self._go_on(path, memory, time_usec)
        self._step()
        self._leg_due = self.legs.due(path, int(memory["ticks"][0]), _pace(memory), time_usec)

    def _go_on(self, path: Path, memory: Memory, time_usec: int) -> None:
        """Another leg, if this one is over: in place, what the law has learnt and integrated stays."""
        if self.legs.is_over(path, int(memory["ticks"][0]), _pace(memory)):
            path[:] = self.legs.next(time_usec)
            memory["ticks"], memory["adaptation"]["pace"] = 1, 0.0


def _pace(memory: Memory) -> float:
    """Of the ramp, over the plan's; 1 as long as it is not set."""
    return float(memory["adaptation"]["pace"][0]) or 1.0
