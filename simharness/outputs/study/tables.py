"""Tables of a study: mean scores of the variants with intervals over seeds, and differences between variants.

Also what the page shows of the failures of a study.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from mvpose.report.tables import NOTHING, Cell
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.catalogue import SCORES, ScoreInfo
from simharness.scoring.failure_classes import DISPLACED, FailureKind
from simharness.scoring.score_summary import STAGES
from simharness.statistics.intervals import Interval, mean_interval
from simharness.statistics.many_tests import holm
from simharness.statistics.paired_tests import paired
from simharness.statistics.studentized import unseen_share
from simharness.study.factors import FactorBreakingPoint
from simharness.study.study_folder import Results

COLUMNS: tuple[ScoreInfo, ...] = tuple(
    SCORES[key] for key in ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts", "time_ms")
)
"""Scores of the headline table."""

NOT_BLAMED = "not determined"
"""Stage of a failure whose stage to blame was not determined."""

OVER_TIME = ("hota", "idf1", "switches_per_minute", "jerk_ratio")
"""Scores over time with curves, of studies with a variant that tracks people."""

SIGNIFICANT = 0.05
"""Adjusted p value below which a difference is significant."""

_OF_A_VARIANT = ("variant", "seconds", "scenario")  # columns besides the scores that are not part of the setting
_OTHER = " of the other variant"  # suffix that no column of a study has


def tracks_people(trials: pl.DataFrame) -> bool:
    """Return whether a variant of a study gives identities; tables of earlier versions have no column of them."""
    return "hota" in trials.columns and trials["hota"].is_not_null().any()


def by_seed(rows: pl.DataFrame, score: str) -> dict[int, float]:
    """Return a score by seed, as the mean over the settings; seeds without the score are left out.

    The settings of one seed share their people and are not independent, so intervals are over seeds.
    """
    means = rows.group_by("seed").agg(pl.col(score).mean()).drop_nulls(score).sort("seed")
    return dict(zip(means["seed"].to_list(), means[score].to_list(), strict=True))


def cell(interval: Interval, score: ScoreInfo) -> Cell:
    """Return the cell of a mean, with its interval in small letters."""
    return Cell(*interval.texts(score.digits))


def headline(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, list[Cell]]:
    """Return the headline table: a row for each variant, a cell for each of :data:`COLUMNS`.

    A mean is over the settings where the score applies to that variant, and these may differ between variants. So the
    difference between two variants is the one of :func:`differences`, not the difference of these means.
    """
    rows = {}
    for variant in variants:
        trials_of_variant = trials.filter(pl.col("variant") == variant)
        rows[variant] = [
            cell(mean_interval(list(by_seed(trials_of_variant, info.key).values()), unit=info.unit), info)
            for info in COLUMNS
        ]
    return rows


def all_scores(trials: pl.DataFrame, variants: Sequence[str]) -> list[tuple[ScoreInfo, list[Cell]]]:
    """Return the table of all scores that apply to any variant: a row for each score, a cell for each variant.

    Means are over the settings where the score applies to that variant, as in :func:`headline`.
    """
    rows = []
    for info in SCORES.values():
        if info.key not in trials.columns:  # a table of an earlier version
            continue
        means = [
            mean_interval(list(by_seed(trials.filter(pl.col("variant") == variant), info.key).values()), unit=info.unit)
            for variant in variants
        ]
        if any(mean.n for mean in means):
            rows.append((info, [cell(mean, info) for mean in means]))
    return rows


def condition(seeds: int) -> str:
    """Return a sentence about what intervals over seeds cannot contain."""
    share = fixed(100 * unseen_share(seeds), 0)
    return f"They are of what these scenes show: {seeds} scenes may miss what happens in up to {share} % of all scenes."


def cases(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, dict[str, list[Cell]]]:
    """Return a headline table for each case; empty for a study without cases."""
    names = [name for name in dict.fromkeys(trials["case"]) if name]
    return {name: headline(trials.filter(pl.col("case") == name), variants) for name in names}


def differences(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, list[Cell]]:
    """Return the differences of the other variants from the first, paired by seed, over the settings that both have.

    A cell is strong where the p value, adjusted by Holm's method over all cells, is below :data:`SIGNIFICANT`. Time is
    not tested, because other work on the machine changes it.
    """
    tests: list[tuple[str, ScoreInfo, Any]] = []
    first, *others = variants
    base = trials.filter(pl.col("variant") == first)
    setting = [column for column in trials.columns if column not in (*SCORES, *_OF_A_VARIANT)]  # with the seed
    for variant in others:
        other = trials.filter(pl.col("variant") == variant)
        pairs = base.join(other, on=setting, suffix=_OTHER, nulls_equal=True, maintain_order="left")
        for info in COLUMNS:
            both = pairs.drop_nulls([info.key, f"{info.key}{_OTHER}"])
            before, after = by_seed(both, info.key), by_seed(both, f"{info.key}{_OTHER}")
            tests.append((variant, info, paired(list(before.values()), list(after.values()))))
    tested = [each for each in tests if each[1].key != "time_ms"]
    adjusted = dict(zip([(each[0], each[1].key) for each in tested], holm([each[2].p for each in tested]), strict=True))
    rows: dict[str, list[Cell]] = {variant: [] for variant in others}
    for variant, info, pair in tests:
        if not pair.n:
            rows[variant].append(Cell(NOTHING))
            continue
        small = ""
        if np.isfinite(pair.low):
            small = f"{_signed(pair.low, info)} to {_signed(pair.high, info)}"
        significant = adjusted.get((variant, info.key), 1.0) < SIGNIFICANT
        rows[variant].append(Cell(_signed(pair.difference, info), small, strong=significant))
    return rows


def _signed(value: float, score: ScoreInfo) -> str:
    """Return a difference with its sign; the minus is typographic, and zero has no sign."""
    return signed(value, score.digits).replace("-", "−")


def stage_means(trials: pl.DataFrame) -> dict[str, float]:
    """Return the time of each stage, ms: means over trials of the medians over frames."""
    means = {stage: trials["time_ms" if stage == "total" else f"time_{stage}_ms"].mean() for stage in STAGES}
    return {stage: float(mean) for stage, mean in means.items() if isinstance(mean, int | float)}


def broken(score: str, threshold: float) -> str:
    """Return the condition that counts as broken."""
    info = SCORES[score]
    past = "under" if info.better == "higher" else "over"
    return f"{info.title} {past} {threshold:g}{f' {info.unit}' if info.unit else ''}"


def breaking_cell(breaking: FactorBreakingPoint | None) -> Cell:
    """Return the cell of a breaking point."""
    if breaking is None:
        return Cell(NOTHING)
    low, high = breaking.swept
    point = breaking.point
    side = "above" if breaking.rising else "below"
    small = ""
    if point.low is not None or point.high is not None:
        least = f"{low:.3g} or less" if point.low is None else f"{point.low:.3g}"
        most = f"{high:.3g} or more" if point.high is None else f"{point.high:.3g}"
        small = f"{least} to {most}"
    if point.why == "never":
        return Cell(f"not between {low:.3g} and {high:.3g}", small)
    if point.why == "at once":
        return Cell(f"already at {low if breaking.rising else high:.3g}", small)
    assert point.value is not None  # the score crosses the threshold
    return Cell(f"{side} {point.value:.3g}", small, strong=True)


def failures_per_100_frames(
    failures: pl.DataFrame, frames: Mapping[str, int], variants: Sequence[str], column: str
) -> dict[str, dict[str, float]]:
    """Return the failures per 100 frames of each variant, by a column of the table of failures.

    Args:
        failures: table of failures of the study.
        frames: scored frames of each variant.
        variants: variants in the order of the result.
        column: ``kind`` or ``stage``; null becomes :data:`NOT_BLAMED`.
    """
    rates: dict[str, dict[str, float]] = {}
    for variant in variants:
        classes = failures.filter(pl.col("variant") == variant)[column].fill_null(NOT_BLAMED)
        counts = dict(classes.value_counts().iter_rows())
        rates[variant] = {key: 100 * count / max(1, frames.get(variant, 0)) for key, count in counts.items()}
    return rates


MEANING: Mapping[FailureKind, str] = {
    FailureKind.MISSED: "no estimate within 500 mm",
    FailureKind.GHOST: "an estimate where no person is",
    FailureKind.MERGED: "one estimate of several people's detections",
    FailureKind.SPLIT: "two estimates of one person",
    FailureKind.SWAPPED_LIMB: "a joint where its other side, or another person's, is",
    FailureKind.DISPLACED_JOINT: f"a joint off by more than {1000 * DISPLACED:.0f} mm, or not estimated although seen",
}
"""Meaning of every kind, the worst first: whole people, then mixed people, then joints."""

_JOINTS = (FailureKind.SWAPPED_LIMB, FailureKind.DISPLACED_JOINT)


def failure_rows(results: Results, variants: Sequence[str]) -> dict[str, Any]:
    """Return what the page shows of the failures, for its template; empty without failures."""
    failures = results.failures
    if not len(failures):
        return {}
    frames, people = (dict(table["variant"].value_counts().iter_rows()) for table in (results.frames, results.people))
    kinds = failures_per_100_frames(failures, frames, variants, "kind")
    return {
        "meanings": {kind: text for kind, text in MEANING.items() if any(of.get(str(kind)) for of in kinds.values())},
        "rates": kinds,
        "most": max(rate for of in kinds.values() for rate in (*of.values(), 0.0)) or 1.0,
        "wrong": [_wrong_people(failures, people, variant) for variant in variants],
        "typical": _typical(failures, variants[0]),
    }


def _wrong_people(failures: pl.DataFrame, people: Mapping[str, int], variant: str) -> str:
    """Return the share of all people in all frames who are wrong, with its unit."""
    wrong = len(failures.filter((pl.col("variant") == variant) & (pl.col("kind") != str(FailureKind.GHOST))))
    return f"{100 * wrong / people[variant]:.1f} %" if people.get(variant) else "–"


def _typical(failures: pl.DataFrame, variant: str) -> str:
    """Return how many joints are wrong where only joints are, in a sentence; empty where that never happens."""
    of_joints = failures.filter((pl.col("variant") == variant) & pl.col("kind").is_in([str(kind) for kind in _JOINTS]))
    if not len(of_joints):
        return ""
    share = 100 * len(of_joints) / len(failures.filter(pl.col("variant") == variant))
    count = int(of_joints["joints"].list.len().median() or 0)  # type: ignore[arg-type]
    joints = "1 wrong joint" if count == 1 else f"{count} wrong joints"
    return f"{share:.0f} % of the failures of {variant} are people with {joints} of 17 (median) and all others right"
