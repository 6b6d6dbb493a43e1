"""Score a method on recorded data by the published protocol, and show the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from rich.box import Box
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mvpose import Detections, Estimate, Pipeline, Rig
from mvpose.skeleton import HeadMapping
from simharness.datasets.shelf import Shelf, read_shelf
from simharness.scoring.frame import score_frame
from simharness.scoring.pcp import GROUPS
from simharness.scoring.summary import STAGES, VariantScores, summarize

ACTORS = (0, 1, 2)
"""The actors of Shelf whose PCP papers average."""

PUBLISHED: dict[str, tuple[float, ...]] = {
    "full": (98.8, 94.1, 97.8, 96.9),
    "geometry": (97.2, 79.5, 96.5, 91.1),
    "no-3dps": (97.9, 89.5, 97.8, 95.1),
}
"""PCP of actors 1 to 3 on Shelf and their average, as Dong et al., CVPR 2019, tables 1 and 2, print them."""


class Estimator(Protocol):
    """Anything that the harness can score: :class:`mvpose.Pipeline`, or another method."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """The people of one frame, on COCO17."""
        ...


@dataclass(frozen=True)
class Evaluation:
    """How variants of a method scored on a data set.

    Attributes:
        name: of the data set.
        head: how the head of SHELF14 was made from COCO-17.
        frames: how many frames the method saw.
        annotated: how many of them have truth, and so a score.
        variants: scores by variant.
    """

    name: str
    head: HeadMapping
    frames: int
    annotated: int
    variants: Mapping[str, VariantScores]

    def summary(self) -> dict[str, Any]:
        """The JSON-ready summary, in the shape of a run's ``summary.json``.

        Beside the shared keys: ``head`` and ``frames_annotated``.
        """
        return summarize(
            self.name,
            self.variants,
            frames=self.frames,
            seeds=0,
            actors=ACTORS,
            head=self.head,
            frames_annotated=self.annotated,
        )


def evaluate_shelf(
    folder: str | Path,
    *,
    variants: Sequence[str] = ("full",),
    head: HeadMapping = "voxelpose",
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Run variants of :class:`mvpose.Pipeline` on frames 300 to 599 of Shelf and score them.

    Args:
        folder: the published files, see :mod:`simharness.datasets.shelf`.
        variants: names of pipeline presets.
        head: the head mapping, ``"voxelpose"`` or ``"2019"``.
        progress: called after every frame with how many are done, and of how many.

    Raises:
        ValueError: files that are missing or broken, an unknown preset or head mapping.
    """
    pipelines = {name: Pipeline.preset(name) for name in variants}
    return evaluate(read_shelf(folder), pipelines, head=head, progress=progress)


def evaluate(
    shelf: Shelf,
    estimators: Mapping[str, Estimator],
    *,
    head: HeadMapping = "voxelpose",
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Run any methods on frames of Shelf and score them.

    Frames in which nobody is annotated (people are in them all the same) are run and timed, but not scored.
    Each method sees the first frame once more beforehand, so that compilation is not in the timings.

    Args:
        shelf: the data.
        estimators: methods by name.
        head: the head mapping.
        progress: called after every frame with how many are done, and of how many.

    Raises:
        ValueError: an unknown head mapping, or no frame.
    """
    if not len(shelf):
        raise ValueError("no frame to evaluate")
    annotated = np.any(np.isfinite(shelf.truth), axis=(1, 2, 3))
    variants: dict[str, VariantScores] = {}
    for name, estimator in estimators.items():
        estimator.estimate(shelf.rig, shelf.detections[0])
        scores, timings = [], []
        for frame, detections in enumerate(shelf.detections):
            estimate = estimator.estimate(shelf.rig, detections)
            timings.append(estimate.timings)
            if annotated[frame]:
                scores.append(score_frame(shelf.truth[frame], estimate.joints, head=head))
            if progress is not None:
                progress(len(variants) * len(shelf) + frame + 1, len(estimators) * len(shelf))
        variants[name] = VariantScores(tuple(scores), tuple(timings))
    return Evaluation("shelf", head, len(shelf), int(annotated.sum()), variants)


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
        "an estimate of someone without annotation counts as a ghost.",
        style="dim",
    )
    blocks: list[RenderableType] = [
        headline,
        *tables,
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
    published = PUBLISHED.get(name)
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


def _people_table(summaries: Mapping[str, Any]) -> Table:
    table = _table("People, one-to-one; MPJPE in mm", "variant")
    for column in ("precision %", "recall %", "ghosts / frame", "missed / frame", "MPJPE mean", "median"):
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
