"""Truth of Shelf and Campus: ``actorsGT.mat``, a MATLAB 5 file (Belagiannis et al., CVPR 2014).

``actor3D`` holds a cell for each actor, in it one for each frame, from 0: an array of joints, metres, or an empty or
1 x 1 array where the actor is not annotated.
"""

from pathlib import Path
from typing import Any

import numpy as np

from mvpose.files.archives import MOST
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line, prefixed
from mvpose.formats.joint_names import KNOWN, skeleton_of
from mvpose.formats.people.matlab5 import read_variable
from mvpose.formats.people.people_files import PeopleFiles
from mvpose.recording import People

_WHAT = "the truth of Shelf or Campus: a MATLAB 5 file with actor3D, for each actor a cell of frames of joints x 3"


def read(files: PeopleFiles) -> People:
    """Read the joints of all actors in all frames; those of SHELF14 unless another skeleton is declared.

    Raises:
        ValueError: the file is missing, truncated, no MATLAB 5 file, or of another layout.
    """
    path = files.single()
    actors = _read_actors(path)
    names = files.skeleton or KNOWN["shelf14"]
    count = len(names)
    frames = max(map(len, actors))
    if frames * len(actors) * count * 24 > MOST:
        raise ValueError(f"{path}: {frames} frames of {len(actors)} actors are too many; expected {_WHAT}")
    joints = np.full((frames, len(actors), count, 3), np.nan)
    for actor, track in enumerate(actors):
        for frame, cell in enumerate(track):
            pose = _unwrap(cell)
            if pose.shape == (count, 3) and pose.dtype.kind in "fiu":
                joints[frame, actor] = pose
            elif pose.size > 1:
                raise ValueError(
                    f"{path}: actor {actor + 1}, frame {frame}: expected {count} x 3 joints or nothing, got "
                    f"{pose.shape}"
                )
    numbers = np.arange(frames)
    with prefixed(path):
        return People(files.times(numbers), np.arange(len(actors)), joints, skeleton=skeleton_of(names))


def _read_actors(path: Path) -> list[np.ndarray]:
    """Return an array of cells of frames for each actor."""
    content = read_bytes(path, what=_WHAT)
    try:
        cells = read_variable(content, "actor3D")
    except ValueError as error:
        raise ValueError(
            f"{path}: cannot be read as a MATLAB file ({one_line(str(error), 160)}; it has {len(content)} bytes); "
            f"expected {_WHAT}. It was probably cut off: copy or download it again"
        ) from None
    if cells is None:
        raise ValueError(f"{path}: has no variable actor3D; expected {_WHAT}")
    actors = _unwrap(cells).ravel()
    if actors.dtype != object or not len(actors):
        raise ValueError(f"{path}: actor3D must be cells of actors, got {cells.dtype} {cells.shape}")
    if all(_unwrap(each).dtype != object for each in actors):
        actors = _one_actor(actors)
    return [track.ravel() for track in map(_unwrap, actors)]


def _one_actor(frames: np.ndarray) -> np.ndarray:
    """Return the cell of the only actor, given its frames, to which :func:`_unwrap` has gone down."""
    actor = np.empty(1, object)
    actor[0] = frames
    return actor


def _unwrap(cell: Any) -> np.ndarray:
    """Unwrap MATLAB cells that contain only one other array."""
    cell = np.asarray(cell)
    while cell.dtype == object and cell.size == 1:
        cell = np.asarray(cell.item())
    return cell
