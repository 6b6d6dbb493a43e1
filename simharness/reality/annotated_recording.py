"""Recordings with annotated joints, recorded or simulated: the input of evaluation protocols."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import SHELF14, Detections, Rig
from mvpose.checks import as_array


@dataclass(frozen=True)
class AnnotatedRecording:
    """Frames with detections, and joints of the people who are annotated in them.

    Attributes:
        rig: the cameras.
        truth: annotated joints on SHELF14, (F, A, 14, 3), metres; NaN where an actor is not annotated.
        detections: detections in each of the F frames.
        frames: indices of the frames in the original sequence, from 0, (F,).

    Raises:
        ValueError: shapes or numbers of frames that differ.
    """

    rig: Rig
    truth: NDArray[np.float64]
    detections: tuple[Detections, ...]
    frames: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", as_array(self.frames, ("F",), "frames", np.int64))
        object.__setattr__(self, "truth", as_array(self.truth, (len(self.frames), "A", len(SHELF14), 3), "truth"))
        object.__setattr__(self, "detections", tuple(self.detections))
        if len(self.detections) != len(self.frames):
            raise ValueError(f"expected detections of {len(self.frames)} frames, got {len(self.detections)}")

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def people(self) -> int:
        """Number of actors, A."""
        return self.truth.shape[1]
