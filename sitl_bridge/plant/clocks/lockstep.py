"""The lockstep clock: simulated time advances when the answer to the tick is in, and never otherwise.

A protocol object without I/O: `receive(datagram, now)`, `to_send(now)`, `next_deadline()`. Over UDP an
unanswered tick is sent again after a time-out, so loss, duplication, reordering and delay of datagrams
change how long a run takes and never what happens in it.

    state     | event                               | what happens                  | goes on to
    ----------+-------------------------------------+-------------------------------+-----------
    START     | the first tick is due               | send it                       | FREEWHEEL
              | an answer                           | the autopilot is there        | READY
    FREEWHEEL | the next tick is due                | go on to it, send it          | FREEWHEEL
              | an answer to an older tick          | the autopilot is there        | WAITING
              | the answer to this tick             | the autopilot is there;       | READY
              |                                     | the tick is over              |
    READY     | the tick is due                     | send it                       | WAITING
              | it is not due for a long time       | say HEARTBEAT                 | READY
    WAITING   | the answer to this tick             | the tick is over              | READY
              | time-out                            | send it again                 | WAITING
              | time-out after the last repeat, and | fly it with the last controls,| WAITING
              | `on_silence` is "continue"          | send the next                 |

A tick that is over has been flown under the answer's controls, or held before the scenario began. The first
armed answer begins the scenario. Any other answer is a duplicate or late, and is dropped. At speed 0 time
stands still between two ticks, and the HEARTBEATs tell the autopilot that the plant is there.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Literal

from sitl_bridge.ids import COMPONENT_TRUTH, vehicle_system
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.plant.clocks.receiver import HilReceiver
from sitl_bridge.plant.clocks.retransmission import RetransmissionTimer
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.wire.slow_frames import plant_heartbeat

REPEATS_BEFORE_NOTICE = 3
SILENCE_BEFORE_NOTICE = 1.0
"""And at least so long without an answer before anything is said, s."""

KEEP_ALIVE = 0.25
"""Between two HEARTBEATs while no tick is due, s: an autopilot takes longer silence for lost sensors."""

OnSilence = Literal["wait", "continue"]

State = Enum("State", ["START", "FREEWHEEL", "READY", "WAITING"])
"""See the table above."""


class Lockstep:
    """Simulator's side of the lockstep protocol.

    speed: simulated seconds a second at the most, None for as fast as it goes. resend: False on a link that
    loses nothing (TCP). on_silence: with "continue" a tick without an answer after three repeats is flown
    with the last controls, and counted.
    """

    def __init__(
        self,
        simulation: Simulation,
        notices: Notices,
        instance: int,
        speed: float | None = None,
        resend: bool = True,
        on_silence: OnSilence = "wait",
    ) -> None:
        self.simulation = simulation
        self.resent_ticks = 0
        """Ticks that had to be sent again, counted once for each repeat, from the scenario's beginning on."""
        self.unanswered_ticks = 0
        """Ticks flown with the last controls because no answer came."""
        self._receiver = HilReceiver(simulation, notices, instance)
        self._packer = Packer(vehicle_system(instance), COMPONENT_TRUTH)
        self._notices = notices
        self.speed = speed
        """Simulated seconds a second at the most; 0: time stands still; None: as fast as it goes."""
        self._pace = self._interval(speed)
        self._steps = 0  # ticks that may be flown at speed 0
        self._resend = resend
        self._on_silence = on_silence
        self._state = State.START
        self._due = 0.0  # when the current tick is to be sent (again)
        self._not_before = 0.0  # with a pace: earliest start of the next tick
        self._sent_at = 0.0
        self._first_sent_at = 0.0
        self._repeats = 0  # of the current tick
        self._repeated_usec: int | None = None  # the last tick that was repeated, until a second answer to it
        self._timer = RetransmissionTimer()
        self._last_controls: Array | None = None  # kept only to fly on with

    @property
    def finished(self) -> bool:
        """Whether the scenario is over."""
        return self.simulation.finished

    def start(self, now: float) -> None:
        """Begin to freewheel."""
        self._due = self._not_before = now

    def change_speed(self, speed: float | None, now: float) -> None:
        """From the end of the current tick on; 0: time stands still; None: as fast as it goes."""
        self.speed, self._pace, self._steps = speed, self._interval(speed), 0
        self._not_before = math.inf if speed == 0.0 else now
        if self._state is State.READY:
            self._wait_for_time(now)

    def step(self, ticks: int, now: float) -> None:
        """Let a world that stands still go on for so many ticks."""
        if self.speed != 0.0 or ticks <= 0:
            return
        self._steps, self._not_before = ticks, now
        if self._state is State.READY:
            self._steps -= 1
            self._due = now

    @property
    def steps_left(self) -> int:
        """Ticks that a world at speed 0 has still to go on for."""
        return self._steps

    def next_deadline(self) -> float:
        """When `to_send` has something to do at the latest."""
        return self._due

    def to_send(self, now: float) -> list[bytes]:
        """Datagrams that are due."""
        out = self._receiver.replies
        if out:
            self._receiver.replies = []
        if now < self._due:
            return out
        if self._state in (State.START, State.FREEWHEEL):
            self._freewheel(now)
        elif self._state is State.WAITING:
            self._repeat(now)
        elif now < self._not_before:
            self._wait_for_time(now)
            return [*out, self._packer.pack(plant_heartbeat())]
        if self.simulation.finished:
            return out
        self._sent_at = now
        if self._repeats == 0:
            self._first_sent_at = now
        if self._state is State.READY:
            self._state = State.WAITING
        if self._state is State.WAITING:
            self._due = now + self._timer.timeout()
            if self._repeats > 0 and not self._resend:
                return out
        return [*out, self.simulation.datagram()] if out else [self.simulation.datagram()]

    def receive(self, datagram: bytes, now: float) -> None:
        """Take a datagram from the autopilot."""
        at_once = self._state is State.WAITING and self._on_silence == "wait"
        time_usec = self.simulation.time_usec
        if at_once and self.simulation.fly_whole_tick(datagram):
            if self._repeats > 0:
                self._notices.over("silence", "autopilot answers again")
            self._answered(now, time_usec)
            return
        answer = self._receiver
        if not answer.receive(datagram):
            return
        if self._state in (State.START, State.FREEWHEEL):
            self._heard()
        if self._state is State.READY or answer.time_usec != self.simulation.time_usec:
            self._heard_again(answer.time_usec)
            return  # a duplicate, or an answer that comes too late to matter
        if self._repeats > 0:
            self._notices.over("silence", "autopilot answers again")
        if self._on_silence == "continue":
            self._last_controls = answer.controls.copy()
        begins = answer.armed and not self.simulation.started
        if begins:
            self.simulation.begin()
        self._advance(answer.controls)
        self._answered(now, answer.time_usec)
        if begins:  # what came before was start-up, and this tick was planned in
            self._timer = RetransmissionTimer()

    def _freewheel(self, now: float) -> None:
        """Until the first answer: time runs at the nominal pace, the vehicle is held."""
        if self._state is State.FREEWHEEL:
            self.simulation.next_tick()
        self._state = State.FREEWHEEL
        self._due = max(self._due + self.simulation.period, now)

    def _heard(self) -> None:
        """The autopilot has answered: no tick without an answer from here on."""
        self.simulation.heard()
        if self._state is State.FREEWHEEL:
            self._state = State.WAITING
            self._due = self._sent_at + self._timer.timeout()
        else:
            self._state = State.READY

    def _repeat(self, now: float) -> None:
        """No answer within the time-out: the same tick goes out again."""
        self._timer.expired()
        silence = self._repeats >= REPEATS_BEFORE_NOTICE
        if silence and self._on_silence == "continue" and self._last_controls is not None:
            self.unanswered_ticks += 1
            self._advance(self._last_controls)
            self._state, self._repeats = State.READY, 0
            return
        self._repeats += 1
        if silence and now - self._first_sent_at >= SILENCE_BEFORE_NOTICE:
            self._notices.once("silence", "no answer from the autopilot: the world waits for it")
        if self.simulation.started and self._resend:
            self.resent_ticks += 1

    def _heard_again(self, time_usec: int) -> None:
        """A second answer to a tick that was repeated: the time-out was too short."""
        if time_usec == self._repeated_usec:
            self._repeated_usec = None
            self._timer.repeated_needlessly()

    def _advance(self, controls: Array) -> None:
        if self.simulation.started:
            self.simulation.step(controls)
        else:
            self.simulation.next_tick()

    def _answered(self, now: float, time_usec: int) -> None:
        """The tick of `time_usec` is over, the next is due."""
        if self._repeats == 0:
            self._timer.sample(now - self._sent_at)
        else:
            self._timer.over()
            self._repeated_usec = time_usec
        self._state, self._repeats = State.READY, 0
        self._due = now
        if self._pace is None:
            return
        if self._steps > 0:
            self._steps -= 1
            return
        self._not_before = max(self._not_before + self._pace, now - self._pace)
        self._wait_for_time(now)

    def _wait_for_time(self, now: float) -> None:
        self._due = max(now, min(self._not_before, now + KEEP_ALIVE))

    def _interval(self, speed: float | None) -> float | None:
        """Between two ticks, s; None: none."""
        if speed is None:
            return None
        return self.simulation.period / speed if speed > 0.0 else math.inf
