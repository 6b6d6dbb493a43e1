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
from simharness.trial.arrays import (
    Arrays,
    detection_arrays,
    detections_of,
    estimate_arrays,
    estimates_of,
    rig_arrays,
    rig_of_arrays,
    rows_of_frames,
    timing_arrays,
    timings_of,
    truth_arrays,
    truth_of,
    whole_arrays,
    whole_of,
)
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
    arrays = _prefixed("rig", rig_arrays(detected.rig))
    arrays |= _prefixed("detections", detection_arrays(recording.detections))
    arrays |= _prefixed("truth", truth_arrays(detected.time, recording.truth))
    if all(frame.peaks is not None for frame in frames):
        arrays["rivals"] = np.concatenate([frame.peaks.rivals for frame in frames if frame.peaks is not None])
    arrays |= _prefixed("whole", whole_arrays([frame.whole for frame in frames]))
    return _packed(arrays)


def unpack_detected(content: bytes, scenario: Scenario) -> DetectedSequence:
    """Restore detections, truth and believed cameras.

    Args:
        content: from :func:`pack_detected`, not empty.
        scenario: the scenario of the trial, for the parameters of its heat maps.
    """
    arrays = _unpacked(content)
    detection = _part("detections", arrays)
    detections = detections_of(detection)
    truth_part = _part("truth", arrays)
    truth = truth_of(truth_part, detection["frame"])
    frames = []
    rows = rows_of_frames(detection["frame"], len(detections))
    whole = whole_of(_part("whole", arrays), detections)
    for frame_detections, frame_truth, row, frame_whole in zip(detections, truth, rows, whole, strict=True):
        peaks = None
        if "rivals" in arrays:
            rivals = arrays["rivals"][row]
            peaks = Peaks(
                frame_detections.boxes,
                frame_detections.keypoints,
                frame_detections.scores,
                rivals,
                scenario.detector.heatmaps,
            )
        frames.append(Detected(frame_detections, frame_truth, peaks, frame_whole))
    return DetectedSequence(truth_part["time"], rig_of_arrays(_part("rig", arrays)), tuple(frames))


def pack_estimates(estimates: Sequence[Estimate]) -> bytes:
    """Pack the estimates of one variant with their timings; relaxed permutation matrices are left out."""
    return _packed({**estimate_arrays(estimates), **timing_arrays(estimates)})


def unpack_estimates(content: bytes, detected: DetectedSequence) -> tuple[Estimate, ...]:
    """Restore the estimates of one variant.

    Args:
        content: from :func:`pack_estimates`.
        detected: the detections from which they were made.
    """
    arrays = _unpacked(content)
    counts = [len(frame.detections) for frame in detected.frames]
    frame = np.repeat(np.arange(len(counts)), counts)
    return tuple(estimates_of(arrays, frame, timings_of(arrays)))


def _packed(arrays: Arrays) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _unpacked(content: bytes) -> Arrays:
    return arrays_of(content)


def _prefixed(name: str, arrays: Arrays) -> Arrays:
    return {f"{name}/{key}": value for key, value in arrays.items()}


def _part(name: str, arrays: Arrays) -> Arrays:
    return {key.removeprefix(f"{name}/"): value for key, value in arrays.items() if key.startswith(f"{name}/")}
