"""Serial links, over pseudo-terminals."""

from __future__ import annotations

import os
import time
import tty
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.mavlink.links.address import Address, parse_stack_address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.opening import open_link

BEAT = Packer(1, 1).pack(mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3))


class Line:
    """A link on one end of a pseudo-terminal, a test on the other."""

    def __init__(self) -> None:
        self.end, far = os.openpty()
        tty.setraw(far)
        self.said: list[str] = []
        self.link: Link = open_link(Address("serial", os.ttyname(far), 921_600), self.said.append)
        os.close(far)

    def receive(self) -> bytes | None:
        return self.link.receive(time.monotonic() + 1.0)


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.link.close()
    os.close(made.end)


def test_frames_come_whole_in_whatever_pieces(line: Line) -> None:
    os.write(line.end, b"noise" + BEAT[:7])
    assert line.link.receive(time.monotonic()) is None
    os.write(line.end, BEAT[7:] + BEAT)
    received = line.receive()
    assert received is not None
    assert [frame.raw for frame in split(received).frames] == [BEAT, BEAT]


def test_what_is_sent_goes_out(line: Line) -> None:
    line.link.send(BEAT)
    assert os.read(line.end, 1000) == BEAT


def test_a_line_that_takes_nothing_does_not_block(line: Line) -> None:
    for _ in range(10_000):
        line.link.send(BEAT)
    assert os.read(line.end, 1 << 16).startswith(BEAT)


def test_a_device_that_goes_is_said() -> None:
    made = Line()
    os.close(made.end)
    assert made.receive() is None
    assert "disconnected" in made.said[0]
    made.link.send(BEAT)  # lost, without an error
    made.link.close()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("serial:", "expected serial:DEVICE:BAUD"),
        ("serial:/dev/ttyACM0:fast", "expected serial:DEVICE:BAUD"),
        ("serial:/dev/ttyACM0:0", "expected serial:DEVICE:BAUD"),
        ("seriell:/dev/x:1", "or serial:DEVICE:BAUD"),
    ],
)
def test_a_wrong_address_says_what_was_expected(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_stack_address(text, 14540, 5760)


def test_addresses() -> None:
    assert parse_stack_address("serial:/dev/ttyACM0:57600", 1, 2) == ("serial", "/dev/ttyACM0", 57600)
    assert parse_stack_address("serial:/dev/ttyACM0", 1, 2) == ("serial", "/dev/ttyACM0", 921_600)
    assert str(parse_stack_address("udpin", 14540, 5760)) == "udpin:127.0.0.1:14540"


@pytest.mark.parametrize("device", ["/dev/no-such-device", "/dev/null"])
def test_a_device_that_is_none_is_named(device: str) -> None:
    with pytest.raises(OSError, match=device):
        open_link(Address("serial", device, 921_600), lambda text: None)
