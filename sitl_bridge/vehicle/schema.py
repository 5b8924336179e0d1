"""What every table of a description is made of: values with unit and range."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

Vector = tuple[float, float, float]

_Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
_ArmLength = Annotated[float, Field(ge=-100, le=100)]
_Speed = Annotated[float, Field(ge=-1e3, le=1e3)]
_Angle = Annotated[float, Field(ge=-100, le=100)]
_Rate = Annotated[float, Field(ge=-1e3, le=1e3)]
_Inertia = Annotated[float, Field(gt=0, le=1e5)]

Place = tuple[_Metres, _Metres, _Metres]
"""m, world ENU."""
Arm = tuple[_ArmLength, _ArmLength, _ArmLength]
"""m, from the centre of mass, body FLU."""
Velocity = tuple[_Speed, _Speed, _Speed]
"""m/s."""
Angles = tuple[_Angle, _Angle, _Angle]
"""rad."""
Rates = tuple[_Rate, _Rate, _Rate]
"""rad/s."""
Inertia = tuple[_Inertia, _Inertia, _Inertia]
"""kg m²."""


def quantity(unit: str, description: str, default: Any = ..., **bounds: Any) -> Any:
    """Declare a field with its unit and allowed range; both appear in messages about a faulty file."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, **bounds)


class Section(BaseModel):
    """A table of the description: unknown keys, other types and values that are not finite are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)
