"""`KEY=VALUE` on top of a description: `cable.rest_length=10`."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from typing import Any, NamedTuple

from sitl_bridge.vehicle.errors import DescriptionError

DEEPEST = 16
"""Keys in a row; no description has so many."""


class Override(NamedTuple):
    """One value of a description to change, `KEY=VALUE`, and where a person has said so."""

    text: str
    source: str = "--set"

    @property
    def keys(self) -> tuple[int | str, ...]:
        """What is changed: keys, and indices of lists."""
        parts = self.text.partition("=")[0].strip().split(".")
        return tuple(int(part) if part.isdecimal() and part.isascii() else part for part in parts)


def apply_overrides(content: dict[str, Any], overrides: Iterable[Override]) -> None:
    """Set values of nested tables; raises DescriptionError with a line for each override that is none."""
    errors: list[DescriptionError] = []
    for override in overrides:
        try:
            apply_override(content, override)
        except DescriptionError as error:
            errors.append(error)
    if errors:
        raise DescriptionError.joined(errors)


def apply_override(content: dict[str, Any], override: Override) -> None:
    """Set one value of nested tables from `table.key=VALUE`, VALUE being TOML or a bare word."""
    key, equals, text = override.text.partition("=")
    path, source = key.strip().split("."), override.source
    if not equals or not all(path) or len(path) > DEEPEST:
        raise DescriptionError(source, [f"{override.text!r}: expected KEY=VALUE, as in cable.rest_length=10"])
    try:
        parsed = tomllib.loads(f"value = {text.strip()}")
    except (ValueError, RecursionError):
        parsed = {}
    # A bare word is no TOML; more than one value (on lines of their own) is no value either.
    value: Any = parsed["value"] if parsed.keys() == {"value"} else text.strip()
    target: Any = content
    for step, following in zip(path, [*path[1:], None], strict=True):
        place: Any = step
        if isinstance(target, list):
            if not (step.isdecimal() and step.isascii()) or int(step) >= len(target):
                raise DescriptionError(source, [f"{key}: {step!r} is no index of a list of {len(target)}"])
            place = int(step)
        elif not isinstance(target, dict):
            raise DescriptionError(source, [f"{key}: {step!r} lies below a value that is not a table"])
        if following is None:
            target[place] = value
        else:
            target = target[place] if isinstance(target, list) else target.setdefault(place, {})
