"""Search for the detections of each camera: a folder with a file for each picture, or one file for all pictures."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mvpose.files.input_files import read_json
from mvpose.files.message_text import listed, one_line
from mvpose.formats.openpose import natural_order

SUFFIXES = (".json", ".npz")
"""Endings of files of detections."""

_INSIDE = ("pose-sync", "pose", "predictions")  # folders of Pose2Sim's and MMPose's layouts that hold the detections
_AFFIXES = re.compile(r"^(alphapose-results_|results_)|(_json|_keypoints|_predictions|_results|_detections)$")
_KINDS = "OpenPose folders, COCO or AlphaPose results, MMPose predictions or RTMLib arrays (*.json, *.npz)"


@dataclass(frozen=True)
class Source:
    """Detections of one camera.

    Attributes:
        name: what the folder or file is called, without the usual affixes: "cam1" of ``cam1_json``.
        path: the folder of files for one picture each, or the file.
    """

    name: str
    path: Path


def find_sources(paths: Sequence[Path]) -> list[Source]:
    """Return the detections of every camera below some paths.

    Args:
        paths: for each camera a folder or a file; or one folder that holds these, as ``pose`` of a Pose2Sim project,
            or the project itself.

    Returns:
        In the given order; those of one folder sorted by name, numbers by value.

    Raises:
        ValueError: a path that does not exist, holds no detections, or is given twice.
    """
    sources = [source for path in paths for source in _below(path)]
    seen: dict[Path, Source] = {}
    for source in sources:
        place = source.path.resolve()
        if place in seen:
            raise ValueError(f"{one_line(str(source.path), 200)}: is given twice; give the detections of a camera once")
        seen[place] = source
    return sources


def _below(path: Path) -> list[Source]:
    name = one_line(str(path), 200)
    if not os.path.exists(path):
        raise ValueError(f"{name}: no such file or folder; expected detections: {_KINDS}")
    if not path.is_dir():
        if path.suffix.lower() not in SUFFIXES:
            raise ValueError(f"{name}: expected detections, {_KINDS}; `mvpose detect` makes them of videos")
        return [_source(path)]
    files = _files(path)
    if files:
        return [_source(path)] if _is_of_one_picture(files[0]) else [_source(each) for each in files]
    folders = sorted((each for each in path.iterdir() if each.is_dir()), key=natural_order)
    for inside in _INSIDE:
        if path / inside in folders:
            return _below(path / inside)
    found = [_source(each) for each in folders if _files(each)]
    if not found:
        has = "has neither" if any(path.iterdir()) else "is an empty folder"
        if folders:
            has = f"has the folders {listed([each.name for each in folders])} without such files"
        raise ValueError(f"{name}: {has}; expected *.json or *.npz, or a folder with these for each camera: {_KINDS}")
    return found


def _files(folder: Path) -> list[Path]:
    return sorted((each for each in folder.iterdir() if each.suffix.lower() in SUFFIXES), key=natural_order)


def _is_of_one_picture(file: Path) -> bool:
    """Return whether a file holds the people of one picture, so that its folder holds those of one camera."""
    if file.suffix.lower() != ".json":
        return False
    content = read_json(file, what=f"detections: {_KINDS}")
    if isinstance(content, dict):
        return "people" in content or "instances" in content
    return (
        isinstance(content, list) and bool(content) and isinstance(content[0], dict) and "keypoint_scores" in content[0]
    )


def _source(path: Path) -> Source:
    name = path.name if path.is_dir() else path.stem
    return Source(_AFFIXES.sub("", name) or name, path)
