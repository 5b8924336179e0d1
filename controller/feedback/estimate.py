"""Flying on the estimate: HIL_SENSOR, HIL_GPS and LANDING_TARGET go into the estimator, tick by tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20.common import MAVLINK_MSG_ID_LANDING_TARGET

from controller.design.model import rotor_time_constant
from controller.estimator.filter import Estimator
from controller.estimator.records import X_LOAD, X_POSITION
from controller.estimator.tuning import Tuning, from_sensors
from controller.feedback.delay_watch import DelayWatch
from controller.feedback.health_notices import HealthWatch
from controller.feedback.log import EstimateLog
from controller.feedback.truth import PathFrom, PlainTick, TruthFeedback
from controller.hil.answers import AnswerWriter
from controller.hil.estimate_tick import answer_estimate
from controller.hil.ticks import Tick, TickReader
from controller.law.control_law import Law
from controller.law.reference import Path
from controller.law.state import Array
from sitl_bridge.frames import MICROSECONDS_PER_SECOND, LocalOrigin, Triple, fix_from_wire, flu_to_frd
from sitl_bridge.magnetic import field_at
from sitl_bridge.mavlink.framing import decode
from sitl_bridge.mavlink.hil import FRAME_BODY_FRD
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds

ALIGNMENT_TIME = 1.0
"""From the first tick, or from the one with which the plant's sensors began, to arming, s."""
LONGEST_BACKLOG = 10.0
"""s of ticks that may lie in a socket before the one with which the plant's sensors begin. Without that one,
arming waits so long: it may be yet to come."""
LONGEST_WAIT = 3.0
"""s for which the law on truth waits for an estimator that runs beside it."""
FALLING = 0.5
"""Of gravity: less than this along body z, with the rotors stopped, and the vehicle falls."""
FALLING_SAMPLES = 3
GUESSING_TIME = 0.1
"""s in which a vehicle that was flying when the controller came has begun to fall."""
CHECK_EVERY = 25
"""Ticks between two looks at whether the estimate can still be flown on."""
LOST_TILT, LOST_POSITION = 0.35, 30.0
"""rad and m, standard deviations: who knows no more than this cannot go on."""
_PARTS = 16
"""Late measurements belong to the nearest sixteenth of a tick: the wire's microseconds are rounded, and how
depends on when the plant was started."""
LARGE_START_OFFSET = 1.0
"""m between the estimated load and its described start, beyond which the law is spared the step."""
_LEAST_STD = 0.005
"""m; no tracker is taken for better."""
_FIX_3D = 3


def tuning_for(vehicle: Vehicle, rate_hz: float) -> Tuning:
    """What the filter assumes of the sensors and surroundings that a vehicle description has."""
    return from_sensors(
        vehicle.sensors,
        rate_hz,
        field_at(vehicle.home),
        home_altitude=vehicle.home.altitude,
        has_ground=vehicle.ground is not None,
        rotor_time_constant=rotor_time_constant(vehicle),
        estimate_load_wind=vehicle.estimation.load_wind,
        estimate_load_mass=vehicle.estimation.load_mass,
    )


class EstimateFeedback:
    """The estimator on HIL_SENSOR and HIL_GPS.

    It aligns at rest from the tick on with which the plant's sensors begin (HIL_SENSOR_UPDATED_RESET), and
    counts time in ticks from there, so that in lockstep the flight does not depend on who was started when.
    A plant whose sensors do not begin with us has flown before. If it then falls while the rotors stand, it
    was in the air, and the alignment is that in flight.
    """

    name = "estimate"
    needs_truth = False

    def __init__(
        self,
        vehicle: Vehicle,
        rate_hz: float,
        log: EstimateLog | None = None,
        say: Callable[[str], None] = lambda text: None,
        only_good: bool = True,
    ) -> None:
        """only_good: give no estimate before it is good enough to fly on, nor when it is so no more.

        Otherwise whoever takes it has to look at its health.
        """
        self.estimator = Estimator(vehicle, 1.0 / rate_hz, tuning_for(vehicle, rate_hz))
        self.guessing = False
        """Whether it is still open if the vehicle stands or flies."""
        self.fresh = False
        """Whether the plant's sensors have begun with us."""
        self._rate_hz = rate_hz
        self._say = say
        self._only_good = only_good
        self._vehicle = vehicle
        self._tracker = vehicle.sensors.tracker
        self._log = log
        self._origin = LocalOrigin(vehicle.home.latitude, vehicle.home.longitude, vehicle.home.altitude)
        self._largest_speeds = np.array([rotor.max_speed for rotor in vehicle.rotors])
        self.loop_delay: int | None = None
        self._standing = np.zeros(len(vehicle.rotors))
        self._hover_speeds = np.array(hover_rotor_speeds(vehicle))
        self._watch = HealthWatch(vehicle.sensors.tracker is not None)
        self.restart()

    def restart(self) -> None:
        """Align anew with the next tick."""
        self._align(in_flight=False)

    def _align(self, in_flight: bool) -> None:
        self.estimator.reset(in_flight=in_flight)
        self._flown = self._lost = False
        self.loop_delay = None
        self._released = False  # nothing holds the vehicle at its start any more
        self._first_usec: int | None = None
        self._tick = self._first_flown = self._falling = 0
        self._last_gps_usec = 0
        self.guessing = in_flight
        self.fresh = False

    def update(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The estimate at a new tick, once it is aligned and good enough to fly on."""
        if reader.begun:
            self._align(in_flight=False)
            self.fresh = True
        elif self._first_usec is None:
            self._align(in_flight=True)
        if self._first_usec is None:
            self._first_usec = time_usec
        self._tick = self._tick_at(time_usec)
        if self.guessing:
            self._guess(float(reader.sensed["accelerometer"][0, 2]), time_usec)
        estimator = self.estimator
        estimator.sensed(reader.sensed)
        if tick.gps and reader.gps["fix_type"] >= _FIX_3D:
            valid_usec = int(reader.gps["time_usec"])
            valid_s = self._seconds(valid_usec)
            if valid_usec > self._last_gps_usec and valid_s >= 0.0:
                self._last_gps_usec = valid_usec
                position, velocity = fix_from_wire(reader.gps, self._origin)
                estimator.gps(valid_s, position, velocity)
        for frame in tick.others:
            if frame.message_id == MAVLINK_MSG_ID_LANDING_TARGET:
                self._see_load(decode(frame))
        if not self._flown and estimator.held and self._vehicle.initial.start == "hover":
            self._begin_at_described_start()
        if estimator.found_delay >= 0:
            self.loop_delay = max(estimator.found_delay, self._vehicle.loop.delay_ticks)
            estimator.set_delay(self.loop_delay)
        estimate = estimator.tick(self._tick / self._rate_hz)
        if self.guessing or (estimator.in_flight and not self._flown and not self.ready()):
            return None
        if not self._only_good:
            return estimate
        if not self._flown:
            return estimate if self.ready() else None
        if self._tick % CHECK_EVERY == 0:
            self._check()
        return None if self._lost else estimate

    def note_command(self, controls: Array, armed: bool) -> None:
        """Note what the rotors are told; the first time armed, that the vehicle flies."""
        if not armed:
            self.estimator.command(self._standing)
            return
        if not self._flown:
            self._flown = True
            self._first_flown = self._tick
        if self.estimator.held and self._vehicle.initial.start == "hover":
            self.estimator.take_off(self._hover_speeds)
        self._record()
        self.estimator.command(controls[: len(self._largest_speeds)] * self._largest_speeds)

    def note_unheard(self, controls: Array | None) -> None:
        """Note what the rotors do instead. What they turn the vehicle by then says nothing of a delay."""
        self._record()
        speeds = self._standing
        if controls is not None:
            speeds = controls[: len(self._largest_speeds)] * self._largest_speeds
        self.estimator.command(speeds)
        self.estimator.forget_delay()

    def plain_tick(self, reader: TickReader, law: Law, writer: AnswerWriter) -> PlainTick | None:
        """Datagram in, estimator, control step, answer out; between two looks at the estimate's health."""
        answer = answer_estimate.bind(*reader.buffers, *self.estimator.arrays, *law, *writer.buffers)

        def plain_tick(length: int, last_time_usec: int, sequence: int, until_s: float) -> int:
            checks = self._only_good and (self._tick + 1) % CHECK_EVERY == 0
            if checks or self._lost or self.guessing or not self._flown or self._first_usec is None:
                return 0
            if not self._released:
                self._released = not self.estimator.held
                return 0
            if self.estimator.found_delay >= 0:
                return 0
            size: int = answer(length, last_time_usec, sequence, until_s, self._first_usec, self._rate_hz)
            if size:
                self._tick = self._tick_at(reader.time_usec)
                self._record()
            return size

        return plain_tick

    def _tick_at(self, time_usec: int) -> int:
        """Number of a tick, counted from the first."""
        assert self._first_usec is not None
        return round((time_usec - self._first_usec) * self._rate_hz / MICROSECONDS_PER_SECOND)

    def _record(self) -> None:
        if self._log is not None:
            self._log.record((self._tick - self._first_flown) / self._rate_hz, self.estimator)

    def path_from(self, path_from: PathFrom) -> PathFrom:
        """To where the description has the load at the start, which no sensor shows as well.

        The motion begins where the estimate has the load, metres away with some receivers: to begin elsewhere
        would be a step. In a hover that way is the estimate's own error, which is not hurried over. In
        flight, all of it is from where the estimate has it.
        """
        start = self._vehicle.initial_load_position

        def make(load: Triple) -> Path:
            if self.estimator.in_flight:
                return path_from(load)
            path = path_from(start)
            path["unhurried"][0] = np.array_equal(path["centre"][0], path["start"][0])
            path["start"][0] = load
            return path

        return make

    def ready(self) -> bool:
        """Whether it is aligned, and good enough to begin a flight on."""
        wait = LONGEST_BACKLOG if self._only_good and not self.fresh else ALIGNMENT_TIME
        if not self.estimator.in_flight and self._tick < round(wait * self._rate_hz):
            return False
        health = self.estimator.health()
        return health.attitude and health.velocity and health.position

    def _begin_at_described_start(self) -> None:
        """Spread a large offset of the estimate out, as after a GPS outage.

        The reference begins at the described start of the load. A receiver that is metres off would make the
        first deviation a step of metres, which turns the vehicle over.
        """
        nominal = self.estimator.nominal
        load = nominal[X_POSITION : X_POSITION + 3] + nominal[X_LOAD : X_LOAD + 3]
        offset = load - np.array(self._vehicle.initial.load_position)
        self.estimator.hide_offset(offset if np.linalg.norm(offset) > LARGE_START_OFFSET else np.zeros(3))

    def _guess(self, specific_force: float, time_usec: int) -> None:
        """Flying or standing: specific_force: m/s², along body z, the rotors being stopped."""
        falls = specific_force < FALLING * self._vehicle.gravity
        self._falling = self._falling + 1 if falls else 0
        if self._falling >= FALLING_SAMPLES:
            self.guessing = False
            self._say("the vehicle is in flight: aligning there")
        elif self._tick > GUESSING_TIME * self._rate_hz:
            self._align(in_flight=False)
            self._first_usec = time_usec
            self._tick = 0

    def _check(self) -> None:
        health = self.estimator.health()
        for text in self._watch.changes(health):
            self._say(text)
        if health.tilt_std > LOST_TILT or health.position_std > LOST_POSITION:
            self._lost = True
            self._say(
                "the estimate is lost: position to within "
                f"{health.position_std:.0f} m, tilt to within {health.tilt_std:.2f} rad; rotors stopped"
            )

    def _seconds(self, time_usec: int) -> float:
        """A time of the wire on the filter's clock, s."""
        assert self._first_usec is not None
        ticks = (time_usec - self._first_usec) * self._rate_hz / MICROSECONDS_PER_SECOND
        return round(ticks * _PARTS) / _PARTS / self._rate_hz

    def _see_load(self, target: Any) -> None:
        """LANDING_TARGET of the tracker: the load from the vehicle, BODY_FRD."""
        if self._tracker is None or not target.position_valid or target.frame != FRAME_BODY_FRD:
            return
        across = max(_LEAST_STD, self._tracker.angle_noise * target.distance)
        along = max(_LEAST_STD, self._tracker.distance_noise * target.distance)
        position = flu_to_frd((target.x, target.y, target.z))
        self.estimator.load_seen(self._seconds(target.time_usec), position, (across, across, along))


class TruthBesideEstimate(TruthFeedback):
    """The law flies on truth; the estimator runs beside it, for its log."""

    def __init__(self, beside: EstimateFeedback, rate_hz: float, watch: DelayWatch | None = None) -> None:
        super().__init__(watch)
        self._beside = beside
        self._patience = round(LONGEST_WAIT * rate_hz)
        self._begun = False

    def update(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The truth, from when the estimator has aligned; it is not waited for longer than LONGEST_WAIT."""
        estimate = self._beside.update(time_usec, tick, reader)
        truth = super().update(time_usec, tick, reader)
        if not self._begun and truth is not None:
            self._patience -= 1
            waits = self._beside.fresh and self._patience > 0  # not where it may be in flight
            self._begun = estimate is not None or not waits
        return truth if self._begun else None

    def plain_tick(self, reader: TickReader, law: Law, writer: AnswerWriter) -> PlainTick | None:
        """The estimator needs its part of every tick."""
        return None

    def note_command(self, controls: Array, armed: bool) -> None:
        """The estimator has to know."""
        super().note_command(controls, armed)
        self._beside.note_command(controls, armed)

    def note_unheard(self, controls: Array | None) -> None:
        """Likewise."""
        super().note_unheard(controls)
        self._beside.note_unheard(controls)

    def restart(self) -> None:
        """Align anew."""
        super().restart()
        self._beside.restart()
        self._begun = False
