"""Output of a 2D pose detector for one frame, in all views."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import Sealed, as_array, seal
from mvpose.heatmaps import Heatmaps
from mvpose.skeleton import COCO17, SHELF14, Skeleton

MOST_DETECTIONS = 2000
"""Largest number of detections of a frame that is estimated: 64 cameras that see 31 people each. The time of matching
grows with the cube of it, to about a minute."""

_FARTHEST = 1e9  # pixels; larger than any image, and the squares are far from overflow
_LEAST_SCORE = 1e-6  # below the resolution of any detector, and products of such scores are far from underflow


@dataclass(frozen=True)
class Detections(Sealed):
    """2D poses detected in all views of one frame, as flat arrays of m detections.

    A keypoint that was not detected has score 0 and NaN coordinates. Both are set where either is given, where a
    coordinate is infinite or beyond 1e9 pixels, and where the score is NaN or below 1e-6. A detection without any
    keypoint is allowed and ignored by every stage.

    Raises:
        ValueError: a wrong shape or skeleton, a negative view, scores outside 0..1, or an invalid box.
    """

    view: Integers
    """Index of the camera of each detection, (m,)."""
    keypoints: Floats
    """Pixels, (m, J, 2)."""
    scores: Floats
    """Confidence of each keypoint, 0 to 1, (m, J)."""
    boxes: Floats
    """x, y, width, height in pixels, (m, 4)."""
    box_scores: Floats
    """Confidence of each box, 0 to 1, (m,)."""
    skeleton: Skeleton = COCO17
    """The J joints."""
    descriptors: Floats | None = None
    """Appearance descriptors, (m, D), or None. A row with a value that is not finite becomes NaN, which means no
    descriptor."""
    likelihoods: Heatmaps | None = None
    """Heat maps from which the keypoints were read, or None."""
    time: Floats | None = None
    """Time of each camera's picture, (V,), seconds; NaN for a camera without a picture in this frame. None: all cameras
    gave a picture at one time."""

    def __post_init__(self) -> None:
        view = as_array(self.view, ("m",), "view", np.int64)
        count = len(view)
        keypoints, scores = _keypoints(self.keypoints, self.scores, count, self.skeleton)
        boxes = as_array(self.boxes, (count, 4), "boxes")
        box_scores = as_array(self.box_scores, (count,), "box_scores")
        if count and view.min() < 0:
            raise ValueError(f"view must be camera indices from 0, got {view.min()}")
        if not (np.isfinite(boxes).all() and (boxes[:, 2:] >= 0).all()):
            bad = int(np.flatnonzero(~(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] >= 0).all(axis=1)))[0])
            raise ValueError(
                f"boxes must be finite x, y, width, height with sizes of at least 0, got {boxes[bad].tolist()} for "
                f"detection {bad}; convert corners x0, y0, x1, y1 to x0, y0, x1 - x0, y1 - y0"
            )
        if not ((box_scores >= 0) & (box_scores <= 1)).all():
            bad = int(np.flatnonzero(~((box_scores >= 0) & (box_scores <= 1)))[0])
            raise ValueError(f"box_scores must lie in 0..1, got {box_scores[bad]:.6g} for detection {bad}")
        for key, value in (
            ("view", view),
            ("keypoints", keypoints),
            ("scores", scores),
            ("boxes", boxes),
            ("box_scores", box_scores),
        ):
            object.__setattr__(self, key, value)
        if self.descriptors is not None:
            descriptors = as_array(self.descriptors, (count, "D"), "descriptors").copy()
            descriptors[~np.isfinite(descriptors).all(axis=1)] = np.nan
            descriptors.flags.writeable = False
            object.__setattr__(self, "descriptors", descriptors)
        if self.time is not None:
            object.__setattr__(self, "time", as_array(self.time, ("V",), "time"))
        if self.likelihoods is not None:
            _check_likelihoods(self.likelihoods, scores.shape)

    def __len__(self) -> int:
        return len(self.view)

    def select(self, which: Bools | Integers) -> Self:
        """Return some detections without heat maps, given by a mask (m,) or by indices in a new order."""
        if which.dtype == np.bool_:
            which = np.flatnonzero(which)
        selected = object.__new__(type(self))  # without the constructor: the arrays are checked already
        names = ("view", "keypoints", "scores", "boxes", "box_scores", "descriptors")
        arrays = {name: value.take(which, axis=0) for name in names if (value := getattr(self, name)) is not None}
        seal(*arrays.values())
        selected.__dict__.update(descriptors=None, skeleton=self.skeleton, likelihoods=None, time=self.time)
        selected.__dict__.update(arrays)
        return selected

    @property
    def detected(self) -> Bools:
        """Mask of detected keypoints, (m, J)."""
        return self.scores > 0

    @classmethod
    def empty(cls, skeleton: Skeleton = COCO17) -> Self:
        """Return a frame without detections."""
        return cls.from_keypoints([], np.zeros((0, len(skeleton), 2)), np.zeros((0, len(skeleton))), skeleton=skeleton)

    @classmethod
    def from_keypoints(
        cls, view: ArrayLike, keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton = COCO17
    ) -> Self:
        """Create detections with boxes that span the keypoints and have their mean score."""
        view = as_array(view, ("m",), "view", np.int64)
        keypoints, scores = _keypoints(keypoints, scores, len(view), skeleton)
        return cls(view, keypoints, scores, _spanning_boxes(keypoints), _mean_scores(scores), skeleton)

    @classmethod
    def from_heatmaps(
        cls, view: ArrayLike, heatmaps: Heatmaps, *, boxes: ArrayLike | None = None, skeleton: Skeleton = COCO17
    ) -> Self:
        """Create detections from heat maps; the strongest mode of each map is the keypoint, and the maps are kept.

        Args:
            view: camera of each detection, (m,).
            heatmaps: heat map for each of m detections and J joints. The height of its strongest mode, at most 1, is
                the score; an empty map is a missing joint.
            boxes: x, y, width, height in pixels, (m, 4); by default the box that spans the keypoints.
            skeleton: the J joints.

        Raises:
            ValueError: as for the class.
        """
        if not isinstance(heatmaps, Heatmaps):
            raise ValueError(f"heatmaps must be mvpose.heatmaps.Heatmaps, got {type(heatmaps).__name__}")
        view = as_array(view, ("m",), "view", np.int64)
        _check_likelihoods(heatmaps, (len(view), len(_checked_skeleton(skeleton))))
        pixels, heights = heatmaps.modes(1)
        keypoints, scores = pixels[:, :, 0], np.minimum(heights[:, :, 0], 1.0)
        spans = _spanning_boxes(keypoints) if boxes is None else as_array(boxes, (len(view), 4), "boxes")
        return cls(view, keypoints, scores, spans, _mean_scores(scores), skeleton, likelihoods=heatmaps)


def _keypoints(keypoints: ArrayLike, scores: ArrayLike, count: int, skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Check keypoints and scores, and mark missing ones in both."""
    joints = len(_checked_skeleton(skeleton))
    keypoints = as_array(keypoints, ("m", "J", 2), "keypoints")
    if keypoints.shape != (count, joints, 2):
        raise ValueError(
            f"keypoints must be {(count, joints, 2)}, got {keypoints.shape}"
            + (f": {_skeleton_hint(skeleton, keypoints.shape[1])}" if keypoints.shape[1] != joints else "")
        )
    scores = as_array(scores, (count, joints), "scores")
    outside = (scores < 0) | (scores > 1)  # a NaN score is a missing joint
    if outside.any():
        detection, joint = (int(index[0]) for index in np.nonzero(outside))
        raise ValueError(
            f"scores must lie in 0..1, got {scores[detection, joint]:.6g} for joint {skeleton.joints[joint]!r} of "
            f"detection {detection}; clip the heights of heat maps, take the sigmoid of logits, and give 0 for a "
            "missing joint"
        )
    detected = (scores >= _LEAST_SCORE) & (np.abs(keypoints) < _FARTHEST).all(axis=2)
    keypoints, scores = np.where(detected[:, :, None], keypoints, np.nan), np.where(detected, scores, 0.0)
    keypoints.flags.writeable = scores.flags.writeable = False
    return keypoints, scores


def _checked_skeleton(skeleton: Skeleton) -> Skeleton:
    if not isinstance(skeleton, Skeleton):
        raise ValueError(f"skeleton must be a Skeleton such as COCO17, got {type(skeleton).__name__}")
    return skeleton


def _skeleton_hint(skeleton: Skeleton, got: int) -> str:
    others = [other.name for other in (COCO17, SHELF14) if len(other) == got]
    fits = f"skeleton {others[0]!r} has {got}" if others else "pass the skeleton that the keypoints are of"
    return f"skeleton {skeleton.name!r} has {len(skeleton)} joints ({', '.join(skeleton.joints)}); {fits}"


def _spanning_boxes(keypoints: Floats) -> Floats:
    """Return boxes around the detected keypoints, (m, 4); zeros for a detection without any."""
    low = np.where(np.isnan(keypoints), np.inf, keypoints).min(axis=1)
    high = np.where(np.isnan(keypoints), -np.inf, keypoints).max(axis=1)
    with np.errstate(invalid="ignore"):
        boxes = np.concatenate([low, high - low], axis=1)
    return np.where(np.isfinite(low[:, :1]), boxes, 0.0)


def _mean_scores(scores: Floats) -> Floats:
    """Return the mean score of the detected keypoints, (m,); 0 for a detection without any."""
    return scores.sum(axis=1) / np.maximum((scores > 0).sum(axis=1), 1)


def _check_likelihoods(likelihoods: Heatmaps, shape: tuple[int, ...]) -> None:
    if not isinstance(likelihoods, Heatmaps):
        raise ValueError(f"likelihoods must be mvpose.heatmaps.Heatmaps, got {type(likelihoods).__name__}")
    if likelihoods.values.shape[:2] != shape:
        raise ValueError(
            f"heat maps must be {shape}, a row for each detection and a map for each joint of the skeleton, "
            f"got {likelihoods.values.shape[:2]}"
        )
