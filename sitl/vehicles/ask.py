"""Ask a person for a vehicle's figures, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from sitl.vehicles.sketch import Sketch
from sitl_bridge.vehicle.errors import DescriptionError, comment_of
from sitl_bridge.vehicle.files import validated

ASKED = ("name", "mass", "rotors", "arm", "thrust_to_weight", "load_mass", "cable_length", "stretch")
"""What is asked for; the rest has flags."""
ALTERNATIVES = {"thrust_to_weight": ("hover_throttle", "max_thrust"), "stretch": ("stretch_share",)}
"""Flags that answer a question in another way."""


def parsed(key: str, text: str) -> tuple[str, Any]:
    """The key and value of what a person says: a number, a percentage of the cable, or a word."""
    text = text.strip()
    if key == "stretch" and text.endswith("%"):
        key, share = "stretch_share", _number(text[:-1])
        return key, share / 100.0 if isinstance(share, (int, float)) else text
    return key, text if key in ("name", "sensors") else _number(text)


def ask(given: Mapping[str, Any], read: Callable[[str], str], say: Callable[[str], None]) -> dict[str, Any]:
    """Ask for what is not given; an empty answer takes the default. Ends like `read` at the end of input."""
    answers = dict(given)
    for key in ASKED:
        if any(name in answers for name in (key, *ALTERNATIVES.get(key, ()))):
            continue
        question = f"{key.replace('_', ' ')}: {comment_of(Sketch, key)}: "
        while text := read(question).strip():
            name, value = parsed(key, text)
            faults = _faults({"mass": 1.5, **answers, name: value}, name)
            if not faults:
                answers[name] = value
                break
            for fault in faults:
                say(f"  {fault}")
        else:
            if Sketch.model_fields[key].is_required():
                say(f"  {key}: needed")
                return ask(answers, read, say)
    return answers


def _faults(answers: dict[str, Any], name: str) -> list[str]:
    """What is wrong with an answer."""
    try:
        validated(Sketch, answers, "")
    except DescriptionError as error:
        return [fault for fault in error.faults if fault.startswith(name) or "mass" in answers]
    return []


def _number(text: str) -> Any:
    """A number, or the text that is none."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
