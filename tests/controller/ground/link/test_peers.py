"""Who is served, in which version, how often, for how long."""

from __future__ import annotations

import itertools
import socket
from typing import Any

import pytest
from pymavlink.dialects.v10 import common as v1
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import FigureEightStatus
from controller.ground.link.peers import MOST_PEERS, SILENCE
from controller.ground.link.sockets import FRAMES_AT_ONCE, MOST_BYTES, BindError, GroundSockets
from controller.ground.telemetry.message_rates import DEFAULT_RATES
from sitl_bridge.mavlink.framing import Packer, split
from tests.controller.ground.rig import Rig


def test_the_vehicle_talks_first_to_both_standard_places() -> None:
    rig = Rig()
    station, onboard = rig.client(14550), rig.client(14540, link=1)
    rig.run(0.5)
    for client in (station, onboard):
        beat = client.got("HEARTBEAT")[0]
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
        assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4)
        assert beat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        assert beat.custom_mode == 4 << 16 | 3 << 24


def test_default_rates() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(10.0)
    # Nothing to say without a load on the link, on the ground, without a pattern, without a winch:
    silent = (
        mavlink.MAVLINK_MSG_ID_WINCH_STATUS,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS,
        FigureEightStatus.id,
    )
    for number, rate in DEFAULT_RATES.items():
        if number in silent:
            continue
        count = sum(1 for raw in client.raw if raw[7] | raw[8] << 8 == number)
        assert count == pytest.approx(10 * rate, abs=1.5), number


def test_any_peer_that_speaks_is_served_and_forgotten_when_silent() -> None:
    rig = Rig()
    third = rig.client(50123)
    rig.run(1.0)
    assert not third.inbox
    third.heartbeat()
    rig.run(1.0)
    assert third.got("HEARTBEAT")
    third.send(mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, 10000, *(0,) * 5))
    rig.run(SILENCE + 2)
    third.clear()
    rig.run(2.0)
    assert not third.inbox
    third.heartbeat()
    rig.run(1.0)
    assert len(third.got("ATTITUDE")) == pytest.approx(10, abs=2)  # its rates of before are forgotten


def test_a_standard_peer_that_falls_silent_starts_afresh() -> None:
    rig = Rig()
    client = rig.client()
    assert client.command(511, 30, 10000).result == 0
    rig.run(SILENCE + 2)
    client.clear()
    rig.run(1.0)
    assert len(client.got("ATTITUDE")) == pytest.approx(10, abs=2)


def test_there_is_an_end_to_peers() -> None:
    rig = Rig()
    for port in range(40000, 40100):
        rig.client(port).heartbeat()
    rig.run(0.1)
    assert len(list(rig.station.peers)) == MOST_PEERS
    assert rig.station.dropped == 100 - (MOST_PEERS - 2)
    rig.run(SILENCE + 2)
    assert len(list(rig.station.peers)) == 2


def test_ports_that_are_no_lasting_clients_lock_nobody_out() -> None:
    rig = Rig()
    ping = mavlink.MAVLink_ping_message(1, 1, 0, 0)
    strays = [rig.client(port) for port in range(40000, 40000 + MOST_PEERS)]
    friend = rig.client(50000)
    for stray in strays[:5]:
        stray.heartbeat()  # these were clients
    for stray in strays[5:]:
        stray.send(ping)
    for _ in range(4):
        for stray in strays[5:]:
            stray.send(ping)
        friend.heartbeat()
        rig.run(2.0)
    assert friend.address in {peer.address for peer in rig.station.peers}
    assert len(friend.got("HEARTBEAT")) >= 7
    assert len(list(rig.station.peers)) == MOST_PEERS
    friends = [rig.client(port) for port in range(51000, 51000 + MOST_PEERS - 3)]
    for each in friends:
        each.heartbeat()  # in the places of what has sent no HEARTBEAT, and then of clients long silent
    assert {each.address for each in (friend, *friends)} <= {peer.address for peer in rig.station.peers}


def test_mavlink_1_is_answered_in_mavlink_1_until_the_peer_knows_better() -> None:
    rig = Rig()
    old, new = rig.client(), rig.client(14540, link=1)
    writer = v1.MAVLink(None, srcSystem=255, srcComponent=190)
    beat = v1.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(writer)
    old.send_raw(beat)
    old.send_raw(v1.MAVLink_command_long_message(1, 1, 400, 0, 7, 0, 0, 0, 0, 0, 0).pack(writer))
    rig.run(1.0)
    assert {raw[0] for raw in old.raw} == {0xFE}
    assert old.got("COMMAND_ACK")[0].result == 2
    assert old.got("STATUSTEXT")[0].text.startswith("Arm or disarm denied")
    assert {raw[0] for raw in new.raw} == {0xFD}
    old.clear()
    old.heartbeat()
    rig.run(1.0)
    assert {raw[0] for raw in old.raw} == {0xFD}


def test_sequence_numbers_count_for_each_peer_without_a_gap() -> None:
    rig = Rig()
    client, other = rig.client(), rig.client(14540, link=1)
    client.command(511, 30, 10000)
    rig.run(5.0)
    for each in (client, other):
        numbers = [raw[4] for raw in each.raw]
        assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(numbers))


def test_a_datagram_may_hold_several_frames_and_junk() -> None:
    """PX4 does not find a good frame again behind junk with a false start byte."""
    rig = Rig()
    client = rig.client()
    frames = [client.packer.pack(mavlink.MAVLink_ping_message(n, n, 0, 0)) for n in range(3)]
    client.send_raw(b"\xfd\xff\x00" + frames[0] + b"\xfe\x10junk" + frames[1] + frames[2])
    rig.run(0.04)
    assert [m.seq for m in client.got("PING")] == [0, 1, 2]


def test_our_own_echo_and_unknown_flags_are_not_taken() -> None:
    rig = Rig()
    client = rig.client()
    ping = mavlink.MAVLink_ping_message(1, 1, 0, 0)
    client.send_raw(Packer(1, 1).pack(ping), Packer(101, 35).pack(ping), Packer(0, 1).pack(ping))
    flagged = bytearray(client.packer.pack(ping))
    flagged[2] |= 0x80
    crc = mavlink.x25crc(bytes(flagged[1:-2]) + bytes((ping.crc_extra,))).crc
    client.send_raw(bytes(flagged[:-2]) + crc.to_bytes(2, "little"))
    rig.run(0.04)
    assert not client.got("PING")
    assert rig.station.dropped == 4
    client.send_raw(Packer(1, 191).pack(ping))  # a companion computer shares the system
    rig.run(0.04)
    assert client.got("PING")


def test_data_streams_as_mavproxy_asks_for_them() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1))
    rig.run(0.1)
    client.clear()
    rig.run(5.0)
    for kind in ("ATTITUDE", "GLOBAL_POSITION_INT", "VFR_HUD"):
        assert len(client.got(kind)) == pytest.approx(20, abs=1)
    client.send(mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_EXTRA1, 4, 0))
    rig.run(0.1)
    client.clear()
    rig.run(1.0)
    assert not client.got("ATTITUDE")
    assert client.got("HEARTBEAT")


def test_the_load_is_passed_on_as_a_system_of_its_own_and_as_traffic() -> None:
    rig = Rig()
    client = rig.client()
    load = Packer(101, 35)

    def plant() -> None:
        place = mavlink.MAVLink_global_position_int_message(
            1, 473977420, 85455940, 488100, 100, 300, 400, -100, 0
        )
        for message in (mavlink.MAVLink_heartbeat_message(7, 8, 0, 0, 4, 3), place):
            for frame in split(load.pack(message)).frames:
                rig.station.hear_plant(frame, rig.now)

    rig.before_step = plant
    rig.run(5.0)
    beats = [m for m in client.got("HEARTBEAT") if m.get_srcSystem() == 101]
    assert len(beats) == pytest.approx(5, abs=1)
    assert {(m.type, m.autopilot, m.get_srcComponent()) for m in beats} == {(7, 8, 35)}
    places = [m for m in client.got("GLOBAL_POSITION_INT") if m.get_srcSystem() == 101]
    assert len(places) == pytest.approx(25, abs=2)
    traffic = client.got("ADSB_VEHICLE")[-1]
    assert (traffic.get_srcSystem(), traffic.lat, traffic.lon, traffic.altitude) == (
        1,
        473977420,
        85455940,
        488100,
    )
    assert traffic.flags & mavlink.ADSB_FLAGS_VALID_COORDS
    assert (traffic.hor_velocity, traffic.ver_velocity) == (500, 100)
    assert traffic.heading == pytest.approx(5313, abs=1)
    rig.before_step = lambda: None
    rig.run(3.0)
    client.clear()
    rig.run(2.0)
    assert not [m for m in client.inbox if m.get_srcSystem() == 101]
    assert not client.got("ADSB_VEHICLE")


def test_nothing_is_due_before_the_deadline() -> None:
    rig = Rig()
    rig.station.update(rig.view, rig.now)
    sent, began = 0, rig.now
    for _ in range(300):
        sent += len(rig.station.to_send(rig.now))
        deadline = rig.station.next_deadline(rig.now)
        assert rig.now < deadline <= rig.now + 1.0
        assert not rig.station.to_send(deadline - 1e-6)
        rig.now = deadline
    assert sent > 80 * (rig.now - began)  # four messages alone go to two peers at 10 Hz


def test_links_stay_on_this_machine_unless_told_otherwise() -> None:
    with pytest.raises(BindError):
        GroundSockets((0, 0), "0.0.0.0")
    links = GroundSockets((0, 0))
    assert [link.getsockname()[0] for link in links.sockets] == ["127.0.0.1"] * 2
    links.close()
    GroundSockets((0, 0), "0.0.0.0", exposed=True).close()


def test_one_exchange_takes_so_many_frames_and_leaves_the_rest_to_the_next() -> None:
    """A full datagram of requests would otherwise stand in front of the control loop for 80 ms."""
    rig = Rig()
    links = GroundSockets((0, 0))
    taken: list[int] = []
    original = rig.station.receive_frame

    def counted(*arguments: Any) -> None:
        taken[-1] += 1
        original(*arguments)

    rig.station.receive_frame = counted  # type: ignore[method-assign]
    packer = Packer(255, 190)
    request = mavlink.MAVLink_param_request_read_message(1, 1, b"", 0)
    frames = [packer.pack(request) for _ in range(65507 // len(packer.pack(request)))]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.sendto(b"".join(frames), links.sockets[0].getsockname())
        client.sendto(frames[0], links.sockets[1].getsockname())
        for _ in range(len(frames)):
            taken.append(0)
            links.serve(rig.station, rig.now)
    links.close()
    assert max(taken) <= FRAMES_AT_ONCE + 1  # of one link, and the other's one
    assert taken[0] == FRAMES_AT_ONCE + 1
    assert sum(taken) == MOST_BYTES // len(frames[0]) + 1
