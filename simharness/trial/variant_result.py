"""Result of one variant in one trial. Stores and pages read it without the simulator."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl


@dataclass(frozen=True)
class VariantResult:
    """Scores and tables of one variant of the method in one trial.

    Raises:
        ValueError: a score that is not finite.
    """

    scores: Mapping[str, float | None]
    """By the keys of :data:`simharness.scoring.catalogue.SCORES`; None where a score does not apply."""
    frames: pl.DataFrame
    """a row for each frame."""
    people: pl.DataFrame
    """a row for each frame and true person."""
    failures: pl.DataFrame
    """a row for each failure, with its kind and the stage to blame."""

    def __post_init__(self) -> None:
        if wrong := [key for key, score in self.scores.items() if score is not None and not math.isfinite(score)]:
            raise ValueError(f"a score is a finite number or None, got {wrong[0]} = {self.scores[wrong[0]]}")
