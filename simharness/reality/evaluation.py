"""Score a method on recorded data by the published protocol, and show the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.box import Box
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mvpose import Estimate
from mvpose.pipeline import Estimator
from mvpose.skeleton import HeadMapping
from simharness.reality.published_scores import ABLATION
from simharness.reality.shelf import Shelf
from simharness.scoring.frame import score_frame
from simharness.scoring.matching import count_violations
from simharness.scoring.pcp import GROUPS
from simharness.scoring.summary import STAGES, VariantScores, summarize

ACTORS = (0, 1, 2)
"""The actors of Shelf whose PCP papers average."""

_PAPER = ABLATION["shelf"]


@dataclass(frozen=True)
class Evaluation:
    """How variants of a method scored on a data set.

    Attributes:
        name: of the data set.
        head: how the head of SHELF14 was made from COCO-17.
        frames: how many frames the method saw.
        annotated: how many of them have truth, and so a score.
        variants: scores by variant.
        violations: by variant, how many detections share a person with another one of their own view.
    """

    name: str
    head: HeadMapping
    frames: int
    annotated: int
    variants: Mapping[str, VariantScores]
    violations: Mapping[str, int]

    def summary(self) -> dict[str, Any]:
        """The JSON-ready summary, in the shape of a run's ``summary.json``.

        Beside the shared keys: ``head``, ``frames_annotated``, and ``same_view_violations`` of every variant.
        """
        summary = summarize(
            self.name,
            self.variants,
            frames=self.frames,
            seeds=0,
            actors=ACTORS,
            head=self.head,
            frames_annotated=self.annotated,
        )
        for name, scores in summary["variants"].items():
            scores["same_view_violations"] = self.violations[name]
        return summary


def evaluate(
    shelf: Shelf,
    estimators: Mapping[str, Estimator],
    *,
    head: HeadMapping = "voxelpose",
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Run methods on frames of a recording and score them.

    Frames in which nobody is annotated are run and timed, but not scored, because people may be in them all the same.
    Each method gets the first frame once more beforehand, so that compilation is not in the timings.

    Args:
        shelf: the recording.
        estimators: methods by name.
        head: the head mapping.
        progress: called after every frame with the number of finished frames and of all.

    Raises:
        ValueError: an unknown head mapping, or no frame.
    """
    if not len(shelf):
        raise ValueError("no frame to evaluate")
    estimates: dict[str, list[Estimate]] = {}
    for number, (name, estimator) in enumerate(estimators.items()):
        estimator.estimate(shelf.rig, shelf.detections[0])
        estimates[name] = []
        for frame, detections in enumerate(shelf.detections, start=1):
            estimates[name].append(estimator.estimate(shelf.rig, detections))
            if progress is not None:
                progress(number * len(shelf) + frame, len(estimators) * len(shelf))
    return score_estimates(shelf, estimates, head=head)


def score_estimates(
    shelf: Shelf, estimates: Mapping[str, Sequence[Estimate]], *, head: HeadMapping = "voxelpose"
) -> Evaluation:
    """Score the estimates of methods on a recording.

    Args:
        shelf: the recording of F frames.
        estimates: estimates by method, F of each.
        head: the head mapping.

    Raises:
        ValueError: an unknown head mapping, or another number of estimates.
    """
    annotated = np.any(np.isfinite(shelf.truth), axis=(1, 2, 3))
    variants: dict[str, VariantScores] = {}
    violations: dict[str, int] = {}
    for name, answers in estimates.items():
        scores, violations[name] = [], 0
        for frame, (detections, estimate) in enumerate(zip(shelf.detections, answers, strict=True)):
            if len(estimate.matching.labels):  # a method without matching has no labels that could be violated
                violations[name] += count_violations(detections.view, estimate.matching.labels)
            if annotated[frame]:
                scores.append(score_frame(shelf.truth[frame], estimate.joints, head=head))
        variants[name] = VariantScores(tuple(scores), tuple(estimate.timings for estimate in answers))
    return Evaluation("shelf", head, len(shelf), int(annotated.sum()), variants, violations)


def print_evaluation(evaluation: Evaluation, console: Console) -> None:
    """Print PCP by actor and part beside the paper's, what PCP does not see, and the time per stage."""
    summaries = evaluation.summary()["variants"]
    headline = Text.assemble(
        ("Shelf", "bold"),
        f"  {evaluation.frames} frames, {evaluation.annotated} of them annotated; head mapping ",
        (evaluation.head, "bold"),
    )
    tables = [_pcp_table(name, scores) for name, scores in evaluation.variants.items()]
    notes = Text(
        "PCP: part correct within 0.5 of its length; average of actors 1 to 3; blind to ghosts. "
        "Paper: Dong et al. 2019, with its own detections and the 2019 head.\n"
        "One-to-one: pairs under 500 mm. Shelf does not annotate everyone in every frame: "
        "an estimate of someone without annotation counts as a ghost. "
        "Same view: detections that share a person with another of their own view.",
        style="dim",
    )
    blocks: list[RenderableType] = [
        headline,
        *tables,
        *([_comparison(evaluation)] if len(tables) > 1 else []),
        _people_table(summaries),
        _time_table(summaries),
        notes,
    ]
    console.print(Group(*(Padding(block, (0, 0, 1, 0)) for block in blocks)))


def _pcp_table(name: str, scores: VariantScores) -> Table:
    table = _table(f"PCP, {name}", "actor")
    for group in GROUPS:
        table.add_column(group.replace("_", " "), justify="right")
    table.add_column("all", justify="right", style="bold")
    published = _PAPER.get(name)
    if published:
        table.add_column("paper", justify="right", style="cyan")
    rows = scores.pcp_table(actors=ACTORS)
    summary = scores.summary(actors=ACTORS)
    rows.append({**summary["pcp_parts"], "all": summary["pcp"]})
    labels = [*(str(actor + 1) for actor in ACTORS), "average"]
    for index, (label, row) in enumerate(zip(labels, rows, strict=True)):
        last = index == len(rows) - 1
        cells = [_number(value, 1) for value in row.values()]
        cells += [_number(published[index], 1)] if published else []
        table.add_row(label, *cells, style="bold" if last else "", end_section=index == len(rows) - 2)
    return table


def _comparison(evaluation: Evaluation) -> Table:
    """Everybody's PCP in one table, a variant a row, with the paper's row under those that it has."""
    table = _table("PCP of the variants", "variant")
    for actor in ACTORS:
        table.add_column(f"actor {actor + 1}", justify="right")
    table.add_column("average", justify="right", style="bold")
    for name, scores in evaluation.summary()["variants"].items():
        table.add_row(name, *(_number(value, 1) for value in (*scores["pcp_actors"], scores["pcp"])))
        if name in _PAPER:
            table.add_row("  paper", *(_number(value, 1) for value in _PAPER[name]), style="cyan not bold")
    return table


def _people_table(summaries: Mapping[str, Any]) -> Table:
    table = _table("People, one-to-one: %, people a frame, and MPJPE in mm", "variant")
    columns = ("precision", "recall", "ghosts", "missed", "mean", "median", "same view")
    for column in columns:
        table.add_column(column, justify="right")
    for name, scores in summaries.items():
        table.add_row(
            name,
            _number(scores["precision"], 1, scale=100),
            _number(scores["recall"], 1, scale=100),
            _number(scores["ghosts_per_frame"], 2),
            _number(scores["missed_per_frame"], 2),
            _number(scores["mpjpe_mm"]["mean"], 1),
            _number(scores["mpjpe_mm"]["median"], 1),
            str(scores["same_view_violations"]),
        )
    return table


def _time_table(summaries: Mapping[str, Any]) -> Table:
    table = _table("Time per frame, ms: median (99th percentile)", "variant")
    for stage in STAGES:
        table.add_column(stage, justify="right", style="bold" if stage == "total" else "")
    for name, scores in summaries.items():
        times = (scores["timings_ms"][stage] for stage in STAGES)
        table.add_row(name, *(f"{_number(time['median'], 2)} ({_number(time['p99'], 2)})" for time in times))
    return table


_RULES = Box("    \n    \n ── \n    \n ── \n ── \n    \n    \n")  # a rule under the head and between sections


def _table(title: str, first: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", box=_RULES, show_edge=False, pad_edge=False)
    table.add_column(first, min_width=8, no_wrap=True)
    return table


def _number(value: float | None, digits: int, *, scale: float = 1.0) -> str:
    return "–" if value is None else f"{scale * value:.{digits}f}"
