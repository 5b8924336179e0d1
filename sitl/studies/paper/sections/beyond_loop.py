"""Delay margins of every law, linear and flown, and what a step costs."""

from __future__ import annotations

from collections.abc import Sequence

from controller.design.catalogue import design
from controller.design.margins import delay_margin
from controller.design.model import actuated_model
from sitl.studies.paper import offline, page
from sitl.studies.paper.analysis.every_law import TICK, borne_in_flight, step_cost
from sitl.studies.paper.analysis.step import LENGTHS, vehicle_with
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import Ledger

LEAST_MARGIN = 0.02
"""s, of the default design and the nonlinear one"""


def table(ledger: Ledger, laws: Sequence[str]) -> str:
    """Delay margins, linear and flown, and the cost of a step, of every law on both cables."""
    rows = []
    for length in LENGTHS:
        vehicle = vehicle_with(length)
        for law in laws:
            name, record = f"beyond.loop.{length}.{law}", design(law, vehicle, offline.RATE_HZ)
            model = actuated_model(vehicle)
            each = [delay_margin(model, record, inputs) for inputs in ((0,), (1,), (2,), (3,))]
            source = "20 ms are promised"
            if law in ("default", "geometric"):
                ledger.at_least(f"{name}.margin_at_each_input_s", min(each), LEAST_MARGIN, "s", source)
            else:
                ledger.put(
                    f"{name}.margin_at_each_input_s",
                    min(each),
                    "s",
                    "for comparison: there is no figure to reach",
                )
            together = delay_margin(model, record)
            late = borne_in_flight(vehicle, record, together)
            ledger.check(f"{name}.margin_s", together, late, TICK, "s", "flown, whole ticks")
            ledger.check(f"{name}.flown_margin_s", late, together, TICK, "s", "linear loop")
            ledger.put(f"{name}.step_s", step_cost(vehicle, record), "s", "of this machine, as busy as it is")
            rows.append(
                (
                    f"{law}, l₀ = {length} m",
                    Cell(f"{name}.margin_at_each_input_s", 1e3),
                    Cell(f"{name}.margin_s", 1e3),
                    Cell(f"{name}.flown_margin_s", 1e3),
                    Cell(f"{name}.step_s", 1e6),
                )
            )
    return page.heading("Delay margins, and what a step costs") + page.table(
        ledger,
        (
            "law",
            "least margin of one input [ms]",
            "margin of all together [ms]",
            "the same by flying, whole ticks [ms]",
            "a step [µs]",
        ),
        rows,
    )
