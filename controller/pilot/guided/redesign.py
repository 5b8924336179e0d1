"""What ground control can weigh the gains with, and who designs them meanwhile."""

from __future__ import annotations

from typing import Protocol

from controller.design.catalogue import Emphasis
from controller.law.control_law import Design

WEIGHTS = {
    "LQR_Q_VPOS": "vehicle_position",
    "LQR_Q_LPOS": "load_position",
    "LQR_Q_VVEL": "vehicle_velocity",
    "LQR_Q_LVEL": "load_velocity",
    "LQR_Q_RATE": "body_rates",
    "LQR_Q_ATT": "attitude",
    "LQR_Q_INT": "integral",
    "LQR_R_THRUST": "thrust",
    "LQR_R_MOMENT": "moments",
}
"""Parameters that weigh the designs, and what of `Emphasis` they are."""


class Redesigner(Protocol):
    """Makes designs in the background."""

    def request(self, emphasis: Emphasis, rest_length: float) -> None:
        """Begin to design, for a cable of this length (m); what was under way is given up."""

    def result(self) -> tuple[Design, Design] | str | None:
        """The designs of the last request, once, when they are there; or why there are none."""
