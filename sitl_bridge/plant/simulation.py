"""The simulation as the HIL link sees it: ticks out, rotor commands in, a scenario in between. No I/O.

The clock (`lockstep`, `realtime`) decides when a tick happens; this decides what happens in it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import common

from sitl_bridge.frames import MICROSECONDS_PER_SECOND, LocalOrigin
from sitl_bridge.mavlink.framing import Frame, decode
from sitl_bridge.mavlink.hil import HIL_STATE_QUATERNION, ODOMETRY, SENSOR_RESET
from sitl_bridge.plant.faults.schedule import (
    Action,
    Faults,
    from_command,
    lightest_load,
    timeline,
    with_gusts,
)
from sitl_bridge.plant.log.rows import CHUNK_ROWS, WIDTH
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.tick import exchange
from sitl_bridge.plant.wire.answers import AnswerReader
from sitl_bridge.plant.wire.messages import TRUTH, TickWriter
from sitl_bridge.plant.wire.slow_frames import LoadOnMap, SlowFrames
from sitl_bridge.vehicle.description import Vehicle


class Recorder(Protocol):
    """Takes the state of each tick of the scenario."""

    @property
    def table(self) -> Array | None:
        """Rows as in `rows` (CHUNK_ROWS, WIDTH), where a tick may fill in the next itself; None: there are
        none, call `record`."""

    @property
    def count(self) -> int:
        """Number of the next row in `table`."""

    def record(self, time_s: float, world: World) -> None:
        """Keep the world as it is at scenario time `time_s`, with the rotors as commanded from now on."""

    def took_row(self) -> None:
        """The next row is filled in."""


class Diverged(ArithmeticError):
    """The state is not finite any more: what was described cannot be simulated."""


NO_FAULTS = Faults()
_FAULT_GRAIN = 1e-9  # s; a fault at a tick's time happens at that tick, rounding or not
BATTERY_STEP = 0.04
"""So often the battery is drawn on, s: its charge needs no tick."""


class Simulation:
    """One run: freewheeling and held first, then the scenario from the first armed answer on."""

    def __init__(
        self,
        vehicle: Vehicle,
        rate_hz: float,
        seed: int,
        instance: int = 0,
        duration_s: float | None = None,
        recorder: Recorder | None = None,
        on_begin: Callable[[], None] = lambda: None,
        faults: Faults = NO_FAULTS,
    ) -> None:
        self.rate_hz = rate_hz
        self.period = 1.0 / rate_hz
        self.world = World(with_gusts(vehicle, faults), rate_hz, seed, lightest_load(faults))
        self._faults = timeline(faults)
        self._faults_done = 0
        self._injected: dict[tuple[Any, ...], Action] = {}
        self.tick = 0
        """Number of the current tick."""
        self.time_usec = 0
        """`time_usec` of the current tick: above 0, and only growing."""
        self.finished = False
        """Whether the scenario's duration is over."""
        self.ticks_flown = 0
        """Ticks of the scenario that are over."""
        self.started = False
        """Whether the scenario has begun."""
        self._last_tick = None if duration_s is None else max(1, round(duration_s * rate_hz))
        self._vehicle = vehicle
        self._delay_ticks = vehicle.loop.delay_ticks
        self._on_begin = on_begin
        self._first_sensed = 0
        self._sensors_due = False
        self._truth = False
        self._heard = False
        home = vehicle.home
        self.origin = LocalOrigin(home.latitude, home.longitude, home.altitude)
        self.answers = AnswerReader(instance)
        """Reads what the autopilot says."""
        self._writer = TickWriter(instance, self.origin, self.world)
        self._slow = SlowFrames(
            LoadOnMap(self.origin),
            self._writer.load,
            self._writer.vehicle,
            vehicle.battery,
            rate_hz,
        )
        self._power = self.world.battery(0.0)
        self._battery_every = max(1, round(BATTERY_STEP * rate_hz))
        self._under_way: deque[Array] = deque()
        self.record_with(recorder)
        self._datagram: bytes | None = None
        self._ticks_left = 0  # on which nothing is due but what `exchange` does
        self._go_to_tick(0)

    def record_with(self, recorder: Recorder | None) -> None:
        """Have the states of the scenario kept from now on."""
        self._recorder = recorder
        table = None if recorder is None else recorder.table
        self._exchange = exchange.bind(
            *self.answers.arrays,
            *self.world.arrays(),
            np.zeros((CHUNK_ROWS, WIDTH)) if table is None else table,
            *self._writer.arrays,
        )

    @property
    def scenario_time(self) -> float:
        """Seconds since the scenario began."""
        return self.ticks_flown / self.rate_hz

    def datagram(self) -> bytes:
        """The current tick's frames; the same bytes as often as it is asked for.

        Raises Diverged. Ticks that `exchange` flies are not looked at, but GPS has it give way many times a
        second.
        """
        if self._datagram is None:
            if not math.isfinite(sum(self.world.state.tolist())):
                raise Diverged(f"the state is not finite any more at t = {self.scenario_time:.3f} s")
            fresh = self._sensors_due and self.tick >= self._first_sensed
            if fresh:
                self._begin_sensing()
            tick, time_usec, world = self.tick - self._first_sensed, self.time_usec, self.world
            fix = world.measure(tick, not self.started)
            if fresh:
                world.measurement["updated"] |= SENSOR_RESET
            seen = None if world.tracker is None else world.tracker.sample(tick, world.state)
            slow = self._slow.frames(tick, time_usec, world.state, self._power, seen)
            wanted = TRUTH if self._truth and self._heard else 0
            self._datagram = slow + self._writer.datagram(time_usec, fix, wanted)
            self._ticks_left = self._count_ticks_left() if self.started else 0
        return self._datagram

    def heard(self) -> None:
        """The autopilot has answered a tick; truth, where asked for, goes out from the next tick on.

        So an autopilot that flies on truth arms only when the plant is known to hear its answers, and the
        step that arms it is the scenario's first. The sensors begin afresh with the next tick, which says so
        (HIL_SENSOR_UPDATED_RESET): an autopilot that aligns its estimate from there on, for a number of
        ticks, does the same whenever it was started.
        """
        if not self._heard:
            self._heard = True
            self._first_sensed = self.tick + 1
            self._sensors_due = True

    def _begin_sensing(self) -> None:
        self.world.reset_sensors()
        self._sensors_due = False
        self._inject(self._injected.values())

    def _inject(self, actions: Iterable[Action]) -> None:
        """Let something fail by command: also over the resets until the scenario begins."""
        for action in list(actions):
            action.apply(self.world)
            if not self.started:
                self._injected[type(action), action[:1]] = action

    def ask_for_truth(self, wanted: bool) -> None:
        """Send ODOMETRY of vehicle and load with every tick, or no more."""
        self._truth = wanted

    def begin(self) -> None:
        """The scenario begins at the current tick: initial state, fresh random streams of what acts.

        The sensors go on as they are: biases that were estimated before the start stay what they are.
        """
        self.world.reset_motion()
        if self._sensors_due:
            self._begin_sensing()
        self.started = True
        self._ticks_left = 0
        self._under_way.clear()
        for _ in range(self._delay_ticks):
            self._under_way.append(np.array(self.world.initial_controls))
        self._faults_done = 0
        self._power = self.world.battery(0.0)
        self._inject(self._injected.values())
        self._apply_faults()
        self._on_begin()

    def next_tick(self) -> None:
        """Go on to the next tick while the vehicle is held."""
        self._go_to_tick(self.tick + 1)

    def _go_to_tick(self, tick: int) -> None:
        self.tick = tick
        self.time_usec = self._time_usec(tick)
        self._datagram = None

    def _time_usec(self, tick: int) -> int:
        return round((tick + 1) * MICROSECONDS_PER_SECOND / self.rate_hz)

    def step(self, controls: Array) -> None:
        """Fly one tick under the controls (16,) that answer it (later by the loop's delay)."""
        if self._delay_ticks:
            self._under_way.append(controls.copy())
            controls = self._under_way.popleft()
        self.world.command(controls)
        self.record()
        self.world.advance(self.world.steps_per_tick)
        self.finish_tick()

    def exchange(self, datagram: bytes) -> bool:
        """Fly the current tick and have the next one's frames ready, in one go: True.

        Only if the datagram is the armed answer to the tick and nothing else is due; where this returns False
        nothing has happened, and the datagram is to be taken apart.
        """
        if self._ticks_left <= 0:
            return False
        answers, recorder, tick, length = self.answers, self._recorder, self.tick + 1, len(datagram)
        answers.view[:length] = datagram
        next_time_usec = self._time_usec(tick)
        size = self._exchange(
            length,
            answers.system,
            self.time_usec,
            next_time_usec,
            *self.world.next_steps(),
            tick - self._first_sensed,
            -1 if recorder is None else recorder.count,
            TRUTH if self._truth else 0,
            self.ticks_flown / self.rate_hz,
        )
        if size == 0:
            return False
        self.world.flown()
        if recorder is not None:
            recorder.took_row()
        self.tick, self.time_usec = tick, next_time_usec
        self.ticks_flown += 1
        self._ticks_left -= 1
        self._datagram = self._writer.written(size)
        return True

    def _count_ticks_left(self) -> int:
        """For how many ticks from the current one on nothing is due but what `exchange` does."""
        recorder = self._recorder
        if self._delay_ticks or self._sensors_due or (recorder is not None and recorder.table is None):
            return 0
        sensed, flown = self.tick - self._first_sensed, self.ticks_flown
        ticks = min(self.world.ticks_left(sensed), self._slow.ticks_left(sensed))
        if self._power is not None:
            ticks = min(ticks, self._battery_every - 1 - flown % self._battery_every)
        if self._last_tick is not None:
            ticks = min(ticks, self._last_tick - 1 - flown)
        if self._faults_done < len(self._faults):
            due = math.ceil((self._faults[self._faults_done].time - _FAULT_GRAIN) * self.rate_hz)
            ticks = min(ticks, due - 1 - flown)
        return ticks

    def record(self) -> None:
        """Record the world at the current tick, with the rotors as they are commanded now."""
        if self._recorder is not None:
            self._recorder.record(self.scenario_time, self.world)

    def finish_tick(self) -> None:
        """The tick is over: the next one is the current one; the scenario's last is recorded too."""
        self.ticks_flown += 1
        if self.ticks_flown % self._battery_every == 0:
            self._power = self.world.battery(self._battery_every * self.period)
        if self._faults:
            self._apply_faults()
        self.next_tick()
        if self.ticks_flown == self._last_tick:
            self.finished = True
            self.record()

    def _apply_faults(self) -> None:
        """Let happen what is due at this tick of the scenario."""
        while self._faults_done < len(self._faults):
            due = self._faults[self._faults_done]
            if due.time > self.scenario_time + _FAULT_GRAIN:
                break
            due.action.apply(self.world)
            self._faults_done += 1

    def handle(self, frame: Frame) -> bytes | None:
        """Answer anything else that the autopilot says; the reply, if one is due.

        SET_MESSAGE_INTERVAL for ODOMETRY asks for truth at every tick, for HIL_STATE_QUATERNION for that at
        its interval; INJECT_FAILURE lets something fail. A HEARTBEAT needs no reaction.
        """
        if frame.message_id != common.MAVLINK_MSG_ID_COMMAND_LONG:
            return None
        command = decode(frame)
        result = common.MAV_RESULT_ACCEPTED
        if command.command == common.MAV_CMD_INJECT_FAILURE:
            actions = from_command(command.param1, command.param2, command.param3, len(self._vehicle.rotors))
            self._inject(actions or ())
            result = common.MAV_RESULT_UNSUPPORTED if actions is None else result
        elif command.command == common.MAV_CMD_SET_MESSAGE_INTERVAL and command.param1 == ODOMETRY.message_id:
            self.ask_for_truth(command.param2 >= 0)
        elif (
            command.command == common.MAV_CMD_SET_MESSAGE_INTERVAL
            and command.param1 == HIL_STATE_QUATERNION.message_id
        ):
            self._writer.state.every(command.param2)
        else:
            return None
        acknowledgement: Any = common.MAVLink_command_ack_message(
            command=command.command,
            result=result,
            progress=0,
            result_param2=0,
            target_system=frame.system,
            target_component=frame.component,
        )
        return self._writer.vehicle.pack(acknowledgement)
