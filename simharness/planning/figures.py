"""Figures by which rigs are compared in a plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any, Self

import numpy as np

from simharness.planning.prediction import Prediction
from simharness.planning.room_keys import TargetKeys


@dataclass(frozen=True)
class Figures:
    """Figures of a rig in the volume.

    Attributes:
        pcp: percentage of correct parts, with its interval (90 % by the fast layer, 95 % by simulation).
        error_mm: mean error of joints, millimetres, with its interval.
        share: share of the places of the volume within the target, percent; NaN where it was not computed.
        worst: least PCP of a place, percent; NaN where it was not computed.
    """

    pcp: tuple[float, float, float]
    error_mm: tuple[float, float, float]
    share: float = math.nan
    worst: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON values; null where unknown."""
        return {
            "pcp": _interval(self.pcp),
            "mpjpe_mm": _interval(self.error_mm),
            "share_within_target": number(self.share),
            "worst_pcp": number(self.worst),
        }

    @classmethod
    def of(cls, prediction: Prediction, target: TargetKeys) -> Self:
        """Return the figures that the fast layer predicts; places where nobody can stand do not count."""
        figures = prediction.summary()
        within = (prediction.pcp >= target.pcp) & (prediction.error_mm <= target.error)
        known = np.isfinite(prediction.pcp)
        pcp, error = figures["pcp"], figures["mpjpe_mm"]
        return cls(
            (float(pcp.value), float(pcp.low), float(pcp.high)),
            (float(error.value), float(error.low), float(error.high)),
            100.0 * float(within[known].mean()),
            float(prediction.pcp[known].min()),
        )

    def to_row(self) -> tuple[Any, ...]:
        """Return the figures as values for the ledger; :meth:`of_row` reads them."""
        return astuple(self)

    @classmethod
    def of_row(cls, row: Sequence[Any]) -> Self:
        """Return the figures of a row of the ledger."""
        pcp, error, share, worst = row
        return cls((pcp[0], pcp[1], pcp[2]), (error[0], error[1], error[2]), share, worst)


def _interval(values: tuple[float, float, float]) -> dict[str, float | None]:
    return {"value": number(values[0]), "low": number(values[1]), "high": number(values[2])}


def number(value: float) -> float | None:
    """Return a value as JSON has it, four decimal places; None for NaN and infinity."""
    return round(float(value), 4) if math.isfinite(value) else None
