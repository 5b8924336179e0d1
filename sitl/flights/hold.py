"""`sitl fly` under ground control: plant and controller run until Ctrl-C, and a person or program flies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sitl.flights.flight import FlightOptions, flight_facts
from sitl.flights.launch import Outcome, Pair, watch
from sitl.report.keep import keep_recording
from sitl.report.summary import clear, write_report
from sitl.terminal.display import Display
from sitl.terminal.status import status_of
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError

if TYPE_CHECKING:
    from controller.pilot.guided.options import GroundOptions


def ground_arguments(options: GroundOptions) -> list[str]:
    """The controller's command line for its ground-control links."""
    arguments: list[str] = []
    for flag, ports in (("--gcs", options.stations), ("--onboard", options.onboard)):
        if ports is not None:
            arguments += [flag, f"{ports.local}:{ports.peer}"]
    for flag, file in (("--signing-key", options.signing_key), ("--parameters", options.parameters)):
        if file is not None:
            arguments += [flag, str(file)]
    return [*arguments, "--expose"] if options.exposed else arguments


def check_design(design: str) -> None:
    """Under ground control there is no choice of a design; raises DescriptionError for one."""
    if design != "default":
        raise DescriptionError(
            "--design", [f"{design} does not fly under ground control; weigh the default by LQR_* parameters"]
        )


def hold(options: FlightOptions, stop: StopRequest) -> str | None:
    """Run both processes until asked to stop; returns what went wrong before that, if something did."""
    vehicle = options.checked_vehicle()
    options.check_port()
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        clear(options.out)
    with Display() as display:
        pair = Pair(*options.command_lines(), display.messages, forked=options.law is None)
        display.forward()
        outcome = watch(pair, stop, lambda event: display.show(status_of(event)))
    failure = None if stop else outcome.failure
    if options.out is not None:
        _report(options.out, options, vehicle, outcome, failure)
    return failure


def _report(
    out: Path, options: FlightOptions, vehicle: Vehicle, outcome: Outcome, failure: str | None
) -> None:
    """Summary, picture, MCAP and interactive page; of a flight that never began, the summary alone."""
    ended = replace(outcome, failure=failure, end={**outcome.end, "completed": failure is None})
    facts = flight_facts(options, vehicle, ended)
    write_report(out, facts, None, described=vehicle, picture=options.report)
    keep_recording(out, vehicle, None, options.written, options.report)
