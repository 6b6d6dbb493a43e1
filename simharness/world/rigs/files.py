"""A calibration file of the user's own as a rig: which format it is, its content says."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mvpose.camera import Rig
from simharness.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from simharness.formats.calibration.file_storage import read_storage
from simharness.formats.read_errors import read_bytes, read_json
from simharness.world.rigs.selection import select

_WHAT = "a calibration of VoxelPose or Panoptic (JSON), OpenCV or EasyMocap (YAML), or Pose2Sim (TOML)"


def read_rig(path: str | Path, *, size: tuple[int, int], only: Sequence[str] = ()) -> Rig:
    """Read a calibration of any known format.

    Args:
        path: the file; of formats in two files (EasyMocap, a stereo pair of OpenCV) either.
        size: width and height of the images in pixels, where the format does not carry them (VoxelPose, and some files
            of EasyMocap and OpenCV).
        only: names of the cameras to take, in this order; empty: all, of Panoptic's the HD cameras.

    Raises:
        ValueError: no such file, one of no known format, or what its reader finds wrong with it, each naming the file.
    """
    path = Path(path)
    kind = _kind(path)
    if kind is panoptic:
        rig = panoptic.read_calibration(path, types=() if only else ("hd",))
    elif kind is pose2sim:
        rig = pose2sim.read_calibration(path)
    else:
        rig = kind.read_calibration(path, size=size)
    try:
        return select(rig, only)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _kind(path: Path) -> Any:
    """The module that reads a file."""
    content = read_bytes(path, what=_WHAT)
    start = content.lstrip(b"\xef\xbb\xbf \t\r\n")[:5]
    if start[:1] == b"{":
        return _json_kind(path)
    if start == b"%YAML" or start == b"<?xml":
        values = read_storage(path, what=_WHAT)
        return easymocap if isinstance(values.get("names"), list) else opencv
    try:
        sections = tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        sections = {}
    if any(isinstance(entry, dict) and "matrix" in entry for entry in sections.values()):
        return pose2sim
    found = f"TOML with {_some(sections)}" if sections else f"a file that begins with {content[:16]!r}"
    raise ValueError(f"{path}: found {found}; expected {_WHAT}")


def _json_kind(path: Path) -> Any:
    entries = read_json(path, what=_WHAT)
    if isinstance(entries.get("cameras"), list):
        return panoptic
    if any(isinstance(entry, dict) and "fx" in entry for entry in entries.values()):
        return voxelpose
    raise ValueError(
        f"{path}: found JSON with {_some(entries)}; expected VoxelPose's object of cameras with fx, fy, cx, cy, R, T, "
        "k, p, or Panoptic's list 'cameras'"
    )


def _some(entries: dict[str, Any]) -> str:
    names = ", ".join(json.dumps(name) for name in list(entries)[:6])
    return f"the keys {names}{', ...' if len(entries) > 6 else ''}" if entries else "no keys"
