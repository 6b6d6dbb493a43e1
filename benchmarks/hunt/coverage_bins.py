"""Coverage: in which circumstances the people of trials, or of a recording, were seen, and how well they were found.

The circumstances are those of a hunt's findings, the people in the room and the cameras, each in bins. Faults that take
several circumstances show in few of them together: t-wise coverage (Kuhn, Wallace & Gallo, "Software fault interactions
and implications for software testing", IEEE TSE 30(6), 2004) says which combinations of t bins no trial has had.
"""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from mvpose import Detections, Estimate, Rig
from mvpose.commands.progress import Reporter
from mvpose.files.input_files import parse_json, read_bytes
from simharness.hunt.hunted_trial import CIRCUMSTANCES, sightings
from simharness.scenario.load import Study
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import Part
from simharness.study.study_folder import plan
from simharness.study.study_run import run_planned
from simharness.study.trial_store import Store
from simharness.trial.archive import unpack_detected, unpack_estimates
from simharness.types.truth import Truth
from simharness.types.views import Visibility

Bin = tuple[str, int]
"""Circumstance, and the number of a bin of it."""

_TEXTS = {
    "views": ("2 or fewer", "3", "4", "5 or more"),
    "distance": ("under 0.6 m", "to 1.2 m", "beyond"),
    "overlap": ("under 0.1", "to 0.4", "more"),
    "hidden": ("under 10 %", "to 40 %", "more"),
    "people": ("1", "2 or 3", "4 to 6", "7 or more"),
    "cameras": ("3 or fewer", "4 or 5", "6 or more"),
}
_ALONE: Bin = ("people", 0)
_IMPOSSIBLE: frozenset[frozenset[Bin]] = frozenset(
    {frozenset({("cameras", 0), ("views", views)}) for views in (2, 3)}
    | {frozenset({_ALONE, (name, near)}) for name, bins in (("distance", (0, 1)), ("overlap", (1, 2))) for near in bins}
)
_FLESH = 0.1  # metres; how far a body reaches beyond its joints: the crown, hands, soles and the trunk
SCHEMA = {**dict.fromkeys(CIRCUMSTANCES, pl.Int64), "trial": pl.String, "right": pl.Int64, "parts": pl.Int64}
"""Columns of a table of people in frames: bins of circumstances, the trial, and how many of their parts are right."""


def bin_text(each: Bin) -> str:
    """Return a bin in words."""
    return f"{each[0]} {_TEXTS[each[0]][each[1]]}"


def bins() -> list[Bin]:
    """Return all bins of all circumstances, in their order."""
    return [(name, k) for name, borders in CIRCUMSTANCES.items() for k in range(len(borders) + 1)]


def study_sightings(study: Study, store: Path, *, workers: int, reporter: Reporter) -> pl.DataFrame:
    """Return the people of all frames of the trials of a study, by bins, with the parts of them that are right.

    Args:
        study: the study; its first variant is scored.
        store: folder of finished trials, which are not run again.
        workers: processes that share the trials.
        reporter: receiver of progress.

    Raises:
        ValueError: trials that cannot be run, or whose detections cannot be stored.
    """
    planned, opened, tables = plan(study), Store(store), []
    run_planned(planned, opened, workers=workers, reporter=reporter)
    for each in {trial.trial: trial for trial in planned}.values():
        entry, content = opened.read(each.entries[study.variants[0]]), opened.read_detections(each.trial)
        if entry is None or not content:
            continue  # a trial that could not be run, or whose pictures a network has read
        detected = unpack_detected(content, each.scenario)
        truth, estimates = detected.recording.truth, unpack_estimates(entry.estimates, detected)
        states = score_frames([true.joints for true in truth], [found.joints for found in estimates]).parts
        for true, parts in zip(truth, states, strict=True):
            right, counted = (parts == Part.CORRECT).sum(axis=1), (parts != Part.UNDEFINED).sum(axis=1)
            tables.append(_table(true, each.trial, right, counted))
    if not tables:
        raise ValueError(f"{study.name}: no trial could be run and stored; see simharness run {study.name}")
    return pl.concat(tables)


def hunt_sightings(file: Path) -> pl.DataFrame:
    """Return the people of all frames of the trials of a hunt; they have no scores.

    Raises:
        ValueError: no trials of a hunt, or of one that did not store its circumstances.
    """
    rows = [parse_json(line) for line in read_bytes(file, what="trials").decode().splitlines()[1:]]
    found = [(*each, f"{file} {row['trial']}", 0, 0) for row in rows for each in row.get("sightings", ())]
    if not found:
        raise ValueError(f"{file}: has no circumstances of people; hunt again with this version")
    return pl.DataFrame(found, schema=SCHEMA, orient="row")


def recording_sightings(rig: Rig, detections: Sequence[Detections], estimates: Sequence[Estimate]) -> pl.DataFrame:
    """Return the estimated people of all frames of a recording, without its truth.

    Distances, overlaps and borders of pictures follow from the estimates. A joint counts as visible where the person's
    detection has it, so detectors that guess hidden joints make people look less hidden, and in more views.
    """
    tables = [
        _table(_as_truth(rig, found, answer), str(frame), 0, 0)
        for frame, (found, answer) in enumerate(zip(detections, estimates, strict=True))
    ]
    return pl.concat([pl.DataFrame(schema=SCHEMA), *tables])


def _table(truth: Truth, trial: str, right: np.ndarray | int, parts: np.ndarray | int) -> pl.DataFrame:
    people, shape = np.flatnonzero(truth.present), len(truth.present)
    scores = [np.broadcast_to(each, shape)[people].tolist() for each in (right, parts)]
    rows = [(*each, trial, *score) for each, *score in zip(sightings(truth), *scores, strict=True)]
    return pl.DataFrame(rows, schema=SCHEMA, orient="row")


def _as_truth(rig: Rig, detections: Detections, estimate: Estimate) -> Truth:
    """Return what an estimate and its detections say of the people in the pictures, as if it were the truth."""
    known = np.isfinite(estimate.joints).all(axis=-1, keepdims=True)
    total, count = np.where(known, estimate.joints, 0.0).sum(axis=1), np.maximum(known.sum(axis=1), 1)
    joints = np.where(known, estimate.joints, (total / count)[:, None])
    around = joints[:, :, None] + _FLESH * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    places = np.stack([camera.project(around) for camera in rig])  # (V, P, 17, 7, 2)
    pictured = np.stack([camera.inside(each) for camera, each in zip(rig, places, strict=True)])
    pixels, inside = places[..., 0, :], pictured[..., 0]
    low = np.where(pictured[..., None], places, np.inf).min(axis=(2, 3))
    size = np.where(pictured[..., None], places, -np.inf).max(axis=(2, 3)) - low
    boxes = np.where(np.isfinite(low[..., :1]), np.concatenate([low, size], axis=-1), 0.0)
    reported, labels = np.zeros(inside.shape, bool), estimate.matching.labels
    of = labels >= 0
    reported[detections.view[of], labels[of]] = detections.detected[of]
    hidden = np.where(reported, np.int8(Visibility.VISIBLE), np.int8(Visibility.OCCLUDED_BY_CLUTTER))
    visibility = np.where(inside, hidden, np.int8(Visibility.OUTSIDE))
    errors = np.zeros(detections.detected.shape, np.int8)
    return Truth(joints, pixels, visibility, boxes, labels, errors)


def coverage(tested: pl.DataFrame, strength: int) -> dict[tuple[Bin, ...], tuple[int, int, float]]:
    """Return for all possible combinations of bins the trials and people that had them, and PCP there.

    Args:
        tested: people of trials by bins.
        strength: number of bins of a combination, of different circumstances.

    Returns:
        Numbers of trials and of people in frames, and PCP, NaN where nothing was scored; zeros where it is untested.
    """
    found = {each: (0, 0, np.nan) for each in _combinations(strength)}
    for names in itertools.combinations(CIRCUMSTANCES, strength):
        sums = tested.group_by(names).agg(
            pl.col("trial").n_unique(), pl.len(), 100.0 * pl.col("right").sum() / pl.col("parts").sum()
        )
        for *places, trials, people, pcp in sums.iter_rows():
            found[tuple(zip(names, places, strict=True))] = trials, people, pcp
    return found


def found_alike(tested: pl.DataFrame, recording: pl.DataFrame) -> tuple[float, float]:
    """Return the share of a recording's people in whose bins of all circumstances trials were, and PCP in these bins.

    PCP is the mean of those of the bins, each with the number of people of the recording in it; NaN without any.
    """
    names = list(CIRCUMSTANCES)
    cells = tested.group_by(names).agg((100.0 * pl.col("right").sum() / pl.col("parts").sum()).alias("pcp"))
    alike = recording.join(cells, on=names)["pcp"].to_numpy()
    known = alike[np.isfinite(alike)]
    return len(alike) / max(len(recording), 1), float(known.mean()) if len(known) else np.nan


def _combinations(strength: int) -> Iterator[tuple[Bin, ...]]:
    for each in itertools.combinations(bins(), strength):
        if len({name for name, _ in each}) == strength and not any(pair <= set(each) for pair in _IMPOSSIBLE):
            yield each
