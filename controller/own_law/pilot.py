"""The autopilot with a law of one's own. No I/O; see `hil.session.Pilot`."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from controller.design.motion.ramp import smoothly_planned
from controller.feedback.truth import PathFrom
from controller.hil.ticks import TickReader
from controller.law.allocation import allocation
from controller.law.control_law import WORK
from controller.law.reference import Path
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    WRENCH_SIZE,
    Array,
)
from controller.law.terms import SATURATED
from controller.own_law import answer
from controller.own_law.blame import cause, place_of
from controller.own_law.find import ChosenLaw, make
from controller.own_law.interface import Estimate, LawError, OwnLaw, Reference
from controller.own_law.tick import MOTION_ROWS, allocate_wrench, reference_at
from controller.pilot.autopilot import planned_from
from controller.pilot.legs import Legs, OnLeg, no_legs, planned_legs
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.vehicle.description import Cable, Vehicle
from sitl_bridge.vehicle.files import DescriptionError


class OwnLawPilot:
    """Calls the law at each tick; `controls` (16,) are its rotor commands, 0..1.

    Once the law has failed the rotors stay stopped, and `failure` says why.
    """

    law = None
    """There is no compiled law: `step` is called at each tick."""

    def __init__(
        self,
        chosen: ChosenLaw,
        vehicle: Vehicle,
        rate_hz: float,
        path_from: PathFrom,
        controls: Array,
        on_leg: OnLeg = no_legs,
    ) -> None:
        """Raises DescriptionError for a law that cannot be flown."""
        self.armed = False
        self.failure: LawError | None = None
        self._chosen = chosen
        self._vehicle = vehicle
        self._rate_hz = rate_hz
        self._path_from = path_from
        self._controls = controls
        self._rotors = len(vehicle.rotors)
        self._flying: OwnLaw = make(chosen, vehicle, rate_hz)
        self._path: Path | None = None
        self._ticks = self._leg_ticks = 0
        following = path_from(vehicle.initial_load_position)[1:]
        self.legs = Legs(planned_legs(following, self._plan), rate_hz, on_leg)
        self._motion, self._raw = np.zeros((2, MOTION_ROWS, 3))
        self._scratch = np.zeros(MOTION_ROWS)
        self._wrench = np.zeros(WRENCH_SIZE)
        self._work = np.zeros(1, dtype=WORK)
        self._allocate = allocate_wrench.bind(allocation(vehicle), self._work, self._wrench, controls)
        self.terms: Array | None = None
        """See `terms_log.Termed`."""
        self._steps = self._total_ns = self._worst_ns = 0

    @property
    def cost(self) -> dict[str, Any]:
        """The law's name, and what a call of it takes."""
        mean = self._total_ns / self._steps / 1e3 if self._steps else None
        worst = self._worst_ns / 1e3 if self._steps else None
        return {"name": self._chosen.name, "steps": self._steps, "mean_us": mean, "worst_us": worst}

    def attend(self, reader: TickReader) -> None:
        """The estimate is all that the law gets."""

    def whole_until(self, now: float) -> float:
        """Nothing is compiled of it: `law` is None."""
        return math.inf

    def flown_whole(self, time_usec: int, now: float) -> None:
        """Nothing here depends on it."""

    def act_late(self, ticks: int) -> None:
        """The law is the user's own; it has been said."""

    def hear(self, frame: Frame, now: float) -> None:
        """Anything else from the plant has no effect."""

    def disarm(self) -> None:
        """Stop the rotors; the next step arms, with a new object of the law."""
        self.armed = False
        if self._path is not None and self.failure is None:
            self._path = None
            try:
                self._flying = make(self._chosen, self._vehicle, self._rate_hz)
            except DescriptionError as error:
                self.failure = LawError(str(error))

    def step(self, estimate: Array, time_usec: int, now: float) -> None:
        """One call of the law on an estimate (18,), eq. 31; the first one arms."""
        if self.failure is not None:
            return
        if self._path is None:
            self._path = planned_from(self._path_from, estimate, self._plan)
            self._ticks = self._leg_ticks = 0
            self._reference_at = reference_at.bind(self._path, self._motion, self._raw, self._scratch)
            self.legs.begin(time_usec)
        if self.legs.is_over(self._path, self._leg_ticks):
            self._path[:] = self.legs.next(time_usec)
            self._leg_ticks = 0
        time_s = self._ticks / self._rate_hz
        seen = estimate_of(estimate, time_s, self._vehicle.cable)
        wanted = self._reference(self._path, time_s, self._leg_ticks / self._rate_hz)
        self._ticks += 1
        self._leg_ticks += 1
        began = time.perf_counter_ns()
        try:
            returned = self._flying.step(seen, wanted)
        except (Exception, SystemExit) as error:
            self._fail(time_s, f"raised {cause(error, self._chosen.make)}", error)
            return
        took = time.perf_counter_ns() - began
        self._steps += 1
        self._total_ns += took
        self._worst_ns = max(self._worst_ns, took)
        commands = answer.read(returned, self._rotors)
        if isinstance(commands, str):
            self._fail(time_s, f"{commands}{place_of(self._flying.step)}")
            return
        if commands.wrench is not None:
            self._wrench[:] = commands.wrench
            self._allocate()
            wrong = self._read_terms()
            if wrong is not None:
                self._fail(time_s, f"{wrong}{place_of(self._flying.step)}")
                return
        else:
            self._controls[: self._rotors] = commands.rotors
        self.armed = True

    def _read_terms(self) -> str | None:
        """Take the terms that the law tells, if it does; returns what is wrong with them."""
        told = getattr(self._flying, "terms", None)
        if told is None:
            self.terms = None
            return None
        terms = self._work["terms"][0]
        wrong = answer.read_terms(told, terms)
        terms[SATURATED] = self._work["achieved"][0] - self._wrench
        self.terms = terms.reshape(-1)
        return wrong

    def _plan(self, path: Path) -> Path:
        return smoothly_planned(path, self._vehicle)

    def _reference(self, path: Path, time_s: float, leg_time_s: float) -> Reference:
        self._reference_at(leg_time_s)
        position, velocity, acceleration, jerk, snap, _ = self._motion.copy()
        yaw, yaw_rate = float(path["yaw"][0]), float(path["yaw_rate"][0])
        goal = self._raw[0].copy()
        return Reference(time_s, position, velocity, acceleration, jerk, snap, goal, yaw, yaw_rate)

    def _fail(self, time_s: float, what: str, error: BaseException | None = None) -> None:
        self.armed = False
        self._controls[: self._rotors] = 0.0
        self.failure = LawError(
            f"law {self._chosen.name} {what} at t = {time_s:.3f} s: the rotors were stopped"
        )
        self.failure.__cause__ = error


def estimate_of(state: Array, time_s: float, cable: Cable) -> Estimate:
    """The estimate that a law is given, of a state (18,), eq. 31; it shares no memory with it."""
    x = state.copy()
    position, velocity = x[VEHICLE_POSITION], x[VEHICLE_VELOCITY]
    load, load_velocity = x[LOAD_POSITION], x[LOAD_VELOCITY]
    span = load - position
    length = math.sqrt(span @ span)
    direction = span / length if length > 0.0 else np.array([0.0, 0.0, -1.0])
    stretch = length - cable.rest_length
    tension = cable.stiffness * stretch + cable.damping * float(direction @ (load_velocity - velocity))
    if cable.model == "tension-only":
        tension = 0.0 if stretch <= 0.0 else max(0.0, tension)
    return Estimate(
        time_s,
        position,
        velocity,
        x[EULER_ANGLES],
        _rotation(*x[EULER_ANGLES].tolist()),
        x[BODY_RATES],
        load,
        load_velocity,
        direction,
        length,
        stretch,
        tension,
        x,
    )


def _rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rz(yaw)·Ry(pitch)·Rx(roll)."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
