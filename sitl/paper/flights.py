"""Flights over the real link: plant and controller as two processes in lockstep, as `sitl fly` launches them."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.fly import Pair, watch
from sitl.flight import FlightOptions
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


class Pilot:
    """Flies scenarios one after another, each on a free port, into a folder of their own."""

    def __init__(self, folder: Path, stop: StopRequest) -> None:
        self._folder = folder
        self._stop = stop
        self.flown = 0

    def fly(
        self,
        scenario: str,
        design: str,
        duration: float,
        overrides: Sequence[str] = (),
        plant_overrides: Sequence[str] = (),
        seed: int = 0,
    ) -> Flight:
        """Fly; raises FlightError when it did not come to its end."""
        self.flown += 1
        description = load_scenario(scenario)
        out = self._folder / f"flight-{self.flown:02d}"
        out.mkdir(parents=True, exist_ok=True)
        options = FlightOptions(
            scenario_name=scenario,
            scenario=description,
            vehicle=None,
            overrides=overrides,
            plant_overrides=plant_overrides,
            hil=Address("udpout", "127.0.0.1", free_port()),
            clock="lockstep",
            speed=None,
            on_silence="wait",
            rate_hz=RATE_HZ,
            seed=seed,
            design=design,
            feedback="truth",
            duration_s=duration,
            drop_percent=0.0,
            instance=0,
            out=out,
        )
        outcome = watch(Pair(*options.command_lines()), self._stop, lambda _: None)
        if outcome.failure or not outcome.end.get("completed"):
            raise FlightError(f"{scenario}: {outcome.failure or 'the flight was not completed'}")
        log = read_state_log(out / FILE_NAME)
        vehicle = scenario_vehicle(description, None, [*overrides, *plant_overrides])
        path = description.reference.path(vehicle.initial.load_position)
        words = ["sitl fly", scenario, "--clock lockstep", f"--design {design}", f"--duration {duration:g}"]
        words += [f"--set '{text}'" for text in overrides]
        words += [f"--plant-set '{text}'" for text in plant_overrides]
        words += [f"--seed {seed}"] if seed else []
        return Flight(
            command=" ".join(words),
            vehicle_description=vehicle,
            time=log["time_s"],
            vehicle=positions(log, "vehicle"),
            load=positions(log, "load"),
            reference=reference_positions(path, log["time_s"]),
            tension=log["cable_tension_N"],
            rotors=np.stack([log[f"rotor_{i + 1}_rad_s"] for i in range(len(vehicle.rotors))], axis=1),
            force_on_load=np.stack([log[f"force_load_{axis}_N"] for axis in "xyz"], axis=1),
        )


def free_port() -> int:
    """A UDP port of 127.0.0.1 that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
