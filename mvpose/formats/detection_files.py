"""What a reader of detections is given: files, cameras, frames and skeleton."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections
from mvpose.formats.joint_names import JointNames


@dataclass(frozen=True)
class DetectionFiles:
    """Files of detections, and what is requested of them.

    Attributes:
        path: folder of the detections of all cameras.
        cameras: names of the V cameras, in the order of the rig.
        frames: numbers of the requested frames, (F,), increasing.
        first: number of the frame of the first file of a camera, for formats whose files have no frame numbers.
        skeleton: declared skeleton; None: the default of the format.
    """

    path: Path
    cameras: tuple[str, ...]
    frames: NDArray[np.int64]
    first: int = 0
    skeleton: JointNames | None = None


class ReadDetections(Protocol):
    """Reader of a format."""

    def __call__(self, files: DetectionFiles) -> tuple[Detections, ...]:
        """Read the detections of every requested frame, on COCO17.

        Raises:
            ValueError: anything wrong with a file; the message names it.
        """
