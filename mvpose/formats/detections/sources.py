"""Sources of detections, folders with a file for each picture or files of all: found below paths, given to cameras."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mvpose.files.input_files import MIB, files_ending, natural_order
from mvpose.files.message_text import listed, one_line
from mvpose.formats.detections.detection_file import LONG_LIST, DetectionFile
from mvpose.formats.detections.detection_formats import formats_for, suffixes
from mvpose.formats.pose2sim_project import folder_names

POSES = ("pose-sync", "pose", "pose-2d", "predictions")
"""Names of the folders of Pose2Sim and MMPose that hold detections."""

_AFFIXES = re.compile(r"^(alphapose-results_|results_)|(_json|_keypoints|_predictions|_results|_detections)$")
_SETTINGS = MIB  # bytes
_KINDS = "OpenPose folders, COCO or AlphaPose results, MMPose predictions or RTMLib arrays (*.json, *.npz)"


@dataclass(frozen=True)
class Source:
    """Detections of one camera."""

    name: str
    """What the folder or file is called, without the usual affixes: "cam1" of ``cam1_json``."""
    path: Path
    """The folder of files for one picture each, or the file."""
    recognised: bool = True
    """Whether a file is of a known format of detections, and no file of settings."""


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
        place = Path(os.path.realpath(source.path))  # resolve() fails on loops of links
        if place in seen:
            raise ValueError(f"{one_line(str(source.path), 200)}: is given twice; give the detections of a camera once")
        seen[place] = source
    return sources


def _below(path: Path) -> list[Source]:
    name = one_line(str(path), 200)
    if not os.path.exists(path):
        raise ValueError(f"{name}: no such file or folder; expected detections: {_KINDS}")
    if not path.is_dir():
        if path.suffix.lower() not in suffixes():
            raise ValueError(f"{name}: expected detections, {_KINDS}; `mvpose detect` makes them of videos")
        return [_source(path)]
    files = files_ending(path, suffixes())
    if files:
        first = next(filter(_is_detections, files), files[0])
        if _is_of_one_picture(first):
            return [_source(path)]
        return [replace(_source(each), recognised=_is_detections(each)) for each in files]
    folders = sorted((each for each in path.iterdir() if each.is_dir()), key=natural_order)
    for inside in folder_names(path, "pose_folder_name", POSES):
        if path / inside in folders:
            return _below(path / inside)
    found = [_source(each) for each in folders if files_ending(each, suffixes())]
    if not found:
        has = "has neither" if any(path.iterdir()) else "is an empty folder"
        if folders:
            has = f"has the folders {listed([each.name for each in folders])} without such files"
        raise ValueError(f"{name}: {has}; expected *.json or *.npz, or a folder with these for each camera: {_KINDS}")
    return found


def _is_of_one_picture(path: Path) -> bool:
    """Return whether a file holds the people of one picture, so that its folder holds those of one camera."""
    file = DetectionFile(path)
    return path.stat().st_size <= LONG_LIST and any(each.of_picture(file) for each in formats_for(path))


def _is_detections(path: Path) -> bool:
    """Return whether a file may hold detections: files of settings beside them are small, and of no known format."""
    file = DetectionFile(path)
    try:
        return path.stat().st_size > _SETTINGS or any(each.recognises(file) for each in formats_for(path))
    except (OSError, ValueError):
        return True  # its reader says what is wrong


def _source(path: Path) -> Source:
    name = path.name if path.is_dir() else path.stem
    return Source(_AFFIXES.sub("", name) or name, path)


@dataclass(frozen=True)
class Assignment:
    """Source of each camera."""

    sources: tuple[Source, ...]
    """One for each camera, in the order of the rig."""
    by_name: bool
    """Whether names agree; False: the cameras and the sources have the same number only."""
    unused: tuple[Source, ...] = ()
    """Sources of no camera."""

    def text(self, cameras: Sequence[str]) -> str:
        """Return the assignment in one line, for a message."""
        pairs = listed([f"{camera} = {source.path.name}" for camera, source in zip(cameras, self.sources, strict=True)])
        unused = f"; not used: {listed([each.path.name for each in self.unused])}" if self.unused else ""
        how = "by name" if self.by_name else "in order, because their names differ (rename the files if this is wrong)"
        return f"detections of cameras, {how}: {pairs}{unused}"


def assign(
    cameras: Sequence[str], sources: Sequence[Source], *, what: str = "detections", option: str = "--cameras"
) -> Assignment:
    """Assign a source to each camera.

    Names count as equal if they are after the removal of upper case and punctuation; or if each contains the other's
    words ("cam1" and "int_cam1_img"), or the same only number ("camera 01" and "cam1"), and no other name fits.

    Args:
        cameras: names of the cameras.
        sources: what there is.
        what: what the sources hold, for messages.
        option: option or key that selects cameras, for messages.

    Raises:
        ValueError: two sources that fit one camera, a camera without source, or, where no name fits, another number of
            sources than of cameras.
    """
    if not sources:
        raise ValueError(f"no {what} for the cameras {listed(cameras)}; give a folder or file for each")
    for equal in (_same_name, _same_words, _same_number):
        fitting = [[k for k, source in enumerate(sources) if equal(camera, source.name)] for camera in cameras]
        for camera, found in zip(cameras, fitting, strict=True):
            if len(found) > 1 and equal is _same_name:
                twice = listed([str(sources[k].path) for k in found])
                raise ValueError(f"camera {camera!r} has {len(found)} sources of {what}, {twice}; give one of them")
        chosen = [found[0] for found in fitting if len(found) == 1]
        if len(chosen) == len(cameras) and len(set(chosen)) == len(chosen):
            rest = tuple(source for k, source in enumerate(sources) if k not in chosen)
            return Assignment(tuple(sources[k] for k in chosen), by_name=True, unused=rest)
    exact = [camera for camera in cameras if any(_same_name(camera, source.name) for source in sources)]
    names = listed([source.name for source in sources])
    if exact:
        lacking = listed([camera for camera in cameras if camera not in exact])
        raise ValueError(
            f"no {what} for the camera {lacking}: the {what} are called {names}; add them, rename them as the "
            f"cameras of the calibration, or select cameras: {option} {','.join(exact)}"
        )
    others = tuple(source for source in sources if not source.recognised)
    sources = [source for source in sources if source.recognised]
    if len(sources) != len(cameras):
        raise ValueError(
            f"the calibration has {len(cameras)} cameras, {listed(cameras)}, but there are {what} of "
            f"{len(sources)}, {names}; name folders or files as the cameras, or select cameras: {option} NAME,NAME"
        )
    return Assignment(tuple(sources), by_name=False, unused=others)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "", name.lower())


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-z0-9]+", name.lower()) if word]


def _same_name(camera: str, source: str) -> bool:
    return _plain(camera) == _plain(source)


def _same_words(camera: str, source: str) -> bool:
    one, other = set(_words(camera)), set(_words(source))
    return bool(one and other) and (one <= other or other <= one)


def _same_number(camera: str, source: str) -> bool:
    one, other = re.findall(r"\d+", camera), re.findall(r"\d+", source)
    return len(one) == len(other) == 1 and int(one[0]) == int(other[0])
