"""Flights over the real link: two processes in lockstep, launched as `sitl fly` launches them."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.flight import FlightOptions
from sitl.fly import Pair, watch
from sitl.metrics import reference_positions
from sitl.report import positions, read_state_log
from sitl.scenario import load_scenario, scenario_vehicle
from sitl_bridge.mavlink.links import Address
from sitl_bridge.plant.statelog import FILE_NAME
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle import Vehicle

Array = NDArray[np.float64]

RATE_HZ = 250.0


class FlightError(RuntimeError):
    """A flight did not take place as asked for."""


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
    overrides: Sequence[str] = ()
    plant_overrides: Sequence[str] = ()
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
    """Makes flights, each on a free port and into a folder of its own."""

    def __init__(self, folder: Path, stop: StopRequest) -> None:
        self._folder = folder
        self._stop = stop
        self._ports: set[int] = set()
        self.flown = 0

    def fly(self, requests: Sequence[Request]) -> list[Flight]:
        """Make these flights; raises FlightError when one does not come to its end."""
        jobs = []
        for request in requests:
            self.flown += 1
            jobs.append((request, self._folder / f"flight-{self.flown:02d}", self._free_port()))
        with ThreadPoolExecutor(AT_ONCE) as pool:
            return list(pool.map(lambda job: self._fly(*job), jobs))

    def _fly(self, request: Request, out: Path, port: int) -> Flight:
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
        path = description.reference.path(vehicle.initial.load_position)
        return Flight(
            command=request.command,
            vehicle_description=vehicle,
            time=log["time_s"],
            vehicle=positions(log, "vehicle"),
            load=positions(log, "load"),
            reference=reference_positions(path, log["time_s"]),
            tension=log["cable_tension_N"],
            rotors=np.stack([log[f"rotor_{i + 1}_rad_s"] for i in range(len(vehicle.rotors))], axis=1),
            force_on_load=np.stack([log[f"force_load_{axis}_N"] for axis in "xyz"], axis=1),
        )

    def _free_port(self) -> int:
        """A UDP port of 127.0.0.1 that is free now, and that no other flight of this run was given."""
        while True:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("127.0.0.1", 0))
                port = int(probe.getsockname()[1])
            if port not in self._ports:
                self._ports.add(port)
                return port
