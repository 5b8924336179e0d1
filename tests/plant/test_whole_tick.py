"""A tick in one compiled call is the tick in steps: the same bytes on the link, the same rows in the log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from controller.feedback.estimate import EstimateFeedback
from controller.feedback.truth import Feedback, TruthFeedback
from controller.hil.session import new_session
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.faults.schedule import Faults, LoadFault, RotorFault, SensorFault
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.log.state_log import StateLog
from sitl_bridge.plant.simulation import NO_FAULTS, Simulation
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.network import Faults as Loss
from tests.plant.network import Network

RATE_HZ = 250.0
CALM = Loss()


class InParts:
    """A feedback whose autopilot has to take each tick apart."""

    def __init__(self, feedback: Feedback) -> None:
        self._feedback = feedback

    def __getattr__(self, name: str) -> Any:
        return getattr(self._feedback, name)

    def plain_tick(self, *arguments: Any) -> None:
        return None


def flight(
    path: Path,
    name: str,
    overrides: list[str],
    faults: Faults = NO_FAULTS,
    loss: Loss = CALM,
    whole: bool = True,
    on_estimate: bool = False,
) -> tuple[dict[str, list[bytes]], int]:
    """What both said in a flight of 6 s, and how many ticks the plant flew in one call."""
    vehicle = load_vehicle(name, overrides)
    simulation = Simulation(vehicle, RATE_HZ, 3, duration_s=6.0, faults=faults)
    log = StateLog(path, simulation.world)
    simulation.record_with(log)
    flown_whole = 0

    def fly_whole_tick(datagram: bytes) -> bool:
        nonlocal flown_whole
        flown = whole and Simulation.fly_whole_tick(simulation, datagram)
        flown_whole += flown
        return flown

    simulation.fly_whole_tick = fly_whole_tick  # type: ignore[method-assign]
    feedback = EstimateFeedback(vehicle, RATE_HZ) if on_estimate else TruthFeedback()
    session = new_session(
        lambda controls: Autopilot(
            vehicle, "default", RATE_HZ, lambda start: setpoint((1.0, 2.0, start[2] + 1.0), start), controls
        ),
        0,
        lambda text: None,
        feedback if whole else InParts(feedback),
    )
    network = Network(Lockstep(simulation, Notices(lambda text: None), 0), session, loss)
    network.run(lambda: simulation.finished)
    log.close()
    return network.sent, flown_whole


FLIGHTS = {
    "paper with noise": ("paper", ["disturbance.force_std=5", "sensors.preset=consumer"], NO_FAULTS),
    "everything": (
        "iris",
        [
            "initial.start=hover",
            "sensors.preset=urban",
            "air.wind=[3, 1, 0]",
            "air.turbulence.wind_at_6_m=7.7",
            "sensors.tracker.rate=20",
            "sensors.tracker.delay=0.05",
            "sensors.tracker.angle_noise=0.01",
        ],
        Faults(
            sensor=(SensorFault(at=2.0, duration=1.0, sensor="gps", failure="wrong"),),
            rotor=(RotorFault(at=3.0, duration=0.1, rotor=2, thrust=0.8),),
            load=(LoadFault(at=4.0, mass=0.4),),
        ),
    ),
}


CASES = [("paper with noise", False), ("paper with noise", True), ("everything", False)]


@pytest.mark.parametrize(("name", "on_estimate"), CASES)
def test_both_ways_say_and_log_the_same(name: str, on_estimate: bool, tmp_path: Path) -> None:
    vehicle, overrides, faults = FLIGHTS[name]
    whole, flown_whole = flight(tmp_path / "whole", vehicle, overrides, faults, on_estimate=on_estimate)
    parts, flown_in_parts = flight(
        tmp_path / "parts", vehicle, overrides, faults, whole=False, on_estimate=on_estimate
    )
    assert flown_in_parts == 0
    assert flown_whole > 0.5 * 6.0 * RATE_HZ  # or nothing is compared here
    assert whole == parts
    assert pq.read_table(tmp_path / "whole").equals(pq.read_table(tmp_path / "parts"))


def test_loss_and_duplicates_change_nothing_either(tmp_path: Path) -> None:
    vehicle, overrides, faults = FLIGHTS["paper with noise"]
    flight(tmp_path / "calm", vehicle, overrides, faults)
    flight(
        tmp_path / "rough", vehicle, overrides, faults, Loss(drop=0.1, duplicate=0.1, jitter_s=0.01, seed=4)
    )
    assert (tmp_path / "calm").read_bytes() == (tmp_path / "rough").read_bytes()


def test_a_loop_delay_is_flown_in_steps(tmp_path: Path) -> None:
    _, flown_whole = flight(tmp_path / "log", "paper", ["loop.delay_ticks=2"])
    assert flown_whole == 0
