"""Whether commands act later than told, seen in the true rates: `late_commands` without an estimator."""

from __future__ import annotations

import numpy as np

from controller.design.model import rotor_time_constant
from controller.estimator.late_commands import NOISE_ON_TRUTH, watch_truth
from controller.estimator.records import FILTER, FLYING, MOST_ROTORS, STANDING
from controller.estimator.tuning import Tuning, parameters
from controller.feedback.truth import PlainTick
from controller.hil.ticks import TickReader
from controller.law.state import STATE_SIZE, Array
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds


class DelayWatch:
    """Compares how a vehicle turns with what it was told, tick by tick."""

    def __init__(self, vehicle: Vehicle, rate_hz: float) -> None:
        """rate_hz: of the ticks."""
        self._vehicle, self._rate_hz = vehicle, rate_hz
        self._told = vehicle.loop.delay_ticks
        tuning = Tuning(
            gyroscope_std=NOISE_ON_TRUTH,
            rotor_time_constant=rotor_time_constant(vehicle),
            has_ground=vehicle.ground is not None,
        )
        self._record = np.zeros(1, dtype=FILTER)
        self._parameters = parameters(vehicle, 1.0 / rate_hz, tuning)
        self._speeds = np.zeros(MOST_ROTORS)
        self._speeds[: len(vehicle.rotors)] = [rotor.max_speed for rotor in vehicle.rotors]
        self._state, self._controls = np.zeros(STATE_SIZE), np.zeros(ACTUATOR_CONTROLS)
        self._own = watch_truth.bind(self._record, self._state, self._controls, self._speeds)
        self._memory = self._record[0]["m"]
        self._ticks = 1
        self.restart()

    @property
    def found(self) -> int:
        """Ticks after which commands are seen to act, when it is not what is reckoned with; else -1."""
        return int(self._memory["delay_found"])

    def take(self) -> int:
        """The delay that was found is reckoned with from now on; returns it, ticks, not less than told."""
        delay = max(self.found, self._told)
        self._record[0]["p"]["command_delay"] = delay
        self._forget()
        return delay

    def restart(self) -> None:
        """Forget everything: the vehicle is held at its start, or stands there."""
        self._record[...] = np.zeros((), dtype=FILTER)
        self._record["p"] = self._parameters
        memory = self._memory
        memory["vehicle_mode"], memory["grounded"] = STANDING, self._vehicle.initial.start == "ground"
        memory["delay_found"] = -1
        if not memory["grounded"]:
            speeds = hover_rotor_speeds(self._vehicle)
            memory["rotor_speed"][: len(speeds)] = speeds
        self._last_usec: int | None = None

    def begin(self, time_usec: int, state: Array) -> None:
        """A tick with this true state (18,)."""
        since = 0 if self._last_usec is None else time_usec - self._last_usec
        self._ticks = round(since * self._rate_hz / MICROSECONDS_PER_SECOND)
        self._last_usec = time_usec
        self._state[:] = state

    def answered(self, controls: Array, armed: bool) -> None:
        """The tick was answered with these controls (16,)."""
        self._controls[:] = np.nan_to_num(controls) if armed else 0.0
        self._own(self._ticks)
        if armed:
            self._memory["vehicle_mode"] = FLYING

    def unheard(self, controls: Array | None) -> None:
        """The answer came too late; the rotors had these controls (16,), or stood."""
        self.answered(np.zeros(ACTUATOR_CONTROLS) if controls is None else controls, True)
        self._forget()

    def watching(self, answer: PlainTick, reader: TickReader, controls: Array) -> PlainTick:
        """A compiled tick, and behind it the watch."""
        watch = watch_truth.bind(self._record, reader.estimate, controls, self._speeds)
        memory = self._memory

        def plain_tick(length: int, last_time_usec: int, sequence: int, until_s: float) -> int:
            if memory["delay_found"] >= 0:
                return 0
            size = answer(length, last_time_usec, sequence, until_s)
            if size:
                time_usec = reader.time_usec
                since = 0 if self._last_usec is None else time_usec - self._last_usec
                watch(int(since * self._rate_hz / MICROSECONDS_PER_SECOND + 0.5))
                self._last_usec = time_usec
            return size

        return plain_tick

    def _forget(self) -> None:
        self._memory["delay_ticks_watched"] = self._memory["delay_ticks_compared"] = 0
        self._memory["delay_found"] = -1
