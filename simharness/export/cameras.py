"""The cameras of an exported sequence, by names that loaders of Panoptic know."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mvpose import Rig
from simharness.formats.calibration.panoptic import write_calibration

_HD = re.compile(r"00_\d\d")


def hd_names(names: Sequence[str]) -> tuple[str, ...]:
    """Names of HD cameras, 00_00 and on, in the order of the rig; those that already have such names keep them.

    So the sets of Panoptic cameras that loaders list (0 3, 0 6, ...) are found in a twin of theirs.
    """
    if all(map(_HD.fullmatch, names)):
        return tuple(names)
    return tuple(f"00_{view:02d}" for view in range(len(names)))


def renamed(rig: Rig, names: Sequence[str]) -> Rig:
    """The same cameras by other names."""
    return Rig([replace(camera, name=name) for camera, name in zip(rig, names, strict=True)])


def write_cameras(path: Path, rig: Rig, *, source: str) -> None:
    """Write a Panoptic calibration with all that loaders look for: they choose cameras by ``panel`` and ``node``.

    Args:
        path: the JSON file.
        rig: cameras by names of HD cameras.
        source: what ``calibDataSource`` says.
    """
    write_calibration(path, rig)
    entries = json.loads(path.read_text(encoding="utf-8"))["cameras"]
    for entry in entries:
        entry["panel"], entry["node"] = map(int, entry["name"].split("_"))
    text = json.dumps({"calibDataSource": source, "cameras": entries}, indent=1)
    path.write_text(text + "\n", encoding="utf-8")
