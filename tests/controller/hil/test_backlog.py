"""A controller that stood still while the plant went on: what it reads afterwards, and makes of it."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from controller.design.names import ON_ESTIMATE
from controller.feedback.estimate import EstimateFeedback
from controller.hil.backlog import WATCHFUL, Inlet, Silence
from controller.hil.session import new_session
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl_bridge.mavlink.hil import ROTORS_STOP_AFTER
from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.network import Faults, Network, Rows

RATE_HZ = 250.0
HEIGHT = 20.0


class Socket:
    """A link whose datagrams come when the test says so."""

    reliable = False

    def __init__(self) -> None:
        self.waiting: list[bytes] = []

    def send(self, datagram: bytes) -> None:
        raise AssertionError("nothing is sent")

    def receive(self, until: float) -> bytes | None:
        return self.waiting.pop(0) if self.waiting else None

    def close(self) -> None:
        """Nothing to free."""


def test_after_a_pause_all_that_waits_is_known_and_comes_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    socket = Socket()
    inlet = Inlet(socket)
    socket.waiting = [b"a", b"b"]
    assert (inlet.receive(now), inlet.found()) == (b"a", [])  # in time: nothing is looked for
    assert (inlet.receive(now), inlet.found()) == (b"b", [])
    assert inlet.receive(now) is None
    now += 1.0
    socket.waiting = [b"c", b"d", b"e"]
    assert (inlet.receive(now), inlet.found()) == (b"c", [b"d", b"e"])
    assert (inlet.receive(now), inlet.found()) == (b"d", [])
    socket.waiting = [b"f"]  # came while the others were answered
    assert (inlet.receive(now), inlet.found()) == (b"e", [b"f"])
    assert (inlet.receive(now), inlet.found()) == (b"f", [])
    for _ in range(WATCHFUL):
        socket.waiting = [b"g"]
        assert (inlet.receive(now), inlet.found()) == (b"g", [])
    socket.waiting = [b"h", b"i"]
    assert (inlet.receive(now), inlet.found()) == (b"h", [])


def test_the_last_answer_in_time_acts_until_the_rotors_stop() -> None:
    controls = np.full(16, 0.5)
    silence = Silence(controls, 1_000_000)
    controls[:] = 0.9
    stop = 1_000_000 + round(ROTORS_STOP_AFTER * 1e6)
    before = silence.controls(stop - 1)
    assert before is not None
    assert (before == 0.5).all()
    assert silence.controls(stop) is None


class Stalled:
    """A hover on estimates in real time; then one side stands still for a second, or nothing gets through."""

    def __init__(self, name: str, how: str, seed: int, length: float = 1.0) -> None:
        place = ["initial.start=hover", f"initial.load_position=[0, 0, {HEIGHT}]"]
        vehicle = load_vehicle(name, [*place, "sensors.preset=consumer"])
        self.said: list[str] = []
        self.rows = Rows()
        self.simulation = Simulation(vehicle, RATE_HZ, seed, duration_s=None, recorder=self.rows)
        clock = Realtime(self.simulation, Notices(self.said.append), 0)
        self.feedback = EstimateFeedback(vehicle, RATE_HZ, say=self.said.append)
        start = vehicle.initial_load_position
        path_from = self.feedback.path_from(lambda load: setpoint(start, load))
        session = new_session(
            lambda controls: Autopilot(vehicle, ON_ESTIMATE, RATE_HZ, path_from, controls),
            0,
            self.said.append,
            self.feedback,
        )
        faults = Faults()
        self.network = Network(clock, session, faults)
        clock.start(self.network.now)
        self.network.run(lambda: self.simulation.scenario_time > 3.0)
        stalled = self.network.now
        if how == "lost":
            faults.drop = 1.0
        else:
            self.network.stalled.add(how)
        if how == "plant":
            self.network.now += length
        else:
            self.network.run(lambda: self.network.now > stalled + length)
        faults.drop = 0.0
        self.network.stalled.clear()

    def go_on(self, seconds: float) -> None:
        end = self.network.now + seconds
        self.network.run(lambda: self.network.now > end)

    @property
    def flown(self) -> np.ndarray:
        return np.array(self.rows.rows)[:, 1:]

    @property
    def largest_tilt_deg(self) -> float:
        up = 1.0 - 2.0 * (self.flown[:, 7] ** 2 + self.flown[:, 8] ** 2)
        return math.degrees(math.acos(np.min(up)))


@pytest.mark.parametrize("how", ["autopilot", "lost"])
@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_the_filter_knows_that_the_rotors_stood_still(name: str, how: str) -> None:
    stalled = Stalled(name, how, seed=0)
    world, memory = stalled.simulation.world, stalled.feedback.estimator.memory
    assert (world.rotor_speed[:4] < 1.0).all()
    estimator = stalled.feedback.estimator
    before = estimator.memory["time"]
    stalled.network.run(lambda: estimator.memory["time"] > before + 0.9)
    assert world.state[5] < -4.0  # it falls
    np.testing.assert_allclose(memory["rotor_speed"][:4], world.rotor_speed[:4], atol=120.0)
    assert estimator.state()[8] == pytest.approx(world.state[5], abs=1.0)


@pytest.mark.parametrize("how", ["autopilot", "plant", "lost"])
@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_a_silence_of_a_second_is_survived(name: str, how: str) -> None:
    stalled = Stalled(name, how, seed=1)
    stalled.go_on(8.0)
    flown = stalled.flown
    assert flown[:, 15].min() > 0.3 * HEIGHT  # the load
    assert np.abs(flown[-1, 2] - flown[0, 2]) < 2.0
    assert stalled.largest_tilt_deg < 50.0
    assert not [text for text in stalled.said if "ticks late" in text]
