"""Flies the flights of docs/faults.md: prints the table, draws docs/images/faults.png.

    python scripts/fault_flights.py                    # all of them
    python scripts/fault_flights.py gps "rotor 1"      # some, and no picture

Plant and autopilot as they are, on a clock of their own instead of a wall clock, in one process; `iris` at
250 Hz, hovering with its load in moderate turbulence (always the same), fed back the estimate from its
sensors, one fault from t = 5 s on.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, get_args

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from controller.design.names import ON_ESTIMATE  # noqa: E402
from controller.feedback.estimate import EstimateFeedback  # noqa: E402
from controller.hil.session import new_session  # noqa: E402
from controller.law.reference import setpoint  # noqa: E402
from controller.pilot.autopilot import Autopilot  # noqa: E402
from sitl_bridge.plant.clocks.realtime import Realtime  # noqa: E402
from sitl_bridge.plant.faults.impairments import FaultyPath  # noqa: E402
from sitl_bridge.plant.faults.schedule import Faults, SensorFault  # noqa: E402
from sitl_bridge.plant.log.notices import Notices  # noqa: E402
from sitl_bridge.plant.simulation import Simulation  # noqa: E402
from sitl_bridge.vehicle.files import load_vehicle, validated  # noqa: E402

RATE = 250.0
AT, END = 5.0, 20.0
TICK_OF_CLOCK = 1e-7  # s, so that rounding never leaves a datagram just ahead
START = ["initial.start=hover", "initial.load_position=[0.0, 0.0, 20.0]", "air.turbulence.wind_at_6_m=15.4"]

TRACKER = ["sensors.tracker.rate=20", "sensors.tracker.delay=0.05", "sensors.tracker.angle_noise=0.01"]
"""What a vehicle has besides where the tracker fails."""


def sensor_flights() -> dict[str, dict[str, Any]]:
    """A flight for each way in which each sensor can fail."""
    flights = {
        f"{sensor} {failure}": {"sensor": [{"sensor": sensor, "failure": failure, "at": AT}]}
        for sensor in get_args(SensorFault.model_fields["sensor"].annotation)
        for failure in get_args(SensorFault.model_fields["failure"].annotation)
        if failure != "lost" or sensor == "gps"
    }
    lost = {"sensor": "gps", "failure": "lost", "at": AT, "duration": 5.0}
    return {**flights, "gps lost for 5 s": {"sensor": [lost]}}


FLIGHTS = {
    "none": {},
    **sensor_flights(),
    "rotor 1 at 90 % thrust": {"rotor": [{"rotor": 1, "thrust": 0.9, "at": AT}]},
    "rotor 1 at 70 % thrust": {"rotor": [{"rotor": 1, "thrust": 0.7, "at": AT}]},
    "rotor 1 off for 0.1 s": {"rotor": [{"rotor": 1, "thrust": 0.0, "at": AT, "duration": 0.1}]},
    "rotor 1 off": {"rotor": [{"rotor": 1, "thrust": 0.0, "at": AT}]},
    "cable snaps": {"cable": [{"at": AT}]},
    "load twice as heavy": {"load": [{"mass": 0.6, "at": AT}]},
    "gust of 8 m/s, 2 s": {"gust": [{"start": AT, "duration": 2.0, "peak": [8.0, 0.0, 0.0]}]},
    "link: 20 % dropped": {"link": [{"failure": "drop", "share": 0.2, "at": AT}]},
    "link: 10 ms late each way": {"link": [{"failure": "delay", "delay": 0.01, "at": AT}]},
    "link: 20 ms late each way": {"link": [{"failure": "delay", "delay": 0.02, "at": AT}]},
    "link: 40 ms late each way": {"link": [{"failure": "delay", "delay": 0.04, "at": AT}]},
    "link: jitter up to 10 ms": {"link": [{"failure": "jitter", "delay": 0.01, "at": AT}]},
    "link: all doubled": {"link": [{"failure": "duplicate", "delay": 0.003, "at": AT}]},
    "link: 20 % reordered": {"link": [{"failure": "reorder", "share": 0.2, "delay": 0.006, "at": AT}]},
    "link: stall of 0.1 s": {"link": [{"failure": "stall", "at": AT, "duration": 0.1}]},
    "link: stall of 1 s": {"link": [{"failure": "stall", "at": AT, "duration": 1.0}]},
}
PICTURE = ROOT / "docs" / "images" / "faults.png"
DRAWN = {
    "sensors": ("none", "accelerometer wrong", "gyroscope stuck", "barometer wrong", "gps lost", "gps wrong"),
    "the rest": (
        "rotor 1 at 70 % thrust",
        "rotor 1 off for 0.1 s",
        "cable snaps",
        "gust of 8 m/s, 2 s",
        "link: 40 ms late each way",
        "link: stall of 1 s",
    ),
}


def fly(table: dict[str, list[dict[str, object]]]) -> NDArray[np.float64]:
    """One flight with these faults: rows of time and state (n, 20), a tick each, to its end or the ground."""
    faults = validated(Faults, table, "table")
    tracked = any(fault.sensor == "tracker" for fault in faults.sensor)
    vehicle = load_vehicle("iris", [*START, *TRACKER] if tracked else START)
    simulation = Simulation(vehicle, RATE, seed=0, duration_s=END, faults=faults)
    clock = Realtime(simulation, Notices(lambda text: None), 0)
    session = new_session(
        lambda controls: Autopilot(vehicle, ON_ESTIMATE, RATE, lambda at: setpoint(at, at), controls),
        0,
        lambda text: None,
        EstimateFeedback(vehicle, RATE),
    )
    paths = [FaultyPath(faults.link, way, 0) for way in ("to_autopilot", "to_plant")]
    clock.start(0.0)
    now, began, rows = 0.0, None, []
    while not clock.finished:
        for datagram in clock.to_send(now):
            paths[0].receive(datagram, now - began if began is not None else -1.0)
        for path, receiver in zip(paths, (session, clock), strict=True):
            for datagram in path.to_send(now - began if began is not None else -1.0):
                receiver.receive(datagram, now)
            for datagram in session.to_send(now):
                paths[1].receive(datagram, now - began if began is not None else -1.0)
        if simulation.started and began is None:
            began = now
        if simulation.started and (not rows or rows[-1][0] != simulation.scenario_time):
            rows.append(np.concatenate([[simulation.scenario_time], simulation.world.state]))
            if simulation.world.state[2] < 0.5:
                break
        arrivals = [path.next_deadline() for path in paths]
        upcoming = min([clock.next_deadline(), *((began or 0.0) + at for at in arrivals if at is not None)])
        now = max(now, upcoming + TICK_OF_CLOCK)
    return np.array(rows)


def tilt(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of the vehicle's z axis from the vertical, deg."""
    x, y = rows[:, 8], rows[:, 9]
    return np.degrees(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))


def main() -> None:
    """Fly, print, draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("words", nargs="*", help="fly only faults whose name has one of these words")
    parser.add_argument(
        "--picture", type=Path, help=f"PNG to draw; of all flights by default {PICTURE.relative_to(ROOT)}"
    )
    arguments = parser.parse_args()
    wanted = [name for name in FLIGHTS if not arguments.words or any(w in name for w in arguments.words)]
    if not wanted:
        parser.error(f"no fault has one of these words in its name: {' '.join(arguments.words)}")
    picture = arguments.picture or (None if arguments.words else PICTURE)
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained", sharey=True)
    print("| fault at 5 s | vehicle strays by, m | largest tilt, deg | 15 s later, m | outcome |")
    print("|---|---|---|---|---|")
    for name in wanted:
        rows = fly(FLIGHTS[name])
        after = rows[rows[:, 0] >= AT]
        away = np.linalg.norm(after[:, 1:4] - rows[0, 1:4], axis=1)
        down = rows[-1, 3] < 0.5
        outcome = f"on the ground at {rows[-1, 0]:.1f} s" if down else "flies on"
        last = "-" if down else f"{away[-1]:.2f}"
        print(f"| {name} | {away.max():.2f} | {tilt(after).max():.0f} | {last} | {outcome} |", flush=True)
        for axes, names in zip(panels, DRAWN.values(), strict=True):
            if name in names:
                (line,) = axes.plot(after[:, 0], away, label=name, linewidth=1.2)
                if down:
                    axes.plot(after[-1, 0], away[-1], "x", color=line.get_color())
    for axes, title in zip(panels, DRAWN, strict=True):
        axes.set(xlabel="t / s", xlim=(AT, END), yscale="log", ylim=(0.02, 200), title=title)
        axes.legend(fontsize=8, loc="lower center", ncols=2)
        axes.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("vehicle from where it hovered / m")
    if picture is not None:
        figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main()
