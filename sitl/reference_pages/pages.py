"""The pages by file name."""

from __future__ import annotations

from collections.abc import Callable

from sitl.reference_pages import command_line, mavlink, python_api, schema

PAGES: dict[str, Callable[[], str]] = {
    "command-line.md": command_line.markdown,
    "vehicle.md": schema.vehicle_markdown,
    "scenario.md": schema.scenario_markdown,
    "python.md": python_api.markdown,
    "mavlink.md": mavlink.markdown,
}
