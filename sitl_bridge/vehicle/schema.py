"""What every table of a description is made of: values with unit and range."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

Vector = tuple[float, float, float]


def quantity(unit: str, description: str, default: Any = ..., **bounds: Any) -> Any:
    """Declare a field with its unit and allowed range; both appear in messages about a faulty file."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, **bounds)


class Section(BaseModel):
    """A table of the description: unknown keys, other types and values that are not finite are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)
