"""`sitl view`: what to show, the server, and the browser."""

from __future__ import annotations

import contextlib
import io
import json
import os
import socket
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sitl.recording.recording import read_recording, read_vehicle
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

HERE = "127.0.0.1"
"""Who serves the page to this machine alone."""
PORT = 8080
TRUTH_PORT = 19410
"""Where PX4's viewers listen for HIL_STATE_QUATERNION."""


@dataclass(frozen=True)
class ViewOptions:
    """What `sitl view` is asked for."""

    addresses: Sequence[Address] = ()
    """Links to listen on; none: a flight is played."""
    flight: Path | None = None
    """A flight's folder, or a .tlog."""
    vehicle: str | None = None
    """Name or file of the description that says what it looks like; None: the flight's own, or iris."""
    overrides: Sequence[str] = ()
    scenario: str | None = None
    """Name or file of the scenario whose reference is drawn."""
    export: Path | None = None
    """Write the page here, serve nothing."""
    host: str = HERE
    port: int = PORT
    browser: bool = True
    """Open one where there is a display."""
    events: bool = False
    """Say the address as an event on standard output, for the program that started this one."""


def run(options: ViewOptions, stop: StopRequest) -> None:
    """Show until asked to stop. Raises DescriptionError, RecordingError, OSError."""
    views, vehicle = _what_to_show(options)
    way = None
    if options.scenario is not None:
        from sitl.flights.scenario import load_scenario
        from sitl.view.way import Way

        way = Way(load_scenario(options.scenario), vehicle)
    server = _server(options)
    try:
        if options.export is not None:
            from sitl.view.playback import export_html

            export_html(views, vehicle, server, options.export)
            return
        announce(options, server)
        if views:
            from sitl.view.playback import play

            play(views, vehicle, server, stop)
        else:
            from sitl.view.live import watch

            watch(options.addresses, vehicle, server, stop, way)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def _what_to_show(options: ViewOptions) -> tuple[list[Any], Vehicle]:
    """Moments of a finished flight (none: live), and the vehicle as it is drawn."""
    from sitl.view.replay import views_of_recording, views_of_tlog

    described = None
    if options.vehicle is not None and options.vehicle.endswith(".json"):
        described = read_vehicle(Path(options.vehicle))
    elif options.vehicle is not None or options.overrides:
        described = load_vehicle(options.vehicle or "iris", list(options.overrides))
    if options.flight is None:
        return [], described or load_vehicle("iris", [])
    if options.flight.is_file():
        return views_of_tlog(options.flight), described or load_vehicle("iris", [])
    recording = read_recording(options.flight)
    return views_of_recording(recording), described or recording.vehicle


def _server(options: ViewOptions) -> Any:
    try:
        import viser
    except ImportError:
        raise DescriptionError(
            "sitl view", ["needs viser: pip install 'sitl-bridge[view]' (or: pip install viser)"]
        ) from None
    with contextlib.redirect_stdout(io.StringIO()):  # its banner would stand between our lines
        return viser.ViserServer(host=options.host, port=options.port, label="sitl", verbose=False)


def announce(options: ViewOptions, server: Any) -> None:
    """Print the address, and open a browser where there is a display."""
    port = server.get_port()
    address = f"http://{HERE}:{port}"
    if options.events:
        print(json.dumps({"event": "view", "address": address}), flush=True)
    outside = "" if options.host == HERE else f", and from elsewhere http://{socket.gethostname()}:{port}"
    print(f"view: {address}{outside}", file=sys.stderr, flush=True)
    if options.browser and has_display():
        webbrowser.open(address)


def has_display() -> bool:
    """Whether a browser has somewhere to open."""
    return sys.platform in ("darwin", "win32") or any(
        os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY")
    )
