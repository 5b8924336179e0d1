"""Two processes, the law flying on what the sensors say, over a link that loses datagrams."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

Fly = Callable[..., dict[str, Any]]
ON_ESTIMATE = (
    *("--feedback", "estimate", "--set", "sensors.preset=consumer"),
    *("--set", "disturbance.force_std=5"),
)


def sha256(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def test_the_same_seed_gives_the_same_logs_whatever_is_lost(fly: Fly) -> None:
    short = ("--duration", "6", "--no-report")  # too short to have settled
    once, again = (fly("setpoint", *ON_ESTIMATE, *short, *more, expect=1) for more in ((), ("--drop", "10")))
    assert again["resent_ticks"] > 100
    assert once["state_log_sha256"] == again["state_log_sha256"]
    for log in ("estimate_log", "covariance_log"):
        assert sha256(once["estimate"][log]) == sha256(again["estimate"][log])
