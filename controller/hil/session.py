"""The autopilot's side of the HIL link as a protocol object: one answer for each tick. No I/O.

A repeated tick gets the same bytes again, without a second control step; a tick that a newer one has
overtaken gets none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import TYPE_CHECKING, Protocol

from pymavlink.dialects.v20 import common

from controller.feedback.truth import Feedback, PlainTick, TruthFeedback
from controller.hil.answers import AnswerWriter
from controller.hil.backlog import Silence
from controller.hil.tick_rate import TickRate
from controller.hil.ticks import Tick, TickReader
from controller.law.control_law import Law
from controller.law.state import Array
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.ids import COMPONENT_AUTOPILOT, COMPONENT_TRUTH, vehicle_system
from sitl_bridge.mavlink.framing import Frame, Packer
from sitl_bridge.mavlink.hil import ODOMETRY

if TYPE_CHECKING:
    from controller.pilot.terms_log import TermsLog

PLANT_TIMEOUT = 1.0
"""Silence of the plant after which it is said to be gone, s."""
REQUEST_INTERVAL = 0.2
"""Between two requests for truth, s."""
HIL_STATE_QUATERNION = common.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
PX4_STATE_INTERVAL_US = 5000  # what PX4 asks a simulator for on connecting


def is_plant_heartbeat(frame: Frame) -> bool:
    """Whether the plant says that it is there while its time stands still or runs slowly."""
    return frame.message_id == common.MAVLINK_MSG_ID_HEARTBEAT and frame.component == COMPONENT_TRUTH


class Pilot(Protocol):
    """What flies: it has the rotor commands of the next answer ready after each step."""

    @property
    def armed(self) -> bool:
        """Whether the rotors turn."""

    @property
    def law(self) -> Law | None:
        """The arrays of `control_step`, while that may be all there is to `step`; None: it is not."""

    def whole_until(self, now: float) -> float:
        """The plant's time, s, before which `step` would do no more than `control_step` on `law`."""

    def flown_whole(self, time_usec: int, now: float) -> None:
        """A compiled tick did `control_step` instead of `step`, at the tick of `time_usec`."""

    @property
    def terms(self) -> Array | None:
        """What the last command is made of, see `terms_log.Termed`."""

    def step(self, estimate: Array, time_usec: int, now: float) -> None:
        """One control step on an estimate (18,), eq. 31, of the tick of `time_usec`."""

    def hear(self, frame: Frame, now: float) -> None:
        """Take anything else that the plant says."""

    def attend(self, reader: TickReader) -> None:
        """Where the sensors of each tick can be looked at; told once, before the first."""

    def disarm(self) -> None:
        """Stop the rotors; the next step starts afresh."""

    def act_late(self, ticks: int) -> None:
        """Commands have been found to act so many ticks late, which is more than was told."""


class HilSession:
    """Answers the ticks of one plant; `receive(datagram, now)`, `to_send(now)`, `next_deadline()`."""

    def __init__(
        self,
        autopilot: Pilot,
        writer: AnswerWriter,
        packer: Packer,
        instance: int,
        say: Callable[[str], None],
        feedback: Feedback,
        tick_rate: TickRate | None = None,
        terms_log: TermsLog | None = None,
    ) -> None:
        self.steps = 0
        """Control steps made."""
        self._autopilot = autopilot
        self._writer = writer
        self._packer = packer
        self._say = say
        self._reader = TickReader(instance)
        autopilot.attend(self._reader)
        self._feedback = feedback
        self._tick_rate = tick_rate
        self._terms_log = terms_log
        self._loop_delay: int | None = None
        self._law: Law | None = None
        self._plain_tick: PlainTick | None = None  # of that law
        self._instance = instance
        self._out: list[bytes] = []
        self._last_time = 0
        self._newest = 0
        """`time_usec` of the last tick that is known to have come"""
        self._silence: Silence | None = None  # while ticks come too late to be answered in time
        self._was_late = False
        self._last_answer: bytes | None = None
        self._last_tick = b""  # the datagram to which that was the answer, if given in one compiled call
        self._armed_at: int | None = None
        """`time_usec` of the first armed answer"""
        self._last_heard: float | None = None
        self._next_request = 0.0

    @property
    def scenario_time(self) -> float | None:
        """s since the first armed answer; None before it."""
        if self._armed_at is None:
            return None
        return max(0.0, (self._last_time - self._armed_at) / MICROSECONDS_PER_SECOND)

    def next_deadline(self) -> float:
        """When the plant's silence is worth a word."""
        return float("inf") if self._last_heard is None else self._last_heard + PLANT_TIMEOUT

    def to_send(self, now: float) -> list[bytes]:
        """Datagrams for the plant."""
        if self._last_heard is not None and now >= self._last_heard + PLANT_TIMEOUT:
            self._say(f"no HIL_SENSOR for {PLANT_TIMEOUT:g} s: waiting for the plant")
            self._last_heard = None
        if not self._out:
            return []
        out, self._out = self._out, []
        return out

    def expect(self, datagrams: Sequence[bytes]) -> None:
        """These have come from the plant as well, and will be received in turn."""
        for datagram in reversed(datagrams):
            time_usec = self._reader.read(datagram).time_usec
            if time_usec is not None:
                self._newest = time_usec
                return

    def receive(self, datagram: bytes, now: float) -> None:
        """Take a datagram from the plant; the answer is in `to_send`."""
        in_time = self._silence is None and self._newest <= self._last_time
        if in_time and self._plain_tick is not None:
            if datagram == self._last_tick and self._last_answer is not None:
                self._out.append(self._last_answer)  # the answer was lost
                self._last_heard = now
                return
            if self._answer_plainly(self._plain_tick, datagram, now):
                self._last_tick = datagram
                return
        tick = self._reader.read(datagram)
        for frame in tick.others:
            self._autopilot.hear(frame, now)
        if tick.time_usec is None:
            if self._last_heard is not None and any(map(is_plant_heartbeat, tick.others)):
                self._last_heard = now
            return
        if self._last_answer is None:
            self._connect()
        if tick.time_usec == self._last_time and self._last_answer is not None:
            self._out.append(self._last_answer)
        elif tick.time_usec > self._last_time or self._last_heard is None:
            if tick.time_usec <= self._last_time:
                self._say("the plant has started again")
                self._disarm()
                self._armed_at = None
                self._feedback.restart()
                self._newest, self._silence = 0, None
                if self._tick_rate is not None:
                    self._tick_rate.restart()
                if self._terms_log is not None:
                    self._terms_log.restart()
            self._answer(tick.time_usec, tick, now)
        else:
            return  # overtaken by a newer tick
        self._last_heard = now

    def _answer_plainly(self, plain_tick: PlainTick, datagram: bytes, now: float) -> bool:
        """Answer in one compiled call; False: there is more to this datagram, nothing was done."""
        until = self._autopilot.whole_until(now)
        if until == -inf:
            return False
        reader, packer, length = self._reader, self._packer, len(datagram)
        reader.view[:length] = datagram
        size = plain_tick(length, self._last_time, packer.sequence, until)
        if size == 0:
            return False
        packer.next_sequence()
        self.steps += 1
        self._last_time = reader.time_usec
        self._autopilot.flown_whole(self._last_time, now)
        if self._terms_log is not None:
            self._terms_log.tick(self._last_time, self._autopilot)
        self._last_answer = bytes(self._writer.view[:size])
        self._out.append(self._last_answer)
        self._last_heard = now
        return True

    def _answer(self, time_usec: int, tick: Tick, now: float) -> None:
        at_our_rate = self._tick_rate is None or self._tick_rate.fits(time_usec)
        late = self._note_silence(time_usec)
        estimate = self._feedback.update(time_usec, tick, self._reader)
        self._follow_delay()
        if estimate is not None and at_our_rate:
            before = self._autopilot.armed
            self._autopilot.step(estimate, time_usec, now)
            if self._armed_at is None and self._autopilot.armed:
                self._armed_at = time_usec
            if self._autopilot.armed != before:
                self._say(
                    "disarmed" if before else f"plant and {self._feedback.name} are there: armed, flying"
                )
            if late and self._silence is not None and self._autopilot.armed:
                self._feedback.note_unheard(self._silence.controls(time_usec))
            else:
                self._feedback.note_command(self._writer.controls, self._autopilot.armed)
            self.steps += 1
            if self._terms_log is not None and self._autopilot.armed:
                self._terms_log.tick(time_usec, self._autopilot)
            self._take_law(self._autopilot.law)
        else:
            self._disarm()
            if estimate is None and self._feedback.needs_truth and now >= self._next_request:
                self._next_request = now + REQUEST_INTERVAL
                self._request(ODOMETRY.message_id, 0.0)
        self._last_time, self._last_tick = time_usec, b""
        self._last_answer = self._writer.answer(time_usec, self._autopilot.armed)
        self._out.append(self._last_answer)

    def _note_silence(self, time_usec: int) -> bool:
        """Whether the answer to this tick comes too late to act: newer ones have come already.

        The last tick of a backlog is answered in time, as far as is known; if more has come meanwhile it was
        not, and the silence lasts.
        """
        late = time_usec < self._newest and self._autopilot.armed
        if late and self._silence is None:
            self._silence = Silence(self._writer.controls, self._last_time)
        elif not late and not self._was_late:
            self._silence = None
        self._was_late = late
        return late

    def _take_law(self, law: Law | None) -> None:
        """Another law may fly from the next tick on, or none that a compiled tick could."""
        if law is not self._law:
            self._law = law
            self._plain_tick = (
                None if law is None else self._feedback.plain_tick(self._reader, law, self._writer)
            )

    def _follow_delay(self) -> None:
        late = self._feedback.loop_delay
        if late == self._loop_delay:
            return
        self._loop_delay = late
        if late is not None:
            self._say(f"commands act {late} ticks late: the gains are for that now")
            self._autopilot.act_late(late)

    def _disarm(self) -> None:
        self._autopilot.disarm()
        self._take_law(None)

    def _connect(self) -> None:
        """What PX4 says on connecting: a heartbeat, and a request for the simulator's state."""
        self._say("plant connected")
        heartbeat = common.MAVLink_heartbeat_message(
            type=common.MAV_TYPE_QUADROTOR,
            autopilot=common.MAV_AUTOPILOT_PX4,
            base_mode=0,
            custom_mode=0,
            system_status=common.MAV_STATE_STANDBY,
            mavlink_version=3,
        )
        self._out.append(self._packer.pack(heartbeat))
        self._request(HIL_STATE_QUATERNION, PX4_STATE_INTERVAL_US)

    def _request(self, message_id: int, interval_us: float) -> None:
        """SET_MESSAGE_INTERVAL (0: the plant's own rate, every tick)."""
        command = common.MAVLink_command_long_message(
            target_system=0,
            target_component=0,
            command=common.MAV_CMD_SET_MESSAGE_INTERVAL,
            confirmation=0,
            param1=message_id,
            param2=interval_us,
            param3=0,
            param4=0,
            param5=0,
            param6=0,
            param7=0,
        )
        self._out.append(self._packer.pack(command))


def new_session(
    make_autopilot: Callable[[Array], Pilot],
    instance: int,
    say: Callable[[str], None],
    feedback: Feedback | None = None,
    rate_hz: float | None = None,
    terms_log: TermsLog | None = None,
) -> HilSession:
    """A session of one instance with the autopilot that `make_autopilot` builds around its controls (16,).

    rate_hz: that the autopilot was designed for; None: it flies at any.
    """
    packer = Packer(vehicle_system(instance), COMPONENT_AUTOPILOT)
    writer = AnswerWriter(instance, packer)
    return HilSession(
        make_autopilot(writer.controls),
        writer,
        packer,
        instance,
        say,
        feedback or TruthFeedback(),
        None if rate_hz is None else TickRate(rate_hz, say),
        terms_log,
    )
