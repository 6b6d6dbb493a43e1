"""Time and quality of the three matching methods on hard frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from benchmarks.method.measure import interleaved
from benchmarks.method.report import caption, figure, table
from benchmarks.method.scenes import HARD, Case, frames, matching, prepare
from mvpose.estimate import Matching
from mvpose.matching import Method, objective

METHODS: tuple[Method, ...] = ("admm", "clustering", "hungarian")
FRAMES = {(5, 4): 40, (10, 6): 20, (10, 10): 12, (15, 20): 6}  # by views and people


@dataclass(frozen=True)
class Row:
    """Result of one matching method on the frames of one size.

    Attributes:
        views: number of cameras.
        people: number of people.
        frames: number of frames.
        method: matching method, or "truth".
        objective: mean of :func:`mvpose.matching.objective`; less is better, 0 means that no person was found.
        share: objective over the best that any method reached on the frame, at most 1; mean over frames.
        worst_share: least value of that ratio over frames.
        precision: precision of pairs of detections matched to one person, over all frames.
        recall: recall of the same pairs.
        f1: harmonic mean of precision and recall.
        time_ms: median time; None for the truth.
        iterations: median number of iterations; None for a method without iterations.
        most_iterations: greatest number of iterations on a frame.
        converged: fraction of the frames on which the residuals fell below the tolerance.
    """

    views: int
    people: int
    frames: int
    method: str
    objective: float
    share: float
    worst_share: float
    precision: float
    recall: float
    f1: float
    time_ms: float | None = None
    iterations: float | None = None
    most_iterations: float | None = None
    converged: float | None = None


def measure(*, quick: bool = False) -> list[Row]:
    """Match the frames of every size by every method."""
    sizes = {(5, 4): 2, (10, 6): 1} if quick else FRAMES
    return [row for (views, people), count in sizes.items() for row in _rows(views, people, count)]


def _rows(views: int, people: int, count: int) -> list[Row]:
    cases = prepare(frames(views, people, count, conditions=HARD))
    with threadpool_limits(1):
        samples = interleaved({method: matching(method, _note) for method in METHODS}, cases, calls=count)
    notes = {method: sample.notes for method, sample in samples.items()}
    truth = [_note(case, _truth(case)) for case in cases]
    notes["truth"] = {key: np.array([note[key] for note in truth]) for key in truth[0]}
    best = np.min([notes[method]["objective"] for method in METHODS], axis=0)
    rows = []
    for name, note in notes.items():
        share = np.where(best < 0, note["objective"] / np.where(best < 0, best, 1.0), 1.0)
        right, claimed, true = (note[key].sum() for key in ("right", "claimed", "true"))
        rows.append(
            Row(
                views,
                people,
                count,
                name,
                objective=float(note["objective"].mean()),
                share=float(share.mean()),
                worst_share=float(share.min()),
                precision=ratio(right, claimed),
                recall=ratio(right, true),
                f1=ratio(2 * right, claimed + true),
                time_ms=samples[name].quantile(0.5) if name in samples else None,
                **_solver(note) if name == "admm" else {},
            )
        )
    return rows


def _note(case: Case, result: Matching) -> Mapping[str, float]:
    right, claimed, true = pairs(result.labels, case.scene.person)
    return {
        "objective": result.objective,
        "right": right,
        "claimed": claimed,
        "true": true,
        "iterations": result.iterations,
        "converged": result.converged,
    }


def _truth(case: Case) -> Matching:
    return Matching(case.scene.person, objective=objective(case.scene.person, case.affinity))


def _solver(note: Mapping[str, np.ndarray]) -> dict[str, float]:
    return {
        "iterations": float(np.median(note["iterations"])),
        "most_iterations": float(note["iterations"].max()),
        "converged": float(note["converged"].mean()),
    }


def pairs(labels: ArrayLike, person: ArrayLike) -> tuple[int, int, int]:
    """Count pairs of detections matched to one person: correct pairs, matched pairs, and true pairs.

    Args:
        labels: estimated person of each detection, -1 for none, (m,).
        person: true person of each detection, -1 for a phantom, (m,).
    """
    claimed, true = (_same_person(np.asarray(assigned)) for assigned in (labels, person))
    return int((claimed & true).sum()), int(claimed.sum()), int(true.sum())


def _same_person(assigned: np.ndarray) -> np.ndarray:
    return np.triu((assigned[:, None] == assigned) & (assigned >= 0), k=1)


def ratio(part: float, whole: float) -> float:
    """Return ``part / whole``, or 1 if ``whole`` is 0."""
    return float(part / whole) if whole else 1.0


def table_of(rows: list[Row]) -> str:
    """Format the rows as text."""
    head = ["frames", "matching", "objective", "of best", "worst", "prec.", "recall", "F1", "ms", "iterations"]
    text = [head]
    for row in rows:
        iterations = "" if row.iterations is None else f"{row.iterations:.0f}, ≤ {row.most_iterations:.0f}"
        text.append(
            [
                f"{row.frames} of {row.views}×{row.people}" if row.method == METHODS[0] else "",
                row.method,
                f"{row.objective:.2f}",
                f"{row.share:.4f}",
                f"{row.worst_share:.4f}",
                f"{row.precision:.3f}",
                f"{row.recall:.3f}",
                f"{row.f1:.3f}",
                "" if row.time_ms is None else figure(row.time_ms),
                iterations,
            ]
        )
    solved = 100 * min(row.converged for row in rows if row.converged is not None)
    return table(text, "<<>>>>>>>>", rules=range(0, len(text) - 1, len(METHODS) + 1)) + caption(
        "12 px noise, 30 % of people and 10 % of joints missed, a phantom in every view. Objective: mean of "
        "<alpha E - A, P> over pairs, less is better; of best: ratio to the best of the three methods, mean and worst "
        "frame. Precision, recall and F1 are over pairs of detections. Truth: objective of the true matching; where a "
        "method has a better objective, the error is in the affinity and not in the method. Iterations: median and "
        f"greatest number; ADMM converged on {solved:.0f} % of the frames of the worst size."
    )
