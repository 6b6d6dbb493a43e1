"""Detections of the latest pictures that belong to nobody: partners for those of cameras that deliver at other times.

Where cameras run freely, or pictures are lost, no frame may show somebody new to two cameras at once. So a detection
that no track claims waits a moment for the picture of another camera.
"""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.skeleton import Skeleton

_AGE = 0.1  # seconds: a person walks 0.13 m in it; rays that are further apart do not match
_FIELDS = ("view", "keypoints", "scores", "boxes", "box_scores")


class RecentPictures:
    """When each camera took its latest picture, and the detections in it that belong to nobody.

    Attributes:
        latest: time of the latest picture of each camera, (V,), seconds; -inf before the first.
        rows: the detections that wait, as arrays of k rows: the fields of :class:`mvpose.Detections` without heat maps,
            and ``time``, the time of the picture, seconds. Descriptors of length 0 stand for none.
    """

    def __init__(self, cameras: int, joints: int) -> None:
        self.latest = np.full(cameras, -np.inf)
        self.rows: dict[str, NDArray[Any]] = {
            "view": np.empty(0, np.int64),
            "keypoints": np.empty((0, joints, 2)),
            "scores": np.empty((0, joints)),
            "boxes": np.empty((0, 4)),
            "box_scores": np.empty(0),
            "descriptors": np.empty((0, 0)),
            "time": np.empty(0),
        }

    def take(self, now: float, lead: Floats, pictures: Bools) -> Floats:
        """Take the pictures of a frame; return the time since the previous one of each camera, (V,), seconds.

        The time is infinite for the first picture of a camera, and 0 for a camera without a picture.

        Args:
            now: time of the frame, seconds.
            lead: time from the frame to the picture of each camera, (V,), seconds.
            pictures: whether each camera gave a picture, (V,).
        """
        return _take(self.latest, now, lead, pictures)

    def wait_for(self, now: float, pictures: Bools) -> int:
        """Forget detections of cameras that have a picture now, and old ones; return how many still wait.

        Args:
            now: seconds.
            pictures: whether each camera has a picture now, (V,).
        """
        if len(self.rows["time"]):
            self.drop(pictures[self.rows["view"]] | (self.rows["time"] < now - _AGE))
        return len(self.rows["time"])

    def drop(self, which: Bools) -> None:
        """Forget some of those who wait, (k,)."""
        if which.any():
            self.rows = {name: array[~which] for name, array in self.rows.items()}

    def add(self, detections: Detections, unclaimed: Bools) -> None:
        """Let detections (m,) of this frame wait."""
        if not unclaimed.any():
            return
        new = {name: getattr(detections, name)[unclaimed] for name in _FIELDS}
        given = detections.descriptors
        new["descriptors"] = np.empty((len(new["view"]), 0)) if given is None else given[unclaimed]
        new["time"] = self.latest[new["view"]]
        if len(self.rows["time"]):
            if self.rows["descriptors"].shape[1] != new["descriptors"].shape[1]:  # only some have descriptors: none do
                new["descriptors"] = np.empty((len(new["view"]), 0))
                self.rows["descriptors"] = np.empty((len(self.rows["time"]), 0))
            new = {name: np.concatenate([self.rows[name], array]) for name, array in new.items()}
        self.rows = new

    def beside(self, detections: Detections, skeleton: Skeleton) -> Detections:
        """Return detections followed by those who wait; with descriptors only if all have them."""
        described = detections.descriptors
        if described is not None and described.shape[1] == self.rows["descriptors"].shape[1]:
            described = np.concatenate([described, self.rows["descriptors"]])
        else:
            described = None
        view, keypoints, scores, boxes, box_scores = (
            np.concatenate([getattr(detections, name), self.rows[name]]) for name in _FIELDS
        )
        return Detections(view, keypoints, scores, boxes, box_scores, skeleton, described)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, for :meth:`restored`."""
        return {"latest": self.latest, **self.rows}

    @classmethod
    def restored(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Return what was saved as arrays by :meth:`state`."""
        recent = cls(len(arrays["latest"]), arrays["scores"].shape[1])
        recent.latest = arrays["latest"].copy()
        recent.rows = {name: arrays[name].copy() for name in recent.rows}
        return recent


@njit(cache=True)
def _take(latest, now, lead, pictures):
    since = np.zeros(len(latest))
    for v in range(len(latest)):
        if pictures[v]:
            since[v] = max(now + lead[v] - latest[v], 0.0)
            latest[v] = max(now + lead[v], latest[v])
    return since
