"""Properties that an answer should have, each a pure function of one frame: its cameras, detections, truth and answer.

A violation is a failure class of :mod:`simharness.scoring.failure_classes`, an error that the covariance makes all but
impossible, or another answer where only the order of cameras, axes of the world, or handedness differ. A predicate of
the user joins them as "FILE.py:FUNCTION" or "PACKAGE.MODULE:FUNCTION": it is called with rig, detections, truth and
estimate, and returns whether the frame fails, or in words how.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from runpy import run_path

import numpy as np

from mvpose import COCO17, Camera, Detections, Estimate, Rig
from mvpose.arrays import Floats
from mvpose.estimators import Estimator
from mvpose.files.message_text import listed
from simharness.scoring.failure_classes import FailureKind, failures_of_frame
from simharness.scoring.pairing import pair
from simharness.types.truth import Truth
from simharness.types.views import Visibility

PLAIN_VIEWS = 3
"""Views in which somebody must be in plain view, for a miss to count."""

PLAIN_SHARE = 0.75
"""Share of the joints that are visible, or hidden by the person's own body, of somebody in plain view."""

UNLIKELY = 1e-6
"""Probability, by the covariance, of an error that contradicts it."""

_CONTRADICTION = 0.1  # metres; smaller errors are within the offsets between detected and anatomical joints
_SAME = 0.01  # metres; mean distance of a person in two answers that should be one
_APART = 0.15  # metres; the same for two variants: the limit of a displaced joint
_TURN, _SHIFT = 1.1, np.array([3.0, -2.0, 0.0])  # radians, metres
_MIRROR = list(COCO17.mirror)


@dataclass(frozen=True)
class FrameAnswer:
    """Answer of a variant for one frame, beside the truth."""

    rig: Rig
    """Believed rig."""
    detections: Detections
    """What the variant was given."""
    truth: Truth
    """Truth of the frame and of these detections."""
    estimate: Estimate
    """The answer."""
    variant: Estimator
    """The variant, for other questions."""
    rival: Estimator | None = None
    """Another variant."""


@dataclass(frozen=True)
class Violation:
    """Property that does not hold in a frame."""

    property: str
    """Name of the property."""
    person: int
    """Index of the true person; -1 where it is nobody's in particular."""
    text: str
    """What happened, with ``{}`` for the name of the person."""
    joints: tuple[int, ...] = ()
    """Joints that are wrong; empty where the property is none of single joints."""

    def is_like(self, other: "Violation") -> bool:
        """Return whether the same property is violated for the same person, at one of the same joints."""
        same = (self.property, self.person) == (other.property, other.person)
        return same and (not self.joints or bool(set(self.joints) & set(other.joints)))


Property = Callable[[FrameAnswer], Iterator[Violation]]


def plain_views(truth: Truth) -> np.ndarray:
    """Return the number of cameras in whose pictures each person is in plain view, (P,)."""
    return np.asarray(((truth.visibility <= Visibility.SELF_OCCLUDED).mean(axis=-1) >= PLAIN_SHARE).sum(axis=0))


def _classified(answer: FrameAnswer, kind: FailureKind) -> Iterator[Violation]:
    """Yield the failures of one class; of missed people those in plain view."""
    plain = plain_views(answer.truth)
    for each in failures_of_frame(answer.rig, answer.detections, answer.truth, answer.estimate):
        if each.kind is not kind or (kind is FailureKind.MISSED and plain[each.person] < PLAIN_VIEWS):
            continue
        views = plain[each.person] if each.person >= 0 else 0
        joints = listed([COCO17.joints[j].replace("_", " ") for j in each.joints])
        of_joints = each.joints if kind in (FailureKind.SWAPPED_LIMB, FailureKind.DISPLACED_JOINT) else ()
        yield Violation(str(kind), each.person, _TEXTS[kind].format(joints=joints, views=views), of_joints)


_TEXTS = {
    FailureKind.MISSED: "{{}} is missed, in plain view of {views} cameras",
    FailureKind.GHOST: "an estimate is nobody",
    FailureKind.MERGED: "{{}} and somebody else are made one",
    FailureKind.SPLIT: "{{}} is two estimates",
    FailureKind.SWAPPED_LIMB: "limbs of {{}} are exchanged: {joints}",
    FailureKind.DISPLACED_JOINT: "joints of {{}} are displaced: {joints}",
}


def _overconfident(answer: FrameAnswer) -> Iterator[Violation]:
    """Yield people with a joint whose error the covariance makes all but impossible."""
    estimate = answer.estimate
    ellipsoids = estimate.ellipsoids(1.0 - UNLIKELY)
    if ellipsoids is None:
        return
    partner = pair(answer.truth.joints, estimate.joints).estimate
    for person in np.flatnonzero(partner >= 0).tolist():
        error = estimate.joints[partner[person]] - answer.truth.joints[person]
        known = np.isfinite(error).all(axis=-1) & np.isfinite(ellipsoids[partner[person]]).all(axis=(1, 2))
        inverse = np.linalg.pinv(ellipsoids[partner[person]][known])
        distance = np.einsum("ji,jik,jk->j", error[known], inverse, error[known])
        size = np.linalg.norm(error[known], axis=-1)
        beyond = (distance > 1) & (size > _CONTRADICTION)
        if beyond.any():
            joints, sizes = np.flatnonzero(known)[beyond], size[beyond]
            worst = COCO17.joints[joints[sizes.argmax()]].replace("_", " ")
            text = f"the {worst} of {{}} is off by {1000 * sizes.max():.0f} mm, which its covariance excludes"
            yield Violation("overconfident", person, text, tuple(joints.tolist()))


def _differs(name: str, what: str, answer: FrameAnswer, joints: Floats, limit: float = _SAME) -> Iterator[Violation]:
    """Yield a violation where other people (n, 17, 3) are found than in the answer."""
    own = answer.estimate.joints
    if len(own) != len(joints):
        yield Violation(name, -1, f"{what}, {len(joints)} people are found instead of {len(own)}")
    elif (unpaired := int((pair(own, joints, limit=limit).estimate < 0).sum())) > 0:
        yield Violation(name, -1, f"{what}, {unpaired} of {len(own)} people are elsewhere")


def _renamed(answer: FrameAnswer) -> Iterator[Violation]:
    """Yield a violation where cameras in reverse order give another answer."""
    rig, found = answer.rig, answer.detections
    reverse = replace(found, view=len(rig) - 1 - found.view).select(np.argsort(-found.view, kind="stable"))
    other = answer.variant.estimate(Rig(rig.cameras[::-1]), reverse)
    yield from _differs("renamed", "with the cameras in reverse order", answer, other.joints)


def _rotated(answer: FrameAnswer) -> Iterator[Violation]:
    """Yield a violation where a turned and shifted world gives another answer."""
    c, s = np.cos(_TURN), np.sin(_TURN)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    cameras = [replace(each, R=each.R @ turn.T, t=each.t - each.R @ turn.T @ _SHIFT) for each in answer.rig]
    other = answer.variant.estimate(Rig(cameras), answer.detections)
    yield from _differs("rotated", "in a turned world", answer, (other.joints - _SHIFT) @ turn)


def _mirrored(answer: FrameAnswer) -> Iterator[Violation]:
    """Yield a violation where a mirrored world, with left and right exchanged, gives another answer."""
    found, flip = answer.detections, np.array([1.0, -1.0, 1.0])
    last = np.array([camera.size[0] - 1.0 for camera in answer.rig])[found.view]
    keypoints, boxes = found.keypoints[:, _MIRROR].copy(), found.boxes.copy()
    keypoints[..., 0] = last[:, None] - keypoints[..., 0]
    boxes[:, 0] = last - boxes[:, 0] - boxes[:, 2]
    mirrored = replace(found, keypoints=keypoints, scores=found.scores[:, _MIRROR], boxes=boxes)
    other = answer.variant.estimate(Rig([mirrored_camera(each) for each in answer.rig]), mirrored)
    yield from _differs("mirrored", "in a mirrored world", answer, other.joints[:, _MIRROR] * flip)


def mirrored_camera(camera: Camera) -> Camera:
    """Return the camera that sees the world mirrored at y = 0 as this one sees the world, mirrored left to right."""
    K, distortion = camera.K.copy(), camera.distortion * [1.0, 1.0, 1.0, -1.0, 1.0]
    K[0, 1], K[0, 2] = -K[0, 1], camera.size[0] - 1.0 - K[0, 2]
    side = np.array([-1.0, 1.0, 1.0])
    return replace(camera, K=K, R=side[:, None] * camera.R * [1.0, -1.0, 1.0], t=side * camera.t, distortion=distortion)


def _disagree(answer: FrameAnswer) -> Iterator[Violation]:
    """Yield a violation where the rival gives another answer."""
    if answer.rival is not None:
        other = answer.rival.estimate(answer.rig, answer.detections)
        yield from _differs("disagree", "by the other variant", answer, other.joints, _APART)


PROPERTIES: dict[str, Property] = {
    **{str(kind): partial(_classified, kind=kind) for kind in FailureKind},
    "overconfident": _overconfident,
    "renamed": _renamed,
    "rotated": _rotated,
    "mirrored": _mirrored,
    "disagree": _disagree,
}
"""Properties by name: what is violated."""

USUAL = ("missed", "merged", "ghost", "split", "swapped_limb", "overconfident", "renamed", "rotated", "mirrored")
"""Properties that are looked at by default. Displaced joints are frequent, and a rival has to be named."""


@cache
def property_of(name: str) -> Property:
    """Return a property by its name, or a user's predicate by its place.

    Raises:
        ValueError: no such property, or a predicate that cannot be loaded.
    """
    if name in PROPERTIES:
        return PROPERTIES[name]
    source, colon, attribute = name.rpartition(":")
    if not colon:
        raise ValueError(
            f"property {name!r}: no such property; expected one of {', '.join(PROPERTIES)}, or FILE.py:FUNCTION"
        )
    try:
        names = run_path(source) if source.endswith(".py") else vars(import_module(source))
        predicate = names[attribute]
    except Exception as error:
        raise ValueError(f"property {name!r}: cannot be loaded: {type(error).__name__}: {error}") from None

    def check(answer: FrameAnswer) -> Iterator[Violation]:
        found = predicate(answer.rig, answer.detections, answer.truth, answer.estimate)
        if found:
            yield Violation(name, -1, found if isinstance(found, str) else f"{attribute} holds")

    return check


def properties_of(names: Sequence[str] | None, rival: str | None = None) -> tuple[str, ...]:
    """Return the names of properties that a user has chosen, :data:`USUAL` by default, in the same order.

    Raises:
        ValueError: no such property, or "disagree" without a rival, or a rival without it.
    """
    wanted = tuple(dict.fromkeys(names or USUAL))
    for name in wanted:
        property_of(name)
    if ("disagree" in wanted) != (rival is not None):
        raise ValueError("--rival and --property disagree go together; give both or neither")
    return wanted


def violations(answer: FrameAnswer, names: Sequence[str]) -> list[Violation]:
    """Return what some properties find in a frame, in their order.

    Raises:
        ValueError: no such property.
    """
    return [each for name in names for each in property_of(name)(answer)]
