"""Scores of people in files on an exported sequence, or on every sequence of a benchmark, by its exact truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.files.archives import arrays_of
from mvpose.files.input_files import read_bytes, read_json_object
from mvpose.formats.joint_names import KNOWN, to_skeleton
from mvpose.formats.people import read_people
from mvpose.skeleton import COCO17
from simharness.reality.evaluation import estimate_of
from simharness.scoring.assessment import Scores, assess
from simharness.trial import arrays
from simharness.types.recording import Recording
from simharness.world.motion.mocap.recorded_people import TRUNK, body_lengths

_PARTS = ("rig/", "detections/", "truth/")


@dataclass(frozen=True)
class Submission:
    """Scores of a submission by sequence."""

    scores: Mapping[str, Scores]
    """By name of the sequence, scores by the keys of :mod:`simharness.scoring.catalogue`."""
    splits: Mapping[str, str]
    """By name of the sequence, its split; empty for a sequence alone."""

    def of(self, split: str, key: str) -> list[float | None]:
        """Return one score of all sequences of a split; of all for an empty name."""
        return [each[key] for name, each in self.scores.items() if not split or self.splits.get(name) == split]


def write_exact(path: Path, recording: Recording, frames: Sequence[int]) -> None:
    """Write what scoring needs of some frames of a recording: the given rig, detections and truth."""
    truth = arrays.truth_arrays(recording.time[list(frames)], [recording.truth[frame] for frame in frames])
    detected = arrays.detection_arrays([recording.detections[frame] for frame in frames])
    parts = zip(_PARTS, (arrays.rig_arrays(recording.rig), detected, truth), strict=True)
    named: dict[str, Any] = {part + key: array for part, each in parts for key, array in each.items()}
    np.savez_compressed(path, allow_pickle=False, **named)


def read_exact(path: Path) -> Recording:
    """Read the recording of :func:`write_exact`.

    Raises:
        ValueError: no such file, or a damaged one.
    """
    named = arrays_of(read_bytes(path, what="the exact truth of an exported sequence"))
    rig, detected, truth = (
        {name.removeprefix(part): array for name, array in named.items() if name.startswith(part)} for part in _PARTS
    )
    try:
        seen = arrays.truth_of(truth, detected["frame"])
        return Recording(truth["time"], arrays.rig_of_arrays(rig), arrays.detections_of(detected), seen)
    except KeyError as error:
        raise ValueError(f"{path}: is no exact truth of an exported sequence: {error} is missing") from None


def score_submission(predictions: Path, benchmark: Path, *, split: str | None = None) -> Submission:
    """Score people in files.

    Args:
        predictions: people of a sequence, or for a benchmark the folder of those of its sequences: a file or folder
            with the name of each sequence. Any format of :mod:`mvpose.formats.people` that is read.
        benchmark: an exported sequence or benchmark.
        split: of a benchmark, the only split that is scored.

    Raises:
        ValueError: no benchmark, predictions that are missing, of other frames, or not in metres.
    """
    described = benchmark / "benchmark.json"
    if not described.is_file():
        return Submission({benchmark.resolve().name: _score(predictions, benchmark / "exact.npz")}, {})
    entries = read_json_object(described, what="the description of a benchmark")["sequences"]
    splits = {each["name"]: each["split"] for each in entries if split in (None, each["split"])}
    if not splits:
        raise ValueError(f"{benchmark}: has no sequence of the split {split}; expected train, val or test")
    found = {name: _file(predictions, name) for name in splits}
    return Submission({name: _score(found[name], benchmark / name / "exact.npz") for name in splits}, splits)


def _file(predictions: Path, name: str) -> Path:
    """Return the file or folder with the people of a sequence."""
    found = [each for each in sorted(predictions.glob(f"{name}*")) if each.name == name or each.stem == name]
    if len(found) != 1:
        raise ValueError(
            f"{predictions}: expected one file or folder {name} or {name}.* with the people of this sequence, "
            f"found {len(found)}"
        )
    return found[0]


def _score(predictions: Path, exact: Path) -> Scores:
    recording = read_exact(exact)
    count, rate = len(recording), 1.0 / np.diff(recording.time).mean() if len(recording) > 1 else 1.0
    people = to_skeleton(read_people(predictions, skeleton=KNOWN["coco17"], rate=rate), COCO17)
    if people.frames != count:
        raise ValueError(f"{predictions}: has {people.frames} frames, expected the {count} of {exact.parent.name}")
    trunks = [body_lengths(people.joints[:, k])["trunk"] for k in range(len(people))]
    if np.isfinite(trunks).any() and not TRUNK[0] <= np.nanmedian(trunks) <= TRUNK[1]:
        raise ValueError(
            f"{predictions}: trunks are {np.nanmedian(trunks):.3g} m long, expected {TRUNK[0]:g} to {TRUNK[1]:g} m: "
            "write joints in metres, in the order of their names"
        )
    return assess(recording, [estimate_of(people, row) for row in range(count)]).scores
