"""Telemetry logs: what crosses the link at every tick is recorded at a limited rate, all else always."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.tlog import TlogWriter

TICK_USEC = 4000
TICKS = 250
"""One second."""


def sensor(time_usec: int) -> mavlink.MAVLink_hil_sensor_message:
    return mavlink.MAVLink_hil_sensor_message(time_usec, *[0.0] * 13, 0x1FFF)


def odometry(time_usec: int) -> mavlink.MAVLink_odometry_message:
    nothing = [0.0] * 21
    return mavlink.MAVLink_odometry_message(
        time_usec, 1, 12, *[0.0] * 3, [1.0, 0.0, 0.0, 0.0], *[0.0] * 6, nothing, nothing
    )


def answer(time_usec: int, armed: bool) -> mavlink.MAVLink_hil_actuator_controls_message:
    return mavlink.MAVLink_hil_actuator_controls_message(time_usec, [0.5] * 16, 128 if armed else 0, 1)


def recorded(file: Path) -> list[tuple[str, int, int]]:
    """Type, component and time of each message, as pymavlink reads them."""
    found = []
    with mavutil.mavlink_connection(str(file)) as log:
        while (message := log.recv_msg()) is not None:
            found.append((message.get_type(), message.get_srcComponent(), getattr(message, "time_usec", 0)))
    return found


def written(file: Path, rate_hz: float | None, first_tick: int = 0, armed_from: int = 0) -> None:
    """A second of ticks: sensors and the truth of vehicle and load, an answer, now and then a heartbeat."""
    plant, load, autopilot = (Packer(1, component) for component in (51, 52, 1))
    log = TlogWriter(file, rate_hz)
    for tick in range(TICKS):
        time_usec = (first_tick + tick) * TICK_USEC
        log.write(
            plant.pack(sensor(time_usec)) + plant.pack(odometry(time_usec)) + load.pack(odometry(time_usec)),
            1.7e9,
        )
        if tick % 100 == 0:
            log.write(plant.pack(mavlink.MAVLink_heartbeat_message(2, 8, 0, 0, 0, 3)), 1.7e9)
        log.write(autopilot.pack(answer(time_usec, tick >= armed_from)), 1.7e9)
    log.close()


def test_without_a_limit_every_frame_is_there(tmp_path: Path) -> None:
    written(tmp_path / "link.tlog", None)
    found = [kind for kind, _, _ in recorded(tmp_path / "link.tlog")]
    assert len(found) == 4 * TICKS + 3


@pytest.mark.parametrize("first_tick", [0, 7, 10_000_000])
def test_ticks_are_recorded_whole_at_the_rate(tmp_path: Path, first_tick: int) -> None:
    written(tmp_path / "link.tlog", 10.0, first_tick)
    found = recorded(tmp_path / "link.tlog")
    sensors = [time for kind, _, time in found if kind == "HIL_SENSOR"]
    assert 10 <= len(sensors) <= 11
    for component in (51, 52):  # vehicle's and load's
        assert [time for kind, c, time in found if kind == "ODOMETRY" and c == component] == sensors
    assert [time for kind, _, time in found if kind == "HIL_ACTUATOR_CONTROLS"] == sensors
    assert sum(kind == "HEARTBEAT" for kind, _, _ in found) == 3


def test_the_first_armed_answer_is_always_recorded(tmp_path: Path) -> None:
    written(tmp_path / "link.tlog", 10.0, armed_from=123)
    answers = [time for kind, _, time in recorded(tmp_path / "link.tlog") if kind == "HIL_ACTUATOR_CONTROLS"]
    assert 123 * TICK_USEC in answers


def test_a_simulation_that_begins_afresh_is_recorded(tmp_path: Path) -> None:
    file = tmp_path / "link.tlog"
    plant = Packer(1, 51)
    log = TlogWriter(file, 10.0)
    for time_usec in (*range(10_000_000, 11_000_000, TICK_USEC), *range(0, 1_000_000, TICK_USEC)):
        log.write(plant.pack(sensor(time_usec)), 1.7e9)
    log.close()
    times = [time for _, _, time in recorded(file)]
    assert 10 <= sum(time < 1_000_000 for time in times) <= 11
