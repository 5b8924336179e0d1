"""The matrices that the paper prints, appendices F1 and F2 (eqs. 40 to 51 as they should read)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from controller.law.state import Array

STATES = [
    "x_v",
    "y_v",
    "z_v",
    "x_p",
    "y_p",
    "z_p",
    "ẋ_v",
    "ẏ_v",
    "ż_v",
    "ẋ_p",
    "ẏ_p",
    "ż_p",
    "p",
    "q",
    "r",
    "φ",
    "θ",
    "ψ",
]


PRINTED_LENGTH = 2.0
"""l of the point that Appendix F is printed for, m."""


def printed_matrices() -> tuple[Array, Array]:
    """A and B as Appendix F1 prints them."""
    a, b = np.zeros((18, 18)), np.zeros((18, 4))
    for i in range(6):
        a[i, 6 + i] = 1.0
    for axis, stiffness, damping in ((0, 5.0, 0.0), (1, 5.0, 0.0), (2, 10.0, 1.0)):
        for row, own, other in ((6 + axis, axis, 3 + axis), (9 + axis, 3 + axis, axis)):
            a[row, own], a[row, other] = -stiffness, stiffness
            a[row, own + 6], a[row, other + 6] = -damping, damping
    a[6, 16], a[7, 15] = 981 / 50, -981 / 50
    a[15, 12] = a[16, 13] = a[17, 14] = 1.0
    b[8, 0] = 1 / 10
    b[12, 1] = b[13, 2] = b[14, 3] = 100.0
    return a, b


LINMOD_A = """
 0  0   0  0  0   0  1 0  0 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 1  0 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  1 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 1 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 1  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  1 0 0 0       0      0 0
-5  0   0  5  0   0  0 0  0 0 0  0 0 0 0       0 981/50 0
 0 -5   0  0  5   0  0 0  0 0 0  0 0 0 0 -981/50      0 0
 0  0 -10  0  0  10  0 0 -1 0 0  1 0 0 0       0      0 0
 5  0   0 -5  0   0  0 0  0 0 0  0 0 0 0       0      0 0
 0  5   0  0 -5   0  0 0  0 0 0  0 0 0 0       0      0 0
 0  0  10  0  0 -10  0 0  1 0 0 -1 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 0 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 1 0 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 0 1 0       0      0 0
 0  0   0  0  0   0  0 0  0 0 0  0 0 0 1       0      0
"""
"""A as Appendix F2 prints it, "result from linmod", copied row by row: the last row ends in our text after
17 entries, and so does the appendix: of its B there is nothing."""


def linmod_matrix() -> tuple[Array, NDArray[np.bool_]]:
    """A as Appendix F2 prints it, and which of its entries are in our text."""
    a, there = np.zeros((18, 18)), np.zeros((18, 18), dtype=bool)
    for i, line in enumerate(LINMOD_A.strip().splitlines()):
        entries = [float(Fraction(word)) for word in line.split()]
        a[i, : len(entries)], there[i, : len(entries)] = entries, True
    return a, there
