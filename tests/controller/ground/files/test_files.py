"""FTP, component metadata and logs, as clients read them; nothing else can be named."""

from __future__ import annotations

import json
import os
import random
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.files.ftp import DATA, MOST_SESSIONS, Error, Opcode
from controller.ground.files.logs import LogProtocol
from controller.ground.files.metadata import EVENTS, GENERAL, PARAMETERS
from controller.ground.files.param_pck import pack
from controller.ground.files.virtual import VirtualFiles
from controller.ground.link.packing import ComponentInformation, ComponentMetadata
from controller.ground.parameters.protocol import Parameters
from controller.ground.parameters.table import TABLE
from controller.pilot.guided.log_folder import LogFolder
from tests.controller.ground.rig import Client, Rig

CONTENT = random.Random(3).randbytes(50_000)


def rig_with_log(folder: Path) -> tuple[Rig, Client]:
    """A flight whose log is CONTENT; beside it what no client may see."""
    flight = folder / "flight"
    flight.mkdir()
    (flight / "states.parquet").write_bytes(CONTENT)
    (flight / "signing.key").write_text("secret")
    (folder / "outside.json").write_text("secret")
    (flight / "link.json").symlink_to(folder / "outside.json")
    os.mkfifo(flight / "pipe.json")
    rig = Rig(logs=LogFolder(flight))
    return rig, rig.client()


class Reader:
    """An FTP client."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.sequence = 0

    def payload(
        self, opcode: int, path: str = "", offset: int = 0, session: int = 0, size: int | None = None
    ) -> bytes:
        data = path.encode()
        header = (self.sequence, session, opcode, len(data) if size is None else size, 0, 0, 0, offset)
        return (struct.pack("<HBBBBBBI", *header) + data).ljust(251, b"\0")

    def answers(self, seconds: float = 0.04) -> list[bytes]:
        before = len(self.client.got("FILE_TRANSFER_PROTOCOL"))
        self.client.rig.run(seconds)
        return [bytes(m.payload) for m in self.client.got("FILE_TRANSFER_PROTOCOL")[before:]]

    def ask(self, opcode: int, path: str = "", **numbers: Any) -> tuple[int, bytes]:
        """Opcode and data of the one answer."""
        self.sequence += 2
        before = len(self.client.got("FILE_TRANSFER_PROTOCOL"))
        raw = self.payload(opcode, path, **numbers)
        self.client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, raw))
        self.client.rig.run(0.04)
        (message,) = self.client.got("FILE_TRANSFER_PROTOCOL")[before:]
        answer = bytes(message.payload)
        assert (message.target_system, message.target_component) == (255, 190)
        assert int.from_bytes(answer[:2], "little") == self.sequence + 1
        assert answer[5] == opcode
        return answer[3], answer[12 : 12 + answer[4]]

    def error(self, opcode: int, path: str = "", **numbers: Any) -> int:
        """Of a NAK."""
        kind, data = self.ask(opcode, path, **numbers)
        assert kind == Opcode.NAK
        return data[0]

    def read(self, path: str) -> bytes:
        """A whole file, by READ_FILE."""
        kind, size = self.ask(Opcode.OPEN_FILE_RO, path)
        assert kind == Opcode.ACK, size
        content = b""
        while len(content) < int.from_bytes(size, "little"):
            kind, part = self.ask(Opcode.READ_FILE, offset=len(content), size=DATA)
            assert kind == Opcode.ACK
            content += part
        assert self.error(Opcode.READ_FILE, offset=len(content), size=DATA) == Error.END_OF_FILE
        assert self.ask(Opcode.TERMINATE_SESSION)[0] == Opcode.ACK
        return content

    def listed(self, path: str) -> list[str]:
        """Every line of a folder."""
        lines: list[str] = []
        while True:
            kind, data = self.ask(Opcode.LIST_DIRECTORY, path, offset=len(lines))
            if kind == Opcode.NAK:
                assert data[0] == Error.END_OF_FILE
                return lines
            lines += [line.decode() for line in data.split(b"\0") if line]


def unpacked(data: bytes) -> dict[str, tuple[float, float]]:
    """A param.pck read as MAVProxy reads it: value and default by name."""
    magic, count, total = struct.unpack_from("<HHH", data)
    assert magic in (0x671B, 0x671C)
    assert count == total
    at, last, found = 6, b"", {}
    while at < len(data):
        kind, lengths = data[at], data[at + 1]
        shared, rest = lengths & 15, (lengths >> 4) + 1
        name = last[:shared] + data[at + 2 : at + 2 + rest]
        at += 2 + rest
        layout = {3: "<i", 4: "<f"}[kind & 15]
        value = default = struct.unpack_from(layout, data, at)[0]
        at += 4
        if kind >> 4 & 1:
            default = struct.unpack_from(layout, data, at)[0]
            at += 4
        found[name.decode()] = (value, default)
        last = name
    assert len(found) == count
    return found


def test_packed_parameters_are_every_parameter() -> None:
    rig = Rig()
    reader = Reader(rig.client())
    assert rig.station.parameters.set("MIS_TAKEOFF_ALT", 7.5) == ""
    values = rig.station.parameters.values()
    assert {n: v for n, (v, _) in unpacked(reader.read("@PARAM/param.pck")).items()} == values
    both = unpacked(reader.read("@PARAM/param.pck?withdefaults=1"))
    assert both["MIS_TAKEOFF_ALT"] == (7.5, 2.5)
    assert {n for n, (v, d) in both.items() if v != d} == {"MIS_TAKEOFF_ALT"}


@given(
    st.dictionaries(
        st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True),
        st.integers(-(2**31), 2**31 - 1) | st.floats(width=32, allow_nan=False),
    )
)
@settings(deadline=None)
def test_any_parameters_are_packed_so_that_they_can_be_read(values: dict[str, float]) -> None:
    assert {name: value for name, (value, _) in unpacked(pack(values)).items()} == values


def test_metadata_lead_to_the_parameters_meanings_and_to_events() -> None:
    rig = Rig()
    client = rig.client()
    for kind in (ComponentMetadata, ComponentInformation):
        assert client.command(512, kind.id).result == 0
    raw = next(r for r in client.raw if r[7] | r[8] << 8 == ComponentMetadata.id)
    _time, crc = struct.unpack_from("<II", raw, 10)
    uri = raw[18:].split(b"\0")[0].decode("ascii", "replace")
    assert uri.startswith(f"mftp:{GENERAL}")
    reader = Reader(client)
    general = reader.read(GENERAL)
    assert zlib.crc32(general) == crc
    kinds = {entry["type"]: entry for entry in json.loads(general)["metadataTypes"]}
    assert {number: entry["uri"] for number, entry in kinds.items()} == {
        1: f"mftp:{PARAMETERS}",
        4: f"mftp:{EVENTS}",
    }
    parameters = reader.read(PARAMETERS)
    assert zlib.crc32(parameters) == kinds[1]["fileCrc"]
    listed = {entry["name"]: entry for entry in json.loads(parameters)["parameters"]}
    assert set(listed) == {p.name for p in TABLE}
    assert listed["NAV_RCL_ACT"]["values"][0] == {"value": 1, "description": "hold"}
    assert json.loads(reader.read(EVENTS))["version"] == 1
    assert reader.ask(Opcode.CALC_FILE_CRC32, EVENTS)[1] == struct.pack("<I", kinds[4]["fileCrc"])


def test_folders_are_listed_and_only_the_flights_logs_are_in_them(tmp_path: Path) -> None:
    _rig, client = rig_with_log(tmp_path)
    reader = Reader(client)
    assert [line.split("\t")[0] for line in reader.listed("/")] == ["D@PARAM", "Detc", "Dlog"]
    assert reader.listed("/log") == [f"Fstates.parquet\t{len(CONTENT)}"]
    assert reader.listed("etc/extras") == reader.listed("/etc//extras/")
    assert reader.error(Opcode.LIST_DIRECTORY, "/home") == Error.FILE_NOT_FOUND
    assert reader.read("/log/states.parquet") == CONTENT


def test_a_burst_brings_a_file_paced_and_can_be_begun_anywhere(tmp_path: Path) -> None:
    rig, client = rig_with_log(tmp_path)
    reader = Reader(client)
    assert reader.ask(Opcode.OPEN_FILE_RO, "/log/states.parquet")[0] == Opcode.ACK
    for start in (0, 31_000):
        reader.sequence += 1
        raw = reader.payload(Opcode.BURST_READ_FILE, offset=start, size=DATA)
        client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, raw))
        parts = reader.answers(0.02)
        assert 0 < len(parts) < 50
        parts += reader.answers(2.0)
        offsets = [int.from_bytes(part[8:12], "little") for part in parts]
        assert offsets == list(range(start, len(CONTENT), DATA))
        assert b"".join(part[12 : 12 + part[4]] for part in parts) == CONTENT[start:]
        assert [part[6] for part in parts] == [0] * (len(parts) - 1) + [1]
        sequences = [int.from_bytes(part[:2], "little") for part in parts]
        assert sequences == list(range(reader.sequence + 1, reader.sequence + 1 + len(parts)))
    end = reader.error(Opcode.BURST_READ_FILE, offset=len(CONTENT), size=DATA)
    assert end == Error.END_OF_FILE
    assert rig.station.next_deadline(rig.now) >= rig.now


def test_a_request_that_comes_twice_is_answered_twice_by_the_same() -> None:
    rig = Rig()
    client = rig.client()
    reader = Reader(client)
    raw = reader.payload(Opcode.OPEN_FILE_RO, GENERAL)
    message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, raw)
    client.send(message, message)
    first, second = reader.answers()
    assert first == second
    assert first[3] == Opcode.ACK


def test_who_has_read_the_packed_parameters_sets_integers_as_floats() -> None:
    """MAVProxy does; anybody else's type has to fit."""
    rig = Rig()
    client, other = rig.client(), rig.client(14540, link=1)
    Reader(client).read("@PARAM/param.pck?withdefaults=1")
    message = mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", 2.0, mavlink.MAV_PARAM_TYPE_REAL32)
    other.send(message)
    rig.run(0.04)
    assert "INT32" in other.texts()[-1]
    client.send(message)
    rig.run(0.04)
    assert client.texts() == []
    assert rig.station.parameters["GF_ACTION"] == 2
    for bad in (2.5, float("nan"), 1e20):
        client.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", bad, 9))
        rig.run(0.04)
        assert "INT32" in client.texts()[-1]


def test_a_client_may_choose_its_session() -> None:
    """MAVProxy does, and takes no answer of another one."""
    rig = Rig()
    client = rig.client()
    reader = Reader(client)
    raw = reader.payload(Opcode.OPEN_FILE_RO, GENERAL, session=252)
    client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, raw))
    (answer,) = reader.answers()
    assert (answer[2], answer[3]) == (252, Opcode.ACK)
    assert reader.ask(Opcode.READ_FILE, session=252, size=10)[0] == Opcode.ACK


@pytest.mark.parametrize("opcode", [6, 7, 8, 9, 10, 11, 12, 13])
def test_nothing_is_written(opcode: int) -> None:
    assert Reader(Rig().client()).error(opcode, "/log/new.json") == Error.FILE_PROTECTED


def test_what_is_wrong_has_its_own_error() -> None:
    reader = Reader(Rig().client())
    assert reader.error(99) == Error.UNKNOWN_COMMAND
    assert reader.error(Opcode.READ_FILE, session=5) == Error.INVALID_SESSION
    assert reader.error(Opcode.OPEN_FILE_RO, "/etc/passwd") == Error.FILE_NOT_FOUND
    assert reader.error(Opcode.READ_FILE, size=240) == Error.INVALID_DATA_SIZE


def test_sessions_of_clients_are_their_own_and_there_is_an_end_to_them() -> None:
    rig = Rig()
    one, two = Reader(rig.client()), Reader(rig.client(14540, link=1))
    assert one.ask(Opcode.OPEN_FILE_RO, GENERAL)[0] == Opcode.ACK
    assert two.error(Opcode.READ_FILE, size=10) == Error.INVALID_SESSION
    for _ in range(3 * MOST_SESSIONS):
        assert two.ask(Opcode.OPEN_FILE_RO, GENERAL)[0] == Opcode.ACK
    assert one.error(Opcode.READ_FILE, size=10) == Error.INVALID_SESSION  # the oldest was closed


WORDS = ["..", ".", "", "/", "log", "@PARAM", "param.pck", "etc", "extras", "passwd", "flight", "signing.key"]
WORDS += [
    "link.json",
    "pipe.json",
    "outside.json",
    "states.parquet",
    "proc",
    "self",
    "~",
    "\\",
    "%2e%2e",
    "?",
    "*",
]


@given(st.lists(st.sampled_from(WORDS), max_size=9), st.sampled_from(["/", "", "//", "?"]))
@settings(max_examples=300, deadline=None)
def test_no_path_leads_out(parts: list[str], between: str) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        flight = Path(name) / "flight"
        flight.mkdir()
        (flight / "states.parquet").write_bytes(b"log")
        (flight / "signing.key").write_text("secret")
        (Path(name) / "outside.json").write_text("secret")
        (flight / "link.json").symlink_to(Path(name) / "outside.json")
        files = VirtualFiles(Parameters(), LogProtocol(LogFolder(flight)))
        found = files.open(between.join(parts))
        content = b"" if found is None else found.read(0, 10_000_000)
        assert content[:1] in (b"", b"{", b"\x1b", b"\x1c", b"l")  # nothing, JSON, param.pck, the log
        assert b"secret" not in content


@given(st.text(max_size=80), st.integers(0, 2**32 - 1))
@settings(max_examples=200, deadline=None)
def test_any_text_as_a_path(path: str, offset: int) -> None:
    files = VirtualFiles(Parameters(), LogProtocol(LogFolder(Path("/"))))
    for plain in (path, f"/log/{path}", f"/log/../{path}"):
        content = files.open(plain)
        assert content is None or content.read(offset, 10) is not None
        files.entries(plain)


def test_a_log_folder_reads_only_what_it_lists(tmp_path: Path) -> None:
    rig_with_log(tmp_path)
    folder = LogFolder(tmp_path / "flight")
    assert [log.name for log in folder.list()] == ["states.parquet"]
    for name in ("link.json", "signing.key", "../outside.json", "pipe.json", "no.json", ""):
        assert folder.read(name, 0, 100) == b""
    assert folder.read("states.parquet", 49_990, 100) == CONTENT[49_990:]
    assert folder.read("states.parquet", 2**80, 100) == b""


def test_logs_are_listed_and_downloaded(tmp_path: Path) -> None:
    rig, client = rig_with_log(tmp_path)
    client.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    rig.run(0.04)
    (entry,) = client.got("LOG_ENTRY")
    assert (entry.id, entry.num_logs, entry.last_log_num, entry.size) == (0, 1, 0, len(CONTENT))
    assert entry.time_utc > 1_700_000_000
    client.send(mavlink.MAVLink_log_request_data_message(1, 1, 0, 100, 0xFFFFFFFF))
    rig.run(0.02)
    assert 0 < len(client.got("LOG_DATA")) < 100  # paced
    rig.run(1.0)
    data = client.got("LOG_DATA")
    assert b"".join(bytes(m.data[: m.count]) for m in data) == CONTENT[100:]
    assert [m.ofs for m in data] == list(range(100, len(CONTENT), 90))


def test_logs_of_one_second_have_times_of_their_own(tmp_path: Path) -> None:
    """MAVSDK-Python's examples/logfile_download.py names its copies by them."""
    for name in ("a.json", "b.json", "c.json", "empty.json"):
        (tmp_path / name).write_text("" if name == "empty.json" else "{}")
        os.utime(tmp_path / name, (1_700_000_000, 1_700_000_000))
    rig = Rig(logs=LogFolder(tmp_path))
    client = rig.client()
    client.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    rig.run(0.04)
    times = [entry.time_utc for entry in client.got("LOG_ENTRY")]
    assert times == [1_700_000_000, 1_700_000_001, 1_700_000_002]


def test_logs_that_are_not_there_are_answered_at_once(tmp_path: Path) -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    client.send(mavlink.MAVLink_log_request_data_message(1, 1, 7, 0, 100))
    rig.run(0.04)
    (entry,) = client.got("LOG_ENTRY")
    assert (entry.num_logs, entry.size) == (0, 0)
    (data,) = client.got("LOG_DATA")
    assert (data.id, data.count) == (7, 0)


def test_erased_logs_are_not_listed_and_stay_on_the_disk(tmp_path: Path) -> None:
    rig, client = rig_with_log(tmp_path)
    client.send(mavlink.MAVLink_log_erase_message(1, 1))
    client.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    rig.run(0.04)
    assert client.got("LOG_ENTRY")[0].num_logs == 0
    assert "files are kept" in client.texts()[0]
    assert (tmp_path / "flight" / "states.parquet").read_bytes() == CONTENT


def test_a_download_ends_when_the_client_says_so(tmp_path: Path) -> None:
    rig, client = rig_with_log(tmp_path)
    client.send(mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 0xFFFFFFFF))
    rig.run(0.04)
    client.send(mavlink.MAVLink_log_request_end_message(1, 1))
    rig.run(0.02)
    client.clear()
    rig.run(1.0)
    assert client.got("LOG_DATA") == []
