"""Flies the sines, keeps what came of them, and finds the stack's description in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controller.law.state import (
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.over.identify.excitation import PERIOD, PITCH, ROLL, SETTLING, THRUST, excited
from controller.over.identify.fit import LEAST_LAG, Response, Series, fit_response, fit_thrust
from controller.over.law import Setpoint
from controller.over.stack import Kind, Stack
from controller.over.telemetry import Telemetry
from sitl_bridge.frames import quaternion_from_euler, rotate
from sitl_bridge.vehicle.description import Vehicle

LARGEST_MISFIT = 0.3
"""Of a response that passes for a first-order lag."""


class Identified(NamedTuple):
    """What was found."""

    stack: Stack
    responses: dict[str, Response]
    """By name: roll, pitch, thrust (of the latter the gain is in N)."""


class Probe:
    """One measurement, from the moment when the reference begins."""

    def __init__(self, vehicle: Vehicle, kind: Kind) -> None:
        """kind: of the stack, as in `Stack`."""
        self._vehicle, self._kind = vehicle, kind
        self._sent: list[tuple[float, float, float, float]] = []
        self._rates: list[tuple[float, float, float]] = []
        self._thrust: list[tuple[float, float]] = []

    def excited(self, wanted: Setpoint, time_s: float) -> Setpoint:
        """The law's set-point with the sines on top; time_s: since the reference began."""
        return excited(wanted, time_s, self._vehicle.hover_thrust)

    def note(
        self, time_s: float, thrust: float, sent: Setpoint, estimate: Array, telemetry: Telemetry
    ) -> None:
        """Keep a step: the thrust set-point 0 to 1, the rates, and what the stack says."""
        state, imu = telemetry.vehicle, telemetry.last_imu
        if time_s < SETTLING or state is None:
            return
        self._sent.append((time_s, thrust, sent.rates[0], sent.rates[1]))
        self._rates.append((time_s, state.rates[0], state.rates[1]))
        if imu is not None:
            at = time_s + imu.time_s - state.time_s
            if not self._thrust or at > self._thrust[-1][0]:
                force = self._vehicle.airframe.mass * imu.specific_force[2] - self._pull(estimate)
                self._thrust.append((at, force))

    def _pull(self, estimate: Array) -> float:
        """Cable force on the vehicle along its z axis, N."""
        cable = self._vehicle.cable
        away = estimate[LOAD_POSITION] - estimate[VEHICLE_POSITION]
        length = max(1e-6, float(np.linalg.norm(away)))
        unit = away / length
        rate = float(unit @ (estimate[LOAD_VELOCITY] - estimate[VEHICLE_VELOCITY]))
        tension = max(0.0, cable.stiffness * (length - cable.rest_length) + cable.damping * rate)
        roll, pitch, yaw = estimate[EULER_ANGLES].tolist()
        up = rotate(quaternion_from_euler((roll, pitch, yaw)), (0.0, 0.0, 1.0))
        return tension * float(unit @ np.array(up))

    def result(self) -> Identified:
        """Raises ValueError when the flight was too short, or the stack does not follow like a lag."""
        if len(self._sent) < 2 or self._sent[-1][0] - self._sent[0][0] < 2.0 * PERIOD - 0.1:
            raise ValueError(f"expected {SETTLING + 2 * PERIOD:g} s of flight at least")
        sent, rates, thrust = np.array(self._sent), np.array(self._rates), np.array(self._thrust)
        if len(thrust) < 2:
            raise ValueError("the stack sent no HIGHRES_IMU; expected it for the thrust")
        hz = {
            name: np.array(k) / PERIOD for name, k in (("roll", ROLL), ("pitch", PITCH), ("thrust", THRUST))
        }
        series = {
            "roll": (Series(sent[:, 0], sent[:, 2]), Series(rates[:, 0], rates[:, 1])),
            "pitch": (Series(sent[:, 0], sent[:, 3]), Series(rates[:, 0], rates[:, 2])),
        }
        signal, force = Series(sent[:, 0], sent[:, 1]), Series(thrust[:, 0], thrust[:, 1])
        found = {name: fit_response(*series[name], hz[name], known_gain=1.0) for name in series}
        found["thrust"] = fit_response(signal, force, hz["thrust"])
        bad = [f"{name} ({r.misfit:.0%} off)" for name, r in found.items() if r.misfit > LARGEST_MISFIT]
        if bad:
            raise ValueError(f"{', '.join(bad)}: the stack does not follow its set-points like a lag")
        curve = fit_thrust(self._vehicle.hover_thrust, float(np.mean(sent[:, 1])), found["thrust"].gain)
        delay = 0.5 * (found["roll"].delay + found["pitch"].delay)
        # The model has one delay. What the thrust is faster or slower goes into its lag.
        thrust_lag = found["thrust"].lag + found["thrust"].delay - delay
        stack = Stack(
            kind=self._kind,
            rate_lag=round(0.5 * (found["roll"].lag + found["pitch"].lag), 4),
            thrust_lag=round(max(LEAST_LAG, thrust_lag), 4),
            delay=round(delay, 4),
            full_thrust=round(curve.full, 3),
            thrust_curve=round(curve.curve, 3),
        )
        return Identified(stack, found)
