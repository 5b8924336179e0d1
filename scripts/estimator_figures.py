"""Draw the figures of docs/estimator.md, from flights in one process (its table: `estimator_table.py`).

python scripts/estimator_figures.py --out docs/images
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from controller.design.estimated_weights import estimated_weights
from sitl_bridge.vehicle.files import load_vehicle
from tests.estimator.flights import Flight, Sample, fly


def estimate_figure(flight: Flight, path: Path) -> None:
    """Error of the load relative to the vehicle, with three standard deviations."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(9, 7))
    cov = np.sqrt(np.diag(flight.estimator.error_covariance))[19:22]
    error = flight.estimate - flight.truth
    for axis, (plot, name) in enumerate(zip(axes, "xyz", strict=True)):
        plot.plot(flight.time, 100 * (error[:, 3 + axis] - error[:, axis]), lw=0.6, label="error")
        for sign in (-3, 3):
            plot.axhline(100 * sign * cov[axis], color="C3", lw=0.8, label="3 σ" if sign > 0 else None)
        plot.set_ylabel(f"{name} / cm")
        plot.grid(alpha=0.3)
    axes[0].legend(loc="upper right")
    axes[0].set_title("Load relative to the vehicle, estimated minus true")
    axes[-1].set_xlabel("time / s")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def outage_figure(flight: Flight, begin: float, end: float, path: Path) -> None:
    """Vehicle position and load through a GPS outage."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9, 6))
    error = flight.estimate - flight.truth
    std = flight.std[: len(flight.time) // 10]
    coarse = flight.time[::10][: len(std)]
    for axis, name in enumerate("xyz"):
        axes[0].plot(flight.time, error[:, axis], f"C{axis}", lw=0.8, label=f"{name} error")
        axes[1].plot(flight.time, flight.truth[:, 3 + axis], f"C{axis}", lw=0.8, label=f"load {name}")
    axes[0].fill_between(coarse, -3 * std[:, 0], 3 * std[:, 0], color="0.85", label="3 σ (x)")
    for plot in axes:
        plot.axvspan(begin, end, color="C3", alpha=0.1)
        plot.grid(alpha=0.3)
        plot.legend(loc="upper left", ncols=4)
    axes[0].set_ylabel("vehicle position error / m")
    axes[1].set_ylabel("load from its reference / m")
    axes[1].set_xlabel("time / s")
    axes[0].set_title("No GPS for ten seconds (shaded)")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def innovation_figure(samples: list[Any], path: Path) -> None:
    """Normalised innovations of GPS and accelerometer against the normal distribution."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.5))
    grid = np.linspace(-4, 4, 200)
    for plot, (name, values) in zip(axes, samples, strict=True):
        plot.hist(values, bins=60, range=(-4, 4), density=True, color="C0", alpha=0.6)
        plot.plot(grid, np.exp(-0.5 * grid**2) / np.sqrt(2 * np.pi), "C3")
        inside = np.mean(np.abs(values) < 1.96)
        plot.set_title(f"{name}: {100 * inside:.1f} % within 1.96 σ")
        plot.set_xlabel("innovation / its standard deviation")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def draw(out: Path) -> None:
    """All figures."""
    import matplotlib

    matplotlib.use("Agg")
    out.mkdir(parents=True, exist_ok=True)
    vehicle = load_vehicle("paper", ["disturbance.force_std=5"])
    weights = estimated_weights(vehicle)
    estimate_figure(fly(vehicle, weights, 60.0, 1), out / "estimator_load.png")

    def outage(sample: Sample) -> None:
        if 10.0 <= sample.time < 20.0:
            sample.gps = None

    flight = fly(vehicle, weights, 40.0, 3, on_truth=False, spoil=outage)
    outage_figure(flight, 10.0, 20.0, out / "estimator_outage.png")
    flight = fly(vehicle, weights, 60.0, 2)
    samples = [
        ("GPS position", np.ravel(flight.gps_innovations[100:])),
        ("accelerometer", np.ravel(flight.accelerometer_innovations[350:])),
    ]
    innovation_figure(samples, out / "estimator_innovations.png")


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    draw(parser.parse_args().out)


if __name__ == "__main__":
    main()
