"""MAVLink framing, byte for byte against pymavlink, and behind any junk."""

import itertools
import random
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from sitl_bridge.mavlink import framing
from sitl_bridge.mavlink.framing import Frame, Packer, StreamSplitter, decode, split

MESSAGES = [message for number, message in sorted(common.mavlink_map.items())]


def random_message(kind: Any, generator: random.Random) -> Any:
    """A message with random fields; many of them zero, so that payloads end in zeros."""
    values: list[Any] = []
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name, fieldtype in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = lengths[name]
        if fieldtype == "char":
            size = max(1, length)
            values.append(bytes(generator.choices(b"\0abcXYZ", k=generator.randrange(size + 1))))
            continue
        entries: list[Any] = []
        for _ in range(max(1, length)):
            if generator.random() < 0.4:
                entries.append(0)
            elif fieldtype in ("float", "double"):
                entries.append(struct.unpack("<f", struct.pack("<f", generator.uniform(-1e3, 1e3)))[0])
            else:
                bits = int(fieldtype.removeprefix("u").removeprefix("int").removesuffix("_t"))
                unsigned = fieldtype.startswith("u")
                lowest = 0 if unsigned else -(1 << bits - 1)
                entries.append(generator.randrange(lowest, lowest + (1 << bits)))
        values.append(entries if length else entries[0])
    return kind(*values)


def pymavlink_frame(
    message: Any,
    sequence: int = 0,
    version: int = 2,
    signed: bool = False,
    system: int = 1,
    component: int = 1,
) -> bytes:
    link = common.MAVLink(None, srcSystem=system, srcComponent=component)
    link.seq = sequence
    if signed:
        link.signing.secret_key = bytes(range(32))
        link.signing.sign_outgoing = True
        link.signing.timestamp = 1_000_000
        link.signing.link_id = 3
    return bytes(message.pack(link, force_mavlink1=version == 1))


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    """Any message of the dialect in any kind of frame."""
    version = draw(st.sampled_from([2, 2, 2, 1]))
    known = [m for m in MESSAGES if version == 2 or m.id < 256]
    message = random_message(draw(st.sampled_from(known)), random.Random(draw(st.integers(0, 2**32))))
    return pymavlink_frame(
        message,
        sequence=draw(st.integers(0, 255)),
        version=version,
        signed=version == 2 and draw(st.booleans()),
        system=draw(st.integers(1, 255)),
        component=draw(st.integers(1, 255)),
    )


junk = st.binary(max_size=40) | st.lists(st.sampled_from([0xFD, 0xFE, 0x00, 0xFF, 0x21]), max_size=40).map(
    bytes
)


def raw(found: list[Frame]) -> list[bytes]:
    return [frame.raw for frame in found]


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.msgname)
def test_every_message_of_the_dialect_both_ways(kind: Any) -> None:
    generator = random.Random(kind.id)
    for sequence in range(3):
        message = random_message(kind, generator)
        packer = Packer(system=7, component=9)
        packer.sequence = sequence
        packed = packer.pack(message)
        assert packed == pymavlink_frame(message, sequence, system=7, component=9)
        (frame,) = split(packed).frames
        assert frame.message_id == kind.id
        assert (frame.system, frame.component, frame.version, frame.signed) == (7, 9, 2, False)
        assert frame.raw == packed
        assert repr(decode(frame).to_dict()) == repr(common.MAVLink(None).decode(bytearray(packed)).to_dict())


@given(st.sampled_from(MESSAGES), st.integers(0, 2**32), st.integers(0, 255), st.integers(0, 255))
def test_write_frame_writes_pymavlinks_bytes(kind: Any, seed: int, sequence: int, at: int) -> None:
    message = random_message(kind, random.Random(seed))
    expected = pymavlink_frame(message, sequence, system=5, component=6)
    # The payload before MAVLink 2 cuts its zeros off: pymavlink packs the same fields in this order.
    whole = np.zeros(kind.unpacker.size, dtype=np.uint8)
    sent = np.frombuffer(expected[10:-2], dtype=np.uint8)
    whole[: sent.size] = sent
    out = np.full(at + 300, 0xAA, dtype=np.uint8)
    end = framing.write_frame(out, at, whole, kind.id, sequence, 5, 6)
    assert bytes(out[at:end]) == expected
    assert (out[:at] == 0xAA).all()
    assert (out[end:] == 0xAA).all()


def test_a_payload_of_zeros_keeps_one_byte() -> None:
    heartbeat = common.MAVLink_heartbeat_message(0, 0, 0, 0, 0, 0)
    out = np.zeros(64, dtype=np.uint8)
    end = framing.write_frame(out, 0, np.zeros(9, dtype=np.uint8), 0, 0, 1, 1)
    assert out[1] == 1
    assert bytes(out[:end]) == pymavlink_frame(heartbeat)


@given(st.sampled_from(MESSAGES), st.integers(0, 2**32))
def test_read_payload_puts_the_zeros_back(kind: Any, seed: int) -> None:
    message = random_message(kind, random.Random(seed))
    wire = np.frombuffer(b"\x01\x02" + pymavlink_frame(message), dtype=np.uint8)
    table = np.zeros((4, framing.TABLE_COLUMNS), dtype=np.int32)
    assert framing.scan(wire, table, wire.size) == 1
    payload = np.full(kind.unpacker.size, 0xAA, dtype=np.uint8)
    framing.read_payload(wire, table[0], payload)
    sent = wire[12:-2]
    assert bytes(payload) == bytes(sent).ljust(payload.size, b"\0")
    # A payload longer than the record (a newer dialect's extension fields) is cut.
    shorter = np.full(max(0, sent.size - 1), 0xAA, dtype=np.uint8)
    framing.read_payload(wire, table[0], shorter)
    assert bytes(shorter) == bytes(sent[:-1])


@given(st.lists(st.tuples(junk, frames()), max_size=6), junk)
def test_no_junk_swallows_a_good_frame(pieces: list[tuple[bytes, bytes]], end: bytes) -> None:
    data = b"".join(before + frame for before, frame in pieces) + end
    found = split(data)
    assert raw(found.frames) == [frame for _, frame in pieces]
    assert found.junk + len(found.rest) + sum(map(len, raw(found.frames))) == len(data)
    assert data.endswith(found.rest)


def test_false_start_that_claims_the_good_frame_as_its_payload() -> None:
    """Pymavlink's own parser loses this frame; it is why there is a second one here."""
    good = pymavlink_frame(common.MAVLink_system_time_message(1, 2))
    false_start = bytes([0xFD, 40, 0, 0, 0, 1, 1, 0, 0, 0])
    found = split(false_start + good)
    assert raw(found.frames) == [good]
    assert found.junk == len(false_start)
    assert found.rest == b""
    # With as many bytes as the false start claims, too.
    assert raw(split(false_start + good + bytes(60)).frames) == [good]


def test_bad_checksum_unknown_message_and_broken_length_are_junk() -> None:
    good = pymavlink_frame(common.MAVLink_system_time_message(1, 2))
    for index in range(len(good)):
        for bit in (0x01, 0x80):
            broken = bytearray(good)
            broken[index] ^= bit
            assert raw(split(bytes(broken) + good).frames) == [good], (index, bit)
    unknown = bytearray(good)
    unknown[7:10] = b"\xff\xff\xff"
    assert split(bytes(unknown)).frames == []


@given(frames())
def test_a_signed_frame_is_whole(wire: bytes) -> None:
    (frame,) = split(wire).frames
    assert frame.raw == wire
    assert frame.version == (2 if wire[0] == 0xFD else 1)
    assert frame.signed == (frame.version == 2 and len(wire) == wire[1] + 10 + 2 + 13)
    sent = common.MAVLink(None).decode(bytearray(wire))
    assert (frame.system, frame.component) == (sent.get_srcSystem(), sent.get_srcComponent())


@given(st.lists(st.tuples(junk, frames()), max_size=5), st.lists(st.integers(0, 1500), max_size=12))
def test_a_stream_may_be_cut_anywhere(pieces: list[tuple[bytes, bytes]], cuts: list[int]) -> None:
    """The frames of a stream are the same whatever the pieces, once enough has followed a false start."""
    data = b"".join(before + frame for before, frame in pieces)
    # What follows settles every false start: no longer frame can be under way.
    data += bytes(framing.LARGEST_FRAME)
    places = sorted({min(cut, len(data)) for cut in cuts} | {0, len(data)})
    stream = StreamSplitter()
    found = [f for a, b in itertools.pairwise(places) for f in stream.receive(data[a:b])]
    assert raw(found) == [frame for _, frame in pieces]
    assert stream.junk == len(data) - sum(len(frame) for _, frame in pieces)


def test_a_stream_byte_by_byte_gives_each_frame_with_its_last_byte() -> None:
    generator = random.Random(1)
    sent = [pymavlink_frame(random_message(kind, generator), kind.id % 256) for kind in MESSAGES[:40]]
    stream = StreamSplitter()
    for frame in sent:
        answers = [stream.receive(bytes([byte])) for byte in frame]
        assert raw(answers[-1]) == [frame]
        assert not any(answers[:-1])
    assert stream.junk == 0


def test_an_endless_stream_of_start_bytes_is_not_kept() -> None:
    stream = StreamSplitter()
    for _ in range(50):
        assert stream.receive(b"\xfd" * 1000) == []
    assert stream.junk >= 50 * 1000 - framing.LARGEST_FRAME
    good = pymavlink_frame(common.MAVLink_system_time_message(1, 2))
    assert raw(stream.receive(good + bytes(framing.LARGEST_FRAME))) == [good]


@settings(max_examples=100)
@given(
    st.binary(max_size=2000) | st.lists(st.sampled_from([0xFD, 0xFE, 0, 1, 255]), max_size=2000).map(bytes)
)
def test_random_bytes_never_crash(data: bytes) -> None:
    found = split(data)
    assert found.junk + len(found.rest) + sum(map(len, raw(found.frames))) == len(data)
    for frame in found.frames:
        decode(frame)


def test_a_datagram_full_of_the_shortest_frames() -> None:
    shortest = pymavlink_frame(common.MAVLink_heartbeat_message(0, 0, 0, 0, 0, 0))
    count = framing.LARGEST_DATAGRAM // len(shortest)
    assert raw(split(shortest * count).frames) == [shortest] * count
    with pytest.raises(ValueError, match="at most 65536"):
        split(bytes(framing.LARGEST_DATAGRAM + 1))


def test_sequence_numbers_wrap() -> None:
    packer = Packer(1, 1)
    message = common.MAVLink_system_time_message(1, 2)
    assert [packer.pack(message)[4] for _ in range(300)] == [n % 256 for n in range(300)]


def test_compiled_scan_is_the_python_scan() -> None:
    generator = random.Random(5)
    for _ in range(20):
        parts = []
        for kind in generator.choices(MESSAGES, k=8):
            parts.append(generator.randbytes(generator.randrange(30)))
            parts.append(pymavlink_frame(random_message(kind, generator)))
        data = b"".join(parts)[: generator.randrange(400, 800)]
        buffer = np.zeros(framing.LARGEST_DATAGRAM, dtype=np.uint8)
        buffer[: len(data)] = np.frombuffer(data, dtype=np.uint8)
        one, other = (np.zeros(framing.FRAME_TABLE.shape, dtype=np.int32) for _ in range(2))
        assert framing.scan(buffer, one, len(data)) == framing.find_frames(buffer, other, len(data))
        np.testing.assert_array_equal(one, other)
