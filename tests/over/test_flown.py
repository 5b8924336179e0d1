"""Whole flights over our own autopilot: how well the load is flown, and who has the vehicle when."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.law.reference import Path as Reference
from controller.law.reference import setpoint
from controller.over.ages import LONGEST_STANDSTILL
from controller.over.model import Steering
from controller.over.run import Live, LivePorts, OverOptions
from controller.over.stack import read_stack
from controller.over.states import State
from sitl.command_line.commands import main
from sitl.over.window import step_figures
from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.process import Speaker
from sitl_bridge.vehicle.files import load_vehicle
from tests.over.flown import FlownOver

TARGET = (3.0, 0.0, 2.5)
HOLD = (4, 3)


def hover(start: tuple[float, float, float]) -> Reference:
    return setpoint(start, start)


@pytest.mark.parametrize("steering", Steering)
def test_a_step_of_the_load(steering: Steering) -> None:
    over = FlownOver()
    flight = over.start(lambda start: setpoint(TARGET, start), 12.0, steering=steering)
    over.run_until(lambda: flight.state is State.DONE, 150.0, "done")
    times, load, vehicle = over.flight()
    assert times[-1] == pytest.approx(12.0, abs=0.1)
    assert np.linalg.norm(load[0] - TARGET) > 1.5
    figures = step_figures(times, load, vehicle, np.tile(TARGET, (len(times), 1)))
    assert figures["within_5pct_s"] < 2.8
    assert figures["overshoot_m"] < 0.05
    assert figures["residual_swing_rms_deg"] < 0.5
    assert figures["residual_error_rms_m"] < 0.02
    assert over.stack.truth()[0][2] < 0.3  # landed
    assert not over.stack.machine.armed


def test_a_silent_companion_is_replaced_and_an_operator_is_obeyed() -> None:
    over = FlownOver()
    first = over.start(hover, 60.0)
    over.run_until(lambda: first.state is State.FLYING, 60.0, "the first flies")
    over.companion = None  # killed: nothing is sent any more
    over.run_until(lambda: any("No offboard set-point" in said for said in over.stack.said), 3.0, "holds")
    second = over.start(hover, 60.0)
    over.run_until(lambda: second.state is State.FLYING, 30.0, "the second flies")
    assert not [said for said in over.said if "arming" in said]  # it flew already
    over.operator_takes(HOLD)
    over.stack.wait(0.5)
    assert second.state is State.FAILED
    assert over.stack.machine.mode.name == "HOLD"
    assert "took another mode: nothing more is sent" in over.said[-1]
    third = over.start(hover, 60.0)
    over.run_until(lambda: third.state is State.FLYING, 30.0, "the third flies")
    companion, now = over.companion, over.stack.now  # the stack stands still, and the world with it
    assert companion is not None
    for k in range(round(LONGEST_STANDSTILL / 0.01)):
        companion.to_send(now + 0.01 * k)
        assert third.state is State.FLYING  # a busy machine
    companion.to_send(now + LONGEST_STANDSTILL + 0.02)
    assert third.state is State.FAILED
    assert "state is older than 0.2 s: nothing more is sent" in over.said[-1]


def test_identify_finds_the_rotors_lag_and_thrust(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """One and a half times the usual lag of the rotors, of which autopilot and companion know nothing."""
    slow = FlownOver(*(f"rotors.{i}.time_constant=0.03" for i in range(4)))

    def fly(options: OverOptions, *_: Any) -> dict[str, Any]:
        assert options.load == "truth"
        flight = slow.start(options.path_from, options.duration_s, options.probe)
        slow.run_until(lambda: flight.state is State.DONE, 200.0, "done")
        return {"completed": True}

    monkeypatch.setattr("controller.over.run.run", fly)
    monkeypatch.setattr("sitl_bridge.process.StopRequest.install", lambda stop: None)
    file = tmp_path / "stack.toml"
    arguments = ("--vehicle", "iris", "--sensors", "rtk", "--over", "udpin:127.0.0.1:1", "--load", "truth")
    assert main(["identify", *arguments, "--duration", "30", "--json", "--out", str(file)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["responses"]["thrust"]["lag"] == pytest.approx(0.03, rel=0.15)
    full = sum(r.thrust_coefficient * r.max_speed**2 for r in load_vehicle("iris").rotors)
    assert found["full_thrust"] == pytest.approx(full, rel=0.05)
    assert found["rate_lag"] + found["delay"] > 0.06
    stack = read_stack(file)
    assert stack.model_dump() == {key: found[key] for key in stack.model_dump()}


class MemoryLink:
    """The load's own link, without its socket."""

    def __init__(self, local: int, peer: int) -> None:
        self.coming: list[bytes] = []
        self.latest: dict[str, Any] = {}

    def receive(self, now: float) -> list[bytes]:
        coming, self.coming = self.coming, []
        return coming

    def send(self, datagrams: list[bytes], now: float) -> None:
        for datagram in datagrams:
            for frame in split(datagram).frames:
                message = decode(frame)
                assert frame.system == 101
                self.latest[message.get_type()] = message


def test_the_load_is_moved_live(monkeypatch: pytest.MonkeyPatch) -> None:
    links: list[MemoryLink] = []

    def link(local: int, peer: int) -> MemoryLink:
        links.append(MemoryLink(local, peer))
        return links[-1]

    monkeypatch.setattr("controller.over.run.LoadLink", link)
    over, client = FlownOver(), Packer(245, 190)
    options = OverOptions(over.told, Address("udpin", "127.0.0.1", 0), hover, math.inf)
    flight = over.start(hover, math.inf, live=Live(options, LivePorts(0, 0), Speaker("", events=False)))
    over.run_until(lambda: flight.state is State.FLYING, 60.0, "flies")
    over.stack.wait(0.5)
    latest, here = links[0].latest, links[0].latest["LOCAL_POSITION_NED"]
    wanted = (here.x + 2.0, here.y, here.z - 1.0)
    mask = 0b1101_1111_1000
    message = mavlink.MAVLink_set_position_target_local_ned_message(0, 101, 35, 1, mask, *wanted, *(0.0,) * 8)
    links[0].coming.append(client.pack(message))

    def there() -> bool:
        place = latest["LOCAL_POSITION_NED"]
        return math.dist((place.x, place.y, place.z), wanted) < 0.1

    over.run_until(there, 15.0, "the load at its point")
    place = latest["GLOBAL_POSITION_INT"]
    message = mavlink.MAVLink_command_int_message(
        101, 35, 5, 192, 0, 0, -1.0, 0, 0, math.nan, place.lat, place.lon, 1e-3 * place.alt + 1.0
    )
    links[0].coming.append(client.pack(message))
    over.run_until(
        lambda: abs(latest["GLOBAL_POSITION_INT"].alt - place.alt - 1000) < 100, 15.0, "a metre higher"
    )
    load = over.stack.truth()[1]
    assert load == pytest.approx((wanted[1], wanted[0], 1.0 - wanted[2]), abs=0.15)
