"""The initial oscillation: starts that are not at rest, and when load and cable are quiet."""

from __future__ import annotations

import math

import numpy as np

from controller.design.margins import closed_loop_matrix
from controller.design.model import actuated_model
from controller.law.control_law import Design
from controller.law.state import LOAD_POSITION, LOAD_VELOCITY, VEHICLE_POSITION, VEHICLE_VELOCITY, Array
from sitl.studies.paper.analysis.step import vehicle_with
from sitl.studies.paper.flights import Request
from sitl_bridge.vehicle.description import Vehicle

SWING = 20.0
"""deg"""
STARTS = {"rest_length": "with the cable at rest length", "swing": f"swinging, {SWING:g}° aslant and at rest"}
WATCHED = 16.0
"""s"""
NEAR, UPRIGHT = 0.01, math.radians(1.0)
"""m and rad, within which it is quiet"""
PAPERS_SHARE = 0.5
"""Of the time that the paper's law takes"""
LEAST_DAMPING = 0.42
_OF_ITS_OWN = 1e-6
"""Share of a mode that is not vertical, at most"""
_AT_ONCE = 0.3
"""Of a mode's amplitude, that is left after a tick: what dies away faster is no bounce"""


def overrides(start: str, length: str) -> tuple[str, ...]:
    """What makes the paper's vehicle on a cable (l₀, m) start so."""
    rest = f"cable.rest_length={length}"
    if start == "rest_length":
        return rest, f"initial.vehicle_position=[0, 0, {length}]"
    reach, angle = vehicle_with(length).hover_length, math.radians(SWING)
    return rest, f"initial.vehicle_position=[{reach * math.sin(angle):.4f}, 0, {reach * math.cos(angle):.4f}]"


def request(law: str, length: str, start: str) -> Request:
    """A hover that begins so."""
    return Request("hover", law, WATCHED, overrides(start, length))


def quiet_after(time: Array, vehicle: Array, load: Array, reference: Array) -> float:
    """s, after which the load stays near its reference and the cable upright; inf: never. (n,), (n, 3) m."""
    away = vehicle - load
    aslant = np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])
    loud = (np.linalg.norm(load - reference, axis=1) > NEAR) | (np.abs(aslant) > UPRIGHT)
    if loud[-1]:
        return math.inf
    return float(time[np.flatnonzero(loud)[-1]]) if loud.any() else 0.0


def bounce_damping(vehicle: Vehicle, record: Design) -> float:
    """Damping ratio of the sampled loop's least damped vertical oscillation."""
    model = actuated_model(vehicle)
    values, vectors = np.linalg.eig(closed_loop_matrix(model, record))
    moving = (VEHICLE_POSITION, LOAD_POSITION, VEHICLE_VELOCITY, LOAD_VELOCITY)
    upright = np.sum([np.abs(vectors[part][2]) for part in moving], axis=0)
    level = np.sum([np.abs(vectors[part][:2]).sum(axis=0) for part in moving], axis=0)
    bounces = (level < _OF_ITS_OWN * upright) & (np.abs(values) > _AT_ONCE) & (values.imag > 0.0)
    poles = np.log(values[bounces])
    return float(np.min(-poles.real / np.abs(poles)))
