"""What the companion has to know of a flight stack: how fast it follows, what its thrust means, its modes.

The defaults are those measured on PX4 SITL. `sitl identify` measures a stack and writes a file like this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, validated
from sitl_bridge.vehicle.rotors import full_thrust as all_rotors
from sitl_bridge.vehicle.schema import Section, quantity
from sitl_bridge.vehicle.toml_files import toml_content, toml_text, what_is_wrong

Kind = Literal["px4", "ardupilot"]


class Stack(Section):
    """A flight stack as the companion's model has it."""

    kind: Kind = quantity("-", "whose modes and conventions it has", "px4")
    rate_lag: float = quantity(
        "s", "first-order lag of the body rates behind their set-points", 0.06, gt=0, le=1
    )
    thrust_lag: float = quantity("s", "first-order lag of the thrust behind its set-point", 0.01, gt=0, le=1)
    delay: float = quantity("s", "dead time of link and loop, before the lags", 0.03, ge=0, le=0.5)
    full_thrust: float | None = quantity(
        "N", "at a set-point of 1; None: all rotors at full speed", None, gt=0
    )
    thrust_curve: float | None = quantity(
        "-",
        "f of force = full·s², set-point = f·s² + (1 - f)·s: 1 is linear in force, 0 in rotor speed; None: "
        "the stack's own parameter",
        None,
        ge=0,
        le=1,
    )
    attitude_gain: float | None = quantity(
        "1/s",
        "roll and pitch rate per error of the angle; None: the stack's own parameter",
        None,
        gt=0,
        le=30,
    )
    yaw_gain: float | None = quantity(
        "1/s", "yaw rate per error of the heading; None: the stack's own parameter", None, gt=0, le=30
    )


class AttitudeGains(NamedTuple):
    """Of a stack's attitude loop, 1/s: the rate that it asks for per error of the angle."""

    tilt: float
    yaw: float


def full_thrust(vehicle: Vehicle, stack: Stack) -> float:
    """N at a thrust set-point of 1."""
    if stack.full_thrust is not None:
        return stack.full_thrust
    return all_rotors(vehicle.rotors)


def thrust_setpoint(force: float, full: float, curve: float) -> float:
    """Thrust set-point, 0 to 1, that gives `force` (N); `full` (N) and `curve` as in `Stack`."""
    signal = math.sqrt(min(1.0, max(0.0, force / full)))
    return curve * signal * signal + (1.0 - curve) * signal


def read_stack(file: Path) -> Stack:
    """A stack from a TOML file; raises DescriptionError with a line for each fault."""
    try:
        content = toml_content(toml_text(file))
    except OSError as error:
        raise DescriptionError(
            str(file), [f"{error.strerror}; expected a file that `sitl identify` wrote"]
        ) from None
    except ValueError as error:
        raise DescriptionError(str(file), [what_is_wrong(error)]) from None
    return validated(Stack, content, str(file))


def stack_text(stack: Stack, remarks: Sequence[str]) -> str:
    """The file that `read_stack` reads; remarks: lines for a person, on top."""
    lines = [f"# {remark}" for remark in remarks]
    for name, field in Stack.model_fields.items():
        value = getattr(stack, name)
        if value is None:
            continue
        extra = field.json_schema_extra
        unit = extra["unit"] if isinstance(extra, dict) else "-"
        text = f'"{value}"' if isinstance(value, str) else repr(value)
        lines.append(f"{name} = {text}".ljust(24) + ("" if unit == "-" else f"# {unit}"))
    return "\n".join(line.rstrip() for line in lines) + "\n"
