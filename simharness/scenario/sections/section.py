"""Base class and value types of all sections of a scenario file."""

from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field

T = TypeVar("T")


def key(default: T, description: str, **bounds: Any) -> T:
    """Return the default and the description of a key of a section, with further arguments of ``pydantic.Field``."""
    field: T = Field(default, description=description, **bounds)
    return field


@dataclass(frozen=True)
class Elements:
    """Names of the elements of a list of fixed length, for messages: ``("x", "y", "z")``."""

    names: tuple[str, ...]


LARGEST_RIG = 200.0
"""Greatest distance in a scene, metres: mvpose takes no larger rig."""

MOST_CAMERAS = 64
"""Greatest number of cameras of a rig."""

# Every number has a lower and an upper bound, from physics or from cost, so that a typing error is found where
# it is. What several keys cost together is bounded in simharness.scenario.checks.
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Factor = Annotated[float, Field(ge=0.0, le=100.0)]
Length = Annotated[float, Field(gt=0.0, le=LARGEST_RIG)]  # metres
Spread = Annotated[float, Field(ge=0.0, le=LARGEST_RIG)]  # metres
Coordinate = Annotated[float, Field(ge=-LARGEST_RIG, le=LARGEST_RIG)]  # metres
Span = Annotated[float, Field(ge=0.0, le=3600.0)]  # seconds
Turn = Annotated[float, Field(ge=0.0, le=180.0)]  # degrees
Logits = Annotated[float, Field(ge=0.0, le=20.0)]  # beyond, scores are 0 or 1
Percent = Annotated[float, Field(ge=0.0, le=100.0)]
Count = Annotated[int, Field(ge=0, le=50)]
Point = Annotated[tuple[Coordinate, Coordinate, Coordinate], Elements(("x", "y", "z"))]


class Section(BaseModel):
    """Frozen section that refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
