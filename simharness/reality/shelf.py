"""Reader of the Shelf data set: four people assemble a shelf in front of five cameras (Belagiannis et al., CVPR 2014).

The folder holds ``calibration_shelf.json`` (from VoxelPose), ``actorsGT.mat`` (the published truth: 14 joints in
metres, each actor annotated in some frames only) and ``openpose/<camera>/<camera>_<k>_keypoints.json`` (detections of
OpenPose; file k, written with 12 digits, belongs to frame 300 + k).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from simharness.formats.calibration.voxelpose import read_calibration
from simharness.formats.openpose import read_frame
from simharness.formats.read_errors import read_bytes
from simharness.reality.annotated_recording import AnnotatedRecording

SIZE = (1032, 776)
"""Width and height of the pictures, pixels."""

FRAMES = range(300, 600)
"""Published test frames with truth."""

ACTORS = 4
"""Number of actors."""

_FIRST_DETECTED = 300
_TRUTH = "Shelf's truth: a MATLAB 5 file with actor3D, 4 actors x 3200 frames of 14 x 3 metres"


def read_shelf(folder: str | Path, *, frames: range = FRAMES) -> AnnotatedRecording:
    """Read Shelf from its published files.

    Args:
        folder: folder of the files.
        frames: frames to read, 0-based indices into the published sequence; detections exist for 300 to 600.

    Raises:
        ValueError: a file that is missing, truncated or of another format; the message names the file and the remedy.
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
    return AnnotatedRecording(rig, truth, tuple(detections), np.array(frames))


def read_truth(path: str | Path, *, frames: range = FRAMES) -> NDArray[np.float64]:
    """Read the published joints of some frames, (F, 4, 14, 3), metres; NaN where not annotated.

    Raises:
        ValueError: the file is missing, truncated, no MATLAB 5 file, or of another layout.
    """
    path = Path(path)
    size = len(read_bytes(path, what=_TRUTH))
    try:
        cells = loadmat(path).get("actor3D")  # reads all variables, so that truncation after actor3D is detected too
    except Exception as error:  # a truncated file raises many types of errors, for example zlib.error
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
    """Unwrap MATLAB cells that contain only one other array."""
    cell = np.asarray(cell)
    while cell.dtype == object and cell.size == 1:
        cell = np.asarray(cell.item())
    return cell
