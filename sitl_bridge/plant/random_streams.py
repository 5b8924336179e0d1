"""Random numbers: one stream for each source, from one seed and the source's name.

A stream depends on nothing but seed and name, so adding a source, or drawing more from one, changes no other.
"""

from __future__ import annotations

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """The generator of one source of randomness, as `accelerometer.white`."""
    return np.random.default_rng([seed, *name.encode()])
