"""What a law returned, taken apart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from controller.law.state import WRENCH_SIZE, Array
from controller.law.terms import SATURATED, TERMS
from controller.own_law.blame import one_line

EXPECTED = "expected (thrust, moments) in N and N m, with three moments, or {rotors} rotor commands in 0..1"


class Commands(NamedTuple):
    """One of both."""

    wrench: Array | None
    """(4,), thrust and moments, N and N m."""
    rotors: Array | None
    """(n,), 0..1."""


def read(answer: Any, rotors: int) -> Commands | str:
    """Wrench or rotor commands of a vehicle with so many rotors; or what is wrong with the answer."""
    expected = EXPECTED.format(rotors=rotors)
    if answer is None:
        return f"returned None; {expected}"
    try:
        if isinstance(answer, (tuple, list)) and len(answer) == 2:
            thrust, moments = (np.asarray(part, dtype=np.float64) for part in answer)
            if thrust.size != 1 or moments.shape != (3,):
                return f"returned shapes {thrust.shape} and {moments.shape}; {expected}"
            wrench = np.array([thrust.item(), *moments])
            if not np.isfinite(wrench).all():
                return f"returned {one_line(wrench.tolist())}, which is not finite; {expected}"
            return Commands(wrench, None)
        commands = np.asarray(answer, dtype=np.float64)
    except (TypeError, ValueError):
        return f"returned {one_line(answer)}; {expected}"
    if commands.shape != (rotors,):
        return f"returned an array of shape {commands.shape}; {expected}"
    if not ((commands >= 0.0) & (commands <= 1.0)).all():
        return f"returned rotor commands {one_line(commands.tolist())}; {expected}"
    return Commands(None, commands)


TERM_NAMES = TERMS[:SATURATED]
"""Terms that a law may tell; what the rotors' limits take away is seen from its wrench."""


def read_terms(told: Any, terms: Array) -> str | None:
    """Put wrenches (4,) by name into terms (5, 4), 0 for what is not told; or what is wrong with them."""
    expected = f"expected wrenches of four numbers by the names {', '.join(TERM_NAMES)}"
    if not isinstance(told, Mapping) or not told.keys() <= set(TERM_NAMES):
        return f"keeps {one_line(told)} in `terms`; {expected}"
    terms[:] = 0.0
    for name, wrench in told.items():
        try:
            row = np.asarray(wrench, dtype=np.float64)
        except (TypeError, ValueError):
            return f"keeps {one_line(wrench)} in `terms`; {expected}"
        if row.shape != (WRENCH_SIZE,):
            return f"keeps an array of shape {row.shape} in `terms`; {expected}"
        terms[TERMS.index(name)] = row
    return None
