"""Checks of the machine: system, cores, clock, loopback, ports, display."""

from __future__ import annotations

import contextlib
import os
import platform
import socket
import time
from pathlib import Path

from controller.ground.link.ports import ONBOARD_LOCAL, ONBOARD_PEER, STATION_LOCAL, STATION_PEER
from sitl.doctor.finding import Finding
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT, MOST_INSTANCES

TICK = 0.004
"""s, of a flight at the default rate of 250 Hz."""
SLEEPS = 100
VIEW_PORT = 8080


def system() -> Finding:
    """Which system this is; in WSL and containers the network is not the one of the desktop."""
    name = f"{platform.system()} {platform.release()} on {platform.machine()}"
    if "microsoft" in platform.release().lower():
        return Finding(
            "note", "system", f"{name} (WSL)", "a ground station on Windows: see troubleshooting, WSL"
        )
    if Path("/.dockerenv").exists() or Path("/run/.containerenv").exists():
        return Finding("ok", "system", f"{name}, in a container", "for clients outside, give --expose")
    return Finding("ok", "system", name)


def cores() -> Finding:
    """Whether plant and controller have a core each."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    found = f"{count} usable, load average {load:.1f}"
    if count < 2:
        return Finding("note", "cores", found, "real time may be late; use --clock lockstep")
    if load > count:
        return Finding("note", "cores", found, "the machine is busy; use --clock lockstep, or wait")
    return Finding("ok", "cores", found)


def clock() -> Finding:
    """How late a sleep of one tick ends; the real-time clock needs less than a tick."""
    lateness = []
    for _ in range(SLEEPS):
        began = time.monotonic()
        time.sleep(TICK)
        lateness.append(time.monotonic() - began - TICK)
    worst = sorted(lateness)[round(0.95 * (SLEEPS - 1))]
    found = f"sleeps of {TICK * 1e3:g} ms end {worst * 1e3:.2f} ms late (95 % of them earlier)"
    if worst >= TICK:
        return Finding("note", "clock", found, "real time will be late; use --clock lockstep")
    return Finding("ok", "clock", found)


def loopback() -> Finding:
    """Whether a UDP datagram reaches this machine itself."""
    try:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        ):
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(1.0)
            sender.sendto(b"ping", receiver.getsockname())
            receiver.recv(16)
    except OSError as error:
        return Finding(
            "fail",
            "loopback",
            f"no UDP on 127.0.0.1 ({error})",
            "let the firewall pass UDP on the interface `lo`; `sitl fly --in-process` flies without it",
        )
    return Finding("ok", "loopback", "UDP on 127.0.0.1 works")


def hil_port(instance: int = 0) -> Finding:
    """Whether the port between plant and controller is free."""
    port = HIL_UDP_PORT + instance
    if is_free(port):
        return Finding("ok", "HIL port", f"UDP {port} is free")
    return Finding("fail", "HIL port", f"UDP {port} is in use", _other_instance())


def ports(instance: int = 0) -> Finding:
    """Whether the ports of PX4, ground stations and companions are free; `sitl fly SCENARIO` needs none."""
    wanted = [
        ("TCP", HIL_TCP_PORT + instance),
        ("UDP", STATION_LOCAL + instance),
        ("UDP", ONBOARD_LOCAL + instance),
        ("TCP", VIEW_PORT),
    ]
    used = [f"{kind} {port}" for kind, port in wanted if not is_free(port, kind)]
    listening = [str(port) for port in (STATION_PEER, ONBOARD_PEER + instance) if not is_free(port)]
    clients = f"; a client listens on UDP {' and '.join(listening)}" if listening else ""
    if used:
        return Finding("note", "ports", f"in use: {', '.join(used)}{clients}", _other_instance())
    free = ", ".join(f"{kind} {port}" for kind, port in wanted)
    return Finding("ok", "ports", f"{free} are free{clients}")


def is_free(port: int, kind: str = "UDP") -> bool:
    """Whether a port of 127.0.0.1 can be bound."""
    family = socket.SOCK_DGRAM if kind == "UDP" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, family) as candidate:
        if kind == "TCP":
            candidate.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with contextlib.suppress(OSError):
            candidate.bind(("127.0.0.1", port))
            return True
    return False


def _other_instance() -> str:
    for instance in range(1, MOST_INSTANCES):
        ports = (HIL_UDP_PORT, STATION_LOCAL, ONBOARD_LOCAL)
        if all(is_free(port + instance) for port in ports) and is_free(HIL_TCP_PORT + instance, "TCP"):
            return f"end the other program (`ss -lunp`, `ss -ltnp` name it), or give --instance {instance}"
    return "end the other program (`ss -lunp`, `ss -ltnp` name it)"


def display() -> Finding:
    """Whether `--view` can open a browser."""
    try:
        from sitl.view.run import has_display
    except ImportError:
        return Finding("note", "display", "unknown", "install the missing packages first")
    if has_display():
        return Finding("ok", "display", "--view opens a browser")
    return Finding("ok", "display", "none: --view prints an address to open", "")
