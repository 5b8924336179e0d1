"""What clients ask for now and then: home, reboot, calibration, origin, shell; frames and cut datagrams."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.datagrams import MOST_SENDERS, DatagramSplitter
from controller.ground.link.peers import Address
from tests.controller.ground.in_flight import ACCEPTED, DENIED, REJECTED, flying, mode, set_parameter
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.rig import NAN, Rig

UNSUPPORTED_FRAME = 9


def test_home_is_set_here_or_there_and_return_goes_there() -> None:
    rig, client = flying()
    north = ZURICH[0] + 20.0 / 111_200.0
    assert client.command(179, 0, 0, 0, 0, north, ZURICH[1], 488.0).result == ACCEPTED
    client.clear()
    client.command(512, 242)
    home = client.got("HOME_POSITION")[-1]
    assert home.latitude == pytest.approx(north * 1e7, abs=20)
    set_parameter(rig, client, "RTL_RETURN_ALT", 5.0)
    assert client.command(20).result == ACCEPTED
    rig.run_until(lambda: not rig.station.armed, 120.0)
    assert rig.view.load_position[:2] == pytest.approx((0.0, 20.0), abs=0.1)
    rig.run(1.0)  # disarmed and armed again it stays where it was put
    assert client.command(400, 1).result == ACCEPTED
    assert rig.station.machine.home is not None
    assert rig.station.machine.home[:2] == pytest.approx((0.0, 20.0), abs=0.1)
    assert client.command(179, 1).result == ACCEPTED
    assert rig.station.machine.home[:2] == pytest.approx(rig.view.position[:2])


@pytest.mark.parametrize("place", [(91.0, 8.0, 0.0), (NAN, NAN, NAN), (47.0, math.inf, 0.0)])
def test_a_home_that_is_no_place_is_denied(place: tuple[float, ...]) -> None:
    _rig, client = flying()
    assert client.command(179, 0, 0, 0, 0, *place).result == DENIED
    assert "valid position" in client.texts()[-1]


def test_a_reboot_begins_afresh_and_keeps_parameters() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    set_parameter(rig, client, "MIS_TAKEOFF_ALT", 7.0)
    client.command(176, 1, 4, 6)
    client.command(511, 32, -1)
    assert client.command(246, 1).result == ACCEPTED
    rig.run(0.1)
    assert "Rebooted" in client.texts()
    assert mode(rig) == "HOLD"
    assert rig.station.parameters["MIS_TAKEOFF_ALT"] == 7.0
    client.clear()
    rig.run(2.0)
    assert client.got("LOCAL_POSITION_NED")  # streams are the default ones again
    rig.fly(client)


def test_in_flight_nothing_is_rebooted_shut_down_or_calibrated() -> None:
    rig, client = flying()
    for number, params in ((246, (1.0,)), (246, (2.0,)), (241, (1.0,))):
        assert client.command(number, *params).result == REJECTED
        assert "disarm first" in client.texts()[-1]
    assert rig.station.armed
    assert not rig.station.shut_down


def test_shut_down_is_asked_of_the_process() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(246, 2).result == ACCEPTED
    assert rig.station.shut_down
    assert client.command(246, 7).result == DENIED


@pytest.mark.parametrize(
    ("params", "name"),
    [((1,), "gyro"), ((0, 1), "mag"), ((0, 0, 0, 0, 1), "accel"), ((0, 0, 0, 0, 2), "level")],
)
def test_calibrations_are_done_at_once_in_the_words_that_clients_wait_for(
    params: tuple[float, ...], name: str
) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(241, *params, *(0,) * (7 - len(params))).result == ACCEPTED
    assert client.texts() == [
        f"[cal] calibration started: 2 {name}",
        "[cal] progress <100>",
        f"[cal] calibration done: {name}",
    ]


@pytest.mark.parametrize("number", [22, 192, 34, 35, 179])
def test_a_frame_that_is_not_supported_has_its_own_result(number: int) -> None:
    rig, client = flying()
    place = (round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7), 10.0)
    ack = client.command_int(number, (0.0, 0.0, 0.0, 0.0), *place, frame=1)
    assert ack.result == UNSUPPORTED_FRAME
    assert "Frame 1 is not supported" in client.texts()[-1]
    assert mode(rig) == "HOLD"


def test_a_frame_counts_only_where_there_is_a_place() -> None:
    _rig, client = flying()
    assert client.command_int(176, (1.0, 4.0, 3.0, 0.0), 0, 0, 0.0, frame=2).result == ACCEPTED
    unset = 0x7FFFFFFF
    assert client.command_int(192, (-1.0, 1.0, 0.0, NAN), unset, unset, NAN, frame=2).result == ACCEPTED


def test_the_global_origin_is_told_and_stays() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(511, 49, -1)  # its stream off
    client.clear()
    place = (round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7))
    client.send(mavlink.MAVLink_set_gps_global_origin_message(1, *place, 488_000))
    rig.run(0.04)
    (origin,) = client.got("GPS_GLOBAL_ORIGIN")
    assert (origin.latitude, origin.longitude, origin.altitude) == (*place, 488_000)
    assert client.texts() == []
    client.send(mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0))
    rig.run(0.04)
    assert client.got("GPS_GLOBAL_ORIGIN")[-1].latitude == place[0]
    assert "Origin denied" in client.texts()[0]
    assert client.command(512, 49).result == ACCEPTED


def test_a_shell_says_that_there_is_none() -> None:
    rig = Rig()
    client = rig.client()
    line = list(b"top\n".ljust(70, b"\0"))
    client.send(mavlink.MAVLink_serial_control_message(10, 6, 0, 0, 4, line))
    rig.run(0.04)
    (answer,) = client.got("SERIAL_CONTROL")
    assert answer.flags & 1
    assert bytes(answer.data[: answer.count]).startswith(b"no shell here")
    client.send(answer)  # a reply is not replied to
    rig.run(0.04)
    assert len(client.got("SERIAL_CONTROL")) == 1


def test_a_frame_cut_over_two_datagrams_is_read_wherever_the_cut_is() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    for cut in range(1, 20):
        raw = client.packer.pack(mavlink.MAVLink_ping_message(1, cut, 0, 0))
        if cut >= len(raw):
            break
        client.clear()
        client.send_raw(raw[:cut], raw[cut:])
        rig.run(0.04)
        assert [m.seq for m in client.got("PING")] == [cut]


def test_the_beginning_of_a_frame_hides_no_good_one_and_is_nobody_elses() -> None:
    rig = Rig()
    client, other = rig.client(), rig.client(14540, link=1)
    raw = client.packer.pack(mavlink.MAVLink_ping_message(1, 5, 0, 0))
    client.send_raw(raw[:9])
    other.send_raw(raw[9:])
    client.send(mavlink.MAVLink_ping_message(1, 6, 0, 0))
    rig.run(0.04)
    assert [m.seq for m in client.got("PING")] == [6]
    assert other.got("PING") == []


def test_there_is_an_end_to_unfinished_frames() -> None:
    splitter = DatagramSplitter()
    for port in range(1000):
        assert splitter.frames(b"\xfd\x09", Address(0, "127.0.0.1", port)) == []
    assert len(splitter._rests) <= MOST_SENDERS
