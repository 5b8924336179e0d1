"""The simulation as the HIL link sees it: ticks out, rotor commands in, a scenario in between. No I/O.

The clock (`lockstep`, `realtime`) decides when a tick happens; this decides what happens in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import common

from sitl_bridge.frames import MICROSECONDS_PER_SECOND, LocalOrigin
from sitl_bridge.mavlink.framing import Frame, decode
from sitl_bridge.mavlink.hil import HIL_STATE_QUATERNION, ODOMETRY
from sitl_bridge.plant.faults.due import DueFaults
from sitl_bridge.plant.faults.schedule import Action, Faults, from_command, lightest_load, with_gusts
from sitl_bridge.plant.log.rows import CHUNK_ROWS, WIDTH
from sitl_bridge.plant.lost_vehicle import GRACE, LOOK_INTERVAL, LOOKS, is_lost, upright
from sitl_bridge.plant.physics.battery import BatteryReading
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.sensing import Diverged, Sensing
from sitl_bridge.plant.stages import (
    EVER,
    Command,
    LoopDelay,
    Stage,
    always_due,
    due_rules,
    interval_ticks_left,
    never_due,
    run,
    ticks_left,
)
from sitl_bridge.plant.tick import NO_DATAGRAM, fly_whole_tick
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


NO_FAULTS = Faults()
BATTERY_STEP = 0.04
"""Interval at which the battery is drawn on, s."""


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
        end_when_lost: bool = False,
        on_fault: Callable[[str], None] = lambda text: None,
    ) -> None:
        """end_when_lost: end the scenario a few seconds after the vehicle turned over, fell or ran away.

        on_fault: told in words what begins to fail, or works again.
        """
        self.rate_hz = rate_hz
        self.period = 1.0 / rate_hz
        self.world = World(with_gusts(vehicle, faults), rate_hz, seed, lightest_load(faults))
        self._faults = DueFaults(faults, rate_hz)
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
        self._delay = LoopDelay(vehicle.loop.delay_ticks)
        self._on_begin = on_begin
        self._on_fault = on_fault
        self._truth = False
        self._heard = False
        home = vehicle.home
        self.origin = LocalOrigin(home.latitude, home.longitude, home.altitude)
        self.answers = AnswerReader(instance)
        """Reads what the autopilot says."""
        self._writer = TickWriter(instance, self.origin, self.world)
        slow = SlowFrames(
            LoadOnMap(self.origin),
            self._writer.load,
            self._writer.vehicle,
            vehicle.battery,
            vehicle.winch,
            rate_hz,
        )
        self._sensing = Sensing(self.world, self._writer, slow, self._inject_again)
        self._power = self.world.battery(0.0)
        self._battery_every = max(1, round(BATTERY_STEP * rate_hz))
        self._lost_looks = 0  # in a row
        self._look_every = max(1, round(LOOK_INTERVAL * rate_hz)) if end_when_lost else None
        self._commands: Sequence[Command] = ()
        self._datagram: bytes | None = None
        self._ticks_left = 0  # that may be flown whole
        self.record_with(recorder)
        self._go_to_tick(0)

    def _stages_of_flight(self) -> tuple[Stage, ...]:
        """From the answer to the tick's end."""
        world, recorder = self.world, self._recorder
        in_table = never_due if recorder is None or recorder.table is not None else always_due
        took_row = None if recorder is None else recorder.took_row
        return (
            Stage("loop delay", self._hold_back_command, self._delay.due_rule),
            Stage("commands at the start", self._start_commands, never_due),
            Stage("row of the log", self.record, in_table, took_row),
            Stage("motion", self._move, world.motion_ticks_left, world.count_tick),
            Stage("tick count", self._count_tick, never_due),
            Stage("battery", self._draw_on_battery, self._battery_ticks_left),
            Stage("faults", self._apply_faults, self._fault_ticks_left),
            Stage("next tick", self.next_tick, never_due),
            Stage("lost vehicle", self._look_for_loss, self._look_ticks_left),
            Stage("end of the scenario", self._end, self._end_ticks_left),
        )

    def record_with(self, recorder: Recorder | None) -> None:
        """Have the states of the scenario kept from now on."""
        self._recorder = recorder
        self._ticks_left = 0
        self._flying = self._stages_of_flight()
        stages = (*self._flying, *self._sensing.stages)
        self._due_rules = due_rules(stages)
        self._counts = [stage.count for stage in stages if stage.count is not None]
        table = None if recorder is None else recorder.table
        self._fly_whole_tick = fly_whole_tick.bind(
            *self.answers.arrays,
            self.world.record,
            np.zeros((CHUNK_ROWS, WIDTH)) if table is None else table,
            *self._writer.arrays,
        )

    @property
    def scenario_time(self) -> float:
        """Seconds since the scenario began."""
        return self.ticks_flown / self.rate_hz

    @property
    def power(self) -> BatteryReading | None:
        """What the battery's power module told last; None: there is no battery."""
        return self._power

    def datagram(self) -> bytes:
        """The current tick's frames; the same bytes as often as it is asked for.

        Raises Diverged: not after every tick that is flown whole, but several times a second, when GPS is
        due.
        """
        if self._datagram is None:
            wanted = TRUTH if self._truth and self._heard else 0
            try:
                self._datagram = self._sensing.datagram(
                    self.tick, self.time_usec, not self.started, self._power, wanted
                )
            except Diverged as error:
                raise Diverged(f"{error} at t = {self.scenario_time:.3f} s") from None
            self._ticks_left = ticks_left(self._due_rules) if self.started else 0
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
            self._sensing.first_tick = self.tick + 1
            self._sensing.due = True

    def _inject_again(self) -> None:
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
        if self._sensing.due:
            self._sensing.begin_afresh()
        self.started = True
        self._ticks_left = 0
        self._delay.restart(np.array(self.world.initial_controls))
        self._faults.restart()
        self._power = self.world.battery(0.0)
        self._inject_again()
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
        self._commands = (Command(0, controls),)
        run(self._flying)

    def fly_tick(self, commands: Sequence[Command]) -> None:
        """Fly the current tick under commands that act from an integration step of it on, in order.

        For a clock that delays commands by itself. The tick is flown whole where that is the same.
        """
        if self._ticks_left > 0 and all(command.step == 0 for command in commands):
            for command in commands:
                self.world.command(command.controls)
            self._fly_whole(NO_DATAGRAM)
            return
        self._commands = commands
        run(self._flying[1:])

    def fly_whole_tick(self, datagram: bytes) -> bool:
        """Fly the current tick and have the next one's frames ready, in one go: True.

        Only if the datagram is the armed answer to the tick and nothing else is due; where this returns False
        nothing has happened, and the datagram is to be taken apart.
        """
        if self._ticks_left <= 0:
            return False
        length = len(datagram)
        self.answers.view[:length] = datagram
        return self._fly_whole(length)

    def _fly_whole(self, length: int) -> bool:
        """The compiled tick on the datagram of this length, or on the commands as they are (NO_DATAGRAM)."""
        recorder, tick = self._recorder, self.tick + 1
        next_time_usec = self._time_usec(tick)
        size = self._fly_whole_tick(
            length,
            self.time_usec,
            next_time_usec,
            *self.world.next_steps(),
            tick - self._sensing.first_tick,
            -1 if recorder is None else recorder.count,
            TRUTH if self._truth else 0,
            self.ticks_flown / self.rate_hz,
        )
        if size == 0:
            return False
        for count in self._counts:
            count()
        self.tick, self.time_usec = tick, next_time_usec
        self.ticks_flown += 1
        self._ticks_left -= 1
        self._datagram = self._writer.written(size)
        return True

    # The stages of a flight.

    def _hold_back_command(self) -> None:
        if self._delay.ticks:
            self._commands = [Command(c.step, self._delay.passed(c.controls)) for c in self._commands]

    def _start_commands(self) -> None:
        for command in self._commands:
            if command.step == 0:
                self.world.command(command.controls)

    def record(self) -> None:
        """Record the world at the current tick, with the rotors as they are commanded now."""
        if self._recorder is not None:
            self._recorder.record(self.scenario_time, self.world)

    def _move(self) -> None:
        flown = 0
        for command in self._commands:
            if command.step > 0:
                self.world.advance(command.step - flown)
                self.world.command(command.controls)
                flown = command.step
        self.world.advance(self.world.steps_per_tick - flown)

    def _count_tick(self) -> None:
        self.ticks_flown += 1

    def _draw_on_battery(self) -> None:
        if self.ticks_flown % self._battery_every == 0:
            self._power = self.world.battery(self._battery_every * self.period)

    def _battery_ticks_left(self) -> int:
        return EVER if self._power is None else interval_ticks_left(self._battery_every, self.ticks_flown)

    def _apply_faults(self) -> None:
        for action in self._faults.apply(self.world, self.ticks_flown):
            self._on_fault(str(action))

    def _fault_ticks_left(self) -> int:
        left = self._faults.ticks_left(self.ticks_flown)
        return EVER if left is None else left

    def _look_for_loss(self) -> None:
        """A few seconds after the vehicle is lost the scenario is over."""
        if self._look_every is None or self.ticks_flown % self._look_every:
            return
        lost = is_lost(self._vehicle, self.world.state)
        self._lost_looks = self._lost_looks + 1 if lost else 0
        if self._lost_looks >= LOOKS or (lost and upright(self.world.state) < 0.0):
            end = self.ticks_flown + round(GRACE * self.rate_hz)
            self._last_tick = end if self._last_tick is None else min(end, self._last_tick)
            self._look_every = None

    def _look_ticks_left(self) -> int:
        return EVER if self._look_every is None else interval_ticks_left(self._look_every, self.ticks_flown)

    def _end(self) -> None:
        """The scenario's last state is recorded too."""
        if self.ticks_flown == self._last_tick:
            self.finished = True
            self.record()

    def _end_ticks_left(self) -> int:
        return EVER if self._last_tick is None else self._last_tick - 1 - self.ticks_flown

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
            for action in actions or ():
                self._on_fault(str(action))
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
