"""Check a vehicle: what follows from its description, and whether the default law flies it."""

from __future__ import annotations

from typing import Any, NamedTuple

from controller.design.feasibility import vehicle_faults
from controller.design.motion.ramp import planned
from sitl.api import fly
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import Hover, Scenario, Setpoint, scenario_vehicle
from sitl.json_values import to_json
from sitl.vehicles.figures import Figures, figures
from sitl_bridge.vehicle.description import Vehicle

SETTLED = "settled"
AFTER_RAMP = 20.0
"""s that a step's flight goes on after the reference has arrived."""


class Step(NamedTuple):
    """A step that was flown in process."""

    length_m: float
    feedback: str
    outcome: str
    cause: str | None
    settling_time_s: float | None
    overshoot_pct: float | None
    largest_tilt_deg: float


class Checked(NamedTuple):
    """The result of a check."""

    vehicle: Vehicle
    figures: Figures
    refusals: list[str]
    """Why no law flies it; empty: there is no reason."""
    step: Step | None
    """None: it was refused, and not flown."""

    @property
    def flies(self) -> bool:
        """Whether the default law flies it."""
        return self.step is not None and self.step.outcome == SETTLED

    def as_json(self) -> dict[str, Any]:
        """As one object of plain values."""
        content = {
            "vehicle": self.vehicle.name,
            **self.figures._asdict(),
            "flies": self.flies,
            "refusals": self.refusals,
            "step": None if self.step is None else self.step._asdict(),
        }
        return {key: to_json(value) for key, value in content.items()}


def check(vehicle: Vehicle, rate_hz: float, length: float, feedback: str) -> Checked:
    """Judge a vehicle and fly a step of `length` m to the side with it."""
    refusals = vehicle_faults(vehicle)
    step = None if refusals else fly_step(vehicle, length, feedback, rate_hz)
    return Checked(vehicle, figures(vehicle, rate_hz), refusals, step)


def fly_step(vehicle: Vehicle, length: float, feedback: str = "truth", rate_hz: float = 250.0) -> Step:
    """Fly a step of so many metres to the east, in process, under the default law.

    A vehicle that is described on the ground starts in hover.
    """
    import numpy as np

    hover = Scenario(vehicle=vehicle.name, reference=Hover(kind="hover"))
    east, north, up = scenario_vehicle(hover, vehicle, []).initial_load_position
    scenario = Scenario(
        description=f"{length:g} m to the east",
        vehicle=vehicle.name,
        reference=Setpoint(kind="setpoint", position=(east + length, north, up)),
    )
    flown = scenario_vehicle(scenario, vehicle, [])
    check_feasible(scenario, flown, "default")
    path = scenario.reference.path(flown.initial_load_position)  # type: ignore[union-attr]
    ramp = float(planned(path, flown)["ramp_time"][0])
    flight = fly(scenario, vehicle=vehicle, feedback=feedback, rate_hz=rate_hz, duration_s=ramp + AFTER_RAMP)
    up_axis = 1.0 - 2.0 * (flight.states["attitude_qx"] ** 2 + flight.states["attitude_qy"] ** 2)
    summary = flight.summary
    return Step(
        length,
        feedback,
        summary["outcome"],
        summary["outcome_cause"],
        summary["settling_time_2pct_s"],
        summary["overshoot_pct"],
        float(np.degrees(np.arccos(np.clip(up_axis.min(), -1.0, 1.0)))),
    )


def table(checked: Checked) -> str:
    """The result for a person."""
    f = checked.figures
    rows = [
        ("thrust-to-weight", f"{f.thrust_to_weight:.2f}, with the load"),
        (
            "thrust in hover",
            f"{f.hover_thrust_N:.4g} N, {100.0 * f.hover_thrust_share:.0f} % of what there is",
        ),
        ("control in hover", f"{f.hover_control:.2f}, of the busiest rotor's largest speed"),
        ("static stretch", f"{f.static_stretch_m:.3g} m, {f.static_stretch_pct:.2g} % of the cable"),
        ("bounce", f"{f.bounce_frequency_Hz:.3g} Hz, damping ratio {f.bounce_damping:.2g}"),
        ("pendulum", f"{f.pendulum_frequency_Hz:.3g} Hz, damping ratio {f.pendulum_damping:.2g}"),
        (
            "integration",
            f"steps of {1e3 * f.integration_step_s:.3g} ms, {f.integration_steps} a tick",
        ),
        ("delay margin", f"{1e3 * f.delay_margin_s:.0f} ms{' or more' if f.delay_margin_s >= 0.2 else ''}"),
    ]
    lines = [f"{checked.vehicle.name}: {checked.vehicle.description}".rstrip(": ")]
    lines += [f"  {name:<18}{value}" for name, value in rows]
    lines += [f"  {'refused':<18}{reason}" for reason in checked.refusals]
    if (step := checked.step) is not None:
        settled = "" if step.settling_time_s is None else f" in {step.settling_time_s:.1f} s"
        cause = "" if step.cause is None else f": {step.cause}"
        lines.append(
            f"  {f'step of {step.length_m:g} m':<18}{step.outcome}{settled}{cause}, "
            f"tilts {step.largest_tilt_deg:.0f} degrees (on {step.feedback})"
        )
    lines.append(f"  {'the default law':<18}{'flies it' if checked.flies else 'DOES NOT FLY IT'}")
    return "\n".join(lines)
