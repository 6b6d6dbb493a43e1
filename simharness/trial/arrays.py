"""Rigs, detections, truth and estimates of a sequence as plain arrays, for files.

Arrays with a row for each detection or estimate of all T frames have an array ``frame`` beside them: the frame of each
row, ascending.
"""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera, Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.skeleton import COCO17, SHELF14
from mvpose.wholebody import skeleton_by_name
from simharness.types.outer_joints import WholeFrame
from simharness.types.truth import Truth

Arrays = dict[str, NDArray[Any]]

_SKELETONS = {skeleton.name: skeleton for skeleton in (COCO17, SHELF14)}
_OF_DETECTIONS = ("view", "keypoints", "scores", "boxes", "box_scores")
_OF_FRAMES = ("joints", "pixels", "visibility", "boxes")
_OF_ERRORS = ("person", "error")
_OPTIONAL = ("covariance", "freedom", "ids")  # of estimates


def rig_arrays(rig: Rig) -> Arrays:
    """Return the calibration: ``names`` (V,), ``K``, ``R``, ``t`` (metres), ``distortion``, ``size`` of V cameras.

    ``readout`` (V,) in seconds is there where a camera has a rolling shutter.
    """
    readout = np.array([camera.readout for camera in rig])
    return {
        "names": np.array([camera.name for camera in rig]),
        **{key: np.stack([getattr(camera, key) for camera in rig]) for key in ("K", "R", "t", "distortion")},
        "size": np.array([camera.size for camera in rig]),
        **({"readout": readout} if readout.any() else {}),
    }


def rig_of_arrays(arrays: Arrays) -> Rig:
    """Restore a rig from :func:`rig_arrays`."""
    fields = [arrays[key] for key in ("K", "R", "t", "distortion", "size", "names")]
    cameras = zip(*fields, arrays.get("readout", np.zeros(len(fields[0]))), strict=True)
    return Rig(
        [
            Camera(K, R, t, d, (int(w), int(h)), str(name), float(readout))
            for K, R, t, d, (w, h), name, readout in cameras
        ]
    )


def detection_arrays(detections: Sequence[Detections]) -> Arrays:
    """Return the detections of T frames: ``frames`` () is T, ``skeleton`` () its name, ``frame`` (n,), and the fields
    of :class:`mvpose.Detections` with a row for each of the n detections; ``descriptors``, and ``time`` (T, V), where
    all frames have them.
    """
    described = all(each.descriptors is not None for each in detections)
    keys = (*_OF_DETECTIONS, "descriptors") if described else _OF_DETECTIONS
    times = [each.time for each in detections if each.time is not None]
    return {
        "frames": np.array(len(detections)),
        "skeleton": np.array(detections[0].skeleton.name),
        "frame": _frame_index(map(len, detections)),
        **_joined(detections, keys),
        **({"time": np.stack(times)} if len(times) == len(detections) else {}),
    }


def detections_of(arrays: Arrays) -> tuple[Detections, ...]:
    """Restore detections from :func:`detection_arrays`, one for each frame."""
    skeleton, detections = _SKELETONS[str(arrays["skeleton"])], []
    keys = [key for key in (*_OF_DETECTIONS, "descriptors") if key in arrays]
    for index, rows in enumerate(rows_of_frames(arrays["frame"], int(arrays["frames"]))):
        fields: dict[str, Any] = {key: arrays[key][rows] for key in keys}
        time = arrays["time"][index] if "time" in arrays else None
        detections.append(Detections(**fields, skeleton=skeleton, time=time))
    return tuple(detections)


def truth_arrays(time: NDArray[np.float64], truth: Sequence[Truth]) -> Arrays:
    """Return the truth of T frames: ``time`` (T,), the fields of frames stacked, those of detections joined."""
    stacked = {key: np.stack([getattr(each, key) for each in truth]) for key in _OF_FRAMES}
    return {"time": time, **stacked, **_joined(truth, _OF_ERRORS)}


def truth_of(arrays: Arrays, frame: NDArray[np.int64]) -> tuple[Truth, ...]:
    """Restore the truth from :func:`truth_arrays`, one for each frame.

    Args:
        arrays: the arrays.
        frame: frame of each detection, (n,).
    """
    return tuple(
        Truth(**{key: arrays[key][index] for key in _OF_FRAMES}, **{key: arrays[key][rows] for key in _OF_ERRORS})
        for index, rows in enumerate(rows_of_frames(frame, len(arrays["time"])))
    )


def whole_arrays(frames: Sequence[WholeFrame | None]) -> Arrays:
    """Return detections and truth of T frames on a skeleton with feet and hands; no arrays where there are none.

    ``skeleton`` () is its name; ``keypoints`` (n, J, 2) px and ``scores`` (n, J) of the n detections of all frames;
    ``joints`` (T, P, J, 3), metres, the true ones.
    """
    known = [frame for frame in frames if frame is not None]
    if not known or len(known) < len(frames):
        return {}
    return {
        "skeleton": np.array(known[0].detections.skeleton.name),
        **_joined([frame.detections for frame in known], ("keypoints", "scores")),
        "joints": np.stack([frame.joints for frame in known]),
    }


def whole_of(arrays: Arrays, detections: Sequence[Detections]) -> list[WholeFrame | None]:
    """Restore detections and truth from :func:`whole_arrays`, one for each frame; None where there are none.

    Args:
        arrays: the arrays.
        detections: the detections of each frame on COCO17.
    """
    if not arrays:
        return [None] * len(detections)
    skeleton = skeleton_by_name(str(arrays["skeleton"]))
    rows = rows_of_frames(_frame_index(map(len, detections)), len(detections))
    whole: list[WholeFrame | None] = []
    for body, row, joints in zip(detections, rows, arrays["joints"], strict=True):
        keypoints, scores = arrays["keypoints"][row], arrays["scores"][row]
        found = Detections(body.view, keypoints, scores, body.boxes, body.box_scores, skeleton, time=body.time)
        whole.append(WholeFrame(found, joints))
    return whole


def estimate_arrays(estimates: Sequence[Estimate]) -> Arrays:
    """Return the estimates of one variant over T frames: ``frame`` (k,), ``joints``, ``scores`` and, where all frames
    have them, ``covariance``, ``freedom`` and ``ids`` of the k estimated people; ``time`` (T,), NaN where it is not
    known; ``labels`` (n,) of the detections; ``iterations``, ``residuals``, ``objective`` and ``converged`` of the
    matching of each frame.
    """
    known = [key for key in _OPTIONAL if all(getattr(estimate, key) is not None for estimate in estimates)]
    keys = ("joints", "scores", *known)
    matchings = [estimate.matching for estimate in estimates]
    return {
        "frame": _frame_index(map(len, estimates)),
        **_joined(estimates, keys),
        "time": np.array([np.nan if each.time is None else each.time for each in estimates], float),
        **_joined(matchings, ("labels",)),
        "iterations": np.array([each.iterations for each in matchings]),
        "residuals": np.array([each.residuals for each in matchings], float).reshape(-1, 2),
        "objective": np.array([each.objective for each in matchings], float),
        "converged": np.array([each.converged for each in matchings], bool),
        "label_counts": np.array([len(each.labels) for each in matchings]),
    }


def estimates_of(
    arrays: Mapping[str, Any], detected: NDArray[np.int64], timings: Sequence[Mapping[str, float]]
) -> Iterator[Estimate]:
    """Restore the estimates of one variant from :func:`estimate_arrays`.

    Args:
        arrays: the arrays; ``label_counts`` may be missing where every frame has a label for each detection, ``time``
            where no frame has a time.
        detected: frame of each detection, (n,).
        timings: seconds by stage, for each frame; frames at the end may be missing.
    """
    frames = len(arrays["iterations"])
    counts = arrays.get("label_counts")
    labelled = detected if counts is None else np.repeat(np.arange(frames), counts)
    parts = zip(rows_of_frames(arrays["frame"], frames), rows_of_frames(labelled, frames), strict=True)
    keys = [key for key in ("joints", "scores", *_OPTIONAL) if key in arrays]
    time = arrays.get("time", np.full(frames, np.nan))
    for index, (people, labels) in enumerate(parts):
        primal, dual = arrays["residuals"][index]
        yield Estimate(
            **{key: arrays[key][people] for key in keys},
            matching=Matching(
                labels=arrays["labels"][labels],
                iterations=int(arrays["iterations"][index]),
                residuals=(float(primal), float(dual)),
                objective=float(arrays["objective"][index]),
                converged=bool(arrays["converged"][index]),
            ),
            timings=dict(timings[index]) if index < len(timings) else {},
            time=None if np.isnan(time[index]) else float(time[index]),
        )


def timing_arrays(estimates: Sequence[Estimate]) -> Arrays:
    """Return the timings of one variant: ``stages`` (S,) by name, ``seconds`` (T, S), NaN where not timed."""
    stages = list(dict.fromkeys(stage for estimate in estimates for stage in estimate.timings))
    seconds = [[estimate.timings.get(stage, np.nan) for stage in stages] for estimate in estimates]
    table = np.array(seconds, float).reshape(len(estimates), len(stages))
    return {"stages": np.array(stages, dtype=str), "seconds": table}


def timings_of(arrays: Arrays) -> list[dict[str, float]]:
    """Restore the timings of each frame from :func:`timing_arrays`."""
    stages = [str(stage) for stage in arrays["stages"]]
    return [
        {stage: float(value) for stage, value in zip(stages, row, strict=True) if not np.isnan(value)}
        for row in arrays["seconds"]
    ]


def rows_of_frames(frame: NDArray[np.int64], frames: int) -> list[slice]:
    """Return the rows of each frame, of rows sorted by frame."""
    ends = np.searchsorted(frame, np.arange(frames + 1))
    return [slice(int(start), int(end)) for start, end in itertools.pairwise(ends)]


def _joined(items: Iterable[object], keys: Sequence[str]) -> Arrays:
    """Join fields of one object a frame into one array each."""
    items = list(items)
    return {key: np.concatenate([getattr(item, key) for item in items]) for key in keys}


def _frame_index(counts: Iterable[int]) -> NDArray[np.int64]:
    counts = list(counts)
    return np.repeat(np.arange(len(counts)), counts)
