"""The real-time clock: ticks at absolute deadlines, commands take effect when they arrive.

A protocol object without I/O: `receive(datagram, now)`, `to_send(now)`, `next_deadline()`. Late ticks are
counted; lost time is not made up in a burst. An autopilot that is silent for longer than the time-out has
its rotors stopped.
"""

from __future__ import annotations

from collections import deque

from sitl_bridge.mavlink.hil import ROTORS_STOP_AFTER
from sitl_bridge.plant.clocks.lateness import Lateness
from sitl_bridge.plant.clocks.receiver import HilReceiver
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import STOPPED, Array
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.stages import Command

AUTOPILOT_TIMEOUT = ROTORS_STOP_AFTER
"""Silence after which the rotors stop, s."""


class Realtime:
    """Simulator's side of the HIL link against the wall clock."""

    def __init__(self, simulation: Simulation, notices: Notices, instance: int) -> None:
        self.simulation = simulation
        self.late_ticks = 0
        """Ticks that began a whole period late or more, from the scenario's beginning on."""
        self.lateness = Lateness()
        """By how much the ticks of the scenario missed their deadlines."""
        self._receiver = HilReceiver(simulation, notices, instance)
        self._notices = notices
        self._deadline = 0.0  # of the next tick
        self._tick_began = 0.0  # deadline of the current tick
        self._pending: deque[tuple[float, Array]] = deque()  # (when it acts, controls)
        self._last_answer: float | None = None
        self._last_time_usec = 0
        self._sent = False
        delay = simulation.world.vehicle.loop.delay_ticks
        self._loop_delay = delay * simulation.period

    @property
    def finished(self) -> bool:
        """Whether the scenario is over."""
        return self.simulation.finished

    def start(self, now: float) -> None:
        """Begin to freewheel."""
        self._deadline = now

    def next_deadline(self) -> float:
        """When the next tick is due."""
        return self._deadline

    def receive(self, datagram: bytes, now: float) -> None:
        """Take a datagram from the autopilot; its command takes effect now."""
        answer = self._receiver
        if not answer.receive(datagram) or answer.time_usec < self._last_time_usec:
            return  # nothing, or an answer that a newer one has overtaken
        if answer.time_usec > self.simulation.time_usec:
            self._notices.once("future", "an answer to a tick that has not happened yet: ignored")
            return
        self._last_time_usec = answer.time_usec
        self.simulation.heard()
        self._notices.over("silence", "autopilot answers again")
        self._last_answer = now
        if answer.armed and not self.simulation.started:
            self.simulation.begin()
        if self.simulation.started:
            self._pending.append((now + self._loop_delay, answer.controls.copy()))

    def to_send(self, now: float) -> list[bytes]:
        """Datagrams that are due: fly the tick that is over, begin the next."""
        out = self._receiver.replies
        if out:
            self._receiver.replies = []
        if now < self._deadline or self.finished:
            return out
        if self.simulation.started:
            self._fly_tick(now)
        elif self._sent:
            self.simulation.next_tick()
        self._sent = True
        self._keep_pace(now)
        if self.finished:
            return out
        return [*out, self.simulation.datagram()]

    def _keep_pace(self, now: float) -> None:
        """Set the next absolute deadline; time that is lost stays lost."""
        period = self.simulation.period
        lateness = now - self._deadline
        if self.simulation.started:
            self.lateness.add(lateness)
        if lateness >= period:
            if self.simulation.started:
                self.late_ticks += 1
            self._deadline = now
        self._tick_began = self._deadline
        self._deadline += period

    def _fly_tick(self, now: float) -> None:
        """Advance over the tick that ends now, each command from the substep on in which it arrived."""
        simulation = self.simulation
        steps = simulation.world.steps_per_tick
        commands: list[Command] = []
        acts_from = 0
        while self._pending and self._pending[0][0] <= now:
            arrival, controls = self._pending.popleft()
            share = (arrival - self._tick_began) / simulation.period
            acts_from = max(acts_from, min(steps, round(share * steps)))
            commands.append(Command(acts_from, controls))
        if self._last_answer is not None and now - self._last_answer > AUTOPILOT_TIMEOUT:
            self._notices.once(
                "silence", f"no answer from the autopilot for {AUTOPILOT_TIMEOUT} s: rotors stopped"
            )
            self._pending.clear()
            commands.append(Command(acts_from, STOPPED))
        simulation.fly_tick(commands)
