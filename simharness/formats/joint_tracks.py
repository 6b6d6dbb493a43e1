"""Joints of people over time, as files of many formats hold them, and what a reader of such files is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.formats.joint_names import JointNames

UP = {"z": np.eye(3), "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])}
"""Axes of files in ours, (3, 3): ours = UP @ theirs. With y up, x of the file is our y, as in OpenSim and Pose2Sim."""

METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001, "inches": 0.0254, "in": 0.0254}
"""Metres per unit of length, by the name of the unit in files."""


@dataclass(frozen=True)
class JointTracks:
    """Joints of people over time.

    Attributes:
        frames: number of each frame, (n,), increasing.
        joints: (n, P, J, 3), metres, z up; NaN where undefined.
        names: names of the J joints in the file; None: the file does not name them.
        people: number of each person in the file, (P,).
        counted: whether ``frames`` only counts the rows of the file, from 0 or 1, because it has no other numbers.

    Raises:
        ValueError: shapes that do not fit, or frames that do not increase.
    """

    frames: NDArray[np.int64]
    joints: Floats
    names: tuple[str, ...] | None = None
    people: tuple[int, ...] = ()
    counted: bool = False

    def __post_init__(self) -> None:
        frames = as_array(self.frames, ("n",), "frames", np.int64)
        joints = as_array(self.joints, (len(frames), "P", "J", 3), "joints")
        if (np.diff(frames) <= 0).any():
            raise ValueError(f"frame numbers must increase, got {frames[:-1][np.diff(frames) <= 0][0]} before others")
        if self.names is not None and len(self.names) != joints.shape[2]:
            raise ValueError(f"expected {joints.shape[2]} joint names, got {len(self.names)}")
        object.__setattr__(self, "frames", frames)
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "people", tuple(self.people) or tuple(range(joints.shape[1])))

    def numbered(self, first: int) -> JointTracks:
        """Return the tracks with ``first`` as the number of the first frame."""
        shift = first - int(self.frames[0]) if len(self.frames) else 0
        return replace(self, frames=self.frames + shift, counted=False)

    def at(self, frames: Sequence[int] | NDArray[np.int64]) -> Floats:
        """Return the joints in some frames, (F, P, J, 3); NaN in frames that the tracks do not have."""
        frames = np.asarray(frames, np.int64)
        result = np.full((len(frames), *self.joints.shape[1:]), np.nan)
        if len(self.frames):
            rows = np.minimum(np.searchsorted(self.frames, frames), len(self.frames) - 1)
            present = self.frames[rows] == frames
            result[present] = self.joints[rows[present]]
        return result


@dataclass(frozen=True)
class TrackFiles:
    """Files of joints, and what is known about them.

    Attributes:
        paths: one or more files (or folders); of formats that hold one person, one for each person.
        frames: numbers of the requested frames, (F,); a reader may leave out others.
        skeleton: declared skeleton; None: the default of the format.
        up: axis that points up in files whose format does not say it.
    """

    paths: tuple[Path, ...]
    frames: NDArray[np.int64]
    skeleton: JointNames | None = None
    up: Literal["z", "y"] = "z"

    def single(self) -> Path:
        """Return the path of a format that holds all people in one file.

        Raises:
            ValueError: several files.
        """
        if len(self.paths) != 1:
            raise ValueError(f"{self.paths[1]}: expected one file, which holds all people, got {len(self.paths)}")
        return self.paths[0]


class ReadTracks(Protocol):
    """Reader of a format."""

    def __call__(self, files: TrackFiles) -> JointTracks:
        """Read the joints of all people.

        Raises:
            ValueError: anything wrong with a file; the message names it.
        """


def joined(tracks: Sequence[JointTracks], paths: Sequence[Path]) -> JointTracks:
    """Return the people of several tracks side by side, in all frames of any of them.

    Raises:
        ValueError: tracks of different joints.
    """
    first = tracks[0]
    for each, path in zip(tracks, paths, strict=True):
        if each.names != first.names:
            raise ValueError(
                f"{path}: expected the markers of {paths[0].name}, {', '.join(first.names or ())}; "
                f"got {', '.join(each.names or ())}"
            )
    frames = np.unique(np.concatenate([each.frames for each in tracks]))
    joints = np.concatenate([each.at(frames) for each in tracks], axis=1)
    return JointTracks(frames, joints, first.names, counted=all(each.counted for each in tracks))
