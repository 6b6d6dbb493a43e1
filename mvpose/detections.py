"""What a 2D detector says of one frame, in every view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array
from mvpose.skeleton import COCO17, Skeleton


@dataclass(frozen=True)
class Detections:
    """The 2D poses that a detector found in all views of one frame, as flat arrays of m detections.

    A keypoint that was not detected has score 0 and NaN coordinates; both are set where either is given.

    Attributes:
        view: index of the camera of each detection, (m,).
        keypoints: pixels, (m, J, 2).
        scores: confidence of each keypoint, 0 to 1, (m, J).
        boxes: x, y, width, height in pixels, (m, 4).
        box_scores: confidence of each box, 0 to 1, (m,).
        skeleton: the J joints.
        descriptors: appearance, (m, D), or None.

    Raises:
        ValueError: a wrong shape, a negative view, or scores outside 0..1.
    """

    view: NDArray[np.int64]
    keypoints: NDArray[np.float64]
    scores: NDArray[np.float64]
    boxes: NDArray[np.float64]
    box_scores: NDArray[np.float64]
    skeleton: Skeleton = COCO17
    descriptors: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        view = as_array(self.view, ("m",), "view", np.int64)
        count, joints = len(view), len(self.skeleton)
        keypoints = as_array(self.keypoints, (count, joints, 2), "keypoints").copy()
        scores = as_array(self.scores, (count, joints), "scores").copy()
        boxes = as_array(self.boxes, (count, 4), "boxes")
        box_scores = as_array(self.box_scores, (count,), "box_scores")
        if (view < 0).any():
            raise ValueError(f"view must be camera indices from 0, got {view.min()}")
        missing = ~(np.isfinite(keypoints).all(axis=2) & (scores > 0))  # a NaN score is missing too
        keypoints[missing] = np.nan
        scores[missing] = 0.0
        for name, values in (("scores", scores), ("box_scores", box_scores)):
            if not ((values >= 0) & (values <= 1)).all():
                raise ValueError(f"{name} must lie in 0..1, got {np.nanmin(values):.3g} to {np.nanmax(values):.3g}")
        keypoints.flags.writeable = scores.flags.writeable = False
        for key, value in (
            ("view", view),
            ("keypoints", keypoints),
            ("scores", scores),
            ("boxes", boxes),
            ("box_scores", box_scores),
        ):
            object.__setattr__(self, key, value)
        if self.descriptors is not None:
            object.__setattr__(self, "descriptors", as_array(self.descriptors, (count, "D"), "descriptors"))

    def __len__(self) -> int:
        return len(self.view)

    @property
    def detected(self) -> NDArray[np.bool_]:
        """Which keypoints were detected, (m, J)."""
        return self.scores > 0

    @classmethod
    def empty(cls, skeleton: Skeleton = COCO17) -> Self:
        """No detection in any view."""
        return cls.from_keypoints([], np.zeros((0, len(skeleton), 2)), np.zeros((0, len(skeleton))), skeleton=skeleton)

    @classmethod
    def from_keypoints(
        cls, view: ArrayLike, keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton = COCO17
    ) -> Self:
        """Detections without boxes of their own: the box spans the keypoints, its score is their mean score."""
        view = np.asarray(view, np.int64)
        keypoints, scores = np.asarray(keypoints, float), np.asarray(scores, float)
        boxes, box_scores = np.zeros((len(view), 4)), np.zeros(len(view))
        for k in range(len(view)):
            found = (scores[k] > 0) & np.isfinite(keypoints[k]).all(axis=1)
            if found.any():
                low, high = keypoints[k][found].min(axis=0), keypoints[k][found].max(axis=0)
                boxes[k] = *low, *(high - low)
                box_scores[k] = scores[k][found].mean()
        return cls(view, keypoints, scores, boxes, box_scores, skeleton)
