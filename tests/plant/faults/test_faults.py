"""Faults: parsed with validation, timed, mapped from MAV_CMD_INJECT_FAILURE, applied."""

import math
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.plant.faults.impairments import FaultyPath
from sitl_bridge.plant.faults.schedule import (
    FAILURES,
    Due,
    Faults,
    LinkFault,
    ReleaseCable,
    SensorFault,
    SetLoadMass,
    SetRotor,
    SetSensor,
    checked,
    from_command,
    timeline,
)
from sitl_bridge.plant.physics.state import CABLE_HOLDS
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.sensing import Diverged
from sitl_bridge.plant.sensors.gps import NO_FIX
from sitl_bridge.plant.sensors.instruments import GARBAGE, LOST, OFF, STUCK, WORKS, WRONG
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle, validated

TABLE = {
    "sensor": [
        {"sensor": "gps", "failure": "lost", "at": 10.0, "duration": 5.0},
        {"sensor": "magnetometer", "failure": "stuck", "at": 2.0},
    ],
    "rotor": [{"rotor": 2, "thrust": 0.5, "at": 12.0, "duration": 1.0}],
    "cable": [{"at": 20.0}],
    "load": [{"mass": 0.5, "at": 3.0, "duration": 4.0}],
}


def test_timeline_in_order() -> None:
    assert timeline(validated(Faults, TABLE, "test")) == [
        Due(2.0, SetSensor("magnetometer", STUCK)),
        Due(3.0, SetLoadMass(0.5)),
        Due(7.0, SetLoadMass(None)),
        Due(10.0, SetSensor("gps", LOST)),
        Due(12.0, SetRotor(1, 0.5)),
        Due(13.0, SetRotor(1, 1.0)),
        Due(15.0, SetSensor("gps", WORKS)),
        Due(20.0, ReleaseCable()),
    ]


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ({"sensor": [{"sensor": "nose", "failure": "off", "at": 1.0}]}, "sensor.0.sensor = 'nose'"),
        ({"rotor": [{"rotor": 0, "at": 1.0}]}, "rotor.0.rotor = 0"),
        ({"rotor": [{"rotor": 1, "at": -1.0}]}, "rotor.0.at = -1.0 s"),
        ({"link": [{"failure": "drop", "share": 1.5, "at": 0.0}]}, "link.0.share = 1.5"),
        ({"cable": [{}]}, "cable.0.at: missing"),
        ({"weather": []}, "no such key"),
    ],
)
def test_faulty_tables_are_refused(table: dict[str, object], fault: str) -> None:
    with pytest.raises(DescriptionError, match=fault):
        validated(Faults, table, "test")


spans = st.tuples(
    st.integers(0, 20), st.none() | st.integers(1, 20), st.sampled_from(["off", "stuck", "wrong"])
)


@given(st.lists(spans, max_size=6))
def test_faults_of_one_sensor_overlap_as_they_were_meant(found: list[tuple[int, int | None, str]]) -> None:
    """Whenever one looks, the sensor does what the last fault to begin says of those that are not over."""
    table = [
        {"sensor": "gps", "failure": failure, "at": at / 10}
        | ({} if lasts is None else {"duration": lasts / 10})
        for at, lasts, failure in found
    ]
    actions = timeline(validated(Faults, {"sensor": table}, "test"))
    assert [due.time for due in actions] == sorted(due.time for due in actions)
    for instant in range(45):
        now = instant / 10 + 0.05
        doing = WORKS
        for due in actions:
            if due.time <= now:
                assert isinstance(due.action, SetSensor)
                doing = due.action.doing
        on = [
            fault
            for fault in found
            if fault[0] <= instant and (fault[1] is None or instant < fault[0] + fault[1])
        ]
        last = max(on, key=lambda fault: fault[0], default=None)
        candidates = {FAILURES[f[2]] for f in on if last is not None and f[0] == last[0]} or {WORKS}
        assert doing in candidates


def test_a_fault_may_begin_where_another_ends() -> None:
    """0.1 + 0.2 is more than 0.3 to a computer; the second fault acts nevertheless, and lasts."""
    table = [
        {"sensor": "gps", "failure": "off", "at": 0.1, "duration": 0.2},
        {"sensor": "gps", "failure": "wrong", "at": 0.3, "duration": 0.5},
    ]
    for order in (table, table[::-1]):
        assert timeline(validated(Faults, {"sensor": order}, "test")) == [
            Due(0.1, SetSensor("gps", OFF)),
            Due(0.3, SetSensor("gps", WRONG)),
            Due(0.8, SetSensor("gps", WORKS)),
        ]


def test_command_numbers_are_mavlinks() -> None:
    """Against the dialect's own names."""
    for name, sensor in (
        ("GYRO", "gyroscope"),
        ("ACCEL", "accelerometer"),
        ("MAG", "magnetometer"),
        ("BARO", "barometer"),
        ("GPS", "gps"),
    ):
        unit = getattr(common, f"FAILURE_UNIT_SENSOR_{name}")
        for kind, doing in (
            ("OK", WORKS),
            ("OFF", OFF),
            ("STUCK", STUCK),
            ("GARBAGE", GARBAGE),
            ("WRONG", WRONG),
        ):
            kind_number = getattr(common, f"FAILURE_TYPE_{kind}")
            assert from_command(unit, kind_number, 0, 4) == [SetSensor(sensor, doing)]
    motor = common.FAILURE_UNIT_SYSTEM_MOTOR
    assert from_command(motor, common.FAILURE_TYPE_OFF, 3, 4) == [SetRotor(2, 0.0)]
    assert from_command(motor, common.FAILURE_TYPE_OK, 0, 4) == [SetRotor(i, 1.0) for i in range(4)]


@given(*[st.floats(width=32)] * 3)
def test_any_command_is_understood_or_refused(unit: float, kind: float, instance: float) -> None:
    actions = from_command(unit, kind, instance, 4)
    assert actions is None or len(actions) in (1, 4)


@pytest.mark.parametrize(
    "command", [(8, 1, 0), (101, 2, 1), (101, 1, 5), (0, 5, 0), (0, 1, 2), (math.nan, 1, 0)]
)
def test_unsupported_commands(command: tuple[float, float, float]) -> None:
    assert from_command(*command, 4) is None


def hovering() -> World:
    return World(load_vehicle("iris", ["initial.start=hover", "sensors.preset=ideal"]), 250.0, 1)


def test_faults_reach_the_world() -> None:
    world = hovering()
    SetRotor(0, 0.25).apply(world)
    world.command([0.8] * 16)
    np.testing.assert_allclose(world.rotor_speed[:4], [440.0, 880.0, 880.0, 880.0])
    SetLoadMass(1.0).apply(world)
    world.advance(400)
    assert world.state[15] - world.state[2] < -1.52  # hangs lower
    ReleaseCable().apply(world)
    world.advance(4)
    world.measure(1, False)
    assert world.inner[CABLE_HOLDS] == 0.0
    world.reset()
    assert world.inner[CABLE_HOLDS] == 1.0
    world.command(world.trim_controls)
    start = world.state.copy()
    world.advance(400)
    np.testing.assert_allclose(world.state, start, atol=1e-9)


def test_sensor_faults_reach_the_world() -> None:
    world = hovering()
    SetSensor("gps", LOST).apply(world)
    SetSensor("accelerometer", OFF).apply(world)
    world.measure(0, False)
    fixes = [fix for tick in range(60) if (fix := world.gps.sample(tick, world.state)) is not None]
    assert [fix.fix_type for fix in fixes] == [NO_FIX] * 3
    assert world.measurement["updated"][0] == 0x1FFF & ~0x7
    world.reset()
    assert world.gps.sample(0, world.state).fix_type != NO_FIX  # type: ignore[union-attr]


def sent(faults: list[dict[str, object]], count: int = 1000, seed: int = 1) -> list[tuple[float, int]]:
    """(arrival, number) of datagrams sent every 4 ms from 0 on."""
    found = [validated(LinkFault, fault, "test") for fault in faults]
    path, out, now = FaultyPath(found, "to_plant", seed), [], 0.0
    for index in range(count):
        path.receive(index.to_bytes(4, "little"), 0.004 * index)
    while (deadline := path.next_deadline()) is not None:
        assert deadline >= now
        now = deadline
        out += [(now, int.from_bytes(datagram, "little")) for datagram in path.to_send(now)]
    return out


def test_link_faults() -> None:
    every = [(0.004 * index, index) for index in range(1000)]
    assert sent([]) == every
    assert sent([{"failure": "delay", "delay": 0.5, "at": 0.0, "direction": "to_autopilot"}]) == every
    dropped = sent([{"failure": "drop", "share": 0.2, "at": 0.0}])
    assert 740 < len(dropped) < 860
    assert sent([{"failure": "drop", "share": 0.2, "at": 0.0}]) == dropped
    assert sent([{"failure": "drop", "share": 0.2, "at": 0.0}], seed=2) != dropped
    delayed = sent([{"failure": "delay", "delay": 0.5, "at": 1.0, "duration": 1.0}])
    assert [arrival - 0.004 * index for arrival, index in delayed if index < 250] == [0.0] * 250
    assert all(
        arrival - 0.004 * index == pytest.approx(0.5) for arrival, index in delayed if 250 <= index < 500
    )
    assert len(sent([{"failure": "duplicate", "share": 0.5, "at": 0.0}])) == pytest.approx(1500, abs=70)
    mixed = [index for _, index in sent([{"failure": "reorder", "share": 0.1, "at": 0.0}])]
    assert sorted(mixed) == list(range(1000)) != mixed
    jitter = [arrival - 0.004 * index for arrival, index in sent([{"failure": "jitter", "at": 0.0}])]
    assert np.mean(jitter) == pytest.approx(0.01, rel=0.1)
    assert max(jitter) < 0.02
    stalled = sent([{"failure": "stall", "at": 1.0, "duration": 0.5}])
    assert [index for _, index in stalled] == list(range(1000))
    assert all(arrival == 1.5 for arrival, index in stalled if 250 <= index < 375)
    assert sent([{"failure": "stall", "at": 1.0}])[-1][1] == 249


def test_a_fault_of_the_link_changes_no_other() -> None:
    """With losses, what arrives has the delays that it would have had without."""
    jitter: dict[str, object] = {"failure": "jitter", "at": 0.0}
    drop: dict[str, object] = {"failure": "drop", "share": 0.3, "at": 0.0}
    alone = {index: arrival for arrival, index in sent([jitter])}
    for both in ([jitter, drop], [drop, jitter]):
        found = sent(both)
        assert 600 < len(found) < 800
        assert all(alone[index] == arrival for arrival, index in found)
    lost_alone = {index for _, index in sent([drop])}
    assert {index for _, index in sent([jitter, drop])} == lost_alone


def test_scenario_faults_happen_at_their_time() -> None:
    """On the tick that they are due, whichever clock steps the world."""
    table = {"cable": [{"at": 0.1}], "gust": [{"start": 0.0, "duration": 1.0, "peak": [5.0, 0.0, 0.0]}]}
    simulation = Simulation(
        load_vehicle("iris", ["initial.start=hover"]), 250.0, 1, faults=validated(Faults, table, "test")
    )
    simulation.begin()
    holds = []
    for _ in range(50):
        holds.append(simulation.world.inner[CABLE_HOLDS])
        simulation.step(simulation.world.trim_controls)
    assert holds == [1.0] * 25 + [0.0] * 25
    assert simulation.world.state[3] > 0.01  # blown to the east


@pytest.mark.parametrize(
    ("unit", "result", "stopped"),
    [
        (common.FAILURE_UNIT_SYSTEM_MOTOR, common.MAV_RESULT_ACCEPTED, 1),
        (common.FAILURE_UNIT_SENSOR_VIO, common.MAV_RESULT_UNSUPPORTED, 0),
    ],
)
def test_failures_are_injected_over_mavlink(unit: int, result: int, stopped: int) -> None:
    simulation = Simulation(load_vehicle("iris", ["initial.start=hover"]), 250.0, 1)
    simulation.begin()
    command = common.MAVLink_command_long_message(
        1, 191, common.MAV_CMD_INJECT_FAILURE, 0, unit, common.FAILURE_TYPE_OFF, 2, 0, 0, 0, 0
    )
    [frame] = split(Packer(1, 1).pack(command)).frames
    reply = simulation.handle(frame)
    assert reply is not None
    [answer] = split(reply).frames
    assert decode(answer).result == result
    simulation.step(simulation.world.trim_controls)
    assert np.count_nonzero(simulation.world.rotor_speed[:4] == 0.0) == stopped


def inject(simulation: Simulation, unit: int, kind: int, instance: int) -> None:
    command = common.MAVLink_command_long_message(
        1, 191, common.MAV_CMD_INJECT_FAILURE, 0, unit, kind, instance, 0, 0, 0, 0
    )
    [frame] = split(Packer(1, 1).pack(command)).frames
    reply = simulation.handle(frame)
    assert reply is not None
    assert decode(split(reply).frames[0]).result == common.MAV_RESULT_ACCEPTED


@pytest.mark.parametrize("answered_before", [False, True])
def test_what_was_injected_before_take_off_is_still_broken_in_flight(answered_before: bool) -> None:
    """Neither the sensors' new beginning nor that of the scenario heals anything."""
    simulation = Simulation(load_vehicle("iris", ["initial.start=hover"]), 250.0, 1)
    simulation.datagram()
    if answered_before:
        simulation.heard()
    inject(simulation, common.FAILURE_UNIT_SYSTEM_MOTOR, common.FAILURE_TYPE_OFF, 2)
    inject(simulation, common.FAILURE_UNIT_SYSTEM_MOTOR, common.FAILURE_TYPE_OFF, 3)
    inject(simulation, common.FAILURE_UNIT_SYSTEM_MOTOR, common.FAILURE_TYPE_OK, 3)
    inject(simulation, common.FAILURE_UNIT_SENSOR_BARO, common.FAILURE_TYPE_OFF, 0)
    simulation.heard()
    simulation.next_tick()
    simulation.datagram()
    simulation.begin()
    simulation.step(simulation.world.trim_controls)
    simulation.datagram()
    assert (simulation.world.rotor_speed[:4] == 0.0).tolist() == [False, True, False, False]
    assert simulation.world.measurement["updated"][0] & (1 << 9) == 0  # the barometer's pressure


@pytest.mark.parametrize("start", ["hover", "ground"])
def test_a_load_as_light_as_can_be_is_simulated(start: str) -> None:
    """The step follows the lightest load: it leaps with no more energy than cable or ground had stored."""
    mass = 1e-3
    faults = validated(Faults, {"load": [{"mass": mass, "at": 0.0}]}, "test")
    vehicle = load_vehicle("heavy", [f"initial.start={start}"])
    simulation = Simulation(vehicle, 250.0, 1, faults=faults)
    simulation.begin()
    assert vehicle.ground is not None
    weight = vehicle.load.mass * vehicle.gravity
    stiffness = vehicle.cable.stiffness if start == "hover" else weight / vehicle.ground.sink
    fastest = math.sqrt(weight**2 / stiffness / mass)
    speeds = []
    for _ in range(25):
        simulation.step(simulation.world.initial_controls)
        simulation.datagram()
        speeds.append(float(np.linalg.norm(simulation.world.state[16:19])))
    assert 0.0 < max(speeds) < fastest


def test_a_state_that_is_not_finite_ends_the_simulation() -> None:
    simulation = Simulation(load_vehicle("iris", ["initial.start=hover"]), 250.0, 1)
    simulation.begin()
    simulation.world.state[4] = math.nan
    simulation.step(simulation.world.trim_controls)
    with pytest.raises(Diverged, match=r"not finite any more at t = 0\.004 s"):
        simulation.datagram()


@pytest.mark.parametrize("place", [(0.0, 0.0, -3e6), (3e7, -3e7, 3e6), (1e300, 0.0, 0.0)])
def test_however_far_it_falls_the_plant_goes_on(place: tuple[float, float, float]) -> None:
    """Fields of positions end at some thousand kilometres; they keep to that."""
    simulation = Simulation(load_vehicle("paper"), 250.0, 1)
    simulation.begin()
    simulation.world.state[:3] += place
    simulation.world.state[13:16] += place
    for _ in range(60):
        simulation.datagram()
        simulation.step(simulation.world.trim_controls)


def test_a_delay_before_the_first_command_leaves_a_vehicle_standing() -> None:
    simulation = Simulation(load_vehicle("iris", ["loop.delay_ticks=3"]), 250.0, 1)
    simulation.begin()
    for _ in range(3):
        simulation.step(np.array(simulation.world.trim_controls))
        assert not simulation.world.rotor_speed.any()
    simulation.step(np.array(simulation.world.trim_controls))
    assert simulation.world.rotor_speed[:4].all()


def test_the_page_shows_every_failure_of_every_sensor() -> None:
    page = (Path(__file__).parents[3] / "docs" / "faults.md").read_text(encoding="utf-8")
    for sensor in get_args(SensorFault.model_fields["sensor"].annotation):
        for failure in FAILURES:
            if failure != "lost" or sensor == "gps":
                assert f"\n| {sensor} {failure} |" in page


def test_a_fault_that_the_vehicle_cannot_have_is_refused() -> None:
    table = {
        "rotor": [{"rotor": 5, "at": 1.0}],
        "sensor": [
            {"sensor": "barometer", "failure": "lost", "at": 1.0},
            {"sensor": "tracker", "failure": "off", "at": 1.0},
        ],
    }
    with pytest.raises(DescriptionError) as refused:
        checked(validated(Faults, table, "test"), load_vehicle("iris"))
    assert refused.value.faults == [
        "faults.rotor.0.rotor = 5: iris has rotors 1 to 4",
        "faults.sensor.0.failure = 'lost': for gps only",
        "faults.sensor.1.sensor = 'tracker': iris has no [sensors.tracker]",
    ]
    fitted = load_vehicle("iris", ["sensors.tracker.rate=20"])
    faults = validated(Faults, {"sensor": table["sensor"][1:]}, "test")
    assert checked(faults, fitted) is faults
