"""Catalogue of all scores of a trial: key, meaning, unit and direction.

A score is None (null in tables) where it does not apply: the error of pairs without any pair, a share of zero.
"""

from collections.abc import Mapping
from types import MappingProxyType

from simharness.scoring.score_registry import ScoreInfo, registered_scores, shipped_scores

__all__ = ["AP_MM", "HEADLINE", "PCK_MM", "SCORES", "TOLERANCES", "ScoreInfo"]

AP_MM = (25, 50, 75, 100, 125, 150)
"""Thresholds of average precision, mm."""

PCK_MM = (50, 100, 150)
"""Thresholds of PCK, mm."""

SCORES: Mapping[str, ScoreInfo] = MappingProxyType(
    shipped_scores("people")
    | {info.key: info for group in registered_scores() for info in group.infos}
    | shipped_scores("frames")
)
"""Descriptions of all scores by key, in the order of the columns of a study's table of trials."""

HEADLINE = ("pcp", "recall", "precision", "mpjpe_mm", "match_f1", "ghosts")
"""Keys of the headline scores of tables; a gate checks those of :data:`TOLERANCES`."""

TOLERANCES: Mapping[str, float] = MappingProxyType(
    {info.key: info.tolerance for info in SCORES.values() if info.tolerance is not None}
)
"""Scores that a gate compares, in the order of the columns of its baseline, each with its tolerance.

Between processors, means over the shipped suite differ by less than a hundredth of these values, and means over one of
its conditions by less than a third. Scores of people over time (HOTA, IDF1) apply to variants that give identities."""
