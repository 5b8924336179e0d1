"""Commands: one acknowledgement each, the right one."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.dialects.v20 import development

from controller.ground.flight.px4_modes import Mode
from tests.controller.ground.rig import Channel, Rig

ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
NAN = math.nan


@pytest.mark.parametrize("number", [1, 39, 206, 2000, 31010, 65535])
def test_the_unknown_is_unsupported(number: int) -> None:
    rig = Rig()
    client = rig.client()
    assert client.command(number, 0, 0, 0, 0, 0, 0, 0).result == UNSUPPORTED
    assert client.command_int(number, (0, 0, 0, 0), 0, 0, 0).result == UNSUPPORTED
    assert all(str(number) in text for text in client.texts())
    assert len(client.texts()) == 2


@pytest.mark.parametrize("p1", [7, -1, 0.5, 2, NAN, math.inf])
def test_arm_takes_one_or_nought_only(p1: float) -> None:
    """PX4 leaves 7 unanswered and arms on NaN."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, p1).result == DENIED
    assert not rig.station.armed
    assert "use 1 or 0" in client.texts()[0]


@pytest.mark.parametrize(
    ("p1", "main", "sub"),
    [
        *((1, main, 0) for main in (99, 1, 10, 4.5, 1e9)),
        *((1, 4, sub) for sub in (99,)),
        (99, 0, 0),
        (NAN, 4, 3),
        (1, NAN, NAN),
    ],
)
def test_modes_that_are_not_there_are_refused_with_a_reason(p1: float, main: float, sub: float) -> None:
    """PX4 accepts 99."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(176, p1, main, sub).result == DENIED
    assert len(client.texts()) == 1
    assert rig.station.machine.mode.name == "HOLD"


def test_long_and_int_do_the_same() -> None:
    for use_int in (False, True):
        rig = Rig()
        client = rig.client()
        rig.run(0.1)
        ack = client.command_int(400, (1, 0, 0, 0), 0, 0, 0) if use_int else client.command(400, 1, 0)
        assert ack.result == ACCEPTED
        assert rig.station.armed


def test_a_retransmission_is_acknowledged_again_without_a_second_effect() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 3).result == DENIED
    for confirmation in (1, 2):
        assert client.command(400, 3, confirmation=confirmation).result == DENIED
    assert len(client.texts()) == 1  # one refusal, said once
    assert client.command(400, 3).result == DENIED
    assert len(client.texts()) == 2  # asked anew


def test_a_doubled_datagram_has_one_effect() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    raw = client.packer.pack(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 3, *(NAN,) * 6))
    client.send_raw(raw, raw)
    rig.run(0.1)
    assert [a.result for a in client.got("COMMAND_ACK")] == [DENIED, DENIED]
    assert len(client.texts()) == 1


def test_a_sender_whose_sequence_numbers_do_not_count_gets_what_it_asks_for() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    for on in (1, 0, 1, 0, 1):
        client.packer.sequence = 0
        assert client.command(400, on).result == ACCEPTED
        assert rig.station.armed == bool(on)
    rig.run(0.5)
    for _ in range(2):
        client.packer.sequence = 0
        assert client.command(400, 3).result == DENIED
        rig.run(0.5)
    assert len([text for text in client.texts() if "use 1 or 0" in text]) == 2  # asked anew


def test_a_datagram_that_comes_late_once_more_does_not_arm_again() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    arm, disarm = (
        client.packer.pack(mavlink.MAVLink_command_long_message(1, 1, 400, 0, on, *(NAN,) * 6))
        for on in (1, 0)
    )
    client.send_raw(arm, disarm, arm)
    rig.run(0.1)
    assert [a.result for a in client.got("COMMAND_ACK")] == [ACCEPTED] * 3
    assert not rig.station.armed


def test_a_command_gets_through_a_lossy_link() -> None:
    rig = Rig()
    client = rig.client(channel=Channel(loss=0.3, duplication=0.2, reordering=0.2, seed=4))
    rig.run(0.1)
    for confirmation in range(20):
        client.send(mavlink.MAVLink_command_long_message(1, 1, 400, confirmation, 1, *(NAN,) * 6))
        rig.run(0.5)
        if client.got("COMMAND_ACK"):
            break
    assert {a.result for a in client.got("COMMAND_ACK")} == {ACCEPTED}
    assert rig.station.armed


@pytest.mark.parametrize("target", [(2, 1), (1, 100), (1, 154), (200, 0)])
def test_what_is_for_others_is_left_to_them(target: tuple[int, int]) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.send(mavlink.MAVLink_command_long_message(*target, 400, 0, 1, *(NAN,) * 6))
    rig.run(0.1)
    assert not client.got("COMMAND_ACK")
    assert not rig.station.armed


def test_component_0_is_the_vehicle_too() -> None:
    """MAVProxy's disarm."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 0, target=(1, 0)).result == ACCEPTED


def test_acknowledgements_come_from_the_addressed_component() -> None:
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    ack = client.command(192, -1, 1, 0, NAN, NAN, NAN, 492.0, target=(101, 35))
    assert (ack.get_srcSystem(), ack.get_srcComponent(), ack.result) == (101, 35, ACCEPTED)
    assert rig.station.update(rig.view, rig.now).position[2] == pytest.approx(4.0)  # the load's own height
    ack = client.command(21, target=(101, 35))
    assert (ack.get_srcSystem(), ack.result) == (101, UNSUPPORTED)
    assert client.command(400, 1).get_srcSystem() == 1


@pytest.mark.parametrize(
    ("number", "params", "message"),
    [
        (512, (148,), "AUTOPILOT_VERSION"),
        (520, (1,), "AUTOPILOT_VERSION"),
        (512, (242,), "HOME_POSITION"),
        (512, (1,), "SYS_STATUS"),
        (512, (0,), "HEARTBEAT"),
        (512, (244, 30), "MESSAGE_INTERVAL"),
        (510, (30,), "MESSAGE_INTERVAL"),
    ],
)
def test_messages_on_request(number: int, params: tuple[float, ...], message: str) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.clear()
    assert client.command(number, *params).result == ACCEPTED
    assert client.got(message)


@pytest.mark.parametrize("number", [396, 299, 77777, NAN, 1.5, -1])
def test_messages_that_are_not_there_are_refused_at_once(number: float) -> None:
    """COMPONENT_INFORMATION_BASIC and others that clients ask for."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(512, number).result == DENIED


def test_available_modes() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(512, 435, 0).result == ACCEPTED
    frames = [raw for raw in client.raw if raw[7] | raw[8] << 8 == 435]
    read = development.MAVLink(None).decode
    modes = {m.custom_mode: m for m in (read(bytearray(raw)) for raw in frames)}
    assert set(modes) == {mode.custom_mode for mode in Mode}  # every one that HEARTBEAT may show
    assert {m.number_modes for m in modes.values()} == {len(Mode)}
    hidden = [m.mode_name for m in modes.values() if m.properties & 2]  # NOT_USER_SELECTABLE
    assert hidden == ["Termination"]
    assert client.command(512, 435, 2).result == ACCEPTED
    assert client.command(512, 435, 99).result == DENIED


def test_intervals() -> None:
    rig = Rig()
    client, other = rig.client(), rig.client(14540, link=1)
    assert client.command(511, 30, 20000).result == ACCEPTED
    client.clear()
    other.clear()
    rig.run(2.0)
    assert len(client.got("ATTITUDE")) == pytest.approx(100, abs=2)
    assert len(other.got("ATTITUDE")) == pytest.approx(20, abs=2)  # each link its own
    assert client.command(510, 30).result == ACCEPTED
    assert client.got("MESSAGE_INTERVAL")[-1].interval_us == 20000
    assert client.command(511, 30, -1).result == ACCEPTED
    client.clear()
    rig.run(1.0)
    assert not client.got("ATTITUDE")
    assert client.command(511, 30, 0).result == ACCEPTED
    rig.run(2.0)
    assert len(client.got("ATTITUDE")) == pytest.approx(20, abs=2)
    for bad in ((30, 1), (0, -1), (77777, 1000), (30, -5), (30, math.inf), (NAN, 1000)):
        assert client.command(511, *bad).result == DENIED


def test_pings_time_and_ftp() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_ping_message(123, 9, 0, 0))
    client.send(mavlink.MAVLink_timesync_message(0, 77))
    payload = bytes((5, 0, 0, 4)).ljust(251, b"\0")
    client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))
    rig.run(0.04)
    (pong,) = client.got("PING")
    assert (pong.time_usec, pong.seq, pong.target_system, pong.target_component) == (123, 9, 255, 190)
    (sync,) = client.got("TIMESYNC")
    assert sync.ts1 == 77
    assert sync.tc1 == pytest.approx(rig.now * 1e9, rel=1e-3)
    (nak,) = client.got("FILE_TRANSFER_PROTOCOL")
    assert bytes(nak.payload[:13]) == bytes((6, 0, 0, 129, 1, 4, 0, 0, 0, 0, 0, 0, 10))


@pytest.mark.parametrize("opcode", [128, 129, 255])
def test_an_answer_of_ftp_is_not_answered(opcode: int) -> None:
    rig = Rig()
    client = rig.client()
    payload = bytes((5, 0, 0, opcode)).ljust(251, b"\0")
    client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))
    rig.run(0.04)
    assert not client.got("FILE_TRANSFER_PROTOCOL")


def test_every_refusal_has_a_text() -> None:
    """Whatever is refused in a fresh vehicle, somebody is told why."""
    for number in range(3100):
        entry = mavlink.enums["MAV_CMD"].get(number)
        if entry is None:
            continue
        rig = Rig()
        client = rig.client()
        rig.station.update(rig.view, rig.now)
        ack = client.command(number, 5, 5, 5, 5, 5, 5, 5)
        assert (ack.result == ACCEPTED) or client.texts(), entry.name
        assert not rig.station.armed
