"""`sitl bench`: how fast it is, beside what it could be; `limits` judges it."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controller.hil.answers import AnswerWriter
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl.benchmark.footprint import log_figures, memory_figures
from sitl.benchmark.ground import ground_figures
from sitl.benchmark.gym import gym_figures
from sitl.benchmark.in_process import in_process_figures, sweep_figures
from sitl.benchmark.roundtrip import round_trip_us
from sitl.command_line.arguments import DEFAULT_RATE_HZ
from sitl.flights.free_ports import free_ports
from sitl.flights.launch import FlightError, Pair, watch
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

STEPS = 20_000
TRIPS = 7_500
FLIGHT_S = 30.0
FULL = (
    "initial.start=hover",
    "sensors.preset=urban",
    "sensors.tracker.rate=20",
    "disturbance.force_std=0.5",
    "air.wind=[3.0, 1.0, 0.0]",
    "air.turbulence.wind_at_6_m=7.7",
)
"""What makes `iris`, which has ground, rotor lag, drag and a battery, a plant with everything on."""
ON_TRUTH, ON_ESTIMATE = ("--feedback", "truth"), ("--feedback", "estimate")
LOSSY_PERCENT = 10.0
LOSSY_FLIGHT_S = 5.0
WARMING_TICKS = 250


def physics_step_us(vehicle: Vehicle) -> float:
    """Time of one RK4 step, us, in runs of a thousand."""
    world = Simulation(vehicle, DEFAULT_RATE_HZ, seed=0).world
    world.advance(1000)
    began = time.perf_counter()
    for _ in range(STEPS // 1000):
        world.advance(1000)
    return (time.perf_counter() - began) / STEPS * 1e6


def control_step_us(vehicle: Vehicle) -> float:
    """Time of one control step, us: estimate in, rotor commands out."""
    autopilot = Autopilot(
        vehicle, "default", DEFAULT_RATE_HZ, lambda start: setpoint((3.0, 5.0, 2.0), start), np.zeros(16)
    )
    estimate = np.zeros(18)
    estimate[2] = vehicle.hover_length
    autopilot.step(estimate, 0, 0.0)
    began = time.perf_counter()
    for _ in range(STEPS):
        autopilot.step(estimate, 0, 0.0)
    return (time.perf_counter() - began) / STEPS * 1e6


def datagram_sizes(vehicle: Vehicle) -> tuple[int, int]:
    """Bytes of a tick with truth, and of its answer."""
    simulation = Simulation(vehicle, DEFAULT_RATE_HZ, seed=0)
    simulation.ask_for_truth(True)
    simulation.heard()
    simulation.next_tick()
    simulation.datagram()  # the sensors' first: on it all is due that is said now and then
    simulation.next_tick()
    writer = AnswerWriter(0, Packer(1, COMPONENT_AUTOPILOT))
    writer.controls[:4] = 0.7
    return len(simulation.datagram()), len(writer.answer(4000, True))


def estimator_update_us(vehicle: Vehicle) -> float:
    """Median time of the estimator's tick, us: inertial sensors, magnetometer, barometer; GPS at its rate.

    Fixes come as late as the vehicle's receiver gives them, so that they correct an instant that is past.
    """
    from controller.estimator.filter import Estimator
    from controller.feedback.estimate import tuning_for
    from sitl_bridge.vehicle.description import hover_rotor_speeds

    tuning = tuning_for(vehicle, DEFAULT_RATE_HZ)
    estimator = Estimator(vehicle, 1.0 / DEFAULT_RATE_HZ, tuning)
    speeds = np.array(hover_rotor_speeds(vehicle))
    spread = round(DEFAULT_RATE_HZ * tuning.gps_period)
    late = round(DEFAULT_RATE_HZ * vehicle.sensors.gps.delay)
    times = []
    for tick in range(STEPS // 2):
        now = tick / DEFAULT_RATE_HZ
        east, north, height = tuning.field
        # A sensor that repeats itself to the last digit is taken for stuck, and would not be used.
        tremor = 1e-9 * (tick % 3)
        estimator.imu((tremor, 0.0, vehicle.gravity), (tremor, 0.0, 0.0))
        estimator.magnetometer((east + tremor, north, height))
        estimator.barometer(0.0)
        if tick >= late and (tick - late) % spread == 0:
            estimator.gps((tick - late) / DEFAULT_RATE_HZ, (tremor, 0.0, 0.0), (0.0, 0.0, 0.0))
        began = time.perf_counter()
        estimator.tick(now)
        times.append(time.perf_counter() - began)
        estimator.command(speeds)
        if tick == WARMING_TICKS:
            estimator.take_off(speeds)
    return statistics.median(times[WARMING_TICKS + 1 :]) * 1e6


def lockstep_flight(
    scenario: str,
    *more: str,
    feedback: Sequence[str] = ON_TRUTH,
    duration_s: float = FLIGHT_S,
    drop_percent: float = 0.0,
) -> dict[str, Any]:
    """Fly a scenario in lockstep as fast as it goes, without logs; the plant's account of it.

    drop_percent: of the datagrams each way; the plant loses them, as in `sitl fly --drop`.
    """
    [port] = free_ports(1)
    sensors = ["--set", "sensors.preset=consumer"] if feedback == ON_ESTIMATE else []
    common = ["--scenario", scenario, "--rate", str(DEFAULT_RATE_HZ), *sensors, *more]
    plant = [*common, "--hil", f"udpout:127.0.0.1:{port}", "--clock", "lockstep"]
    plant += ["--duration", str(duration_s), "--drop", str(drop_percent)]
    controller = [*common, "--hil", f"udpin:127.0.0.1:{port}", *feedback]
    outcome = watch(Pair(plant, controller), StopRequest(), lambda event: None)
    if outcome.failure:
        raise FlightError(outcome.failure)
    return outcome.end


def launch_to_first_command_s(feedback: Sequence[str] = ()) -> float:
    """Time from the launch of `sitl fly` to the first rotor command at the plant, s."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sitl", "fly", "hover", "--duration", "0.1", "--out", folder]
        command += ["--hil", f"udpout:127.0.0.1:{free_ports(1)[0]}"]
        command += feedback
        launched = time.time()
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        file = Path(folder) / "summary.json"
        summary = json.loads(file.read_text()) if file.exists() else {}
        if summary.get("first_command_unix_s") is None:
            raise FlightError(summary.get("failure") or "`sitl fly` did not fly")
        return float(summary["first_command_unix_s"]) - launched


def bench(repeats: int) -> dict[str, list[float]]:
    """So many samples of each figure; progress on standard error."""
    samples: dict[str, list[float]] = {}
    for repeat in range(repeats):
        print(f"bench: {repeat + 1} of {repeats}", file=sys.stderr, flush=True)
        for key, value in _measured().items():
            samples.setdefault(key, []).append(value)
    return samples


def medians(samples: dict[str, list[float]]) -> dict[str, float]:
    """The figures of a benchmark."""
    return {key: statistics.median(values) for key, values in samples.items()}


def _measured() -> dict[str, float]:
    """Every figure once; what is compared is measured close together."""
    vehicle = load_vehicle("paper", ["cable.rest_length=10"])
    consumer = load_vehicle("paper", ["cable.rest_length=10", "sensors.preset=consumer"])
    factor = lockstep_flight("setpoint")["real_time_factor"]
    estimated = lockstep_flight("setpoint", feedback=ON_ESTIMATE)["real_time_factor"]
    found = {
        "physics_step_us": physics_step_us(vehicle),
        "control_step_us": control_step_us(vehicle),
        "estimator_update_us": estimator_update_us(consumer),
        "lockstep_tick_us": _tick_us(factor),
        "round_trip_us": round_trip_us(*datagram_sizes(vehicle), TRIPS),
        "real_time_factor": factor,
        "lockstep_tick_us_estimate": _tick_us(estimated),
        "real_time_factor_estimate": estimated,
    }
    found |= in_process_figures(DEFAULT_RATE_HZ)
    found |= {
        "lockstep_tick_per_round_trip": found["lockstep_tick_us"] / found["round_trip_us"],
        "lockstep_tick_estimate_per_round_trip": found["lockstep_tick_us_estimate"] / found["round_trip_us"],
        "lockstep_tick_estimate_ratio": found["lockstep_tick_us_estimate"] / found["lockstep_tick_us"],
        "in_process_tick_ratio": found["in_process_tick_us"] / found["lockstep_tick_us"],
        "in_process_tick_estimate_ratio": found["in_process_tick_us_estimate"]
        / found["lockstep_tick_us_estimate"],
        "lossy_real_time_factor": lockstep_flight(
            "setpoint", duration_s=LOSSY_FLIGHT_S, drop_percent=LOSSY_PERCENT
        )["real_time_factor"],
        "launch_to_first_command_s": launch_to_first_command_s(),
        "launch_to_first_command_s_estimate": launch_to_first_command_s(ON_ESTIMATE),
    }
    found |= _full_figures(found["physics_step_us"], found["lockstep_tick_us"])
    found |= ground_figures(DEFAULT_RATE_HZ)
    hovering = _tick_us(
        lockstep_flight("hover", "--vehicle", "iris", feedback=ON_ESTIMATE)["real_time_factor"]
    )
    found |= {"hover_tick_us": hovering, "hold_tick_ratio": found["lockstep_tick_us_ground"] / hovering}
    return found | memory_figures() | log_figures() | gym_figures() | sweep_figures()


def _full_figures(step_us: float, tick_us: float) -> dict[str, float]:
    """With everything on that the plant can do, over the plain step and tick."""
    options = ["--vehicle", "iris", *(word for change in FULL for word in ("--set", change))]
    standing = [*FULL, "initial.start=ground"]
    found = {
        "physics_step_us_full": physics_step_us(load_vehicle("iris", FULL)),
        "physics_step_us_ground_full": physics_step_us(load_vehicle("iris", standing)),
        "lockstep_tick_us_full": _tick_us(lockstep_flight("hover", *options)["real_time_factor"]),
    }
    return {
        **found,
        "physics_step_full_ratio": found["physics_step_us_full"] / step_us,
        "lockstep_tick_full_ratio": found["lockstep_tick_us_full"] / tick_us,
    }


def _tick_us(real_time_factor: float) -> float:
    return 1e6 / (real_time_factor * DEFAULT_RATE_HZ)


def table(results: dict[str, float]) -> str:
    """The results for people."""
    return "\n".join(f"  {key:<40}{value:10.3f}" for key, value in results.items())
