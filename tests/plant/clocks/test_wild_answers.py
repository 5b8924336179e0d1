"""Actuator frames that no autopilot should send, at any moment of a flight, on both clocks."""

from __future__ import annotations

import math
import random
import struct
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import LOAD_POSITION, Array
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.network import Endpoint, Faults, Network, autopilot_session, paper, simulation

WILD, SETTLED = 2.0, 12.0
"""s, of the scenario: until when frames are wild, and when the flight is over"""
NUMBERS = (math.nan, math.inf, -math.inf, 1e38, -1e38, 1e-45, -1.0, 0.0, 0.3, 1.0, 2.0)
MODES = (0, 1, 128, 129, 255)


class WildAutopilot:
    """Sends frames of every kind, and between them what a sound autopilot says, if there is one."""

    def __init__(self, flown: Simulation, sound: Endpoint | None, seed: int, share: float) -> None:
        self._flown = flown
        self._sound = sound
        self._random = random.Random(seed)
        self._share = share
        self._packers = {system: Packer(system, 1) for system in (1, 1, 1, 2, 255)}

    def receive(self, datagram: bytes, now: float) -> None:
        self._now = now
        if self._sound is not None:
            self._sound.receive(datagram, now)

    def next_deadline(self) -> float:
        return math.inf if self._sound is None else self._sound.next_deadline()

    def to_send(self, now: float) -> list[bytes]:
        out = [] if self._sound is None else self._sound.to_send(now)
        flying = self._flown.ticks_flown < WILD * 250
        if flying and self._random.random() < self._share:
            out = [*out, self.frame()] if self._random.random() < 0.5 else [self.frame(), *out]
        return out

    def frame(self) -> bytes:
        r = self._random
        now_usec = self._flown.time_usec
        jumps = (0, 1, now_usec - 4000, now_usec + 4000, now_usec + 10**9, 2**63, 2**64 - 1)
        time_usec = max(r.choice((now_usec, now_usec, *jumps)), 0)
        controls = [r.choice(NUMBERS) for _ in range(16)]
        message = mavlink.MAVLink_hil_actuator_controls_message(
            time_usec, controls, r.choice(MODES), r.choice((0, 1, 2**64 - 1))
        )
        raw = bytes(r.choice([*self._packers.values()]).pack(message))
        cut = r.random()
        if cut < 0.1:  # a piece of it
            return raw[: r.randrange(len(raw))]
        if cut < 0.2:  # a byte is another
            at = r.randrange(len(raw))
            return raw[:at] + bytes((r.randrange(256),)) + raw[at + 1 :]
        return raw


def lockstep(flown: Simulation, say: Callable[[str], None]) -> Lockstep:
    return Lockstep(flown, Notices(say), 0)


def lockstep_that_goes_on(flown: Simulation, say: Callable[[str], None]) -> Lockstep:
    return Lockstep(flown, Notices(say), 0, on_silence="continue")


def realtime(flown: Simulation, say: Callable[[str], None]) -> Realtime:
    return Realtime(flown, Notices(say), 0)


CLOCKS = [lockstep, realtime]


def fly(
    make: Callable[[Simulation, Callable[[str], None]], Lockstep | Realtime],
    vehicle: Vehicle,
    seconds: float,
    seed: int,
    share: float,
    alone: bool = False,
) -> tuple[Array, list[str]]:
    """Rows of the log, and what the plant said."""
    said: list[str] = []
    flown, rows = simulation(vehicle, seconds)
    clock = make(flown, said.append)
    sound = None if alone else autopilot_session(vehicle)
    network = Network(clock, WildAutopilot(flown, sound, seed, share), Faults())
    clock.start(network.now)
    network.run(lambda: clock.finished)
    return np.array(rows.rows), said


@pytest.mark.parametrize("make", CLOCKS)
@pytest.mark.parametrize("seed", range(3))
def test_a_flight_goes_on_after_wild_frames(make: Callable[..., Lockstep | Realtime], seed: int) -> None:
    rows, said = fly(make, paper(), SETTLED, seed, 0.03)
    assert np.isfinite(rows).all()
    load = rows[-250:, 1:][:, LOAD_POSITION]
    assert np.abs(load - (1.0, 2.0, 1.0)).max() < 0.25  # what the noise alone leaves, see the paper's V.A
    kinds = Counter(text.partition(":")[0].lstrip("0123456789 ") for text in said)
    assert all(count == 1 for count in kinds.values()), said
    assert any("are not finite numbers: those rotors stop" in text for text in said)


@pytest.mark.parametrize("make", [lockstep_that_goes_on, realtime])
@pytest.mark.parametrize("name", ["paper", "iris"])
@pytest.mark.parametrize("seed", range(3))
def test_a_plant_alone_with_wild_frames_stays_sound(
    make: Callable[..., Lockstep | Realtime], name: str, seed: int
) -> None:
    rows, said = fly(make, load_vehicle(name), WILD, 10 + seed, 0.7, alone=True)
    assert len(rows) == WILD * 250 + 1
    assert np.isfinite(rows).all()
    texts = [text for text in said if "answer" not in text]  # silence comes and goes
    assert len(texts) == len(set(texts)) <= 4, said


def test_the_frames_are_as_wild_as_they_should_be() -> None:
    flown, _ = simulation(paper(), 1.0)
    source = WildAutopilot(flown, None, 1, 1.0)
    payload = struct.Struct("<QQ16fB")
    frames = [frame for _ in range(400) for frame in split(source.frame()).frames]
    fields = [payload.unpack(frame.payload.ljust(81, b"\0")) for frame in frames if frame.message_id == 93]
    assert {f[18] for f in fields} >= set(MODES)
    assert any(math.isnan(x) for f in fields for x in f[2:18])
    assert any(f[0] == 2**64 - 1 for f in fields)
