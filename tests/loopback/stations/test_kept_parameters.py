"""Parameters in a file, with real processes and clients: a corrupt one survived, changes kept on request."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import common as mavlink

from sitl.flights.free_ports import free_ports
from tests.loopback.clients import Vehicle, mavsdk_vehicle, send_command
from tests.loopback.conftest import Process

LOAD, SAVE = 0.0, 1.0


async def storage(vehicle: Vehicle, action: float) -> int:
    """The result of PREFLIGHT_STORAGE."""
    return await send_command(vehicle, mavlink.MAV_CMD_PREFLIGHT_STORAGE, action)


async def change_and_keep(connection: str) -> None:
    async with mavsdk_vehicle(connection) as vehicle:
        assert await vehicle.param.get_param_float("LQR_Q_LPOS") == 1.0  # defaults, for want of a good file
        await vehicle.param.set_param_float("LQR_Q_LPOS", 4.0)
        await vehicle.param.set_param_int("GF_ACTION", 2)
        assert await storage(vehicle, SAVE) == mavlink.MAV_RESULT_ACCEPTED
        await vehicle.param.set_param_int("GF_ACTION", 5)
        assert await storage(vehicle, LOAD) == mavlink.MAV_RESULT_ACCEPTED
        assert await vehicle.param.get_param_int("GF_ACTION") == 2
        await vehicle.param.set_param_float("MPC_XY_CRUISE", 2.0)  # not kept


async def kept(connection: str) -> None:
    async with mavsdk_vehicle(connection) as vehicle:
        assert await vehicle.param.get_param_float("LQR_Q_LPOS") == 4.0
        assert await vehicle.param.get_param_int("GF_ACTION") == 2
        assert await vehicle.param.get_param_float("MPC_XY_CRUISE") == 3.0


def test_a_corrupt_file_is_survived_and_changes_outlive_the_process(
    start: Callable[..., Process], tmp_path: Path
) -> None:
    file = tmp_path / "parameters.json"
    file.write_text('{"LQR_Q_LPOS": 2.0, "GF_')
    hil, gcs, gcs_peer, onboard, onboard_peer = free_ports(5)
    line = (
        *("controller", "--scenario", "hold", "--hil", f"udpin:127.0.0.1:{hil}", "--parameters", str(file)),
        *("--gcs", f"{gcs}:{gcs_peer}", "--onboard", f"{onboard}:{onboard_peer}"),
    )
    controller = start(*line)
    controller.wait_for("defaults used, file kept as parameters.json.corrupt")
    asyncio.run(change_and_keep(f"udpin://127.0.0.1:{onboard_peer}"))
    controller.popen.send_signal(signal.SIGTERM)
    assert controller.finish()[0] == 0
    again = start(*line)
    asyncio.run(kept(f"udpin://127.0.0.1:{onboard_peer}"))
    assert "warning" not in again.errors
    assert (tmp_path / "parameters.json.corrupt").read_text().startswith('{"LQR_Q_LPOS": 2.0')
