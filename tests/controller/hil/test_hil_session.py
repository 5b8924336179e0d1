"""The autopilot's side of the HIL link, without sockets."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from controller.hil.session import PLANT_TIMEOUT, HilSession
from sitl_bridge.ids import COMPONENT_TRUTH
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS, MODE_FLAG_ARMED
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.wire.slow_frames import plant_heartbeat
from tests.plant.network import autopilot_session, paper, simulation


class Link:
    """A plant's simulation, tick by tick, and the session that answers it."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.now = 50.0
        self.simulation: Simulation
        self.simulation, _ = simulation(paper(), None)
        self.session: HilSession = autopilot_session(paper(), say=self.said.append)

    def give(self, datagram: bytes) -> list[Frame]:
        self.now += 0.004
        self.session.receive(datagram, self.now)
        return [frame for out in self.session.to_send(self.now) for frame in split(out).frames]

    def tick(self) -> list[Frame]:
        frames = self.give(self.simulation.datagram())
        for frame in frames:
            self.simulation.handle(frame)
        self.simulation.heard()
        self.simulation.next_tick()
        return frames


def answers(frames: list[Frame]) -> list[Frame]:
    return [frame for frame in frames if frame.message_id == HIL_ACTUATOR_CONTROLS.message_id]


def armed(frame: Frame) -> bool:
    return bool(decode(frame).mode & MODE_FLAG_ARMED)


def test_on_connecting_it_says_what_px4_says_and_asks_for_truth() -> None:
    frames = Link().tick()
    messages = [decode(frame) for frame in frames]
    assert messages[0].get_type() == "HEARTBEAT"
    assert messages[0].autopilot == common.MAV_AUTOPILOT_PX4
    intervals = {m.param1: m.param2 for m in messages if m.get_type() == "COMMAND_LONG"}
    assert intervals == {115: 5000, 331: 0}
    (answer,) = answers(frames)
    assert not armed(answer)
    assert decode(answer).controls == [0.0] * 16


def test_it_arms_on_the_first_truth_and_answers_every_tick_once() -> None:
    link = Link()
    states = [[armed(answer) for answer in answers(link.tick())] for _ in range(5)]
    assert states == [[False], [True], [True], [True], [True]]
    assert link.session.steps == 4


def test_a_repeated_tick_gets_the_same_bytes_without_a_second_step() -> None:
    link = Link()
    for _ in range(4):
        link.tick()
    datagram = link.simulation.datagram()
    first, again = answers(link.give(datagram)), answers(link.give(datagram))
    assert first[0].raw == again[0].raw
    assert link.session.steps == 4


def test_a_tick_that_is_overtaken_by_an_odd_one_gets_no_answer() -> None:
    link = Link()
    for _ in range(4):
        link.tick()
    in_one_call = link.simulation.datagram()
    assert answers(link.tick())
    heartbeat = Packer(1, COMPONENT_TRUTH).pack(plant_heartbeat())
    assert answers(link.give(heartbeat + link.simulation.datagram()))
    assert link.give(in_one_call) == []


def test_an_overtaken_tick_gets_no_answer() -> None:
    link = Link()
    link.tick()
    old = link.simulation.datagram()
    link.tick()
    link.tick()
    assert link.give(old) == []


def test_a_plant_that_starts_again_is_flown_from_the_start() -> None:
    link = Link()
    for _ in range(20):
        link.tick()
    link.now += 2 * PLANT_TIMEOUT
    assert link.session.to_send(link.now) == []
    assert link.said[-1] == "no HIL_SENSOR for 1 s: waiting for the plant"
    link.simulation, _ = simulation(paper(), None)
    assert not armed(answers(link.tick())[0])  # this plant was not asked for truth yet
    assert link.said[-1] == "the plant has started again"
    assert armed(answers(link.tick())[0])


def test_without_truth_it_stops_the_rotors_and_asks_again() -> None:
    link = Link()
    for _ in range(3):
        link.tick()
    link.simulation.ask_for_truth(False)
    link.simulation.next_tick()
    frames = link.tick()
    assert not armed(answers(frames)[0])
    later = [frame for _ in range(100) for frame in link.tick()]
    assert any(decode(frame).get_type() == "COMMAND_LONG" for frame in frames + later)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_no_tick(seed: int) -> None:
    link = Link()
    link.tick()
    generator = np.random.default_rng(seed)
    for _ in range(200):
        assert link.give(generator.bytes(int(generator.integers(0, 400)))) == []
