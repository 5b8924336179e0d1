"""Matrix exponentials of motions, remembered.

scipy is imported where it is called: a flight whose exponentials are kept (`kept`) does without.
"""

from __future__ import annotations

import numpy as np

from controller.design.remembered import remembered
from controller.law.state import Array


@remembered(16)
def exponential(matrix: Array) -> Array:
    """e to the power of a matrix (n, n)."""
    from scipy import linalg

    return np.asarray(linalg.expm(matrix))
