"""Result folder of a run: its files, written and read.

A result folder holds, for T frames, V cameras, P people, J joints and n detections in all frames together:

`scenario.toml`
    the complete scenario with defaults and overrides; the files that it names are relative to the folder in which the
    run was started.
`rig.npz`
    the calibration: ``names`` (V,), ``K`` (V, 3, 3), ``R`` (V, 3, 3), ``t`` (V, 3) metres,
    ``distortion`` (V, 5), ``size`` (V, 2) width and height.
`detections.npz`
    input of the method beside the rig: ``frames`` () is T; ``frame`` (n,) ascending; ``view`` (n,),
    ``keypoints`` (n, J, 2) px, ``scores`` (n, J), ``boxes`` (n, 4), ``box_scores`` (n,), ``skeleton`` () its
    name, and ``descriptors`` (n, D) if detections have them.
`truth.npz`
    ground truth, which only the scorer reads: ``time`` (T,) s, ``joints`` (T, P, J, 3) m, ``pixels`` (T, V, P, J, 2),
    ``visibility`` (T, V, P, J), ``boxes`` (T, V, P, 4); and for each detection, in the order of
    `detections.npz`, ``person`` (n,) and ``error`` (n, J).
`estimates.npz`
    ``variants`` are their names; for each, over k estimated people of all frames, ``NAME/frame`` (k,) ascending,
    ``NAME/joints`` (k, J, 3) m, ``NAME/scores`` (k, J), ``NAME/covariance`` (k, J, 3, 3) m² and ``NAME/freedom`` (k, J)
    where the variant has them; ``NAME/labels`` (n,) of the detections; and of the matching of each frame
    ``NAME/iterations`` (T,), ``NAME/residuals`` (T, 2), ``NAME/objective`` (T,), ``NAME/converged`` (T,). The relaxed
    P is not stored.
`whole_body.npz`
    only where the detector reports feet or hands (``detector.skeleton``): ``skeleton`` (), the name of a skeleton with
    J joints; ``keypoints`` (n, J, 2) px and ``scores`` (n, J) of the detections in the order of `detections.npz`;
    ``joints`` (T, P, J, 3) m, the true ones, NaN where the body model has none; and for each variant, for its k
    estimated people in the order of `estimates.npz`, ``NAME/joints`` (k, J, 3) m, ``NAME/scores`` (k, J) and
    ``NAME/covariance`` (k, J, 3, 3) m² where the variant has it.
`scores.parquet`
    a row for each frame and variant: :mod:`simharness.scoring.score_summary`.
`timings.parquet`
    ``variant``, ``frame``, ``stage``, ``seconds``: a separate file, because all files above are the same bytes in two
    runs.
`film.mp4`, `mosaic.png`, `report.html`
    pictures of all cameras, a typical frame with all people drawn into it, and the report.
`summary.json`
    the headline scores, the duration of each stage of the run, the command.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.files.archives import arrays_of
from mvpose.files.input_files import read_bytes, read_json_object
from mvpose.files.message_text import one_line
from simharness.runtime.parquet_tables import table_of
from simharness.scenario.load import load
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps
from simharness.trial import arrays as plain
from simharness.trial.arrays import Arrays
from simharness.types.truth import Truth

_WHAT = "a file of a run"


@dataclass(frozen=True)
class Record:
    """Complete run: input, truth, estimates and scores."""

    scenario: Scenario
    """The resolved scenario."""
    rig: Rig
    """The believed cameras."""
    time: NDArray[np.float64]
    """Time of each frame, (T,), seconds."""
    detections: tuple[Detections, ...]
    """Detections of each frame, T."""
    truth: tuple[Truth, ...]
    """Truth of each frame, T."""
    estimates: Mapping[str, tuple[Estimate, ...]]
    """Estimates of each variant for each frame, T."""
    scores: pl.DataFrame
    """a row for each frame and variant."""
    summary: Mapping[str, Any]
    """The headline scores."""
    whole_body: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """Arrays of people with feet and hands, as in `whole_body.npz`; empty where there are none."""

    def __post_init__(self) -> None:
        counts = {len(self.time), len(self.detections), len(self.truth), *map(len, self.estimates.values())}
        if len(counts) != 1:
            raise ValueError(
                f"time, detections, truth and estimates must have an entry for each frame, got {sorted(counts)}"
            )


def write_run(record: Record, folder: Path) -> None:
    """Write the files of a run into an existing folder."""
    (folder / "scenario.toml").write_text(dumps(record.scenario), encoding="utf-8")
    tables = {
        "rig": plain.rig_arrays(record.rig),
        "detections": plain.detection_arrays(record.detections),
        "truth": plain.truth_arrays(record.time, record.truth),
        "estimates": _estimate_arrays(record.estimates),
    }
    for name, arrays in tables.items():
        np.savez(folder / f"{name}.npz", allow_pickle=False, **arrays)
    if record.whole_body:
        np.savez(folder / "whole_body.npz", allow_pickle=False, **record.whole_body)
    record.scores.write_parquet(folder / "scores.parquet")
    timings_table(record.estimates).write_parquet(folder / "timings.parquet")
    text = json.dumps(record.summary, indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")


def read_run(folder: Path | str) -> Record:
    """Read a result folder.

    Raises:
        ValueError: the folder is not a result folder, or a file of it is missing or damaged.
    """
    folder = Path(folder)
    names = ("scenario.toml", "rig.npz", "detections.npz", "truth.npz", "estimates.npz", "scores.parquet")
    missing = [name for name in (*names, "timings.parquet", "summary.json") if not (folder / name).is_file()]
    if missing:
        raise ValueError(f"{folder}: not the result folder of a run: missing {', '.join(missing)}")
    scenario = load(folder / "scenario.toml", folder=Path())
    summary = read_json_object(folder / "summary.json", what="the summary of a run")
    contents = {name: read_bytes(folder / name, what=_WHAT) for name in (*names[1:], "timings.parquet")}
    whole = folder / "whole_body.npz"
    try:
        rig, detected, true, estimated = (arrays_of(contents[name]) for name in names[1:5])
        scores, timings = table_of(contents["scores.parquet"]), table_of(contents["timings.parquet"])
        return Record(
            scenario=scenario,
            rig=plain.rig_of_arrays(rig),
            time=true["time"],
            detections=plain.detections_of(detected),
            truth=plain.truth_of(true, detected["frame"]),
            estimates=_estimates(estimated, detected["frame"], timings),
            scores=scores,
            summary=summary,
            whole_body=arrays_of(read_bytes(whole, what=_WHAT)) if whole.is_file() else {},
        )
    except Exception as error:  # arrays and columns that are missing, or of another shape or type
        why = one_line(f"{type(error).__name__}: {error}", 200)
        raise ValueError(f"{folder}: a file of this run is damaged ({why}); run it again") from None


def is_run(folder: Path) -> bool:
    """Return whether a folder is the result folder of a run."""
    return (folder / "estimates.npz").is_file() and (folder / "summary.json").is_file()


def timings_table(estimates: Mapping[str, Sequence[Estimate]]) -> pl.DataFrame:
    """Return the timings of all stages: columns variant, frame, stage, seconds."""
    rows = [
        (variant, frame, stage, seconds)
        for variant, frames in estimates.items()
        for frame, estimate in enumerate(frames)
        for stage, seconds in estimate.timings.items()
    ]
    schema = {"variant": pl.String, "frame": pl.Int64, "stage": pl.String, "seconds": pl.Float64}
    return pl.DataFrame(rows, schema=schema, orient="row")


def _estimate_arrays(estimates: Mapping[str, Sequence[Estimate]]) -> Arrays:
    arrays: Arrays = {"variants": np.array(list(estimates))}
    for variant, each in estimates.items():
        found = plain.estimate_arrays(each)
        arrays |= {f"{variant}/{key}": value for key, value in found.items() if key != "label_counts"}
    return arrays


def _estimates(arrays: Arrays, detected: NDArray[np.int64], timings: pl.DataFrame) -> dict[str, tuple[Estimate, ...]]:
    estimates = {}
    for variant in map(str, arrays["variants"]):
        fields = {key.removeprefix(f"{variant}/"): arrays[key] for key in arrays if key.startswith(f"{variant}/")}
        seconds = _seconds_by_frame(timings.filter(pl.col("variant") == variant))
        estimates[variant] = tuple(plain.estimates_of(fields, detected, seconds))
    return estimates


def _seconds_by_frame(timings: pl.DataFrame) -> list[dict[str, float]]:
    """Return seconds by stage of one variant, for each frame."""
    stages: dict[int, dict[str, float]] = {}
    for frame, stage, seconds in timings.select("frame", "stage", "seconds").iter_rows():
        stages.setdefault(frame, {})[stage] = seconds
    return [stages.get(frame, {}) for frame in range(max(stages, default=-1) + 1)]
