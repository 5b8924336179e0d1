"""The simulation as the HIL link sees it: ticks out, rotor commands in, a scenario in between. No I/O.

The clock (`lockstep`, `realtime`) decides when a tick happens; this decides what happens in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from pymavlink.dialects.v20 import common

from sitl_bridge.frames import MICROSECONDS_PER_SECOND, LocalOrigin
from sitl_bridge.mavlink.framing import Frame, decode
from sitl_bridge.mavlink.hil import HIL_STATE_QUATERNION, ODOMETRY, SENSOR_RESET
from sitl_bridge.plant.faults import Faults, from_command, timeline, with_gusts
from sitl_bridge.plant.messages import STATE, TRUTH, TickWriter
from sitl_bridge.plant.slow_frames import LoadOnMap, SlowFrames
from sitl_bridge.plant.world import World
from sitl_bridge.vehicle import Vehicle


class Recorder(Protocol):
    """Takes the state of each tick of the scenario."""

    def record(self, time_s: float, world: World) -> None:
        """Keep the world as it is at scenario time `time_s`, with the rotors as commanded from now on."""


NO_FAULTS = Faults()
BATTERY_STEP = 0.04
"""So often the battery is drawn on, s: its charge needs no tick."""


class Paced:
    """A message that goes out at an interval, on average, as near as ticks allow."""

    def __init__(self) -> None:
        self._interval: float | None = None
        self._due = 0.0

    def every(self, interval_us: float) -> None:
        """As SET_MESSAGE_INTERVAL has it: microseconds; 0: at every tick; negative: never."""
        self._interval = None if interval_us < 0 else interval_us
        self._due = 0.0

    def due(self, time_usec: int) -> bool:
        """Whether it goes out at this tick; to be asked once a tick."""
        if self._interval is None or time_usec < self._due:
            return False
        self._due = max(self._due + self._interval, time_usec)
        return True


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
        self.world = World(with_gusts(vehicle, faults), rate_hz, seed)
        self._faults = timeline(faults)
        self._faults_done = 0
        self.tick = 0
        """Number of the current tick; its `time_usec` is that of tick_time(tick)."""
        self.ticks_flown = 0
        """Ticks of the scenario that are over."""
        self.started = False
        """Whether the scenario has begun."""
        self._last_tick = None if duration_s is None else round(duration_s * rate_hz)
        self._vehicle = vehicle
        self.recorder = recorder
        self._on_begin = on_begin
        self._first_sensed = 0
        self._sensors_due = False
        self._truth = False
        self._heard = False
        home = vehicle.home
        self.origin = LocalOrigin(home.latitude, home.longitude, home.altitude)
        self._writer = TickWriter(instance, self.origin, self.world)
        self._slow = SlowFrames(
            LoadOnMap(instance, self.origin),
            self._writer.load,
            self._writer.vehicle,
            vehicle.battery,
            rate_hz,
        )
        self._power = self.world.battery(0.0)
        self._battery_every = max(1, round(BATTERY_STEP * rate_hz))
        self._state = Paced()
        self._under_way: deque[Sequence[float]] = deque()
        self._datagram: bytes | None = None

    @property
    def time_usec(self) -> int:
        """`time_usec` of the current tick: above 0, and only growing."""
        return round((self.tick + 1) * MICROSECONDS_PER_SECOND / self.rate_hz)

    @property
    def scenario_time(self) -> float:
        """Seconds since the scenario began."""
        return self.ticks_flown / self.rate_hz

    @property
    def finished(self) -> bool:
        """Whether the scenario's duration is over."""
        return self._last_tick is not None and self.ticks_flown >= self._last_tick

    def datagram(self) -> bytes:
        """The current tick's frames; the same bytes as often as it is asked for."""
        if self._datagram is None:
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
            if self._state.due(time_usec):
                wanted |= STATE
            self._datagram = slow + self._writer.datagram(time_usec, fix, wanted)
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
        self._under_way.clear()
        for _ in range(self._vehicle.loop.delay_ticks):
            self._under_way.append(self.world.trim_controls)
        self._faults_done = 0
        self._power = self.world.battery(0.0)
        self._apply_faults()
        self._on_begin()

    def next_tick(self) -> None:
        """Go on to the next tick while the vehicle is held."""
        self.tick += 1
        self._datagram = None

    def step(self, controls: Sequence[float]) -> None:
        """Fly one tick under the controls that answer it (later by the loop's delay)."""
        if self._vehicle.loop.delay_ticks:
            self._under_way.append(controls)
            controls = self._under_way.popleft()
        self.world.command(controls)
        self.record()
        self.world.advance(self.world.steps_per_tick)
        self.finish_tick()

    def record(self) -> None:
        """Record the world at the current tick, with the rotors as they are commanded now."""
        if self.recorder is not None:
            self.recorder.record(self.scenario_time, self.world)

    def finish_tick(self) -> None:
        """The tick is over: the next one is the current one; the scenario's last is recorded too."""
        self.ticks_flown += 1
        if self.ticks_flown % self._battery_every == 0:
            self._power = self.world.battery(self._battery_every * self.period)
        self._apply_faults()
        self.next_tick()
        if self.finished:
            self.record()

    def _apply_faults(self) -> None:
        """Let happen what is due at this tick of the scenario."""
        while self._faults_done < len(self._faults):
            due = self._faults[self._faults_done]
            if due.time > self.scenario_time + 1e-9:
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
            for action in actions or ():
                action.apply(self.world)
            result = common.MAV_RESULT_UNSUPPORTED if actions is None else result
        elif command.command == common.MAV_CMD_SET_MESSAGE_INTERVAL and command.param1 == ODOMETRY.message_id:
            self.ask_for_truth(command.param2 >= 0)
        elif (
            command.command == common.MAV_CMD_SET_MESSAGE_INTERVAL
            and command.param1 == HIL_STATE_QUATERNION.message_id
        ):
            self._state.every(command.param2)
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
