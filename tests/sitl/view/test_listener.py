"""What the viewer makes of MAVLink: frames, sources, and whatever else may come."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from sitl.view.listener import STALE, Listener
from sitl_bridge.frames import LocalOrigin, rotate
from sitl_bridge.ids import COMPONENT_LOAD
from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.wire.truth_to import TruthTo
from sitl_bridge.vehicle.files import load_vehicle

AUTOPILOT = Packer(1, 1)
LOAD = Packer(101, COMPONENT_LOAD)


def test_it_shows_what_the_plant_says_of_its_truth() -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", "initial.attitude=[0.1,-0.2,2.5]"])
    simulation = Simulation(vehicle, 250.0, seed=0)
    world = simulation.world
    datagram = TruthTo(0, simulation.origin).to_send(0.0, simulation)
    assert datagram is not None
    listener = Listener()
    listener.receive(datagram, 0.0)
    view = listener.view
    assert view.vehicle == pytest.approx(world.state[0:3], abs=1e-6)
    assert view.load == pytest.approx(world.state[13:16], abs=1e-6)
    up = rotate(tuple(world.state[6:10].tolist()), (0.0, 0.0, 1.0))
    assert rotate(view.attitude, (0.0, 0.0, 1.0)) == pytest.approx(up, abs=1e-6)
    speeds = world.inner[:4] / [rotor.max_speed for rotor in vehicle.rotors]
    assert view.rotors[:4] == pytest.approx(speeds, abs=1e-6)


def test_hil_state_quaternion_alone_gives_the_place_within_its_resolution() -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[30,-20,10]"])
    simulation = Simulation(vehicle, 250.0, seed=0)
    datagram = TruthTo(0, simulation.origin).to_send(0.0, simulation)
    listener = Listener(simulation.origin)
    for frame in split(datagram or b"").frames:
        if frame.message_id == mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
            listener.take(frame, 0.0)
    resolution = 1e-7 * 111_320  # m, of a degree's seventh digit
    assert listener.view.vehicle == pytest.approx(simulation.world.state[0:3], abs=resolution)
    assert listener.view.load == pytest.approx(simulation.world.state[13:16], abs=resolution)


def test_a_coarse_source_does_not_replace_a_fine_one_until_that_is_silent() -> None:
    origin = LocalOrigin(47.0, 8.0, 400.0)
    listener = Listener(origin)
    covariance = [math.nan] + [0.0] * 20
    fine = mavlink.MAVLink_odometry_message(
        1000, 1, 12, 2.0, 1.0, -3.0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, covariance, covariance
    )
    coarse = mavlink.MAVLink_global_position_int_message(2, 470000000, 80000000, 400_000, 0, 0, 0, 0, 0)
    listener.receive(AUTOPILOT.pack(fine), 0.0)
    listener.receive(AUTOPILOT.pack(coarse), 0.5 * STALE)
    assert listener.view.vehicle == pytest.approx((1.0, 2.0, 3.0))
    listener.receive(AUTOPILOT.pack(coarse), 1.5 * STALE)
    assert listener.view.vehicle == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


def test_it_asks_an_autopilot_once_for_what_moves() -> None:
    listener = Listener()
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 129, 0x03040000, 4, 3)
    for second in range(3):
        listener.receive(AUTOPILOT.pack(heartbeat), float(second))
    sent = [decode(frame) for data in listener.to_send(3.0) for frame in split(data).frames]
    asked = [m for m in sent if m.get_type() == "COMMAND_LONG"]
    assert {(m.command, m.target_system) for m in asked} == {(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 1)}
    assert {int(m.param1) for m in asked} == {31, 33}
    assert listener.view.mode == "Hold"
    assert listener.view.armed
    assert not listener.to_send(3.1)


def test_the_loads_place_is_the_loads() -> None:
    listener = Listener(LocalOrigin(47.0, 8.0, 400.0))
    place = mavlink.MAVLink_global_position_int_message(2, 470000900, 80000000, 405_000, 0, 0, 0, 0, 0)
    listener.receive(LOAD.pack(place), 0.0)
    assert listener.view.vehicle is None
    assert listener.view.load is not None
    assert listener.view.load[1] == pytest.approx(10.0, abs=0.01)
    assert listener.view.load[2] == pytest.approx(5.0)


@given(
    st.binary(max_size=300),
    st.sampled_from([0, 22, 30, 31, 32, 33, 85, 93, 115, 147, 231, 251, 253, 331, 350]),
)
def test_no_payload_upsets_it(payload: bytes, message_id: int) -> None:
    from sitl_bridge.mavlink.framing import Frame

    listener = Listener()
    listener.take(Frame(message_id, 1, 1, payload[:255], b"\xfd"), 0.0)
    listener.receive(payload, 0.0)
    assert listener.view.vehicle is None or all(map(math.isfinite, listener.view.vehicle))


def test_it_shows_a_chains_nodes_tension_and_the_scenarios_time() -> None:
    settings = ["cable.model=chain", "cable.segments=5", "air.wind=[3,1,0]", "initial.start=hover"]
    simulation = Simulation(load_vehicle("iris", settings), 250.0, seed=0)
    for _ in range(10):
        simulation.next_tick()
    simulation.begin()
    for _ in range(100):
        simulation.step(np.zeros(16))
    datagram = TruthTo(0, simulation.origin).to_send(0.0, simulation)
    listener = Listener(simulation.origin, node_count=4)
    listener.receive(datagram or b"", 0.0)
    view = listener.view
    assert np.array(view.nodes) == pytest.approx(simulation.world.chain_nodes(), abs=1e-5)
    assert view.tension == pytest.approx(simulation.world.cable_tension(), rel=1e-5)
    assert view.time_s == pytest.approx(0.4, abs=1e-3)
    assert view.wind == pytest.approx((3.0, 1.0, 0.0))
    simulation.world.release_cable()
    broken = TruthTo(0, simulation.origin).to_send(0.0, simulation)
    listener.receive(broken or b"", 0.1)
    assert math.isnan(listener.view.tension or 0.0)


def test_it_sets_the_plants_speed_once_the_plant_can_be_steered() -> None:
    listener = Listener()
    simulation = Simulation(load_vehicle("iris", []), 250.0, seed=0)
    listener.receive(TruthTo(0, simulation.origin).to_send(0.0, simulation) or b"", 0.0)
    listener.set_plant("SIM_SPEEDUP", 0.0)
    sent = [decode(frame) for data in listener.to_send(0.0) for frame in split(data).frames]
    assert [m.get_type() for m in sent] == ["HEARTBEAT", "PARAM_REQUEST_LIST"]
    for name, value in ((b"SIM_SPEEDUP", 0.5), (b"SIM_STEPS", 0.0)):
        message = mavlink.MAVLink_param_value_message(name, value, 9, 2, 0)
        listener.receive(Packer(1, 191).pack(message), 0.1)
    assert (listener.view.speed, listener.view.steerable) == (0.5, True)
    listener.set_plant("SIM_SPEEDUP", 0.0)
    [sent_now] = [decode(frame) for data in listener.to_send(0.2) for frame in split(data).frames]
    assert (sent_now.param_id, sent_now.param_value) == ("SIM_SPEEDUP", 0.0)
    assert (sent_now.target_system, sent_now.target_component) == (1, 191)
