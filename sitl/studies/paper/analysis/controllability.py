"""Controllability in exact arithmetic, eq. 52: its matrix has a condition of some 1e11."""

from __future__ import annotations

import math
from fractions import Fraction

from controller.design.model import linear_model
from sitl_bridge.vehicle.description import Vehicle

Rational = list[list[Fraction]]


def exact_model(vehicle: Vehicle) -> tuple[Rational, Rational]:
    """A and B at the true equilibrium in rational numbers: every parameter as its decimal fraction."""
    model = linear_model(vehicle)
    cable = vehicle.cable
    k, c, rest = (Fraction(str(v)) for v in (cable.stiffness, cable.damping, cable.rest_length))
    m_v, m_p, g = (Fraction(str(v)) for v in (vehicle.airframe.mass, vehicle.load.mass, vehicle.gravity))
    stretch = m_p * g / k
    string = k * stretch / (rest + stretch)
    known = [string / m_v, string / m_p, k / m_v, k / m_p, c / m_v, c / m_p, (m_v + m_p) * g / m_v]
    known += [1 / m_v, Fraction(1), *(1 / Fraction(str(i)) for i in vehicle.airframe.inertia)]

    def exact(value: float) -> Fraction:
        if value == 0.0:
            return Fraction(0)
        nearest = min(known, key=lambda f: abs(float(f) - abs(value)))
        assert math.isclose(float(nearest), abs(value), rel_tol=1e-12)
        return nearest if value > 0 else -nearest

    return [[exact(v) for v in row] for row in model.A.tolist()], [
        [exact(v) for v in row] for row in model.B.tolist()
    ]


def product(a: Rational, b: Rational) -> Rational:
    """a·b in rational numbers."""
    columns = list(zip(*b, strict=True))
    return [
        [sum((x * y for x, y in zip(row, c, strict=True) if x and y), Fraction(0)) for c in columns]
        for row in a
    ]


def rank(matrix: Rational) -> int:
    """Rank by Gaussian elimination in rational numbers: exact."""
    rows, found = [list(row) for row in matrix], 0
    for column in range(len(rows[0])):
        pivot = next((i for i in range(found, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[found], rows[pivot] = rows[pivot], rows[found]
        for i in range(found + 1, len(rows)):
            if rows[i][column]:
                share = rows[i][column] / rows[found][column]
                rows[i] = [x - share * y for x, y in zip(rows[i], rows[found], strict=True)]
        found += 1
    return found
