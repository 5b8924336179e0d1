"""What both clocks make of a datagram."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.plant.clocks.receiver import HilReceiver
from sitl_bridge.plant.log.notices import Notices
from tests.plant.clocks.scripted import Answers, CountedSimulation

COMMAND = mavlink.MAVLink_command_long_message(1, 1, 511, 0, *[0.0] * 7)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


class Received:
    def __init__(self, instance: int = 0) -> None:
        self.said: list[str] = []
        self.simulation = CountedSimulation(instance)
        self.receiver = HilReceiver(self.simulation, Notices(self.said.append), instance)  # type: ignore[arg-type]
        self.answers = Answers(instance)


def test_an_armed_answer_brings_its_tick_and_its_controls() -> None:
    r = Received(2)
    assert r.receiver.receive(r.answers.to(7, 0.5, 0.25))
    assert (r.receiver.time_usec, r.receiver.armed) == (28_000, True)
    assert r.receiver.controls.tolist() == [0.5, 0.25, *[0.0] * 14]
    assert (r.said, r.simulation.done, r.receiver.replies) == ([], [], [])


def test_an_unarmed_answer_stops_the_rotors() -> None:
    r = Received()
    r.receiver.receive(r.answers.to(7, 0.5))
    assert r.receiver.receive(r.answers.to(8, 0.5, armed=False))
    assert not r.receiver.armed
    assert r.receiver.controls.tolist() == [0.0] * 16


def test_an_answer_of_another_system_is_none_and_is_said_once() -> None:
    r = Received(instance=1)
    for _ in range(2):
        assert not r.receiver.receive(Answers(4).to(7, 0.5))
    assert r.receiver.time_usec == 0
    assert r.said == [
        "HIL_ACTUATOR_CONTROLS from system 5 ignored: expected system 2 "
        "(is the autopilot another --instance?)"
    ]


def test_junk_is_said_once_and_hides_no_answer_beside_it() -> None:
    r = Received()
    assert not r.receiver.receive(b"garbage")
    assert r.receiver.receive(b"more" + r.answers.to(7, 0.5))
    assert r.said == ["7 bytes on the HIL link that are not MAVLink `common` frames: ignored"]


def test_other_messages_go_to_the_simulation_and_its_replies_are_kept() -> None:
    r = Received()
    both = r.answers.packer.pack(HEARTBEAT) + r.answers.packer.pack(COMMAND)
    assert r.receiver.receive(both + r.answers.to(7, 0.5))
    assert r.simulation.done == [("message", 0), ("message", 76)]
    assert r.receiver.replies == [b"reply 76"]
    assert not r.receiver.receive(r.answers.packer.pack(COMMAND))
    assert r.receiver.replies == [b"reply 76"] * 2
    assert r.said == []


def test_controls_that_are_no_numbers_are_named_and_said_once() -> None:
    r = Received()
    for _ in range(2):
        assert r.receiver.receive(r.answers.to(7, 0.5, math.nan, 0.5, -math.inf))
    assert r.said == ["controls [1, 3] are not finite numbers: those rotors stop"]
