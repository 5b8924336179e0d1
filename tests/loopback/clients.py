"""What real clients do with a vehicle, pointed at any ports: MAVSDK-Python 4 and MAVProxy, unchanged."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from tests.patience import PATIENCE


class Vehicle:
    """A MAVSDK system with the plugins that the suite uses."""

    def __init__(self, system: Any) -> None:
        from mavsdk.asyncio.plugins.action import ActionAsync
        from mavsdk.asyncio.plugins.info import InfoAsync
        from mavsdk.asyncio.plugins.mission import MissionAsync
        from mavsdk.asyncio.plugins.offboard import OffboardAsync
        from mavsdk.asyncio.plugins.param import ParamAsync
        from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

        self.system = system
        self.action = ActionAsync(system)
        self.info = InfoAsync(system)
        self.mission = MissionAsync(system)
        self.offboard = OffboardAsync(system)
        self.param = ParamAsync(system)
        self.telemetry = TelemetryAsync(system)


@asynccontextmanager
async def mavsdk_vehicle(
    connection: str, timeout: float = PATIENCE, companion: bool = False
) -> AsyncIterator[Vehicle]:
    """A vehicle on a MAVSDK connection string (`udpin://0.0.0.0:14540`).

    companion: MAVSDK as an onboard computer, which is no ground station to the vehicle.
    """
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.logging import log_subscribe

    log_subscribe(lambda level, message, file, line: True)
    kind = ComponentType.COMPANION_COMPUTER if companion else ComponentType.GROUND_STATION
    configuration = Configuration.create_with_component_type(kind)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=timeout)
        assert system is not None, f"no autopilot on {connection} within {timeout:g} s"
        yield Vehicle(system)


async def send_command(vehicle: Vehicle, number: int, *parameters: float) -> int:
    """A COMMAND_LONG that MAVSDK has no method for; its result."""
    from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
    from mavsdk.plugins.mavlink_direct import MavlinkMessage

    values = [*parameters, *[0.0] * (7 - len(parameters))]
    fields = {
        "target_system": 1,
        "target_component": 1,
        "command": number,
        "confirmation": 0,
        **{f"param{index}": value for index, value in enumerate(values, start=1)},
    }
    message = MavlinkMessage("COMMAND_LONG", 245, 190, 1, 1, json.dumps(fields))
    ack = await MavlinkDirectAsync(vehicle.system).send_command(message)
    return int(json.loads(ack.fields_json)["result"])


async def until(
    read: Callable[[], Any], holds: Callable[[Any], bool], what: str, timeout: float = PATIENCE
) -> Any:
    """Read until a condition holds."""
    deadline = time.monotonic() + timeout
    value = None
    while time.monotonic() < deadline:
        value = await read()
        if holds(value):
            return value
        await asyncio.sleep(0.1)
    raise AssertionError(f"{what}: not within {timeout:g} s; last {value}")


class Texts:
    """What a vehicle says to MAVSDK (STATUSTEXT), from the moment this is entered."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.heard: list[str] = []
        self._vehicle = vehicle

    async def _listen(self) -> None:
        async for status in self._vehicle.telemetry.subscribe_status_text():
            self.heard.append(status.text)

    async def __aenter__(self) -> Texts:
        self._task = asyncio.create_task(self._listen())
        await asyncio.sleep(0)  # subscribed
        return self

    async def __aexit__(self, *exception: object) -> None:
        self._task.cancel()

    async def wait_for(self, words: str, timeout: float = PATIENCE) -> None:
        """Wait until it says something that it had not said by the end of the last wait."""
        deadline = time.monotonic() + timeout
        while not any(words in text for text in self.heard):
            assert time.monotonic() < deadline, f"nobody said {words!r} within {timeout:g} s: {self.heard}"
            await asyncio.sleep(0.05)
        self.heard.clear()


TERMINATION_GRACE = 5.0
"""s, of wall time; then it is killed."""


class MavProxy:
    """mavproxy.py as a subprocess that takes commands and whose output is kept."""

    def __init__(self, master: str, folder: Path) -> None:
        program = Path(sys.executable).with_name("mavproxy.py")
        self.log = folder / "mavproxy.txt"
        self._out = self.log.open("wb")
        self._process = subprocess.Popen(
            [str(program), f"--master={master}", "--nowait", f"--state-basedir={folder}", "--default-modules="
             "mode,arm,param,ftp,wp,fence,rally,log,cmdlong,misc,link,signing,rc"],
            stdin=subprocess.PIPE,
            stdout=self._out,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env={"PATH": "/usr/bin:/bin", "HOME": str(folder), "TERM": "dumb", "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip

    def say(self, command: str) -> None:
        """Type a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(command.encode() + b"\n")
        self._process.stdin.flush()

    def output(self) -> str:
        """Everything it has printed."""
        return self.log.read_text(errors="replace")

    def wait_for(self, text: str, timeout: float = PATIENCE, after: int = 0) -> int:
        """Wait until it prints a text behind a position; returns the position behind that."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            found = self.output().find(text, after)
            if found >= 0:
                return found + len(text)
            time.sleep(0.05)
        raise AssertionError(
            f"MAVProxy did not print {text!r} within {timeout:g} s:\n{self.output()[-3000:]}"
        )

    def stop(self) -> None:
        """End it: it does not always follow SIGTERM, and what it has printed is in the file anyway."""
        self._process.terminate()
        try:
            self._process.wait(TERMINATION_GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._out.close()
