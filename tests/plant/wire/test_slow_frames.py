"""The load as a system of its own, battery, tracker and truth on the HIL link, as pymavlink reads them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from sitl_bridge.frames import LocalOrigin
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.wire.load_to import LoadTo
from sitl_bridge.vehicle.files import load_vehicle

RATE = 250.0
INSTANCE = 3
Sent = list[tuple[float, Frame, Any]]


def fly(duration: float, *overrides: str, begin: bool = True, **asked: float) -> tuple[Simulation, Sent]:
    """Hover with held rotors; every frame of every tick with its time, s. asked: intervals, us."""
    vehicle = load_vehicle("iris", ["initial.start=hover", "sensors.preset=ideal", *overrides])
    simulation = Simulation(vehicle, RATE, seed=1, instance=INSTANCE)
    for name, interval in asked.items():
        ask(simulation, getattr(common, f"MAVLINK_MSG_ID_{name}"), interval)
    sent: Sent = []
    for k in range(round(duration * RATE)):
        datagram = simulation.datagram()
        assert len(datagram) <= 2048
        frames = split(datagram).frames
        assert frames[-1].message_id == common.MAVLINK_MSG_ID_HIL_SENSOR
        sent += [(simulation.time_usec / 1e6, frame, decode(frame)) for frame in frames]
        if begin and k == 0:
            simulation.begin()
        if simulation.started:
            simulation.step(simulation.world.trim_controls)
        else:
            simulation.next_tick()
    return simulation, sent


def ask(simulation: Simulation, message_id: int, interval_us: float) -> None:
    command = common.MAVLink_command_long_message(0, 0, 511, 0, message_id, interval_us, 0, 0, 0, 0, 0)
    reply = simulation.handle(split(Packer(INSTANCE + 1, 1).pack(command)).frames[0])
    assert reply is not None
    assert decode(split(reply).frames[0]).result == common.MAV_RESULT_ACCEPTED


def of(sent: Sent, kind: str) -> Sent:
    return [entry for entry in sent if entry[2].get_type() == kind]


def test_the_load_is_a_system_of_its_own() -> None:
    simulation, sent = fly(4.0)
    heartbeats, positions = of(sent, "HEARTBEAT"), of(sent, "GLOBAL_POSITION_INT")
    assert len(heartbeats) == pytest.approx(4, abs=1)
    assert 5 * 4 - 1 <= len(positions) <= 10 * 4 + 1
    for _, frame, message in heartbeats:
        assert (frame.system, frame.component) == (101 + INSTANCE, 35)
        assert message.type == common.MAV_TYPE_AIRSHIP
        assert message.autopilot == common.MAV_AUTOPILOT_INVALID
        assert not message.base_mode & common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    home = simulation.world.vehicle.home
    first = positions[0][2]
    x, y, z = load_vehicle("iris").initial.load_position
    origin = LocalOrigin(home.latitude, home.longitude, home.altitude)
    point = origin.geodetic((x, y, z))
    assert (first.lat, first.lon) == (round(point.latitude * 1e7), round(point.longitude * 1e7))
    assert first.alt == round((home.altitude + z) * 1e3)
    assert first.relative_alt == round(z * 1e3)
    assert first.hdg == 0xFFFF


def test_the_loads_velocity_is_ned_in_centimetres() -> None:
    _, sent = fly(0.01, "initial.load_velocity=[1.0, 2.0, -0.5]", begin=False)
    message = of(sent, "GLOBAL_POSITION_INT")[0][2]
    assert (message.vx, message.vy, message.vz) == (200, 100, 50)


def test_each_sender_counts_its_frames() -> None:
    _, sent = fly(3.0, HIL_STATE_QUATERNION=10_000)
    for system in (INSTANCE + 1, 101 + INSTANCE):
        numbers = [frame.raw[4] for _, frame, _ in sent if frame.system == system]
        assert len(numbers) > 10
        gaps = {(after - before) % 256 for before, after in itertools.pairwise(numbers)}
        assert gaps <= {1, 2}  # 2: the acknowledgement went out on its own
        assert 1 in gaps


def test_the_battery_tells_what_it_gives() -> None:
    simulation, sent = fly(6.0, "battery.charge=0.5")
    reports = of(sent, "BATTERY_STATUS")
    assert len(reports) == pytest.approx(12, abs=1)
    assert {(frame.system, frame.component) for _, frame, _ in reports} == {(INSTANCE + 1, 191)}
    first, last = reports[1][2], reports[-1][2]
    battery = simulation.world.vehicle.battery
    assert battery is not None
    amperes = last.current_battery / 100
    open_circuit = last.voltages[0] / 1000 + battery.resistance * amperes
    half = battery.cells * (battery.empty_cell_voltage + battery.full_cell_voltage) / 2
    assert open_circuit == pytest.approx(half, rel=0.01)
    assert amperes > 5.0  # it hovers
    assert last.voltages[1:] == [0xFFFF] * 9
    used = last.current_consumed / (1000 * battery.capacity)
    assert last.battery_remaining == pytest.approx(100 * (1 - used), abs=0.6)
    elapsed = reports[-1][0] - reports[1][0]
    used = last.current_consumed - first.current_consumed
    assert used == pytest.approx(1000 * amperes * elapsed / 3600, abs=1.5)  # mAh, whole ones


def test_no_battery_no_report() -> None:
    vehicle = load_vehicle("paper")
    simulation = Simulation(vehicle, RATE, seed=0)
    assert not [
        frame
        for frame in split(simulation.datagram()).frames
        if frame.message_id == common.MAVLINK_MSG_ID_BATTERY_STATUS
    ]


def test_the_tracker_sees_the_load_in_body_frd() -> None:
    fitted = "sensors.tracker={rate = 20.0, delay = 0.04}"
    _, sent = fly(1.0, fitted, "initial.vehicle_position=[0.8, 0.1, 2.4]")
    sightings = of(sent, "LANDING_TARGET")
    assert len(sightings) == pytest.approx(20, abs=2)
    time, _, seen = sightings[0]
    assert seen.time_usec == round((time - 0.04) * 1e6)
    assert seen.frame == common.MAV_FRAME_BODY_FRD
    assert seen.position_valid == 1
    # The load hangs at (1, 0, 1): 0.2 m ahead, 0.1 m to the right, 1.4 m below.
    assert (seen.x, seen.y, seen.z) == pytest.approx(
        (0.2, 0.1, 1.4), abs=0.02
    )  # the cable is slack: it falls
    assert seen.distance == pytest.approx(math.sqrt(0.2**2 + 0.1**2 + 1.4**2), abs=0.02)
    assert math.tan(seen.angle_x) == pytest.approx(0.1 / 1.4, abs=0.01)
    assert math.tan(seen.angle_y) == pytest.approx(-0.2 / 1.4, abs=0.01)


def test_no_tracker_no_landing_target() -> None:
    assert not of(fly(0.5)[1], "LANDING_TARGET")


@pytest.mark.parametrize(("interval_us", "hz"), [(5000, 200), (20_000, 50), (0, 250), (1000, 250), (-1, 0)])
def test_hil_state_quaternion_at_its_interval(interval_us: float, hz: float) -> None:
    _, sent = fly(1.0, begin=False, HIL_STATE_QUATERNION=interval_us)
    assert len(of(sent, "HIL_STATE_QUATERNION")) == pytest.approx(hz, abs=1)


def test_hil_state_quaternion_is_not_sent_unasked() -> None:
    assert not of(fly(0.5)[1], "HIL_STATE_QUATERNION")


def test_hil_state_quaternion_is_the_truth() -> None:
    moving = (
        "initial.vehicle_velocity=[1.0, 2.0, 3.0]",
        "initial.body_rates=[0.1, 0.2, 0.3]",
        "air.wind=[1,0,0]",
    )
    simulation, _ = fly(0.004, *moving, "initial.attitude=[0.0, 0.0, 1.5707963267948966]", begin=False)
    simulation.begin()
    ask(simulation, common.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 0)
    simulation.step([0.0] * 16)
    before = simulation.world.state.copy()
    frames = [decode(frame) for frame in split(simulation.datagram()).frames]
    truth = next(m for m in frames if m.get_type() == "HIL_STATE_QUATERNION")
    sensed = next(m for m in frames if m.get_type() == "HIL_SENSOR")
    east, north, up = before[3:6]
    assert (truth.vx, truth.vy, truth.vz) == pytest.approx((100 * north, 100 * east, -100 * up), abs=0.51)
    p, q, r = before[10:13]
    assert (truth.rollspeed, truth.pitchspeed, truth.yawspeed) == pytest.approx((p, -q, -r), abs=1e-6)
    assert truth.attitude_quaternion == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0.01)  # faces north
    felt = np.array([truth.xacc, truth.yacc, truth.zacc]) * 9.80665e-3
    assert felt == pytest.approx([sensed.xacc, sensed.yacc, sensed.zacc], abs=0.006)
    assert truth.true_airspeed == pytest.approx(100 * math.hypot(east - 1.0, north, up), abs=0.51)
    assert truth.alt == pytest.approx(1000 * (488.0 + before[2]), abs=0.51)
    # Air is thinner than at sea level: 488 m of the standard atmosphere is 4.6 % less dense.
    assert truth.ind_airspeed / truth.true_airspeed == pytest.approx(math.sqrt(0.954), abs=0.006)


def test_load_to_shows_the_load_to_maps_of_both_kinds() -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover"])
    simulation = Simulation(vehicle, RATE, seed=0, instance=INSTANCE)
    load = LoadTo(INSTANCE, simulation.origin)
    state = simulation.world.state
    state[16:19] = (1.0, 0.0, 0.5)
    counts = {"HEARTBEAT": 0, "GLOBAL_POSITION_INT": 0, "ADSB_VEHICLE": 0}
    for k in range(1000):  # ten seconds of wall time, simulated time standing still
        datagram = load.to_send(100.0 + 0.01 * k, simulation)
        for frame in split(datagram or b"").frames:
            message = decode(frame)
            counts[message.get_type()] += 1
            if message.get_type() == "ADSB_VEHICLE":
                assert (frame.system, frame.component) == (INSTANCE + 1, 191)
                assert message.flags & common.ADSB_FLAGS_VALID_COORDS
                assert (message.heading, message.hor_velocity, message.ver_velocity) == (9000, 100, 50)
                assert message.ICAO_address == 101 + INSTANCE
                assert message.callsign == f"LOAD{INSTANCE}"
            else:
                assert (frame.system, frame.component) == (101 + INSTANCE, 35)
    assert counts["HEARTBEAT"] == counts["ADSB_VEHICLE"] == pytest.approx(10, abs=1)
    assert counts["GLOBAL_POSITION_INT"] == pytest.approx(100, abs=5)


def test_load_to_shows_each_sighting_of_a_tracker_once() -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", "sensors.tracker.rate=20"])
    simulation = Simulation(vehicle, RATE, seed=0, instance=INSTANCE)
    load = LoadTo(INSTANCE, simulation.origin)
    tracker = simulation.world.tracker
    assert tracker is not None
    seen = []
    for tick in range(1, round(RATE) + 1):
        tracker.sample(tick, simulation.world.state)
        simulation.time_usec = 4000 * tick
        datagram = load.to_send(100.0 + tick / RATE, simulation)
        messages = [decode(frame) for frame in split(datagram or b"").frames]
        seen += [m for m in messages if m.get_type() == "LANDING_TARGET"]
    assert len(seen) == 20
    assert seen[0].z == pytest.approx(vehicle.hover_length, abs=1e-3)
