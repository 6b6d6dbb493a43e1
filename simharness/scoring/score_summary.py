"""Summary of the scores of all frames: the content of ``summary.json`` of a run and of ``--json`` of ``evaluate``."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from simharness.scoring.frame_scores import FrameScores
from simharness.scoring.pcp import GROUPS, percent
from simharness.scoring.score_registry import statistic

STAGES = ("affinity", "matching", "reconstruction", "total")


@dataclass(frozen=True)
class VariantScores:
    """Scores of one variant in all frames."""

    frames: FrameScores
    """Scores of the frames."""
    timings: tuple[Mapping[str, float], ...] = ()
    """``Estimate.timings`` of every timed frame, seconds by stage."""
    tracking: Mapping[str, Any] | None = None
    """Scores over time, where people are tracked: :mod:`simharness.scoring.tracking.identity_figures`."""
    scores: Mapping[str, float | None] | None = None
    """Scores of a trial by their keys in :mod:`simharness.scoring.catalogue`."""

    @classmethod
    def pooled(cls, recordings: "Sequence[VariantScores]") -> "VariantScores":
        """Return the scores of a variant in all frames of several recordings.

        Raises:
            ValueError: recordings of different numbers of people, or none.
        """
        timings = tuple(timing for each in recordings for timing in each.timings)
        return cls(FrameScores.joined(each.frames for each in recordings), timings)

    def summary(self, *, actors: Sequence[int] | None = None) -> dict[str, Any]:
        """Return the summary of this variant.

        Args:
            actors: indices of the people whose PCP is averaged; None: all.

        Returns:
            ``pcp`` and ``pcp_parts`` (percent; means over the actors, so that all actors have equal weight in however
            many frames they are present), ``pcp_actors``, ``precision`` and ``recall`` of people, ``ghosts_per_frame``,
            ``missed_per_frame``, ``mpjpe_mm`` over all one-to-one pairs, ``matching`` over all pairs of detections,
            ``timings_ms`` by stage, ``tracking`` where there are scores over time, and ``scores`` of a trial, by key.
            None where a score does not apply; never NaN.
        """
        scored, frames = self.frames, len(self.frames)
        found, people = int(scored.found.sum()), int(scored.present.sum())
        estimates, ghosts = int(scored.estimates.sum()), int(scored.ghosts.sum())
        errors = scored.error.ravel() * 1000.0
        table = self.pcp_table(actors=actors)
        more = {"tracking": self.tracking, "scores": self.scores}
        return {
            "pcp": _mean(row["all"] for row in table),
            "pcp_parts": {group: _mean(row[group] for row in table) for group in GROUPS},
            "pcp_actors": [row["all"] for row in table],
            "precision": found / estimates if estimates else None,
            "recall": found / people if people else None,
            "ghosts_per_frame": ghosts / frames if frames else None,
            "missed_per_frame": (people - found) / frames if frames else None,
            "mpjpe_mm": {"mean": statistic(np.mean, errors), "median": statistic(np.median, errors)},
            "matching": self._matching(),
            "timings_ms": {stage: self._timing(stage) for stage in STAGES},
            **{key: value for key, value in more.items() if value is not None},
        }

    def pcp_table(self, *, actors: Sequence[int] | None = None) -> list[dict[str, float | None]]:
        """Return PCP of every actor by group of parts and of all ten (``"all"``), percent; None where undefined."""
        parts = self.frames.parts
        chosen = range(parts.shape[1]) if actors is None else actors
        return [
            {group: percent(parts[:, actor, list(index)]) for group, index in GROUPS.items()}
            | {"all": percent(parts[:, actor])}
            for actor in chosen
        ]

    def _matching(self) -> dict[str, float | None]:
        total = reduce(add, self.frames.matching) if self.frames.matching else None
        return {key: getattr(total, key, None) for key in ("precision", "recall", "f1")}

    def _timing(self, stage: str) -> dict[str, float | None]:
        times = np.array([1000.0 * timing[stage] for timing in self.timings if stage in timing])
        return {
            "median": statistic(np.median, times),
            "p99": statistic(lambda values: np.percentile(values, 99), times),
        }


def summarize(
    name: str,
    variants: Mapping[str, VariantScores],
    *,
    frames: int,
    seeds: int,
    actors: Sequence[int] | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Return the summary of a whole run, ready for JSON, with the keys that ``run`` and ``evaluate`` share.

    Args:
        name: name of the scenario or data set.
        variants: scores by variant.
        frames: number of frames that the method was given.
        seeds: number of seeds, 0 for recorded data.
        actors: indices of the people whose PCP is averaged; None: all.
        more: further keys beside the shared ones.
    """
    from simharness.runtime.version import code_version  # imported here: scores do not depend on it

    return dict(
        name=name,
        frames=frames,
        seeds=seeds,
        code=code_version(),
        variants={key: scores.summary(actors=actors) for key, scores in variants.items()},
        **more,
    )


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None
