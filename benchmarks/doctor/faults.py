"""Faults of a recording, each with the findings that name it.

A fault of calibration changes the believed rig, one of the cameras or of the files changes what arrives; the people and
what is true of them stay the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.doctor.measures import aligned
from benchmarks.doctor.recordings import BenchRecording
from mvpose import Camera, Detections, Rig
from mvpose.arrays import Floats

Given = tuple[Rig, tuple[Detections, ...]]
Fault = Callable[[BenchRecording, np.random.Generator], "Case"]


@dataclass(frozen=True)
class Case:
    """What the doctor is given.

    Attributes:
        rig: believed calibration.
        frames: detections.
        view: index of the camera at fault, the first of two; None for all of them or for none.
    """

    rig: Rig
    frames: tuple[Detections, ...]
    view: int | None = None


def moved(camera: Camera, turn: Floats, shift: Floats) -> Camera:
    """Return the camera turned by a rotation vector (3,), radians, about its centre, which moves by (3,), metres."""
    R = Rotation.from_rotvec(turn).as_matrix() @ camera.R
    return replace(camera, R=R, t=-R @ (camera.center + shift))


def direction(rng: np.random.Generator) -> Floats:
    """Return a random unit vector, (3,)."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def with_camera(rig: Rig, view: int, camera: Camera) -> Rig:
    """Return the rig with another camera in one place."""
    return Rig([camera if v == view else each for v, each in enumerate(rig)])


def move_one(recording: BenchRecording, view: int, degrees: float, metres: float, rng: np.random.Generator) -> Case:
    """Turn and shift one camera by these amounts in random directions."""
    camera = moved(recording.rig[view], np.radians(degrees) * direction(rng), metres * direction(rng))
    return Case(with_camera(recording.rig, view, camera), recording.frames, view)


def move_all(recording: BenchRecording, degrees: float, metres: float, rng: np.random.Generator) -> Case:
    """Turn and shift every camera by normal errors of these standard deviations along each axis.

    What all have in common is taken out: a turn or a shift of the whole rig changes no picture, so no picture shows it.
    """
    cameras = [
        moved(camera, np.radians(degrees) * rng.standard_normal(3), metres * rng.standard_normal(3))
        for camera in recording.rig
    ]
    return Case(aligned(Rig(cameras), recording.rig), recording.frames)


def _each(change: Callable[[Camera], Camera]) -> Fault:
    def fault(recording: BenchRecording, rng: np.random.Generator) -> Case:
        return Case(Rig([change(camera) for camera in recording.rig]), recording.frames)

    return fault


def _one(change: Callable[[Camera, np.random.Generator], Camera]) -> Fault:
    def fault(recording: BenchRecording, rng: np.random.Generator) -> Case:
        view = int(rng.integers(len(recording.rig)))
        return Case(with_camera(recording.rig, view, change(recording.rig[view], rng)), recording.frames, view)

    return fault


def _inverted(camera: Camera) -> Camera:
    return replace(camera, R=camera.R.T, t=camera.center)


def _scaled(camera: Camera, factor: float) -> Camera:
    K = camera.K.copy()
    K[:2] *= factor
    return replace(camera, K=K, size=(round(factor * camera.size[0]), round(factor * camera.size[1])))


def _cropped(camera: Camera) -> Camera:
    K = camera.K.copy()
    K[:2, 2] += 0.1 * np.array(camera.size)
    return replace(camera, K=K, size=(round(1.2 * camera.size[0]), round(1.2 * camera.size[1])))


def _distorting(recording: BenchRecording) -> list[Camera]:
    """Return the cameras, each with a lens that distorts."""
    return [
        camera if camera.distortion.any() else replace(camera, distortion=np.array([-0.25, 0.08, 0.0, 0.0, 0.0]))
        for camera in recording.rig
    ]


def _lenses(believed: Callable[[Floats], Floats], *, one: bool = False) -> Fault:
    """Return the fault of lenses whose terms (5,) are believed to be others, in all cameras or in one."""

    def fault(recording: BenchRecording, rng: np.random.Generator) -> Case:
        view = int(rng.integers(len(recording.rig))) if one else None
        wrong = [view is None or v == view for v in range(len(recording.rig))]
        bent = [b if w else c for b, c, w in zip(_distorting(recording), recording.rig, wrong, strict=True)]
        frames = tuple(_through(each, recording.rig, bent) for each in recording.frames)
        cameras = [
            replace(camera, distortion=believed(camera.distortion)) if w else camera
            for camera, w in zip(bent, wrong, strict=True)
        ]
        return Case(Rig(cameras), frames, view)

    return fault


def _distortion_removed(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Give the detections of undistorted pictures to a calibration with distortion."""
    bent = _distorting(recording)
    straight = [replace(camera, distortion=np.zeros(5)) for camera in bent]
    frames = tuple(_through(each, recording.rig, straight) for each in recording.frames)
    return Case(Rig(bent), frames)


def _cropped_pictures(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Crop the pictures of one camera by 10 to 25 % of their width and height, off its centre."""
    view = int(rng.integers(len(recording.rig)))
    camera, signs = recording.rig[view], rng.choice([-1.0, 1.0], 2)
    K = camera.K.copy()
    K[:2, 2] += rng.uniform(0.10, 0.25, 2) * signs * np.array(camera.size)
    return Case(with_camera(recording.rig, view, replace(camera, K=K)), recording.frames, view)


def _through(detections: Detections, rig: Rig, bent: list[Camera]) -> Detections:
    """Return detections as other lenses in the same places would give them."""
    keypoints = detections.keypoints.copy()
    for view, (camera, lens) in enumerate(zip(rig, bent, strict=True)):
        rows = detections.view == view
        if lens is not camera and rows.any():
            shape = keypoints[rows].shape
            rays = camera.rays(keypoints[rows].reshape(-1, 2))
            keypoints[rows] = lens.project(lens.center + 5.0 * rays).reshape(shape)
    return replace(detections, keypoints=keypoints, scores=np.where(np.isnan(keypoints[..., 0]), 0, detections.scores))


def _swapped_files(recording: BenchRecording, rng: np.random.Generator) -> Case:
    a, b = rng.choice(len(recording.rig), 2, replace=False)
    cameras = list(recording.rig)
    cameras[a], cameras[b] = (replace(cameras[b], name=cameras[a].name), replace(cameras[a], name=cameras[b].name))
    return Case(Rig(cameras), recording.frames, int(min(a, b)))  # findings about a pair have its first camera


def _transposed_pictures(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Exchange x and y of the keypoints of every view."""
    frames = tuple(
        replace(each, keypoints=each.keypoints[..., ::-1], boxes=each.boxes[:, [1, 0, 3, 2]])
        for each in recording.frames
    )
    return Case(recording.rig, frames)


def _mirrored(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Mirror the pictures of one view: people look the other way, and their left side passes for the right one."""
    view = int(rng.integers(len(recording.rig)))
    width, mirror = recording.rig[view].size[0], list(recording.frames[0].skeleton.mirror)

    def flipped(each: Detections) -> Detections:
        rows = each.view == view
        keypoints, scores, boxes = each.keypoints.copy(), each.scores.copy(), each.boxes.copy()
        keypoints[rows, :, 0] = width - 1 - keypoints[rows, :, 0]
        keypoints[rows], scores[rows] = keypoints[rows][:, mirror], scores[rows][:, mirror]
        boxes[rows, 0] = width - 1 - boxes[rows, 0] - boxes[rows, 2]
        return replace(each, keypoints=keypoints, scores=scores, boxes=boxes)

    return Case(recording.rig, tuple(flipped(each) for each in recording.frames), view)


def _sides_exchanged(recording: BenchRecording, rng: np.random.Generator) -> Case:
    view, mirror = int(rng.integers(len(recording.rig))), list(recording.frames[0].skeleton.mirror)

    def exchanged(each: Detections) -> Detections:
        rows = each.view == view
        keypoints, scores = each.keypoints.copy(), each.scores.copy()
        keypoints[rows], scores[rows] = keypoints[rows][:, mirror], scores[rows][:, mirror]
        return replace(each, keypoints=keypoints, scores=scores)

    return Case(recording.rig, tuple(exchanged(each) for each in recording.frames), view)


def _silent(recording: BenchRecording, rng: np.random.Generator) -> Case:
    view = int(rng.integers(len(recording.rig)))
    return Case(recording.rig, tuple(each.select(each.view != view) for each in recording.frames), view)


def _other_people(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Give one view the pictures of another time, backwards: other people, as far as the other views know."""
    view = int(rng.integers(len(recording.rig)))
    others = (*recording.frames[len(recording.frames) // 2 :], *recording.frames[: len(recording.frames) // 2])[::-1]
    frames = [_of_view(each, other, view) for each, other in zip(recording.frames, others, strict=True)]
    return Case(recording.rig, tuple(frames), view)


def scattered(recording: BenchRecording) -> tuple[Detections, ...]:
    """Return detections that every view takes from another time, so that no two see the same people."""
    frames, views = recording.frames, len(recording.rig)
    result = list(frames)
    for view in range(1, views):
        ahead = view * len(frames) // views
        result = [_of_view(each, frames[(k + ahead) % len(frames)], view) for k, each in enumerate(result)]
    return tuple(result)


def _of_view(frame: Detections, other: Detections, view: int) -> Detections:
    """Return a frame with the detections of another frame in one view."""
    rest, taken = frame.select(frame.view != view), other.select(other.view == view)
    names = ("view", "keypoints", "scores", "boxes", "box_scores")
    columns: dict[str, Any] = {key: np.concatenate([getattr(rest, key), getattr(taken, key)]) for key in names}
    return Detections(**columns, skeleton=frame.skeleton)


def _late(frames: int) -> Fault:
    """Return the fault of one camera whose pictures come some frames late."""

    def fault(recording: BenchRecording, rng: np.random.Generator) -> Case:
        view = int(rng.integers(len(recording.rig)))
        none = [Detections.empty(recording.frames[0].skeleton)] * frames
        late = [*none, *recording.frames]
        given = [_of_view(each, late[k], view) for k, each in enumerate(recording.frames)]
        return Case(recording.rig, tuple(given), view)

    return fault


def _dropped(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Lose two pictures of one camera in the middle, so that all later ones come two frames early."""
    view, count = int(rng.integers(len(recording.rig))), len(recording.frames)
    given = [_of_view(recording.frames[k], recording.frames[k + 2 * (k >= count // 2)], view) for k in range(count - 2)]
    return Case(recording.rig, tuple(given), view)


def _repeated(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Deliver a tenth of the pictures of one camera twice, each in place of the next one."""
    view = int(rng.integers(len(recording.rig)))
    frames, last = [recording.frames[0]], recording.frames[0]
    for each in recording.frames[1:]:
        last = last if rng.random() < 0.1 else each
        frames.append(_of_view(each, last, view))
    return Case(recording.rig, tuple(frames), view)


def _drifting(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Turn one camera steadily, by three degrees until the end."""
    view, axis = int(rng.integers(len(recording.rig))), direction(rng)
    camera, count = recording.rig[view], len(recording.frames)
    frames = []
    for k, each in enumerate(recording.frames):
        turned = moved(camera, np.radians(3.0) * k / count * axis, np.zeros(3))
        frames.append(_through(each, recording.rig, [turned if v == view else c for v, c in enumerate(recording.rig)]))
    return Case(recording.rig, tuple(frames), view)


def _knocked(recording: BenchRecording, rng: np.random.Generator) -> Case:
    """Turn one camera by two degrees in the middle of the recording."""
    view = int(rng.integers(len(recording.rig)))
    turned = moved(recording.rig[view], np.radians(2.0) * direction(rng), np.zeros(3))
    cameras = [turned if v == view else c for v, c in enumerate(recording.rig)]
    middle = len(recording.frames) // 2
    after = tuple(_through(each, recording.rig, cameras) for each in recording.frames[middle:])
    return Case(recording.rig, (*recording.frames[:middle], *after), view)


def _focal(camera: Camera, rng: np.random.Generator) -> Camera:
    K = camera.K.copy()
    K[:2, :2] *= np.exp(0.05 * rng.choice([-1, 1]))
    return replace(camera, K=K)


def _center(camera: Camera, rng: np.random.Generator) -> Camera:
    angle, K = rng.uniform(0, 2 * np.pi), camera.K.copy()
    K[:2, 2] += 30.0 * np.array([np.cos(angle), np.sin(angle)])
    return replace(camera, K=K)


CONVENTIONS: Mapping[str, tuple[Fault, frozenset[str]]] = {
    "extrinsics inverted": (_each(_inverted), frozenset({"extrinsics-inverted"})),
    "rotation transposed": (
        _each(lambda c: replace(c, R=c.R.T, t=-c.R.T @ c.center)), frozenset({"rotation-transposed"})
    ),
    "position for translation": (_each(lambda c: replace(c, t=c.center)), frozenset({"translation-is-center"})),
    "unit ten times too small": (_each(lambda c: replace(c, t=10.0 * c.t)), frozenset({"wrong-unit"})),
    "half resolution": (_each(lambda c: _scaled(c, 0.5)), frozenset({"image-size"})),
    "uncropped": (_each(_cropped), frozenset({"image-cropped", "principal-point"})),
    "x and y exchanged": (_transposed_pictures, frozenset({"axes-swapped"})),
    "camera axes flipped": (
        _each(lambda c: replace(c, R=np.diag([1.0, -1, -1]) @ c.R, t=np.diag([1.0, -1, -1]) @ c.t)),
        frozenset({"axis-flipped"}),
    ),
    "files of two cameras swapped": (_swapped_files, frozenset({"cameras-swapped"})),
    "distortion ignored": (_lenses(lambda terms: np.zeros(5)), frozenset({"distortion-ignored", "distortion-model"})),
}  # fmt: skip
"""Ten wrong files, with the kinds of findings that name them."""

OTHERS: Mapping[str, tuple[Fault, frozenset[str]]] = {
    "one camera 1 degree and 5 cm off": (
        lambda r, rng: move_one(r, int(rng.integers(len(r.rig))), 1.0, 0.05, rng), frozenset({"moved-camera"})
    ),
    "all cameras 2 degrees and 0.2 m off": (lambda r, rng: move_all(r, 2.0, 0.2, rng), frozenset({"moved-camera"})),
    "one camera knocked in the middle": (_knocked, frozenset({"moved-camera", "drifting-camera"})),
    "one camera drifts by 3 degrees": (_drifting, frozenset({"drifting-camera", "moved-camera"})),
    "focal length 5 % off": (_one(_focal), frozenset({"focal-length"})),
    "principal point 30 px off": (_one(_center), frozenset({"principal-point"})),
    "pictures of one camera cropped": (_cropped_pictures, frozenset({"image-cropped"})),
    "distortion of one camera ignored": (
        _lenses(lambda terms: np.zeros(5), one=True), frozenset({"distortion-ignored", "distortion-model"})
    ),
    "distortion of the other sign": (_lenses(lambda terms: -terms), frozenset({"distortion-model"})),
    "distortion removed already": (_distortion_removed, frozenset({"distortion-model"})),
    "pictures 120 ms late": (_late(3), frozenset({"clock-offset"})),
    "two pictures lost": (_dropped, frozenset({"dropped-pictures"})),
    "a tenth of pictures repeated": (_repeated, frozenset({"repeated-pictures"})),
    "view mirrored": (_mirrored, frozenset({"mirrored-view"})),
    "left and right exchanged": (_sides_exchanged, frozenset({"left-right-exchanged", "mirrored-view"})),
    "view of other people": (_other_people, frozenset({"other-people"})),
    "view without detections": (_silent, frozenset({"silent-view"})),
}  # fmt: skip
"""Faults of cameras, clocks and views, with the kinds of findings that name them."""
