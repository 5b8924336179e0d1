"""A drawn number as a change of the vehicle's own: 0.9 times its load, 0.05 s more than its rotors' lag."""

from __future__ import annotations

from typing import Any, Literal

from sitl_bridge.vehicle.files import DescriptionError

Change = Literal["times", "plus"]


def of_own(description: dict[str, Any], key: str, value: float, change: Change) -> dict[str, float]:
    """Complete keys and their new values.

    description: the vehicle as nested tables; key: as for `--set`, `*` for each entry of a list. Raises
    DescriptionError when there is no such number.
    """
    return {
        name: own * value if change == "times" else own + value
        for name, own in _numbers(description, key.split("."), key, "")
    }


def _numbers(node: Any, path: list[str], key: str, name: str) -> list[tuple[str, float]]:
    if not path:
        if isinstance(node, (int, float)) and not isinstance(node, bool):
            return [(name, float(node))]
        raise DescriptionError(key, [f"of_own: {name} is not a number; expected one that the vehicle has"])
    step, rest = path[0], path[1:]
    entries = (
        {str(index): entry for index, entry in enumerate(node)} if isinstance(node, (list, tuple)) else node
    )
    steps = list(entries) if step == "*" and isinstance(entries, dict) else [step]
    if not isinstance(entries, dict) or not steps or any(each not in entries for each in steps):
        raise DescriptionError(key, [f"of_own: the vehicle has no {'.'.join(filter(None, (name, step)))}"])
    return [
        number
        for each in steps
        for number in _numbers(entries[each], rest, key, ".".join(filter(None, (name, each))))
    ]
