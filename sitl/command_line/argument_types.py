"""What the values of flags have to be; each fault is one line that says what was expected."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from controller.ground.link.ports import STATION_LOCAL, STATION_PEER
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT

STACK_UDP_PORT, STACK_TCP_PORT = 14540, 5760
"""Where PX4 sends for a companion computer, and where ArduPilot's SITL listens."""

if TYPE_CHECKING:
    from controller.pilot.guided.options import Ports


def number(low: float, high: float, what: str) -> Callable[[str], float]:
    """An argument type: a finite number within limits."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}, {low:g} to {high:g}")
        return value

    return parse


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """An argument type: a whole number within limits."""

    def parse(text: str) -> int:
        if not text.lstrip("-").isdigit() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}, {low} to {high}")
        return int(text)

    return parse


def link_address(text: str) -> str:
    """An argument type: the address of a link, the port perhaps left out."""
    from sitl_bridge.mavlink.links.address import parse_address

    try:
        address = parse_address(text, HIL_UDP_PORT, HIL_TCP_PORT)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if address.port == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port that the other end can know, 1 to 65535")
    return text


def stack_address(text: str) -> str:
    """An argument type: the address of a flight stack, a serial line's too."""
    from sitl_bridge.mavlink.links.address import parse_stack_address

    try:
        address = parse_stack_address(text, STACK_UDP_PORT, STACK_TCP_PORT)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if address.port == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port that the other end can know, 1 to 65535")
    return text


def host_and_port(text: str) -> tuple[str, int]:
    """An argument type: HOST:PORT."""
    from sitl_bridge.mavlink.links.address import possible_host

    host, _, port = text.rpartition(":")
    if not possible_host(host) or not port.isdecimal() or not 0 < int(port) <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected HOST:PORT, as in 127.0.0.1:{STATION_PEER}")
    return host, int(port)


def ports(text: str) -> Ports:
    """An argument type: LOCAL:PEER."""
    from controller.pilot.guided.options import Ports

    local, colon, peer = text.partition(":")
    numbers = [int(part) for part in (local, peer) if part.isdecimal() and 0 < int(part) < 65536]
    if not colon or len(numbers) != 2:
        example = f"{STATION_LOCAL}:{STATION_PEER}"
        raise argparse.ArgumentTypeError(f"{text!r}: expected two UDP ports LOCAL:PEER, as in {example}")
    return Ports(*numbers)
