"""Shelf: four people assemble a shelf before five calibrated cameras (Belagiannis et al., CVPR 2014).

The folder holds ``calibration_shelf.json`` (VoxelPose's), ``actorsGT.mat`` (the published truth: 14 joints in
metres, each actor annotated in some frames only) and ``openpose/<camera>/<camera>_<k>_keypoints.json``
(OpenPose's detections; file k, written with 12 digits, belongs to frame 300 + k).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from mvpose import Detections, Rig
from mvpose.checks import as_array
from simharness.formats.calibration.voxelpose import read_calibration
from simharness.formats.openpose import read_frame
from simharness.formats.read_errors import read_bytes

SIZE = (1032, 776)
FRAMES = range(300, 600)  # the published test frames that have truth
ACTORS = 4
_FIRST_DETECTED = 300
_TRUTH = "Shelf's truth: a MATLAB 5 file with actor3D, 4 actors x 3200 frames of 14 x 3 metres"


@dataclass(frozen=True)
class Shelf:
    """Frames of the Shelf data set, or of another recording in its form.

    Attributes:
        rig: the cameras, five of them.
        truth: joints on SHELF14, (F, A, 14, 3), metres; NaN where the actor is not annotated.
        detections: what the 2D detector found in each of the F frames.
        frames: their indices in the published sequence, from 0, (F,).
        people: A, how many actors there are.
    """

    rig: Rig
    truth: NDArray[np.float64]
    detections: tuple[Detections, ...]
    frames: NDArray[np.int64]
    people: int = ACTORS

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", as_array(self.frames, ("F",), "frames", np.int64))
        object.__setattr__(self, "truth", as_array(self.truth, (len(self.frames), self.people, 14, 3), "truth"))
        object.__setattr__(self, "detections", tuple(self.detections))
        if len(self.detections) != len(self.frames):
            raise ValueError(f"expected detections of {len(self.frames)} frames, got {len(self.detections)}")

    def __len__(self) -> int:
        return len(self.frames)


def read_shelf(folder: str | Path, *, frames: range = FRAMES) -> Shelf:
    """Read Shelf from its published files, as they are.

    Args:
        folder: where they lie.
        frames: which frames, 0-based indices into the published sequence; detections exist for 300 to 600.

    Raises:
        ValueError: a file that is missing, cut off or not what it should be; the message names it and says
            how to mend it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(
            f"{folder}: no such folder; expected Shelf's calibration_shelf.json, actorsGT.mat and openpose/. "
            "Correct the path"
        )
    rig = read_calibration(folder / "calibration_shelf.json", size=SIZE)
    truth = read_truth(folder / "actorsGT.mat", frames=frames)
    detections = [
        read_frame(
            [
                folder / "openpose" / camera.name / f"{camera.name}_{frame - _FIRST_DETECTED:012d}_keypoints.json"
                for camera in rig
            ]
        )
        for frame in frames
    ]
    return Shelf(rig, truth, tuple(detections), np.array(frames))


def read_truth(path: str | Path, *, frames: range = FRAMES) -> NDArray[np.float64]:
    """Read the published joints of some frames, (F, 4, 14, 3), metres; NaN where not annotated.

    Raises:
        ValueError: the file is missing, cut off, no MATLAB 5 file, or of another layout.
    """
    path = Path(path)
    size = len(read_bytes(path, what=_TRUTH))
    try:
        cells = loadmat(path).get("actor3D")  # all variables, so that a cut behind actor3D shows too
    except Exception as error:  # a file that is cut off raises a dozen kinds, zlib.error among them
        raise ValueError(
            f"{path}: cannot be read as a MATLAB file ({error}; it has {size} bytes); expected {_TRUTH}. "
            "It was probably cut off: copy or download it again"
        ) from None
    if cells is None:
        raise ValueError(f"{path}: has no variable actor3D; expected {_TRUTH}")
    actors = _unwrap(cells).ravel()
    if actors.dtype != object or len(actors) != ACTORS:
        raise ValueError(f"{path}: actor3D must be cells of {ACTORS} actors, got {cells.dtype} {cells.shape}")
    truth = np.full((len(frames), ACTORS, 14, 3), np.nan)
    for actor, track in enumerate(actors):
        joints = _unwrap(track).ravel()
        if len(joints) <= max(frames, default=0):
            raise ValueError(f"{path}: actor {actor + 1} has {len(joints)} frames; expected more than {max(frames)}")
        for row, frame in enumerate(frames):
            pose = _unwrap(joints[frame])
            if pose.shape == (14, 3):
                truth[row, actor] = pose
            elif pose.size > 1:  # frames without annotation hold an empty or a 1 x 1 array
                raise ValueError(
                    f"{path}: actor {actor + 1}, frame {frame}: expected 14 x 3 joints or nothing, got {pose.shape}"
                )
    return truth


def _unwrap(cell: Any) -> np.ndarray:
    """Take off MATLAB cells that hold nothing but one other array."""
    cell = np.asarray(cell)
    while cell.dtype == object and cell.size == 1:
        cell = np.asarray(cell.item())
    return cell
