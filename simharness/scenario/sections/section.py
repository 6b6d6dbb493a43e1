"""Base class and value types of all sections of a scenario file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


@dataclass(frozen=True)
class Elements:
    """Names of the elements of a list of fixed length, for messages: ``("x", "y", "z")``."""

    names: tuple[str, ...]


Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
Amount = Annotated[float, Field(ge=0.0)]
Count = Annotated[int, Field(ge=0, le=50)]
Point = Annotated[tuple[float, float, float], Elements(("x", "y", "z"))]


class Section(BaseModel):
    """Frozen section that refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
