"""Cameras of an exported sequence, with names that loaders of Panoptic know."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mvpose import Rig
from mvpose.formats.calibration.panoptic import write_calibration

_HD = re.compile(r"00_\d\d")


def hd_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of HD cameras (00_00, 00_01, ...) in the order of the rig; existing names of this form are kept.

    So loaders that list Panoptic cameras by number (0 3, 0 6, ...) find them in a twin of a Panoptic sequence.
    """
    if all(map(_HD.fullmatch, names)):
        return tuple(names)
    return tuple(f"00_{view:02d}" for view in range(len(names)))


def renamed(rig: Rig, names: Sequence[str]) -> Rig:
    """Return the same cameras with other names."""
    return Rig([replace(camera, name=name) for camera, name in zip(rig, names, strict=True)])


def write_cameras(path: Path, rig: Rig, *, source: str) -> None:
    """Write a Panoptic calibration with ``panel`` and ``node``, by which loaders select cameras.

    Args:
        path: path of the JSON file.
        rig: cameras with names of HD cameras.
        source: value of ``calibDataSource``.
    """
    write_calibration(path, rig)
    entries = json.loads(path.read_text(encoding="utf-8"))["cameras"]
    for entry in entries:
        entry["panel"], entry["node"] = map(int, entry["name"].split("_"))
    text = json.dumps({"calibDataSource": source, "cameras": entries}, indent=1)
    path.write_text(text + "\n", encoding="utf-8")
