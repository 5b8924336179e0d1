"""The lockstep machine, without sockets: the network changes how long a run takes, never what happens."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.hil.answers import AnswerWriter
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS, HIL_SENSOR
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.log.notices import Notices
from tests.plant.network import Faults, Network, Rows, autopilot_session, paper, simulation

DURATION = 0.4
TICKS = round(DURATION * 250)


class Flight:
    """A lockstep plant and an autopilot on a network."""

    def __init__(self, faults: Faults, duration: float = DURATION, **options: object) -> None:
        self.said: list[str] = []
        vehicle = paper()
        self.simulation, self.rows = simulation(vehicle, duration)
        self.clock = Lockstep(self.simulation, Notices(self.said.append), 0, **options)  # type: ignore[arg-type]
        self.autopilot_said: list[str] = []
        self.session = autopilot_session(vehicle, say=self.autopilot_said.append)
        self.network = Network(self.clock, self.session, faults)
        self.clock.start(self.network.now)

    def fly(self) -> Rows:
        self.network.run(lambda: self.clock.finished)
        return self.rows


@pytest.fixture(scope="module")
def undisturbed() -> bytes:
    return Flight(Faults()).fly().bytes()


def test_one_row_a_tick_and_the_last_state(undisturbed: bytes) -> None:
    rows = Flight(Faults()).fly().rows
    assert len(rows) == TICKS + 1
    assert [row[0] for row in rows] == pytest.approx([k / 250 for k in range(TICKS + 1)])


@settings(max_examples=15)
@given(
    drop=st.floats(0, 0.4),
    duplicate=st.floats(0, 0.5),
    delay=st.floats(0, 0.02),
    jitter=st.floats(0, 0.02),
    seed=st.integers(0, 1000),
)
def test_the_network_changes_nothing_that_happens(
    undisturbed: bytes, drop: float, duplicate: float, delay: float, jitter: float, seed: int
) -> None:
    flight = Flight(Faults(drop, duplicate, delay, jitter, seed))
    assert flight.fly().bytes() == undisturbed


def test_a_repeated_tick_gets_the_same_bytes_without_a_second_step() -> None:
    flight = Flight(Faults(drop=0.3, seed=1))
    flight.fly()
    assert flight.clock.resent_ticks > 0
    by_time: dict[int, set[bytes]] = {}
    for datagram in flight.network.sent["autopilot"]:
        for frame in split(datagram).frames:
            if frame.message_id == HIL_ACTUATOR_CONTROLS.message_id:
                by_time.setdefault(int.from_bytes(frame.payload[:8], "little"), set()).add(frame.raw)
    assert all(len(versions) == 1 for versions in by_time.values())
    assert flight.session.steps <= TICKS + 1


def test_time_usec_only_grows_and_a_repeat_is_the_same_datagram() -> None:
    flight = Flight(Faults(drop=0.2, seed=2))
    flight.fly()
    times = []
    for datagram in flight.network.sent["plant"]:
        frames = split(datagram).frames
        if frames[-1].message_id == HIL_SENSOR.message_id:
            assert len(datagram) <= 2048
            times.append((int.from_bytes(frames[-1].payload[:8], "little"), datagram))
    assert times[0][0] > 0
    for (before, datagram), (after, following) in pairwise(times):
        assert after > before or (after == before and following == datagram)


def test_late_start_of_the_autopilot_leaves_no_trace(undisturbed: bytes) -> None:
    flight = Flight(Faults())
    flight.network.stalled.add("autopilot")
    began = flight.network.now
    flight.network.run(lambda: flight.network.now > began + 1.234)
    ticks = flight.simulation.tick
    assert ticks == pytest.approx(1.234 * 250, abs=2)  # it freewheels at the nominal pace
    flight.network.stalled.clear()
    assert flight.fly().bytes() == undisturbed


def test_the_world_waits_for_a_stalled_autopilot(undisturbed: bytes) -> None:
    flight = Flight(Faults())
    flight.network.run(lambda: flight.simulation.ticks_flown == 30)
    flight.network.stalled.add("autopilot")
    began, state = flight.network.now, flight.simulation.world.state.copy()
    flight.network.run(lambda: flight.network.now > began + 20.0)
    assert (flight.simulation.world.state == state).all()
    assert [text for text in flight.said if "no answer" in text] == [flight.said[0]]
    flight.network.stalled.clear()
    assert flight.fly().bytes() == undisturbed
    assert flight.said[1:] == ["autopilot answers again"]


def test_a_restarted_autopilot_is_taken_back_and_the_flight_goes_on() -> None:
    flight = Flight(Faults(), duration=12.0)
    flight.network.run(lambda: flight.simulation.ticks_flown == 500)
    flight.network.autopilot = flight.session = autopilot_session(paper())
    rows = flight.fly().rows
    assert rows[-1][14:17] == pytest.approx([1.0, 2.0, 1.0], abs=0.15)  # under white force


def test_repeats_back_off_to_twice_a_second() -> None:
    flight = Flight(Faults())
    flight.network.run(lambda: flight.simulation.ticks_flown == 5)
    flight.network.stalled.add("autopilot")
    sent = len(flight.network.sent["plant"])
    began = flight.network.now
    flight.network.run(lambda: flight.network.now > began + 30.0)
    assert 55 <= len(flight.network.sent["plant"]) - sent <= 75


def test_a_round_trip_longer_than_the_timeout_is_learned() -> None:
    """Karn's algorithm with the time-out kept: repeats end, though every first answer came too late."""
    flight = Flight(Faults(delay_s=0.04), duration=2.0)
    flight.fly()
    assert flight.clock.resent_ticks < 10


def test_continue_on_silence_flies_on_with_the_last_controls_and_counts() -> None:
    flight = Flight(Faults(), on_silence="continue")
    flight.network.run(lambda: flight.simulation.ticks_flown == 30)
    flight.network.stalled.add("autopilot")
    flight.fly()
    assert flight.clock.unanswered_ticks == TICKS - 30
    # The last controls hold: the log of the rotors stays as it is (its last row repeats them anyway).
    assert all((row[20:] == flight.rows.rows[-1][20:]).all() for row in flight.rows.rows[30:])


def test_no_repeats_over_a_reliable_link() -> None:
    flight = Flight(Faults(), resend=False)
    flight.network.run(lambda: flight.simulation.ticks_flown == 5)
    flight.network.stalled.add("autopilot")
    sent = len(flight.network.sent["plant"])
    began = flight.network.now
    flight.network.run(lambda: flight.network.now > began + 5.0)
    assert len(flight.network.sent["plant"]) - sent <= 1
    assert any("no answer" in text for text in flight.said)


def test_speed_paces_the_ticks() -> None:
    flight = Flight(Faults(), speed=4.0)
    flight.network.run(lambda: flight.simulation.started)
    began = flight.network.now
    flight.fly()
    assert flight.network.now - began == pytest.approx(DURATION / 4.0, rel=0.05)


class Scripted:
    """An autopilot that answers every tick with what the test wants."""

    def __init__(self, instance: int = 0, **changes: float) -> None:
        self._out: list[bytes] = []
        self._writer = AnswerWriter(instance, Packer(instance + 1, COMPONENT_AUTOPILOT))
        self._writer.controls[:4] = 0.7
        self.offset_us = 0
        self.garbage: bytes | None = None
        for index, value in changes.items():
            self._writer.controls[int(index[1:])] = value

    def receive(self, datagram: bytes, now: float) -> None:
        time_usec = int.from_bytes(split(datagram).frames[-1].payload[:8], "little")
        answer = self._writer.answer(time_usec + self.offset_us, True)
        self._out.append(answer if self.garbage is None else self.garbage)

    def to_send(self, now: float) -> list[bytes]:
        out, self._out = self._out, []
        return out

    def next_deadline(self) -> float:
        return math.inf


def scripted_flight(autopilot: Scripted) -> Flight:
    flight = Flight(Faults())
    flight.network.autopilot = autopilot
    return flight


def test_an_answer_from_another_system_is_no_answer_and_is_said_once() -> None:
    flight = scripted_flight(Scripted(instance=4))
    flight.network.run(lambda: flight.network.now > 101.0)
    assert not flight.simulation.started
    assert flight.said == [
        "HIL_ACTUATOR_CONTROLS from system 5 ignored: expected system 1 "
        "(is the autopilot another --instance?)"
    ]


def test_garbage_is_no_answer_and_is_said_once() -> None:
    autopilot = Scripted()
    autopilot.garbage = b"\xfd\x09\x00garbage \xfe"
    flight = scripted_flight(autopilot)
    flight.network.run(lambda: flight.network.now > 101.0)
    assert not flight.simulation.started
    assert len(flight.said) == 1
    assert "not MAVLink" in flight.said[0]


def test_an_answer_to_another_tick_never_advances_the_world() -> None:
    autopilot = Scripted()
    flight = scripted_flight(autopilot)
    flight.network.run(lambda: flight.simulation.ticks_flown == 10)
    autopilot.offset_us = -4000
    flight.network.run(lambda: flight.network.now > 103.0)
    assert flight.simulation.ticks_flown <= 11


def test_controls_that_are_not_finite_stop_their_rotors() -> None:
    flight = scripted_flight(Scripted(_2=math.nan, _3=math.inf))
    flight.fly()
    assert (flight.rows.rows[5][20:24] > 0).tolist() == [True, True, False, False]
    assert [text for text in flight.said if "finite" in text] == [
        "controls [2, 3] are not finite numbers: those rotors stop"
    ]


def test_loop_delay_applies_each_command_that_many_ticks_later() -> None:
    from sitl_bridge.vehicle.files import load_vehicle

    said: list[str] = []
    vehicle = load_vehicle("paper", ["loop.delay_ticks=3"])
    sim, rows = simulation(vehicle, DURATION)
    clock = Lockstep(sim, Notices(said.append), 0)
    network = Network(clock, Scripted(), Faults())
    clock.start(network.now)
    network.run(lambda: clock.finished)
    hover = sim.world.trim_controls[0] * vehicle.rotors[0].max_speed
    speeds = [row[20] for row in rows.rows[:5]]
    commanded = 0.7 * vehicle.rotors[0].max_speed
    assert speeds == pytest.approx([hover] * 3 + [commanded] * 2, rel=1e-6)
