"""The Dockerfile against the product: no daemon is needed."""

from __future__ import annotations

import json
import re
from pathlib import Path

from controller.ground.link.ports import ONBOARD_LOCAL, STATION_LOCAL
from sitl.command_line.arguments import build_parser
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT

TOP = Path(__file__).parents[2]
LINES = (TOP / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", "").splitlines()


def _instructions(name: str) -> list[str]:
    return [line.partition(" ")[2].strip() for line in LINES if line.startswith(f"{name} ")]


def test_it_does_not_run_as_root() -> None:
    last = max(number for number, line in enumerate(LINES) if line.startswith("USER "))
    assert LINES[last].split()[1] not in ("root", "0")
    assert f"useradd --create-home --uid 1000 {LINES[last].split()[1]}" in "\n".join(LINES[:last])


def test_its_command_is_one_that_the_product_takes() -> None:
    [entry], [command] = _instructions("ENTRYPOINT"), _instructions("CMD")
    assert json.loads(entry) == ["sitl"]
    arguments = build_parser().parse_args(json.loads(command))
    assert (arguments.command, arguments.scenario, arguments.expose) == ("fly", "hold", True)


def test_the_ports_that_clients_need_are_exposed_and_mapped() -> None:
    [exposed] = _instructions("EXPOSE")
    wanted = {f"{HIL_UDP_PORT}/udp", f"{STATION_LOCAL}/udp", f"{ONBOARD_LOCAL}/udp", f"{HIL_TCP_PORT}/tcp"}
    assert wanted <= set(exposed.split())
    mapped = re.findall(r"-p (\d+):\1/udp", "\n".join(LINES))
    assert {int(port) for port in mapped} == {STATION_LOCAL, ONBOARD_LOCAL}
