"""Joints of people in a NumPy archive (npz): ``joints`` (T, P, J, 3), metres, z up, with ``names`` and ``frames``.

``names`` (J,) are the names of the joints and ``frames`` (T,) the numbers of the frames. Undefined joints are NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose.files.archives import arrays_of
from mvpose.files.input_files import read_bytes
from simharness.formats.joint_tracks import UP, JointTracks, TrackFiles

_WHAT = "a NumPy archive with joints (T, P, J, 3) in metres, names (J,) and frames (T,)"


def read_tracks(files: TrackFiles) -> JointTracks:
    """Read the joints of all people, (T, P, J, 3). Without ``frames`` the rows are counted, without ``names`` unnamed.

    Raises:
        ValueError: the file is missing or no such archive, or its arrays do not fit.
    """
    path = files.single()
    content = read_bytes(path, what=_WHAT)
    try:
        arrays = arrays_of(content, only=("joints", "names", "frames"))
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read ({error}); expected {_WHAT}") from None
    if "joints" not in arrays:
        raise ValueError(f"{path}: has no array joints; expected {_WHAT}")
    joints, names, frames = (arrays.get(key) for key in ("joints", "names", "frames"))
    assert joints is not None
    try:
        return JointTracks(
            np.arange(len(joints)) if frames is None else frames,
            np.asarray(joints, float) @ UP[files.up].T,
            None if names is None else tuple(str(name) for name in names.ravel()),
            counted=frames is None,
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}; expected {_WHAT}") from None


def write_tracks(path: Path, joints: ArrayLike, *, names: Sequence[str], frames: ArrayLike) -> None:
    """Write joints (T, P, J, 3), metres, z up, with the names of the J joints and the numbers of the T frames."""
    tracks = JointTracks(np.asarray(frames), np.asarray(joints, float), tuple(names))
    np.savez_compressed(path, joints=tracks.joints, names=np.array(names), frames=tracks.frames)
