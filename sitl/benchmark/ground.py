"""What ground control costs the control loop: flights with and without clients that listen to everything.

`python -m sitl.benchmark.ground PORT COUNT` is the clients: one arms and takes off, all listen, until killed.
"""

from __future__ import annotations

import math
import select
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from sitl.flights.free_ports import free_ports
from sitl.flights.launch import FlightError, Pair, watch
from sitl_bridge.ids import COMPONENT_AUTOPILOT, vehicle_system
from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.process import StopRequest

CLIENTS = 3
FLIGHT_S = 30.0
_SYSTEM = 200
"""MAVLink system of the first client"""
_BEAT = 1.0
_ASK = 0.1
"""s, between two commands until the vehicle flies"""


def ground_figures(rate_hz: float) -> dict[str, float]:
    """The lockstep tick and the lateness in real time, with nobody listening and with three clients."""
    figures: dict[str, float] = {}
    for name, clients in (("ground", 0), ("clients", CLIENTS)):
        factor = _flight(rate_hz, clients, "lockstep")["real_time_factor"]
        figures[f"lockstep_tick_us_{name}"] = 1e6 / (factor * rate_hz)
        end = _flight(rate_hz, clients, "realtime")
        figures[f"lateness_p99_us_{name}"] = end["lateness_us"]["p99"]
        figures[f"late_ticks_{name}"] = end["late_ticks"]
    figures["lockstep_tick_clients_ratio"] = (
        figures["lockstep_tick_us_clients"] / figures["lockstep_tick_us_ground"]
    )
    return figures


def _flight(rate_hz: float, clients: int, clock: str) -> dict[str, Any]:
    """A take-off and what follows it, with so many clients; the plant's account of it."""
    hil, gcs, gcs_peer, onboard, onboard_peer = free_ports(5)
    common = ["--scenario", "hold", "--rate", str(rate_hz)]
    plant = [*common, "--hil", f"udpout:127.0.0.1:{hil}", "--clock", clock, "--duration", str(FLIGHT_S)]
    controller = [*common, "--hil", f"udpin:127.0.0.1:{hil}"]
    controller += ["--gcs", f"{gcs}:{gcs_peer}", "--onboard", f"{onboard}:{onboard_peer}"]
    command = [sys.executable, "-m", __name__, str(gcs), str(gcs_peer), str(clients)]
    listening = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    try:
        outcome = watch(Pair(plant, controller), StopRequest(), lambda event: None)
    finally:
        listening.kill()
        listening.wait()
    if outcome.failure:
        raise FlightError(outcome.failure)
    return outcome.end


def _beat(packer: Packer) -> bytes:
    return packer.pack(
        mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
    )


def _take_off(pilot: socket.socket, vehicle: tuple[str, int]) -> None:
    """Ask until the vehicle is armed: take-off first, so that it begins at once."""
    packer = Packer(_SYSTEM - 1, mavlink.MAV_COMP_ID_MISSIONPLANNER)
    target, unset = (vehicle_system(0), COMPONENT_AUTOPILOT), [math.nan] * 6
    pilot.settimeout(_ASK)
    while True:
        for number, first in (
            (mavlink.MAV_CMD_NAV_TAKEOFF, math.nan),
            (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0),
        ):
            ask = mavlink.MAVLink_command_long_message(*target, number, 0, first, *unset)
            pilot.sendto(packer.pack(ask), vehicle)
        deadline = time.monotonic() + _ASK
        while time.monotonic() < deadline:
            try:
                datagram = pilot.recv(65535)
            except (TimeoutError, ConnectionError):
                break
            for frame in split(datagram).frames:
                if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and (
                    frame.system == target[0] and frame.payload[6] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
                ):
                    return


def main(arguments: Sequence[str]) -> None:
    """Take off from the standard port, then be so many clients more."""
    port, peer, count = (int(argument) for argument in arguments)
    vehicle = ("127.0.0.1", port)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pilot:
        pilot.bind(("127.0.0.1", peer))
        _take_off(pilot, vehicle)
    clients = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    packers = [Packer(_SYSTEM + i, mavlink.MAV_COMP_ID_MISSIONPLANNER) for i in range(count)]
    due = 0.0
    while True:
        if time.monotonic() >= due:
            due = time.monotonic() + _BEAT
            for client, packer in zip(clients, packers, strict=True):
                client.sendto(_beat(packer), vehicle)
        for client in select.select(clients, [], [], max(0.0, due - time.monotonic()))[0]:
            client.recv(65535)


if __name__ == "__main__":
    main(sys.argv[1:])
