"""Treatments: the same errors added to recorded and to simulated detections, or to their calibration.

Draws are keyed by treatment, frame and view, never by the recording, so that reality and its twins get the same draws;
and by neither level nor share, so that a higher level adds to the errors of a lower one. A level of 0 changes nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import poisson

from mvpose import Camera, Detections, Rig
from mvpose.arrays import Bools, Floats
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.types.random_streams import stream

REFERENCE_WIDTH = 1032.0
"""Width of Shelf's pictures, pixels: levels of noise are stated for pictures of this width."""

_MOST_PHANTOMS = 16  # of a view and frame; a rate of 2 exceeds it once in 10^10 frames


@dataclass(frozen=True)
class Treatment:
    """Errors of one kind and level, as a change of a recording (:class:`.RecordingChange`)."""

    kind: str
    """Key of :data:`KINDS`."""
    level: float
    """Size, in the unit of the kind."""
    draw: int = 0
    """Number of the draw."""
    seed: int = 0
    """Seed of all draws."""

    def __call__(self, recording: AnnotatedRecording) -> AnnotatedRecording:
        """Return the treated recording, with the same frames and the same truth."""
        return KINDS[self.kind].apply(recording, self) if self.level else recording

    def stream(self, *key: int) -> np.random.Generator:
        """Return the random stream of a frame and view, or of a camera; it does not depend on the level."""
        return stream(self.seed, "validation", self.kind, self.draw, *key)


@dataclass(frozen=True)
class TreatmentKind:
    """Kind of treatments."""

    title: str
    """Name in tables and plots."""
    unit: str
    """Unit of the level."""
    levels: tuple[float, ...]
    """Levels of a validation, ascending."""
    apply: Callable[[AnnotatedRecording, Treatment], AnnotatedRecording]
    """Function of a recording and a treatment, which returns the treated recording."""
    calibration: bool = False
    """Whether it changes the calibration, the same in all frames; else the detections."""


def _noise(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Add Gaussian noise to the keypoints; the level is its standard deviation along each axis."""

    def move(detections: Detections, row: int) -> Detections:
        shift = _of_detections(recording, detections, row, treatment, _normal)
        scale = np.array([camera.size[0] for camera in recording.rig]) / REFERENCE_WIDTH
        shift *= (treatment.level * scale[detections.view])[:, None, None]
        return replace(detections, keypoints=detections.keypoints + shift, likelihoods=None)

    return _each_frame(recording, move)


def _drop(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Drop keypoints, each with the same probability; the level is the share."""

    def drop(detections: Detections, row: int) -> Detections:
        uniform = _of_detections(recording, detections, row, treatment, _uniform)[..., 0]
        return replace(detections, scores=np.where(uniform < treatment.level, 0.0, detections.scores), likelihoods=None)

    return _each_frame(recording, drop)


def _miss(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Remove whole detections, each with the same probability; the level is the share."""

    def miss(detections: Detections, row: int) -> Detections:
        uniform = _of_detections(recording, detections, row, treatment, _uniform)[:, 0, 0]
        return _kept(detections, uniform >= treatment.level)

    return _each_frame(recording, miss)


def _phantoms(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Add copies of other detections of the same view, from other frames, at other places; the level is their rate.

    A phantom has a plausible pose, size and score, because all are real: it is a detection from a random frame, moved
    to a random place in the picture and mirrored at random.
    """
    pool = [_pool(recording, view) for view in range(len(recording.rig))]

    def add(detections: Detections, row: int) -> Detections:
        added = [detections]
        for view, camera in enumerate(recording.rig):
            rows, sources = pool[view]
            uniform = treatment.stream(int(recording.frames[row]), view).random((1 + _MOST_PHANTOMS, 4))
            count = min(int(poisson.ppf(uniform[0, 0], treatment.level)), _MOST_PHANTOMS)
            others = np.flatnonzero(rows != row)
            for which, x, y, flip in uniform[1 : 1 + count] if len(others) else ():
                source = _kept(sources, others[int(which * len(others))])
                added.append(_moved(source, np.array([x, y]), np.array(camera.size, float), mirrored=flip < 0.5))
        return _joined(added)

    return _each_frame(recording, add)


def _rotate(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Turn every camera about its centre; the level is the standard deviation about each of its axes, degrees."""

    def turn(camera: Camera, draw: Floats) -> Camera:
        error = Rotation.from_rotvec(np.radians(treatment.level) * draw).as_matrix()
        return replace(camera, R=error @ camera.R, t=error @ camera.t)

    return _each_camera(recording, treatment, turn)


def _shift(recording: AnnotatedRecording, treatment: Treatment) -> AnnotatedRecording:
    """Move the centre of every camera; the level is the standard deviation along each axis, centimetres."""

    def move(camera: Camera, draw: Floats) -> Camera:
        return replace(camera, t=camera.t - camera.R @ (0.01 * treatment.level * draw))

    return _each_camera(recording, treatment, move)


KINDS: Mapping[str, TreatmentKind] = {
    "noise": TreatmentKind("keypoint noise", "px at 1032 px width", (6.0, 12.0, 24.0), _noise),
    "drop": TreatmentKind("keypoints dropped", "share", (0.1, 0.2, 0.4), _drop),
    "miss": TreatmentKind("people missed", "share", (0.1, 0.2, 0.4), _miss),
    "phantoms": TreatmentKind("phantoms", "per view and frame", (0.5, 1.0, 2.0), _phantoms),
    "rotation": TreatmentKind("cameras turned", "° about each axis", (0.25, 0.5, 1.0), _rotate, calibration=True),
    "translation": TreatmentKind("cameras moved", "cm along each axis", (2.5, 5.0, 10.0), _shift, calibration=True),
}
"""Kinds of treatments by key."""


def treatments(*, draws: int, detection_draws: int) -> list[Treatment]:
    """Return all treatments of a validation: every kind at every level, several times.

    Args:
        draws: number of draws of the errors of the calibration: of few cameras, so that each draw differs.
        detection_draws: number of draws of the errors of detections, which average over frames as well.
    """
    return [
        Treatment(key, level, draw)
        for key, kind in KINDS.items()
        for level in kind.levels
        for draw in range(draws if kind.calibration else detection_draws)
    ]


def _each_frame(recording: AnnotatedRecording, change: Callable[[Detections, int], Detections]) -> AnnotatedRecording:
    """Return the recording with the detections of each frame changed, given them and the row of the frame."""
    changed = tuple(change(detections, row) for row, detections in enumerate(recording.detections))
    return replace(recording, detections=changed)


def _each_camera(
    recording: AnnotatedRecording, treatment: Treatment, change: Callable[[Camera, Floats], Camera]
) -> AnnotatedRecording:
    """Return the recording with every camera changed, given it and three standard normal numbers."""
    draws = [treatment.stream(view).normal(size=3) for view in range(len(recording.rig))]
    cameras = [change(camera, draw) for camera, draw in zip(recording.rig, draws, strict=True)]
    return replace(recording, rig=Rig(cameras))


def _normal(generator: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return generator.normal(size=shape)


def _uniform(generator: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return generator.random(shape)


def _of_detections(
    recording: AnnotatedRecording,
    detections: Detections,
    row: int,
    treatment: Treatment,
    draw: Callable[[np.random.Generator, tuple[int, ...]], Floats],
) -> Floats:
    """Return two draws for each keypoint, (m, J, 2): detection k of a view gets the same draws in every recording."""
    joints = detections.scores.shape[1]
    result = np.zeros((len(detections), joints, 2))
    for view in np.unique(detections.view):
        rows = np.flatnonzero(detections.view == view)
        result[rows] = draw(treatment.stream(int(recording.frames[row]), int(view)), (len(rows), joints, 2))
    return result


def _pool(recording: AnnotatedRecording, view: int) -> tuple[np.ndarray, Detections]:
    """Return all detections of a view that have a keypoint, and the row of the frame of each."""
    kept = [(each.view == view) & each.detected.any(axis=1) for each in recording.detections]
    rows = np.repeat(np.arange(len(recording)), [each.sum() for each in kept])
    return rows, _joined([_kept(each, mask) for each, mask in zip(recording.detections, kept, strict=True)])


def _moved(detections: Detections, place: Floats, size: Floats, *, mirrored: bool) -> Detections:
    """Return one detection with its box, as far as it fits, at a random place (2,) of 0 to 1 of the picture."""
    keypoints, scores, box = detections.keypoints, detections.scores, detections.boxes[0]
    if mirrored:
        mirror = list(detections.skeleton.mirror)
        keypoints, scores = keypoints[:, mirror], scores[:, mirror]
        keypoints = np.stack([2 * box[0] + box[2] - keypoints[..., 0], keypoints[..., 1]], axis=-1)
    corner = place * np.maximum(size - box[2:], 0.0)
    return replace(
        detections, keypoints=keypoints + (corner - box[:2]), scores=scores, boxes=np.array([[*corner, *box[2:]]])
    )


def _kept(detections: Detections, which: Bools | int) -> Detections:
    """Return some detections, by mask or index, without heat maps and times."""
    return replace(detections.select(np.atleast_1d(which)), time=None)


def _joined(frames: list[Detections]) -> Detections:
    """Return the detections of several objects as one, without heat maps."""
    descriptors = [each.descriptors for each in frames]
    return Detections(
        np.concatenate([each.view for each in frames]),
        np.concatenate([each.keypoints for each in frames]),
        np.concatenate([each.scores for each in frames]),
        np.concatenate([each.boxes for each in frames]),
        np.concatenate([each.box_scores for each in frames]),
        frames[0].skeleton,
        np.concatenate(descriptors) if all(each is not None for each in descriptors) else None,  # type: ignore[arg-type]
    )
