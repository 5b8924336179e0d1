"""From an address to its link."""

from __future__ import annotations

from collections.abc import Callable

from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.tcp import TcpLink
from sitl_bridge.mavlink.links.udp import UdpLink


def open_link(address: Address, say: Callable[[str], None], punctual: bool = False) -> Link:
    """Open the link of an address. Raises OSError when a port or device is taken, a host unknown."""
    if address.kind in ("udpin", "udpout"):
        return UdpLink(address, punctual)
    if address.kind == "serial":
        from sitl_bridge.mavlink.links.serial_line import SerialLink

        return SerialLink(address.host, address.port, say)
    return TcpLink(address, say)
