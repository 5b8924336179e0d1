"""What the tests of modes and failsafes share: a vehicle in the air, its mode, set-points for it."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from tests.controller.ground.rig import Client, Rig

ACCEPTED, REJECTED, DENIED = 0, 1, 2
HOME_HEIGHT = 0.1


def flying() -> tuple[Rig, Client]:
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    return rig, client


def mode(rig: Rig) -> str:
    return rig.station.machine.mode.name


def local_setpoint(x: float, y: float, z: float, mask: int = 2552, frame: int = 1, **fields: float) -> Any:
    values = {
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
        "afx": 0.0,
        "afy": 0.0,
        "afz": 0.0,
        "yaw": 0.0,
        "yaw_rate": 0.0,
    }
    values.update(fields)
    target = (int(values.pop("system", 1)), int(values.pop("component", 1)))
    return mavlink.MAVLink_set_position_target_local_ned_message(0, *target, frame, mask, x, y, z, **values)


def stream(rig: Rig, client: Client, message: Any, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        client.send(message)
        rig.run(0.1)


def set_parameter(rig: Rig, client: Client, name: str, value: float) -> None:
    assert rig.station.parameters.set(name, value) == ""
