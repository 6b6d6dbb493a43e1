"""A run on disk: what its files hold, how they are written and read back.

A result folder holds, for T frames, V cameras, P people, J joints and n detections in all frames together:

`scenario.toml`
    the whole scenario, defaults and overrides written out; files that it names are relative to where the run was
    started.
`rig.npz`
    the calibration: ``names`` (V,), ``K`` (V, 3, 3), ``R`` (V, 3, 3), ``t`` (V, 3) metres,
    ``distortion`` (V, 5), ``size`` (V, 2) width and height.
`detections.npz`
    all that the method sees beside the rig: ``frames`` () is T; ``frame`` (n,) ascending; ``view`` (n,),
    ``keypoints`` (n, J, 2) px, ``scores`` (n, J), ``boxes`` (n, 4), ``box_scores`` (n,), ``skeleton`` () its
    name, and ``descriptors`` (n, D) where there are any.
`truth.npz`
    what only the scorer sees: ``time`` (T,) s, ``joints`` (T, P, J, 3) m, ``pixels`` (T, V, P, J, 2),
    ``visibility`` (T, V, P, J), ``boxes`` (T, V, P, 4); and for each detection, in the order of
    `detections.npz`, ``person`` (n,) and ``error`` (n, J).
`estimates.npz`
    ``variants`` names them; for each, over k estimated people of all frames, ``NAME/frame`` (k,) ascending,
    ``NAME/joints`` (k, J, 3) m, ``NAME/scores`` (k, J), ``NAME/covariance`` (k, J, 3, 3) m² where the variant
    has it; ``NAME/labels`` (n,) of the detections; and of the matching of each frame ``NAME/iterations``
    (T,), ``NAME/residuals`` (T, 2), ``NAME/objective`` (T,), ``NAME/converged`` (T,). The relaxed P is not
    kept.
`scores.parquet`
    a row for each frame and variant: :mod:`simharness.scoring.summary`.
`timings.parquet`
    ``variant``, ``frame``, ``stage``, ``seconds``: apart, for all files above are the same bytes in two runs.
`film.webp`, `mosaic.png`, `report.html`
    for people: what the cameras recorded, a typical frame with everything drawn in, and the page of both.
`summary.json`
    the headline numbers (DESIGN, "Machine-readable output"), the time of each stage of the run, the command.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from mvpose.camera import Camera, Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.skeleton import COCO17, SHELF14
from simharness.scenario.load import load
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_writer import dumps
from simharness.types.truth import Truth

_SKELETONS = {skeleton.name: skeleton for skeleton in (COCO17, SHELF14)}
_OF_DETECTIONS = ("view", "keypoints", "scores", "boxes", "box_scores")
_OF_FRAMES = ("joints", "pixels", "visibility", "boxes")
_OF_ERRORS = ("person", "error")

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Record:
    """A whole run: input, truth, answers and scores.

    Attributes:
        scenario: as resolved.
        rig: the cameras that the method was told of.
        time: of each frame, (T,), seconds.
        detections: what the method saw, one for each frame.
        truth: what it should have found, one for each frame.
        estimates: what each variant answered, one for each frame.
        scores: a row for each frame and variant.
        summary: the headline numbers.
    """

    scenario: Scenario
    rig: Rig
    time: NDArray[np.float64]
    detections: tuple[Detections, ...]
    truth: tuple[Truth, ...]
    estimates: Mapping[str, tuple[Estimate, ...]]
    scores: pl.DataFrame
    summary: Mapping[str, Any]

    def __post_init__(self) -> None:
        counts = {len(self.time), len(self.detections), len(self.truth), *map(len, self.estimates.values())}
        if len(counts) != 1:
            raise ValueError(f"time, detections, truth and estimates must have one entry a frame, got {sorted(counts)}")


def write_run(record: Record, folder: Path) -> None:
    """Write the files of a run into an existing folder."""
    (folder / "scenario.toml").write_text(dumps(record.scenario), encoding="utf-8")
    tables = {
        "rig": _rig_arrays(record.rig),
        "detections": _detection_arrays(record.detections),
        "truth": _truth_arrays(record.time, record.truth),
        "estimates": _estimate_arrays(record.estimates),
    }
    for name, arrays in tables.items():
        np.savez(folder / f"{name}.npz", allow_pickle=False, **arrays)
    record.scores.write_parquet(folder / "scores.parquet")
    timings_table(record.estimates).write_parquet(folder / "timings.parquet")
    text = json.dumps(record.summary, indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")


def read_run(folder: Path | str) -> Record:
    """Read a result folder back.

    Raises:
        ValueError: the folder is not a result folder, or a file of it is missing.
    """
    folder = Path(folder)
    names = ("scenario.toml", "rig.npz", "detections.npz", "truth.npz", "estimates.npz", "scores.parquet")
    missing = [name for name in (*names, "timings.parquet", "summary.json") if not (folder / name).is_file()]
    if missing:
        raise ValueError(f"{folder}: not the folder of a finished run: it has no {', '.join(missing)}")
    rig, detected, true, answered = (dict(np.load(folder / name)) for name in names[1:5])
    detections = _detections(detected)
    return Record(
        scenario=load(folder / "scenario.toml", folder=Path()),
        rig=_rig(rig),
        time=true["time"],
        detections=detections,
        truth=_truth(true, detected["frame"]),
        estimates=_estimates(answered, detected["frame"], pl.read_parquet(folder / "timings.parquet")),
        scores=pl.read_parquet(folder / "scores.parquet"),
        summary=json.loads((folder / "summary.json").read_text(encoding="utf-8")),
    )


def timings_table(estimates: Mapping[str, Sequence[Estimate]]) -> pl.DataFrame:
    """Seconds of every stage: columns variant, frame, stage, seconds."""
    rows = [
        (variant, frame, stage, seconds)
        for variant, answers in estimates.items()
        for frame, estimate in enumerate(answers)
        for stage, seconds in estimate.timings.items()
    ]
    schema = {"variant": pl.String, "frame": pl.Int64, "stage": pl.String, "seconds": pl.Float64}
    return pl.DataFrame(rows, schema=schema, orient="row")


def _rig_arrays(rig: Rig) -> Arrays:
    return {
        "names": np.array([camera.name for camera in rig]),
        **{key: np.stack([getattr(camera, key) for camera in rig]) for key in ("K", "R", "t", "distortion")},
        "size": np.array([camera.size for camera in rig]),
    }


def _rig(arrays: Arrays) -> Rig:
    fields = (arrays[key] for key in ("K", "R", "t", "distortion", "size", "names"))
    cameras = zip(*fields, strict=True)
    return Rig([Camera(K, R, t, d, (int(w), int(h)), str(name)) for K, R, t, d, (w, h), name in cameras])


def _flat(items: Iterable[object], keys: Sequence[str]) -> Arrays:
    """Fields of one object a frame, one after the other; the objects' lengths are kept in ``frame``."""
    items = list(items)
    return {key: np.concatenate([getattr(item, key) for item in items]) for key in keys}


def _frame_index(counts: Iterable[int]) -> NDArray[np.int64]:
    counts = list(counts)
    return np.repeat(np.arange(len(counts)), counts)


def _parts(frame: NDArray[np.int64], frames: int) -> list[slice]:
    """Where each frame's rows are, of rows sorted by frame."""
    ends = np.searchsorted(frame, np.arange(frames + 1))
    return [slice(int(start), int(end)) for start, end in itertools.pairwise(ends)]


def _detection_arrays(detections: Sequence[Detections]) -> Arrays:
    described = all(each.descriptors is not None for each in detections)
    keys = (*_OF_DETECTIONS, "descriptors") if described else _OF_DETECTIONS
    return {
        "frames": np.array(len(detections)),
        "skeleton": np.array(detections[0].skeleton.name),
        "frame": _frame_index(map(len, detections)),
        **_flat(detections, keys),
    }


def _detections(arrays: Arrays) -> tuple[Detections, ...]:
    skeleton = _SKELETONS[str(arrays["skeleton"])]
    return tuple(
        Detections(
            arrays["view"][part],
            arrays["keypoints"][part],
            arrays["scores"][part],
            arrays["boxes"][part],
            arrays["box_scores"][part],
            skeleton,
            arrays["descriptors"][part] if "descriptors" in arrays else None,
        )
        for part in _parts(arrays["frame"], int(arrays["frames"]))
    )


def _truth_arrays(time: NDArray[np.float64], truth: Sequence[Truth]) -> Arrays:
    stacked = {key: np.stack([getattr(each, key) for each in truth]) for key in _OF_FRAMES}
    return {"time": time, **stacked, **_flat(truth, _OF_ERRORS)}


def _truth(arrays: Arrays, frame: NDArray[np.int64]) -> tuple[Truth, ...]:
    return tuple(
        Truth(
            **{key: arrays[key][index] for key in _OF_FRAMES},
            **{key: arrays[key][part] for key in _OF_ERRORS},
        )
        for index, part in enumerate(_parts(frame, len(arrays["time"])))
    )


def _estimate_arrays(estimates: Mapping[str, Sequence[Estimate]]) -> Arrays:
    arrays: Arrays = {"variants": np.array(list(estimates))}
    for variant, answers in estimates.items():
        certain = all(answer.covariance is not None for answer in answers)
        keys = ("joints", "scores", "covariance") if certain else ("joints", "scores")
        matchings = [answer.matching for answer in answers]
        fields = {
            "frame": _frame_index(map(len, answers)),
            **_flat(answers, keys),
            **_flat(matchings, ("labels",)),
            "iterations": np.array([each.iterations for each in matchings]),
            "residuals": np.array([each.residuals for each in matchings], float).reshape(-1, 2),
            "objective": np.array([each.objective for each in matchings], float),
            "converged": np.array([each.converged for each in matchings], bool),
        }
        arrays |= {f"{variant}/{key}": value for key, value in fields.items()}
    return arrays


_OF_MATCHING = ("labels", "iterations", "residuals", "objective", "converged")
_OF_ESTIMATES = ("frame", "joints", "scores", "covariance", *_OF_MATCHING)


def _estimates(arrays: Arrays, detected: NDArray[np.int64], timings: pl.DataFrame) -> dict[str, tuple[Estimate, ...]]:
    estimates = {}
    for variant in map(str, arrays["variants"]):
        fields = {key: arrays.get(f"{variant}/{key}") for key in _OF_ESTIMATES}
        stages = _stages(timings.filter(pl.col("variant") == variant))
        estimates[variant] = tuple(_answers(fields, detected, stages))
    return estimates


def _answers(
    fields: Mapping[str, Any], detected: NDArray[np.int64], stages: list[dict[str, float]]
) -> Iterator[Estimate]:
    frames = len(fields["iterations"])
    parts = zip(_parts(fields["frame"], frames), _parts(detected, frames), strict=True)
    for index, (mine, seen) in enumerate(parts):
        primal, dual = fields["residuals"][index]
        yield Estimate(
            joints=fields["joints"][mine],
            scores=fields["scores"][mine],
            covariance=None if fields["covariance"] is None else fields["covariance"][mine],
            matching=Matching(
                labels=fields["labels"][seen],
                iterations=int(fields["iterations"][index]),
                residuals=(float(primal), float(dual)),
                objective=float(fields["objective"][index]),
                converged=bool(fields["converged"][index]),
            ),
            timings=stages[index] if index < len(stages) else {},
        )


def _stages(timings: pl.DataFrame) -> list[dict[str, float]]:
    """Of one variant: seconds by stage, one for each frame."""
    stages: dict[int, dict[str, float]] = {}
    for frame, stage, seconds in timings.select("frame", "stage", "seconds").iter_rows():
        stages.setdefault(frame, {})[stage] = seconds
    return [stages.get(frame, {}) for frame in range(max(stages, default=-1) + 1)]
