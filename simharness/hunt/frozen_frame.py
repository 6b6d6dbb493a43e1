"""Frozen frame: one frame as cameras, people, and the differences of its detections from perfect ones.

Detections are perfect where no error says otherwise: everybody is detected in every picture, with all joints that are
inside at the exact pixels and scores of 1. Errors are independent, so that removing one leaves the others as they were.
Keypoints are kept as offsets from their true places, which move with the people and the cameras.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Camera, Detections, Rig
from mvpose.arrays import Bools, Floats
from simharness.detector.error_classes import classify
from simharness.detector.viewing_conditions import oks_units
from simharness.scenario.sections.section import Section
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility

Pixel = tuple[float, float]
Vector = tuple[float, float, float]
_JOINTS = len(COCO17)
_SAME = 1e-6  # pixels: rounding errors of a projection

ErrorKind = Literal["keypoint", "missed", "extra", "box", "picture", "hidden"]
"""Kinds of differences from perfect detections.

keypoint: a joint is elsewhere, has another score, or is not reported; missed: a person is not detected; extra: one more
detection, of nobody or of a person who is detected already; box: score of a person's box; picture: all joints of a
person are elsewhere than where the believed camera puts them (faults of calibrations and clocks); hidden: joints that
are not visible, which scores regard."""


class FrozenCamera(Section):
    """Believed camera."""

    name: str
    size: tuple[int, int]
    """Width and height, pixels."""
    focal: Pixel
    principal: Pixel
    position: Vector
    """Optical centre, metres."""
    rotation: Vector
    """Rotation vector from world to camera, radians."""
    skew: float = 0.0
    distortion: tuple[float, float, float, float, float] = (0.0,) * 5

    @classmethod
    def of(cls, camera: Camera, name: str) -> Self:
        """Freeze a camera."""
        (fx, skew, cx), (_, fy, cy), _ = camera.K.tolist()
        return cls(
            name=name,
            size=camera.size,
            focal=(fx, fy),
            principal=(cx, cy),
            position=tuple(camera.center.tolist()),
            rotation=tuple(Rotation.from_matrix(camera.R).as_rotvec().tolist()),
            skew=skew,
            distortion=tuple(camera.distortion.tolist()),
        )


class FrozenPerson(Section):
    """True person."""

    number: Annotated[int, Field(ge=0)]
    """Index among the people of the trial."""
    joints: Annotated[tuple[Vector, ...], Field(min_length=_JOINTS, max_length=_JOINTS)]
    """COCO-17, metres."""


class DrawnError(Section):
    """One difference of the detections from perfect ones."""

    kind: ErrorKind
    camera: str
    person: int = -1
    """Number of the person; -1 for nobody."""
    joint: str = ""
    offset: Pixel | None = None
    """keypoint: from the true place; None: not reported."""
    score: float | None = None
    """keypoint, box and extra: score of the keypoint or the box."""
    joints: tuple[tuple[float, ...], ...] = ()
    """extra: x, y, score of each joint, score 0 where it is not reported; picture: offset of each joint; hidden: the
    :class:`simharness.types.views.Visibility` of each joint inside the picture."""


class FrozenFrame(Section):
    """Cameras, people and errors of one frame."""

    cameras: tuple[FrozenCamera, ...]
    people: tuple[FrozenPerson, ...] = ()
    errors: tuple[DrawnError, ...] = ()

    @property
    def numbers(self) -> list[int]:
        """Numbers of the people."""
        return [person.number for person in self.people]

    def of(
        self, *, cameras: Iterable[FrozenCamera] | None = None, people: Iterable[FrozenPerson] | None = None
    ) -> Self:
        """Return the frame with some of its cameras and people, and the errors of these."""
        kept = self.model_copy(
            update={
                "cameras": self.cameras if cameras is None else tuple(cameras),
                "people": self.people if people is None else tuple(people),
            }
        )
        seen, known = {each.name for each in kept.cameras}, {-1, *kept.numbers}
        return kept.with_errors(each for each in self.errors if each.camera in seen and each.person in known)

    def with_errors(self, errors: Iterable[DrawnError]) -> Self:
        """Return the frame with other errors."""
        return self.model_copy(update={"errors": tuple(errors)})

    def places(self) -> tuple[Rig, Floats]:
        """Return the believed rig, and the true places of all joints in its pictures, (V, P, 17, 2) pixels."""
        rig = Rig([camera_of(each) for each in self.cameras])
        joints = np.array([each.joints for each in self.people], float).reshape(-1, _JOINTS, 3)
        place = np.stack([camera.project(joints) for camera in rig])
        for v, p, error in self._indexed("picture"):
            place[v, p] += np.array(error.joints)
        return rig, place

    def detected(self) -> tuple[Rig, Detections, Truth]:
        """Return the believed rig, the detections, and the truth of frame and detections."""
        rig, place = self.places()
        inside = np.stack([camera.inside(each) for camera, each in zip(rig, place, strict=True)])
        visibility = np.where(inside, np.int8(Visibility.VISIBLE), np.int8(Visibility.OUTSIDE))
        for v, p, error in self._indexed("hidden"):
            visibility[v, p] = np.where(inside[v, p], np.ravel(error.joints), Visibility.OUTSIDE)
        keypoints, scores = np.where(inside[..., None], place, np.nan), inside.astype(float)
        present: Bools = np.asarray(inside.any(axis=-1))
        box_scores = np.ones(inside.shape[:2])
        for v, p, error in self._indexed("keypoint"):
            at = v, p, COCO17.index(error.joint)
            keypoints[at] = np.nan if error.offset is None else place[at] + error.offset
            scores[at] = 0.0 if error.offset is None else error.score
        present &= (scores > 0).any(axis=-1)
        for v, p, error in self._indexed("box"):
            box_scores[v, p] = error.score
        for v, p, _ in self._indexed("missed"):
            present[v, p] = False
        extras = self._indexed("extra")
        added = np.array([error.joints for *_, error in extras], float).reshape(-1, _JOINTS, 3)
        of_extras = np.array([each[:2] for each in extras], int).reshape(-1, 2)
        view, person = np.concatenate([np.argwhere(present), of_extras]).T
        order = np.argsort(view, kind="stable")
        person = person[order]
        detections = Detections.from_keypoints(
            view[order],
            np.concatenate([keypoints[present], np.where(added[..., 2:] > 0, added[..., :2], np.nan)])[order],
            np.concatenate([scores[present], added[..., 2]])[order],
        )
        own = np.concatenate([box_scores[present], [error.score for *_, error in extras]])[order]
        seen = np.where(inside[..., None], place, np.nan).reshape(-1, _JOINTS, 2)
        boxes = Detections.from_keypoints(np.zeros(len(seen), int), seen, np.isfinite(seen[..., 0])).boxes
        boxes = boxes.reshape(*inside.shape[:2], 4)
        classes = np.where(detections.detected, np.int8(KeypointError.MISS), np.int8(KeypointError.ABSENT))
        real = person >= 0
        of = detections.view[real], person[real]
        classes[real] = classify(detections.keypoints[real], place[of], oks_units(boxes[of]))
        joints = np.array([each.joints for each in self.people], float).reshape(-1, _JOINTS, 3)
        truth = Truth(joints, place, visibility, boxes, person, classes)
        return rig, replace(detections, box_scores=own.astype(float)), truth

    def _indexed(self, kind: ErrorKind) -> list[tuple[int, int, DrawnError]]:
        """Return the errors of a kind with the indices of their cameras and people, -1 for nobody."""
        views = {each.name: v for v, each in enumerate(self.cameras)}
        people = {-1: -1} | {number: p for p, number in enumerate(self.numbers)}
        return [(views[each.camera], people[each.person], each) for each in self.errors if each.kind == kind]


def freeze(rig: Rig, detections: Detections, truth: Truth) -> FrozenFrame:
    """Freeze one frame of a trial.

    Keypoints of joints behind a camera have no true place and are left out; so are descriptors and heat maps.

    Args:
        rig: believed rig, V cameras.
        detections: the m detections of the frame.
        truth: truth of the frame and of these detections.
    """
    names = [camera.name for camera in rig]
    if len(set(names)) < len(names) or not all(names):
        names = [f"cam{view}" for view in range(len(rig))]
    frame = FrozenFrame(
        cameras=tuple(map(FrozenCamera.of, rig, names)),
        people=tuple(
            FrozenPerson(number=p, joints=tuple(map(tuple, truth.joints[p].tolist())))
            for p in np.flatnonzero(truth.present).tolist()
        ),
    )
    _, place = frame.places()
    order = np.lexsort((-detections.scores.sum(axis=1), -detections.box_scores)).tolist()
    firsts: dict[tuple[int, int], int] = {}
    for d in order:
        firsts.setdefault((int(detections.view[d]), int(truth.person[d])), d)
    errors = []
    for v, camera in enumerate(names):
        for p, number in enumerate(frame.numbers):
            shift = np.nan_to_num(truth.pixels[v, number] - place[v, p])
            moved = np.abs(shift).max() > _SAME
            at = place[v, p] + shift if moved else place[v, p]
            about = {"camera": camera, "person": number}
            if moved:
                errors.append(DrawnError(kind="picture", joints=tuple(map(tuple, shift.tolist())), **about))
            inside = rig[v].inside(at)
            seen = truth.visibility[v, number]
            if (inside & (seen != Visibility.VISIBLE)).any():
                errors.append(DrawnError(kind="hidden", joints=tuple((int(each),) for each in seen), **about))
            d = firsts.get((v, number))
            if d is None:
                errors += [DrawnError(kind="missed", **about)] if inside.any() else []
                continue
            if detections.box_scores[d] != 1.0:
                errors.append(DrawnError(kind="box", score=float(detections.box_scores[d]), **about))
            errors += _keypoint_errors(detections, d, at, inside, about)
    for d in sorted(set(order) - {d for (_, person), d in firsts.items() if person >= 0}):
        joints = np.column_stack([np.nan_to_num(detections.keypoints[d]), detections.scores[d]])
        about = {"camera": names[int(detections.view[d])], "person": int(truth.person[d])}
        score = float(detections.box_scores[d])
        errors.append(DrawnError(kind="extra", score=score, joints=tuple(map(tuple, joints.tolist())), **about))
    return frame.with_errors(errors)


def _keypoint_errors(detections: Detections, d: int, place: Floats, inside: Bools, about: dict) -> list[DrawnError]:
    """Return the errors of one detection's keypoints; ``about`` has camera and person."""
    errors = []
    for j, joint in enumerate(COCO17.joints):
        score = float(detections.scores[d, j])
        offset = detections.keypoints[d, j] - place[j]
        if score == 0:
            errors += [DrawnError(kind="keypoint", joint=joint, **about)] if inside[j] else []
        elif np.isfinite(offset).all() and (not inside[j] or score != 1 or np.abs(offset).max() > _SAME):
            away = (float(offset[0]), float(offset[1]))
            errors.append(DrawnError(kind="keypoint", joint=joint, offset=away, score=score, **about))
    return errors


@lru_cache(maxsize=256)
def camera_of(frozen: FrozenCamera) -> Camera:
    """Return the camera."""
    (fx, fy), (cx, cy) = frozen.focal, frozen.principal
    rotation = Rotation.from_rotvec(frozen.rotation).as_matrix()
    return Camera(
        np.array([[fx, frozen.skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        rotation,
        -rotation @ np.array(frozen.position),
        np.array(frozen.distortion),
        frozen.size,
        frozen.name,
    )
