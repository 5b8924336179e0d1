"""What a command is made of: terms that add up to the wrench which the rotors give.

Each term is a wrench: thrust (N) and moments about the body's axes (N m).
"""

from __future__ import annotations

FEEDFORWARD_TERM, PROPORTIONAL, INTEGRAL, DELAY, SATURATED = range(5)
"""Rows of a law's terms (5, 4): u*; -K·(x - x*); -K_i·v; what lagging rotors and commands under way ask for;
and what the limits of lean and rotors take away (or add)."""
TERMS = ("feedforward", "proportional", "integral", "delay", "saturated")
"""Their names."""
COMPONENTS = ("thrust_N", "moment_x_N_m", "moment_y_N_m", "moment_z_N_m")
TERM_COLUMNS = tuple(f"{term}_{component}" for term in TERMS for component in COMPONENTS)
"""Column of each element, row by row."""
