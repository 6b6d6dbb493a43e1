"""People in a NumPy archive (npz): ``joints`` (T, n, J, 3), metres, z up, NaN where absent.

``names`` (J,) are the names of the joints, ``frames`` (T,) the numbers of the frames, ``times`` (T,) their times in
seconds, or ``rate`` the frames per second; ``ids`` (n,) are the identities, ``scores`` (T, n, J) confidences, 0 to 1.
Only ``joints`` is needed: frames and people are then counted, and joints are those of a declared skeleton.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.checks import as_array
from mvpose.files.archives import arrays_of
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import prefixed
from mvpose.formats.joint_names import JointNames, skeleton_of
from mvpose.formats.people.people_files import Export, PeopleFiles
from mvpose.recording import People

_WHAT = (
    "a NumPy archive (npz) with joints (T, P, J, 3) in metres, names (J,), and frames (T,), times (T,) or rate in "
    "frames per second"
)


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the file."""
    people, content = export.people, io.BytesIO()
    np.savez_compressed(
        content,
        joints=people.joints @ export.axes("z").T,
        names=np.array(people.skeleton.joints),
        frames=people.numbers,
        times=people.times,
        ids=people.ids,
        scores=people.scores,
    )
    yield "people.npz", content.getvalue()


def read(files: PeopleFiles) -> People:
    """Read the people of a file.

    Raises:
        ValueError: the file is missing or no such archive, its arrays do not fit, or it does not name its joints and no
            skeleton is declared.
    """
    path = files.single()
    content = read_bytes(path, what=_WHAT)
    try:
        arrays = arrays_of(content, only=("joints", "names", "frames", "times", "rate", "ids", "scores"))
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read ({error}); expected {_WHAT}: write it again") from None
    if "joints" not in arrays:
        raise ValueError(f"{path}: has no array 'joints'; expected {_WHAT}: add it")
    with prefixed(path, f"; expected {_WHAT}"):
        return _people(path, arrays, files)


def _people(path: Path, arrays: dict[str, Any], files: PeopleFiles) -> People:
    joints = as_array(arrays["joints"], ("T", "P", "J", 3), "joints")
    joints = np.where(np.isfinite(joints), joints, np.nan)
    frames, rate = arrays.get("frames"), arrays.get("rate")
    if rate is not None and (rate.dtype.kind not in "fiu" or rate.size != 1 or not 0 < rate.item() < np.inf):
        raise ValueError(f"rate must be one positive number of frames per second, got {rate}: correct it")
    numbers = np.arange(len(joints)) if frames is None else as_array(frames, ("T",), "frames", np.int64)
    names = files.skeleton
    if "names" in arrays:
        names = JointNames(path.name, tuple(str(name) for name in arrays["names"].ravel()))
    if names is None:
        raise ValueError("the file does not name its joints; give skeleton the names: { joints = [...] }")
    if len(names) != joints.shape[2]:
        raise ValueError(f"has {joints.shape[2]} joints, but skeleton {names.name} has {len(names)}; correct the names")
    return People(
        files.times(numbers, arrays.get("times"), rate=None if rate is None else float(rate.item())),
        arrays.get("ids", np.arange(joints.shape[1])),
        joints @ files.axes("z").T,
        arrays.get("scores", np.ones(())),
        skeleton=skeleton_of(names),
        numbers=files.renumbered(numbers, counted=frames is None),
    )
