"""The parameter table and protocol."""

from __future__ import annotations

import json
import math
import os
import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.parameters.file import ParameterFile
from controller.ground.parameters.parameter import Parameter
from controller.ground.parameters.protocol import HASH_CHECK
from controller.ground.parameters.table import BY_NAME, TABLE, markdown
from controller.pilot.guided.link import GroundLink, GroundOptions, Ports
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.rig import Channel, Client, Rig

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32
READ_BY_QGROUNDCONTROL = [
    "SYS_AUTOSTART",
    "COM_RC_IN_MODE",
    "RC_MAP_ROLL",
    "RC_MAP_PITCH",
    "RC_MAP_YAW",
    "RC_MAP_THROTTLE",
    "CAL_GYRO0_ID",
    "CAL_ACC0_ID",
    "CAL_MAG0_ID",
    "BAT1_V_CHARGED",
    "BAT1_V_EMPTY",
    "BAT1_N_CELLS",
]


def set_message(name: str, value: float, kind: int) -> Any:
    field = struct.unpack("<f", struct.pack("<i", int(value)))[0] if kind == INT32 else value
    return mavlink.MAVLink_param_set_message(1, 1, name.encode(), field, kind)


def value_of(message: Any) -> float:
    if message.param_type == INT32:
        return int(
            struct.unpack("<i", message.get_payload()[4:8])[0]
        )  # behind the header's tail of MAVLink 2
    return float(message.param_value)


def read(client: Client, name: str) -> Any:
    before = len(client.got("PARAM_VALUE"))
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    client.rig.run(0.04)
    (message,) = client.got("PARAM_VALUE")[before:]
    return message


def test_the_table_is_sound() -> None:
    assert len(BY_NAME) == len(TABLE)
    for p in TABLE:
        assert len(p.name) <= 16, p.name
        assert p.minimum <= p.default <= p.maximum, p.name
        assert p.description, p.name
        if p.choices:
            assert p.is_integer, p.name
            assert p.default in dict(p.choices), p.name
    assert set(READ_BY_QGROUNDCONTROL) <= set(BY_NAME)
    assert BY_NAME["SYS_AUTOSTART"].default != 0
    assert BY_NAME["COM_RC_IN_MODE"].default == 1


def test_the_documentation_is_the_table() -> None:
    page = Path(__file__).parents[4] / "docs" / "parameters.md"
    assert page.read_text(encoding="utf-8") == markdown()


@pytest.mark.parametrize("p", [p for p in TABLE if p.is_integer], ids=lambda p: p.name)
def test_integers_are_shown_in_all_their_digits(p: Parameter) -> None:
    (row,) = (line for line in markdown().splitlines() if f"`{p.name}`" in line)
    assert f"| {p.default} |" in row
    assert p.choices or f"| {p.minimum} to {p.maximum} |" in row
    rig = Rig()
    client = rig.client()
    client.send(set_message(p.name, p.minimum - 1, INT32))
    rig.run(0.04)
    assert client.texts()[0].startswith(f"{p.name} = {p.minimum - 1}")
    assert p.choices or f"{p.minimum} to {p.maximum}" in client.texts()[0]


def test_a_list_is_complete_and_paced() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_param_request_list_message(1, 1))
    rig.run(1.0)
    first, *values = client.got("PARAM_VALUE")
    assert first.param_id == HASH_CHECK  # as PX4 does: a client that has the same hash stops the list
    assert [v.param_index for v in values] == list(range(len(TABLE)))
    assert {v.param_count for v in values} == {len(TABLE)}
    assert {v.param_id: value_of(v) for v in values} == pytest.approx({p.name: p.default for p in TABLE})


def nuttx_crc32(data: bytes, crc: int) -> int:
    """crc32part() as NuttX has it, bit by bit: the reflected polynomial 0xEDB88320, no inversion."""
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc


def expected_hash(values: dict[str, float]) -> int:
    crc = 0
    for name in sorted(values):
        kind = "<i" if BY_NAME[name].is_integer else "<f"
        value = int(values[name]) if BY_NAME[name].is_integer else values[name]
        crc = nuttx_crc32(struct.pack(kind, value), nuttx_crc32(name.encode(), crc))
    return crc


def test_the_hash_of_all_parameters_is_px4s_and_asked_for_without_a_warning() -> None:
    rig = Rig()
    client = rig.client()
    message = read(client, HASH_CHECK)
    assert message.param_type == mavlink.MAV_PARAM_TYPE_UINT32
    assert (message.param_count, message.param_index) == (len(TABLE), 0xFFFF)
    before = struct.unpack("<I", struct.pack("<f", message.param_value))[0]
    assert before == expected_hash(rig.station.parameters.values())
    assert client.texts() == []
    assert rig.station.parameters.set("MIS_TAKEOFF_ALT", 7.5) == ""
    after = read(client, HASH_CHECK).param_value
    assert struct.pack("<f", after) == struct.pack("<I", expected_hash(rig.station.parameters.values()))
    assert after != message.param_value


def test_a_client_that_has_the_same_hash_stops_the_list() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_param_request_list_message(1, 1))
    rig.run(0.04)
    client.send(set_message(HASH_CHECK, 0, mavlink.MAV_PARAM_TYPE_UINT32))
    rig.run(0.02)
    client.clear()
    rig.run(1.0)
    assert client.got("PARAM_VALUE") == []
    assert client.texts() == []


SET_BY_SCRIPTS = {
    "COM_RC_IN_MODE": (0, 1, 2, 3, 4),
    "COM_OBL_RC_ACT": range(8),
    "COM_RCL_EXCEPT": (0, 4, 7),
    "NAV_RCL_ACT": (1, 2, 3, 5, 6),
    "NAV_DLL_ACT": (0, 1, 2, 3, 5, 6),
    "CBRK_SUPPLY_CHK": (894281, 0),
    "MIS_TAKEOFF_REQ": (0, 1),
    "MIS_DIST_1WP": (0.0, 900.0, 10000.0),
    "MPC_TILTMAX_AIR": (20.0, 45.0, 60.0),
    "MPC_JERK_AUTO": (4.0, 30.0),
    "MPC_YAW_MODE": (0, 3, 4),
    "SIM_BAT_DRAIN": (60.0, 86400.0),
    "SYS_HAS_GPS": (0, 1),
    "COM_ARM_WO_GPS": (0, 1),
    "FLW_TGT_HT": (8.0, 15.0),
    "FLW_TGT_DST": (2.0, 8.0),
    "FLW_TGT_FA": (0.0, -180.0, 180.0),
    "FLW_TGT_ALT_M": (0, 1, 2),
    "FLW_TGT_MAX_VEL": (5.0, 10.0),
    "FLW_TGT_RS": (0.02, 0.5),
}


@pytest.mark.parametrize("name", SET_BY_SCRIPTS)
def test_what_scripts_set_on_a_px4_is_taken_and_given_back(name: str) -> None:
    rig = Rig()
    client = rig.client()
    for value in SET_BY_SCRIPTS[name]:
        kind = INT32 if BY_NAME[name].is_integer else REAL32
        client.send(set_message(name, value, kind))
        rig.run(0.04)
        assert value_of(client.got("PARAM_VALUE")[-1]) == pytest.approx(value)
    assert client.texts() == []


@pytest.mark.parametrize("seed", range(5))
def test_a_client_that_asks_again_gets_everything_over_a_lossy_link(seed: int) -> None:
    rig = Rig()
    client = rig.client(channel=Channel(loss=0.1, duplication=0.1, reordering=0.1, seed=seed))
    client.send(*[mavlink.MAVLink_param_request_list_message(1, 1)] * 2)
    rig.run(1.0)
    assert len({v.param_index for v in client.got("PARAM_VALUE")}) < len(TABLE)  # the link does lose
    for _ in range(20):
        missing = set(range(len(TABLE))) - {v.param_index for v in client.got("PARAM_VALUE")}
        for index in missing:
            client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", index))
        rig.run(0.1)
    assert {v.param_id for v in client.got("PARAM_VALUE")} - {HASH_CHECK} == set(BY_NAME)


def test_a_value_is_set_and_echoed_to_every_client() -> None:
    rig = Rig()
    client, other = rig.client(), rig.client(14540, link=1)
    client.send(set_message("MIS_TAKEOFF_ALT", 5.5, REAL32), set_message("GF_ACTION", 2, INT32))
    rig.run(0.04)
    for each in (client, other):
        assert [(v.param_id, value_of(v)) for v in each.got("PARAM_VALUE")] == [
            ("MIS_TAKEOFF_ALT", 5.5),
            ("GF_ACTION", 2),
        ]
    assert rig.station.parameters["MIS_TAKEOFF_ALT"] == 5.5
    assert rig.station.parameters.take_changed() == {"MIS_TAKEOFF_ALT", "GF_ACTION"}
    assert rig.station.parameters.take_changed() == set()


def test_an_integer_whose_bytes_are_a_signalling_nan_survives() -> None:
    rig = Rig()
    client = rig.client()
    payload = struct.pack("<iBB16sB", 0x7F800001, 1, 1, b"CAL_GYRO0_ID", INT32)
    from controller.ground.link.packing import frame

    client.send_raw(frame(payload, 23, mavlink.MAVLink_param_set_message.crc_extra, 0, 255, 190, False))
    rig.run(0.04)
    assert rig.station.parameters.integer("CAL_GYRO0_ID") == 0x7F800001
    assert any(raw[7] == 22 and raw[10:14] == struct.pack("<I", 0x7F800001) for raw in client.raw)


@pytest.mark.parametrize(
    ("name", "value", "kind", "error"),
    [
        ("NO_SUCH", 1.0, REAL32, 1),
        ("MIS_TAKEOFF_ALT", math.nan, REAL32, 2),
        ("MIS_TAKEOFF_ALT", math.inf, REAL32, 2),
        ("MIS_TAKEOFF_ALT", 1e9, REAL32, 2),
        ("MIS_TAKEOFF_ALT", 5, INT32, 7),
        ("GF_ACTION", 1.0, REAL32, 7),
        ("GF_ACTION", 77, INT32, 2),
        ("NAV_DLL_ACT", 4, INT32, 2),  # within the range, but not one of the choices
    ],
)
def test_what_cannot_be_set_is_refused_with_a_reason(name: str, value: float, kind: int, error: int) -> None:
    rig = Rig()
    client = rig.client()
    before = rig.station.parameters.values()
    client.send(set_message(name, value, kind))
    rig.run(0.04)
    (refusal,) = client.got("PARAM_ERROR")
    assert (refusal.param_id, refusal.error) == (name, error)
    assert (refusal.target_system, refusal.target_component) == (255, 190)
    assert not client.got("PARAM_VALUE")
    assert name in client.texts()[0]
    assert rig.station.parameters.values() == before


def test_unknown_names_and_indices_are_said_to_be_unknown() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", len(TABLE)))
    rig.run(0.04)
    assert [e.error for e in client.got("PARAM_ERROR")] == [1, 1]
    assert len(client.texts()) == 2


def test_mavlink_1_has_no_error_message_so_the_value_says_it() -> None:
    from pymavlink.dialects.v10 import common as v1

    rig = Rig()
    client = rig.client()
    writer = v1.MAVLink(None, srcSystem=255, srcComponent=190)
    client.send_raw(v1.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1e9, REAL32).pack(writer))
    rig.run(0.04)
    (value,) = client.got("PARAM_VALUE")
    assert value.param_value == 2.5
    assert all(raw[0] == 0xFE for raw in client.raw)


def test_parameters_are_kept_in_a_file_on_request(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "parameters.json")
    rig = Rig(storage=file)
    client = rig.client()
    client.send(set_message("MIS_TAKEOFF_ALT", 7.25, REAL32), set_message("GF_ACTION", 1, INT32))
    rig.run(0.04)
    assert client.command(245, 1).result == 0
    again = Rig(storage=file)
    assert again.station.parameters["MIS_TAKEOFF_ALT"] == 7.25
    assert again.station.parameters.integer("GF_ACTION") == 1
    reader = again.client()
    assert reader.command(245, 2).result == 0
    assert again.station.parameters["MIS_TAKEOFF_ALT"] == 2.5
    assert reader.command(245, 0).result == 0
    assert again.station.parameters["MIS_TAKEOFF_ALT"] == 7.25


@pytest.mark.parametrize(
    "content",
    [
        "{",
        "[]",
        "\0\xff",
        '{"MIS_TAKEOFF_ALT": 1e999}',
        "[" * 100000,
        '{"MIS_TAKEOFF_ALT": 1' + "0" * 400 + "}",
        '{"GF_ACTION": -1' + "0" * 400 + "}",
    ],
)
def test_a_corrupt_file_is_survived_with_a_message(tmp_path: Path, content: str) -> None:
    path = tmp_path / "parameters.json"
    path.write_text(content, encoding="latin-1")
    rig = Rig(storage=ParameterFile(path))
    client = rig.client()
    rig.run(0.1)
    assert rig.station.parameters["MIS_TAKEOFF_ALT"] == 2.5
    assert rig.station.parameters.integer("GF_ACTION") == 3
    assert len([text for text in client.texts() if "arameters" in text]) == 1


def test_whoever_starts_a_controller_is_told_of_a_corrupt_file(tmp_path: Path) -> None:
    """Not only ground stations, of which none may be there."""
    path = tmp_path / "parameters.json"
    path.write_text("{")
    any_port = Ports(0, 9)
    said: list[str] = []
    GroundLink(
        load_vehicle("iris"), 0, GroundOptions(any_port, any_port, parameters=path), said.append
    ).close()
    assert said[0].startswith("warning: Parameters: parameters.json: ")
    assert said[0].endswith("defaults used, file kept as parameters.json.corrupt")


def test_what_is_good_in_a_file_is_kept_and_what_is_not_is_named(tmp_path: Path) -> None:
    path = tmp_path / "parameters.json"
    path.write_text('{"MIS_TAKEOFF_ALT": 3.5, "GF_ACTION": 9, "GONE": 1, "NAV_DLL_ACT": "x"}')
    rig = Rig(storage=ParameterFile(path))
    client = rig.client()
    rig.run(0.1)
    assert rig.station.parameters["MIS_TAKEOFF_ALT"] == 3.5
    said = " ".join(client.texts())
    assert all(name in said for name in ("GF_ACTION", "GONE", "NAV_DLL_ACT"))


def test_without_a_file_saving_is_refused_with_a_reason() -> None:
    rig = Rig()
    client = rig.client()
    assert client.command(245, 1).result != 0
    assert "--parameters" in client.texts()[0]


def test_what_is_no_file_is_not_replaced_by_one(tmp_path: Path) -> None:
    """As /dev/null would be, under whoever may write beside it."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert ParameterFile(pipe).save({"MPC_XY_CRUISE": 2.0}) == "pipe: no file; values are not kept"
    assert pipe.is_fifo()
    assert [found.name for found in tmp_path.iterdir()] == ["pipe"]


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link, kept = tmp_path / "parameters.json", tmp_path / "elsewhere" / "kept.json"
    link.symlink_to(kept)
    for value in (2.0, 3.0):
        assert ParameterFile(link).save({"MPC_XY_CRUISE": value}) == ""
        assert link.is_symlink()
        assert json.loads(kept.read_text()) == {"MPC_XY_CRUISE": value}
