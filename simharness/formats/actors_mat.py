"""Truth of Shelf and Campus: ``actorsGT.mat``, a MATLAB 5 file (Belagiannis et al., CVPR 2014).

``actor3D`` holds a cell for each actor, in it one for each frame, from 0: an array of joints, metres, or an empty or
1 x 1 array where the actor is not annotated.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from simharness.formats.joint_tracks import JointTracks, TrackFiles
from simharness.runtime.archives import MOST
from simharness.runtime.input_files import megabytes, read_bytes
from simharness.runtime.message_text import one_line, shown

_JOINTS = 14
_HEADER, _TAG = 128, 8  # bytes
_EXTENTS, _ARRAY, _COMPRESSED = 5, 14, 15
"""Types of elements: the extents of an array (its second element), an array, and another element deflated."""
_WHAT = "the truth of Shelf or Campus: a MATLAB 5 file with actor3D, for each actor a cell of frames of joints x 3"


def read_tracks(files: TrackFiles) -> JointTracks:
    """Read the joints of all actors in all frames, (n, A, J, 3); J is 14 unless another skeleton is declared.

    Raises:
        ValueError: the file is missing, truncated, no MATLAB 5 file, or of another layout.
    """
    path = files.single()
    actors = _read_actors(path)
    count = len(files.skeleton) if files.skeleton is not None else _JOINTS
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
    return JointTracks(np.arange(len(joints)), joints)


def _read_actors(path: Path) -> list[np.ndarray]:
    """Return an array of cells of frames for each actor."""
    content = read_bytes(path, what=_WHAT)
    try:
        # All variables are read, so that truncation after actor3D is detected too.
        cells = loadmat(io.BytesIO(_inflated(content))).get("actor3D")
    except Exception as error:  # a truncated file raises many types of errors, for example zlib.error
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


def _inflated(content: bytes) -> bytes:
    """Return a MATLAB 5 file without compression, which bounds what reading it takes.

    Raises:
        ValueError: no MATLAB 5 file, a truncated one, or one that unpacks to more than ``MOST`` bytes.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[_HEADER - 2 : _HEADER])
    if not content.startswith(b"MATLAB 5.0") or order is None:
        raise ValueError("it does not begin as a MATLAB 5 file")
    parts, start, size = [content[:_HEADER]], _HEADER, _HEADER
    while start < len(content):
        if len(content) < start + _TAG:
            raise ValueError("its last element is cut off")
        kind, length = struct.unpack(f"{order}II", content[start : start + _TAG])
        end = start + _TAG + length
        if end > len(content):
            raise ValueError("its last element is cut off")
        if kind == _COMPRESSED:
            inflater = zlib.decompressobj()
            parts.append(inflater.decompress(content[start + _TAG : end], MOST - size + 1))
            if not inflater.eof and len(parts[-1]) <= MOST - size:
                raise ValueError("an element is damaged")
        else:
            parts.append(content[start:end])
        size += len(parts[-1])
        if size > MOST:
            raise ValueError(f"it unpacks to more than {megabytes(MOST)}")
        start = end
    inflated = b"".join(parts)
    _check_extents(inflated, order)
    return inflated


def _check_extents(content: bytes, order: str) -> None:
    """Check that no array declares more elements than it has bytes: memory for them is taken before they are read.

    Raises:
        ValueError: one does.
    """
    areas = [(_HEADER, len(content))]  # of elements beside each other: those of the file, and those of each array
    while areas:
        start, end = areas.pop()
        length, place = end - start, 0
        while start + _TAG <= end:
            kind, size = struct.unpack_from(f"{order}II", content, start)
            small = kind >> 16  # size of an element whose values are in the tag
            first = start + (4 if small else _TAG)
            kind, size = (kind & 0xFFFF, small) if small else (kind, size)
            if kind == _ARRAY:
                areas.append((first, min(first + size, end)))
            elif kind == _EXTENTS and place == 1:
                extents = struct.unpack_from(f"{order}{min(size, end - first) // 4}i", content, first)
                if math.prod(map(abs, extents)) > length:
                    raise ValueError(f"an array of {shown(extents)} has {length} bytes")
            start = start + _TAG if small else first + -(-size // 8) * 8
            place += 1


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
