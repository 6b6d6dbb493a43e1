"""Detections and estimates of a trial as bytes, from which they are restored exactly.

An archive is a NumPy ``.npz`` file of the arrays that :mod:`simharness.trial.arrays` describes.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mvpose import Estimate
from mvpose.files.archives import arrays_of
from simharness.detector.detect import Detected
from simharness.detector.heatmaps import Peaks
from simharness.scenario.sections.scenario import Scenario
from simharness.trial import arrays as plain
from simharness.trial.arrays import Arrays
from simharness.trial.stages.detected_sequence import DetectedSequence


@dataclass(frozen=True)
class TrialArchive:
    """Stored detections and estimates of a trial, so that it need not be simulated again."""

    detected: bytes = b""
    """Archive of detections and truth; empty where they cannot be restored."""
    estimates: dict[str, bytes] = field(default_factory=dict)
    """Archive of the estimates of each variant."""


def pack_detected(detected: DetectedSequence) -> bytes:
    """Pack detections, truth and believed cameras.

    Returns:
        The archive; empty where detections carry the heat maps of a network, which are too large to store.
    """
    frames = detected.frames
    if any(frame.detections.likelihoods is not None for frame in frames):
        return b""
    recording = detected.recording
    arrays = _prefixed("rig", plain.rig_arrays(detected.rig))
    arrays |= _prefixed("detections", plain.detection_arrays(recording.detections))
    arrays |= _prefixed("truth", plain.truth_arrays(detected.time, recording.truth))
    if all(frame.peaks is not None for frame in frames):
        arrays["rivals"] = np.concatenate([frame.peaks.rivals for frame in frames if frame.peaks is not None])
    arrays |= _prefixed("whole", plain.whole_arrays([frame.whole for frame in frames]))
    return _packed(arrays)


def unpack_detected(content: bytes, scenario: Scenario) -> DetectedSequence:
    """Restore detections, truth and believed cameras.

    Args:
        content: from :func:`pack_detected`, not empty.
        scenario: the scenario of the trial, for the parameters of its heat maps.
    """
    arrays = arrays_of(content)
    detection, truth_part = _part("detections", arrays), _part("truth", arrays)
    detections = plain.detections_of(detection)
    truth = plain.truth_of(truth_part, detection["frame"])
    frames = []
    rows = plain.rows_of_frames(detection["frame"], len(detections))
    whole = plain.whole_of(_part("whole", arrays), detections)
    for found, seen, row, frame_whole in zip(detections, truth, rows, whole, strict=True):
        peaks = None
        if "rivals" in arrays:
            rivals, head = arrays["rivals"][row], scenario.detector.heatmaps
            peaks = Peaks(found.boxes, found.keypoints, found.scores, rivals, head)
        frames.append(Detected(found, seen, peaks, frame_whole))
    return DetectedSequence(truth_part["time"], plain.rig_of_arrays(_part("rig", arrays)), tuple(frames))


def pack_estimates(estimates: Sequence[Estimate]) -> bytes:
    """Pack the estimates of one variant with their timings; relaxed permutation matrices are left out."""
    return _packed({**plain.estimate_arrays(estimates), **plain.timing_arrays(estimates)})


def unpack_estimates(content: bytes, detected: DetectedSequence) -> tuple[Estimate, ...]:
    """Restore the estimates of one variant.

    Args:
        content: from :func:`pack_estimates`.
        detected: the detections from which they were made.
    """
    arrays = arrays_of(content)
    counts = [len(frame.detections) for frame in detected.frames]
    frame = np.repeat(np.arange(len(counts)), counts)
    return tuple(plain.estimates_of(arrays, frame, plain.timings_of(arrays)))


def _packed(arrays: Arrays) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _prefixed(name: str, arrays: Arrays) -> Arrays:
    return {f"{name}/{key}": value for key, value in arrays.items()}


def _part(name: str, arrays: Arrays) -> Arrays:
    return {key.removeprefix(f"{name}/"): value for key, value in arrays.items() if key.startswith(f"{name}/")}
