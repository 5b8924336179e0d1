"""Exports are read back with the tools' own libraries, and hold what the state log holds."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from pyulog import ULog
from scipy.io import loadmat

from controller.law.terms import TERM_COLUMNS
from sitl.export.formats import WRITERS, export
from sitl.export.mcap import _rows
from sitl.recording.recording import RecordingError, read_recording
from sitl_bridge.event_log import Event, EventLog
from sitl_bridge.frames import LocalOrigin, attitude_to_ned_frd, enu_to_ned
from tests.sitl.export.flights import RATE_HZ, ROWS, leave_flight


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flight")
    leave_flight(path)
    return path


def test_csv_has_every_row_and_every_digit(folder: Path) -> None:
    with export(folder, "csv").open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    states = read_recording(folder).states
    assert len(rows) == ROWS
    for name in states:
        assert [float(row[names.index(name)]) for row in rows] == states[name].tolist()


def test_matlab_has_the_same_columns(folder: Path) -> None:
    recording = read_recording(folder)
    loaded = loadmat(export(folder, "mat"), simplify_cells=True)
    assert set(loaded["states"]) == set(recording.states)
    np.testing.assert_array_equal(loaded["states"]["load_x_m"].ravel(), recording.states["load_x_m"])
    np.testing.assert_array_equal(loaded["reference"], recording.reference)
    assert loaded["terms"]["saturated_moment_z_N_m"].tolist() == [19.0] * ROWS


def test_ulog_is_in_ned_and_frd(folder: Path) -> None:
    recording = read_recording(folder)
    log = ULog(str(export(folder, "ulog")))
    topics = {data.name: data.data for data in log.data_list}
    load, attitude = topics["slung_load"], topics["vehicle_attitude_groundtruth"]
    assert len(load["timestamp"]) == ROWS
    assert load["timestamp"][-1] == round((ROWS - 1) * 1e6 / RATE_HZ)
    for row in (0, 137, ROWS - 1):
        expected = enu_to_ned(tuple(recording.vectors("load_{}_m")[row].tolist()))
        assert [load[axis][row] for axis in "xyz"] == pytest.approx(expected, abs=1e-6)
        quaternion = attitude_to_ned_frd(tuple(recording.vectors("attitude_q{}", "wxyz")[row].tolist()))
        assert [attitude[f"q[{i}]"][row] for i in range(4)] == pytest.approx(quaternion, abs=1e-6)
    assert [topics["law_terms"][f"saturated[{i}]"][-1] for i in range(4)] == [16.0, 17.0, -18.0, -19.0]
    heading = topics["vehicle_local_position_groundtruth"]["heading"]
    yaw = (ROWS - 1) / RATE_HZ  # of the flight, from east to the north
    assert heading[-1] == pytest.approx(np.pi / 2 - yaw, abs=1e-6)
    assert topics["actuator_motors"]["control[3]"][0] == pytest.approx(0.4)


def test_ulog_has_the_sensors_from_the_first_armed_tick_on(folder: Path) -> None:
    log = ULog(str(export(folder, "ulog")))
    topics = {data.name: data.data for data in log.data_list}
    sensors = topics["sensor_combined"]
    assert sensors["timestamp"][0] == 0
    assert len(sensors["timestamp"]) == ROWS - 1
    assert sensors["accelerometer_m_s2[2]"][0] == pytest.approx(-9.75)
    assert topics["sensor_gps"]["latitude_deg"][0] == pytest.approx(47.397742)


def test_mcap_has_frames_scene_places_and_numbers(folder: Path) -> None:
    recording = read_recording(folder)
    with export(folder, "mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        schemas = {
            channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()
        }
        assert schemas["/tf"] == "foxglove.FrameTransforms"
        assert schemas["/scene/cable"] == "foxglove.SceneUpdate"
        assert schemas["/load/location"] == "foxglove.LocationFix"
        rows = [
            (message.log_time, json.loads(message.data))
            for _, _, message in reader.iter_messages(topics=["/state"])
        ]
        terms = [json.loads(m.data) for _, _, m in reader.iter_messages(topics=["/terms"])]
        sensors = [json.loads(m.data) for _, _, m in reader.iter_messages(topics=["/sensors"])]
    first, last = rows[0], rows[-1]
    assert last[0] - first[0] == round((ROWS - 1) / RATE_HZ * 1e9)
    assert last[1]["load_x_m"] == float(f"{recording.states['load_x_m'][-1]:.7g}")
    assert len(rows) == len(range(0, ROWS - 1, 5)) + 1
    assert sensors[0]["zacc"] == -9.75
    assert len(terms) == len(rows)
    assert [terms[-1][name] for name in TERM_COLUMNS] == list(range(20))


def test_mcap_location_is_the_loads_place_on_earth(folder: Path) -> None:
    from foxglove.messages import LocationFix

    recording = read_recording(folder)
    home = recording.vehicle.home
    x, y, z = recording.vectors("load_{}_m")[0].tolist()
    expected = LocalOrigin(home.latitude, home.longitude, home.altitude).geodetic((x, y, z))
    wanted = LocationFix(latitude=expected.latitude).encode()
    with export(folder, "mcap").open("rb") as file:
        message = next(iter(make_reader(file).iter_messages(topics=["/load/location"])))[2]
    assert wanted in message.data  # protobuf: the field's tag and its eight bytes


def test_mcap_has_the_diary(tmp_path: Path) -> None:
    leave_flight(tmp_path, rows=3)
    EventLog(tmp_path).add(Event(0.004, "plant", "fault", "gps is lost"))
    with export(tmp_path, "mcap").open("rb") as file:
        messages = [m for _, _, m in make_reader(file).iter_messages(topics=["/log"])]
    assert [b"gps is lost" in message.data for message in messages] == [True, False]
    assert messages[0].log_time == round((1.7e9 + 0.004) * 1e9)


def test_an_older_export_is_replaced(folder: Path) -> None:
    file = export(folder, "mcap")
    file.write_bytes(b"junk")
    export(folder, "mcap")
    assert file.read_bytes()[:5] == b"\x89MCAP"


@pytest.mark.parametrize("name", sorted(WRITERS))
def test_the_command_writes_the_file_and_prints_its_path(folder: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / f"mine.{name}"
    command = [sys.executable, "-m", "sitl", "export", str(folder), "--to", name, "--out", str(out)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == str(out)
    assert out.stat().st_size > 0


@pytest.mark.parametrize("missing", ["state.parquet", "reference.parquet", "vehicle.json", "summary.json"])
def test_a_folder_that_is_no_flight_is_one_message(tmp_path: Path, missing: str) -> None:
    leave_flight(tmp_path, rows=3)
    (tmp_path / missing).unlink()
    with pytest.raises(RecordingError, match=missing) as error:
        read_recording(tmp_path)
    assert "\n" not in str(error.value)


def test_a_folder_that_is_not_there_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sitl", "export", str(tmp_path / "nowhere"), "--to", "csv"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "nowhere" in result.stderr


def test_a_log_that_was_cut_off_still_has_its_sensors(tmp_path: Path) -> None:
    leave_flight(tmp_path, rows=100)
    tlog = tmp_path / "link.tlog"
    tlog.write_bytes(tlog.read_bytes()[:-30])
    log = ULog(str(export(tmp_path, "ulog")))
    assert any(data.name == "sensor_combined" for data in log.data_list)


def test_a_log_that_begins_with_a_burst_keeps_its_rate() -> None:
    """As sensors do in link.tlog: every tick until the vehicle is armed, then ten ticks a second."""
    times = np.concatenate((0.004 * np.arange(8), 0.1 + 0.1 * np.arange(600)))
    assert len(_rows(times, 20.0)) == len(times)
    assert len(_rows(0.004 * np.arange(15000), 20.0)) == 1201
