"""Random numbers: one stream for each source, from one seed and the source's name.

A stream depends on nothing but seed and name, so adding a source, or drawing more from one, changes no other.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """The generator of the source `name`, as `accelerometer.white`, for this seed."""
    digest = hashlib.sha256(name.encode()).digest()
    key = tuple(int.from_bytes(digest[place : place + 4], "little") for place in range(0, 16, 4))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
