"""Addresses that people give for links."""

from __future__ import annotations

from typing import Literal, NamedTuple

KINDS = ("udpout", "udpin", "tcpin", "tcpout")
Kind = Literal["udpout", "udpin", "tcpin", "tcpout", "serial"]

USUAL_BAUD = 921_600
"""PX4's for a companion computer."""


class Address(NamedTuple):
    """Where a link goes: `udpout:HOST:PORT` sends there first, `udpin:` waits there, likewise for TCP."""

    kind: Kind
    host: str
    """Of a serial line: its device."""
    port: int
    """Of a serial line: its baud rate."""

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def possible_host(text: str) -> bool:
    """Whether this may be a host's name or IPv4 address. An empty label is neither; links have no IPv6."""
    try:
        return bool(text.encode("idna")) and ":" not in text
    except UnicodeError:
        return False


def parse_address(text: str, udp_port: int | None = None, tcp_port: int | None = None) -> Address:
    """Parse `udpout:HOST:PORT | udpin:… | tcpin:… | tcpout:…`; raises ValueError with what was expected.

    udp_port, tcp_port: of an address that names none (`tcpin:HOST`, `tcpin`); without a host: 127.0.0.1.
    """
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    default = tcp_port if kind.startswith("tcp") else udp_port
    if ":" not in rest and default is not None:
        host, port = rest or "127.0.0.1", str(default)
    if kind not in KINDS or not possible_host(host) or not port.isdecimal() or not 0 <= int(port) <= 65535:
        no_ipv6 = "; links have no IPv6" if ":" in host else ""
        raise ValueError(
            f"{text!r}: expected {'|'.join(KINDS)}:HOST:PORT, as in udpout:127.0.0.1:14560{no_ipv6}"
        )
    return Address(kind, host, int(port))  # type: ignore[arg-type]  # just checked against KINDS


def parse_stack_address(text: str, udp_port: int, tcp_port: int) -> Address:
    """`parse_address`, and `serial:DEVICE[:BAUD]` besides; raises ValueError."""
    kind, _, rest = text.partition(":")
    if kind != "serial":
        try:
            return parse_address(text, udp_port, tcp_port)
        except ValueError as error:
            raise ValueError(f"{error}, or serial:DEVICE:BAUD") from None
    device, colon, baud = rest.rpartition(":")
    if not colon:
        device, baud = rest, str(USUAL_BAUD)
    if not device or not baud.isdecimal() or not int(baud):
        raise ValueError(f"{text!r}: expected serial:DEVICE:BAUD, as in serial:/dev/ttyACM0:{USUAL_BAUD}")
    return Address("serial", device, int(baud))
