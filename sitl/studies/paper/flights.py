"""Flights over the real link: two processes in lockstep, launched as `sitl fly` launches them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.flights.flight import FlightOptions
from sitl.flights.free_ports import free_ports
from sitl.flights.launch import FlightError, Pair, watch
from sitl.flights.scenario import GroundControl, load_scenario, scenario_vehicle
from sitl.report.metrics import reference_positions
from sitl.report.summary import positions, read_state_log
from sitl.studies.paper.offline import RATE_HZ
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.plant.log.state_log import FILE_NAME
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]


class Flight(NamedTuple):
    """A flight's log, ENU and SI, and the command that repeats it."""

    command: str
    vehicle_description: Vehicle
    """What the plant simulated."""
    time: Array
    """(n,) s"""
    vehicle: Array
    """(n, 3) m"""
    load: Array
    """(n, 3) m"""
    attitude: Array
    """(n, 4) quaternion w, x, y, z, from body to world"""
    reference: Array
    """(n, 3) m"""
    tension: Array
    """(n,) N"""
    rotors: Array
    """(n, rotors) rad/s"""
    force_on_load: Array
    """(n, 3) N"""


class Request(NamedTuple):
    """A flight to make, in the words of `sitl fly`."""

    scenario: str
    design: str
    duration: float
    overrides: tuple[str, ...] = ()
    plant_overrides: tuple[str, ...] = ()
    seed: int = 0

    @property
    def command(self) -> str:
        """The command that makes it."""
        words = ["sitl fly", self.scenario, "--clock lockstep", f"--design {self.design}"]
        words += [f"--set '{text}'" for text in self.overrides]
        words += [f"--plant-set '{text}'" for text in self.plant_overrides]
        words += [f"--duration {self.duration:g}", *([f"--seed {self.seed}"] if self.seed else [])]
        return " ".join(words)


AT_ONCE = 2
"""Flights under way together: in lockstep plant and controller take turns, so a flight fills one core."""


class Pilot:
    """Makes flights in the background, each on a free port and into a folder of its own.

    What is asked for early is ready when it is needed: the flights take as long as everything else together.
    """

    def __init__(self, folder: Path, stop: StopRequest) -> None:
        self._folder = folder
        self._stop = stop
        self._pool = ThreadPoolExecutor(AT_ONCE)
        self._asked: dict[Request, Future[Flight]] = {}

    @property
    def flown(self) -> int:
        """How many flights were asked for."""
        return len(self._asked)

    def ask(self, requests: Sequence[Request]) -> None:
        """Make these flights when their turn comes; nobody waits for them yet."""
        for request in requests:
            if request not in self._asked:
                out = self._folder / f"flight-{len(self._asked) + 1:02d}"
                self._asked[request] = self._pool.submit(self._fly, request, out)

    def fly(self, requests: Sequence[Request]) -> list[Flight]:
        """These flights, made; raises FlightError when one did not come to its end."""
        self.ask(requests)
        return [self._asked[request].result() for request in requests]

    def close(self) -> None:
        """Give up what has not begun, and wait for what has."""
        self._pool.shutdown(cancel_futures=True)

    def _fly(self, request: Request, out: Path) -> Flight:
        if self._stop:
            raise FlightError(f"stopped by {self._stop.reason}")
        [port] = free_ports(1)
        description = load_scenario(request.scenario)
        out.mkdir(parents=True)
        options = FlightOptions(
            scenario_name=request.scenario,
            scenario=description,
            vehicle=None,
            overrides=request.overrides,
            plant_overrides=request.plant_overrides,
            hil=Address("udpout", "127.0.0.1", port),
            clock="lockstep",
            speed=None,
            on_silence="wait",
            rate_hz=RATE_HZ,
            seed=request.seed,
            design=request.design,
            feedback="truth",
            duration_s=request.duration,
            drop_percent=0.0,
            instance=0,
            out=out,
        )
        outcome = watch(Pair(*options.command_lines()), self._stop, lambda _: None)
        if outcome.failure or not outcome.end.get("completed"):
            raise FlightError(f"{request.command}: {outcome.failure or 'the flight was not completed'}")
        log = read_state_log(out / FILE_NAME)
        vehicle = scenario_vehicle(description, None, [*request.overrides, *request.plant_overrides])
        assert not isinstance(description.reference, GroundControl)  # the paper flies references only
        path = description.reference.path(vehicle.initial_load_position)
        return Flight(
            command=request.command,
            vehicle_description=vehicle,
            time=log["time_s"],
            vehicle=positions(log, "vehicle"),
            load=positions(log, "load"),
            attitude=np.stack([log[f"attitude_q{part}"] for part in "wxyz"], axis=1),
            reference=reference_positions(path, log["time_s"]),
            tension=log["cable_tension_N"],
            rotors=np.stack([log[f"rotor_{i + 1}_rad_s"] for i in range(len(vehicle.rotors))], axis=1),
            force_on_load=np.stack([log[f"force_load_{axis}_N"] for axis in "xyz"], axis=1),
        )
