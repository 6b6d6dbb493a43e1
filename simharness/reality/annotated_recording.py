"""Recordings with annotated joints, recorded or simulated: the input of evaluation protocols."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import SHELF14, Detections, Rig
from mvpose.arrays import Floats
from mvpose.checks import as_array, set_arrays
from mvpose.heatmaps import Heatmaps

DetectorKind = Literal["bottom-up", "top-down"]
"""Kind of a 2D detector: joints first, grouped into people; or people first, and all joints of each."""


@dataclass(frozen=True)
class AnnotatedRecording:
    """Frames with detections, and joints of the people who are annotated in them.

    Raises:
        ValueError: shapes or numbers of frames that differ, frames that do not increase, detections in views that the
            rig does not have, a rate that is not positive, or actors that do not exist.
    """

    rig: Rig
    """The V cameras."""
    truth: NDArray[np.float64]
    """Annotated joints on SHELF14, (F, A, 14, 3), metres; NaN where an actor is not annotated."""
    detections: tuple[Detections, ...]
    """Detections in each of the F frames."""
    frames: NDArray[np.int64]
    """Numbers of the frames in the original sequence, (F,), increasing; gaps are allowed."""
    name: str = "recording"
    """Name of the recording in tables and files."""
    rate: float = 25.0
    """Frames of the original sequence per second, Hz."""
    actors: tuple[int, ...] | None = None
    """Indices of the actors whose PCP is averaged; None: all."""
    kind: DetectorKind = "bottom-up"
    """Kind of the detector."""

    def __post_init__(self) -> None:
        set_arrays(self, frames=(("F",), np.int64), truth=("F", "A", len(SHELF14), 3))
        object.__setattr__(self, "detections", tuple(self.detections))
        if len(self.detections) != len(self.frames):
            raise ValueError(f"expected detections of {len(self.frames)} frames, got {len(self.detections)}")
        if (np.diff(self.frames) <= 0).any():
            row = int(np.flatnonzero(np.diff(self.frames) <= 0)[0])
            raise ValueError(f"frames must increase, got {self.frames[row + 1]} after {self.frames[row]}")
        for frame, detections in zip(self.frames, self.detections, strict=True):
            if len(detections) and detections.view.max() >= len(self.rig):
                raise ValueError(
                    f"frame {frame}: expected detections in views below {len(self.rig)}, the number of cameras, "
                    f"got view {detections.view.max()}"
                )
        if not 0 < self.rate < np.inf:
            raise ValueError(f"rate must be above 0 Hz and finite, got {self.rate}")
        if self.actors is not None:
            object.__setattr__(self, "actors", tuple(int(actor) for actor in self.actors))
            if not self.actors or len(set(self.actors)) < len(self.actors):
                raise ValueError(f"actors must be one or more different indices, got {list(self.actors)}")
            if min(self.actors) < 0 or max(self.actors) >= self.people:
                raise ValueError(
                    f"actors must be indices from 0 to {self.people - 1}, of the {self.people} actors of the truth, "
                    f"got {list(self.actors)}"
                )

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def people(self) -> int:
        """Number of actors, A."""
        return self.truth.shape[1]

    @property
    def scored(self) -> tuple[int, ...]:
        """Indices of the actors whose PCP is averaged."""
        return tuple(range(self.people)) if self.actors is None else self.actors

    @property
    def time(self) -> Floats:
        """Times of the frames, (F,), seconds, from frame 0 of the original sequence."""
        return self.frames / self.rate

    @cached_property
    def timed_detections(self) -> tuple[Detections, ...]:
        """Detections of each frame with the time of each camera's picture; by default that of the frame."""
        return tuple(
            each if each.time is not None else replace(each, time=np.full(len(self.rig), time))
            for each, time in zip(self.detections, self.time, strict=True)
        )

    @property
    def segments(self) -> list[slice]:
        """Runs of frames without a gap in their numbers, as slices of rows, in order; together they are all rows."""
        bounds = [0, *(np.flatnonzero(np.diff(self.frames) > 1) + 1).tolist(), len(self)]
        return [slice(start, stop) for start, stop in itertools.pairwise(bounds) if start < stop]

    def subset(self, views: Sequence[int]) -> "AnnotatedRecording":
        """Return the recording of some of its cameras, in the given order, with the same truth.

        Detections of other cameras are left out, and views are renumbered. The order of the detections is kept.

        Args:
            views: indices of two or more cameras.

        Raises:
            ValueError: views that are repeated, do not exist, or make no rig.
        """
        views = [int(view) for view in views]
        if len(set(views)) < len(views) or not all(0 <= view < len(self.rig) for view in views):
            raise ValueError(f"views must be different indices from 0 to {len(self.rig) - 1}, got {views}")
        new = np.full(len(self.rig), -1)
        new[views] = np.arange(len(views))
        return replace(
            self,
            rig=Rig([self.rig[view] for view in views]),
            detections=tuple(_seen_by(detections, new) for detections in self.detections),
        )

    def during(self, rows: ArrayLike) -> "AnnotatedRecording":
        """Return the recording of some of its frames.

        Args:
            rows: mask of the frames, (F,), or increasing indices of rows, which count from 0 whatever the numbers of
                the frames are.

        Raises:
            ValueError: a mask of another length, or indices that do not exist or do not increase.
        """
        rows = np.asarray(rows)
        if rows.dtype == bool:
            rows = np.flatnonzero(as_array(rows, (len(self),), "mask of the frames", np.bool_))
        rows = as_array(rows if rows.size else np.zeros(0, int), ("F",), "rows", np.int64)
        if len(rows) and not (rows.min() >= 0 and rows.max() < len(self)):
            raise ValueError(f"rows must be from 0 to {len(self) - 1}, got {rows.min()} to {rows.max()}")
        return replace(
            self,
            truth=self.truth[rows],
            detections=tuple(self.detections[row] for row in rows),
            frames=self.frames[rows],
        )


def _seen_by(detections: Detections, new: NDArray[np.int64]) -> Detections:
    """Return the detections of cameras whose entry in ``new`` is their new index; -1: left out."""
    kept = new[detections.view] >= 0
    maps = detections.likelihoods
    return Detections(
        new[detections.view[kept]],
        detections.keypoints[kept],
        detections.scores[kept],
        detections.boxes[kept],
        detections.box_scores[kept],
        detections.skeleton,
        None if detections.descriptors is None else detections.descriptors[kept],
        None if maps is None else Heatmaps(maps.values[kept], maps.origin[kept], maps.stride[kept]),
        None if detections.time is None else detections.time[np.flatnonzero(new >= 0)[np.argsort(new[new >= 0])]],
    )
