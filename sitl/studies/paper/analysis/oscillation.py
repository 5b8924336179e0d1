"""The bounce that is left at the start of a step, in flight and in the linear model."""

from __future__ import annotations

import numpy as np

from controller.law.state import Array
from sitl.studies.paper.flights import Flight

OSCILLATION = (
    "largest_deviation_m",
    "frequency_hz",
    "bounce_frequency_hz",
    "damping_ratio",
    "bounce_damping_ratio",
)


def bounce_in_flight(flight: Flight, until: float) -> tuple[Array, Array, Array]:
    """Time (s), the cable's length less that in hover (m), and what drives it (m/s²), up to a time (s).

    Gravity acts on both ends alike. What is left beside the cable's own force is the thrust's part along the
    cable, less what it has in hover, and the centrifugal acceleration of the swing.
    """
    vehicle = flight.vehicle_description
    rows = flight.time <= until
    time, across = flight.time[rows], (flight.vehicle - flight.load)[rows]
    length = np.linalg.norm(across, axis=1)
    w, x, y, z = flight.attitude[rows].T
    up = np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x**2 + y**2)], axis=1)
    thrust = vehicle.rotors[0].thrust_coefficient * np.sum(flight.rotors[rows] ** 2, axis=1)
    along = thrust * np.sum(up * across, axis=1) / length
    rates = np.gradient(across, time, axis=0)
    swing = np.sum(rates**2, axis=1) - np.gradient(length, time) ** 2
    drive = (along - vehicle.hover_thrust) / vehicle.airframe.mass + swing / length
    return time, length - vehicle.hover_length, drive


def rotor_share(flight: Flight) -> float:
    """Largest rotor speed in a flight over the largest there is."""
    return float(flight.rotors.max() / flight.vehicle_description.rotors[0].max_speed)
