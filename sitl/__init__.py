"""What a person runs: the `sitl` command, scenarios, reports; and `sitl.fly`, a flight from Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sitl.api import Flight, fly

__all__ = ["Flight", "fly"]


def __getattr__(name: str) -> Any:
    """The Python interface, imported when it is first used: the command line starts without it."""
    if name in __all__:
        from sitl import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
