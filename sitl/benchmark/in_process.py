"""Flights in one process, and many of them on Dask's workers."""

from __future__ import annotations

import time
from importlib.util import find_spec
from typing import Any

from sitl.api import fly

FLIGHT_S = 30.0
SWEPT = 32
"""Flights of the small sweep"""
SWEPT_S = 20.0
WORKERS = (1, 2)


def in_process_figures(rate_hz: float) -> dict[str, float]:
    """The tick and the real-time factor in one process, on truth and on estimates, without logs."""
    figures: dict[str, float] = {}
    for suffix, feedback, preset in (("", "truth", "ideal"), ("_estimate", "estimate", "consumer")):
        overrides = [f"sensors.preset={preset}"]
        flight = fly("setpoint", overrides=overrides, feedback=feedback, duration_s=FLIGHT_S, rate_hz=rate_hz)
        factor = float(flight.summary["real_time_factor"])
        figures[f"in_process_tick_us{suffix}"] = 1e6 / (factor * rate_hz)
        figures[f"in_process_real_time_factor{suffix}"] = factor
    return figures


def sweep_figures() -> dict[str, float]:
    """Flights a minute of a small sweep on one worker and on two; nothing without the extra [study]."""
    if find_spec("distributed") is None:
        return {}
    figures = {f"sweep_flights_per_min_{count}": _flights_per_minute(count) for count in WORKERS}
    one, two = figures.values()
    return {**figures, "sweep_two_workers_ratio": two / one}


def _flights_per_minute(workers: int) -> float:
    """Of `setpoint` with loads of different mass, once each worker has flown its first."""
    from sitl.studies.sweep.cluster import as_they_come, cluster
    from sitl.studies.sweep.draws import draws
    from sitl.studies.sweep.run import batches_of, fly_batch, lost_row
    from sitl.studies.sweep.study import Study, Vary

    varied = Vary(key="load.mass", low=1.0, high=20.0, steps=SWEPT)
    study = Study(name="benchmark", scenario="setpoint", duration=SWEPT_S, vary=(varied,))
    plain: dict[str, Any] = study.model_dump(mode="json")
    batches = batches_of(draws(study))
    with cluster(workers, needed_by="sitl bench") as client:
        client.run(fly_batch, batches[0][:1], plain, "")
        began = time.perf_counter()
        for _ in as_they_come(client, fly_batch, batches, plain, "", lost=lost_row):
            pass
        taken = time.perf_counter() - began
    return 60.0 * sum(map(len, batches)) / taken
