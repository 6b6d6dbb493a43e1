"""Calibrations in a folder: one file for each camera, whose name is that of the file, or one file of all cameras.

A file of one camera holds its values (:mod:`.camera_entry`): YAML, XML or JSON of OpenCV's FileStorage, plain JSON,
or TOML; there may be two files, of intrinsics and extrinsics: ``cam1_intrinsics.yml`` and ``cam1_extrinsics.yml``.
Cameras of the Panoptic Studio are known by their keys (:data:`.panoptic.OWN`), and are in centimetres.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mvpose import Rig
from mvpose.files.input_files import natural_order
from mvpose.files.message_text import listed, prefixed, shown
from mvpose.formats.calibration.calibration_file import CalibrationFile
from mvpose.formats.calibration.camera_entry import is_camera, read_camera
from mvpose.formats.calibration.colmap import CAMERAS, IMAGES
from mvpose.formats.calibration.opencv import values_of, write_values
from mvpose.formats.calibration.panoptic import OWN, read_entry
from mvpose.formats.pose2sim_project import FILE, folder_names, project_tables

SUFFIXES = (".json", ".yml", ".yaml", ".xml", ".toml")
"""Endings of calibration files."""

_PARTS = re.compile(
    r"[-_ .]*(intrinsics?|extrinsics?|intri|extri|calibration|calib|params?|parameters)$", re.IGNORECASE
)
_QUALISYS = ".qca.txt"
_WHAT = "a folder of calibrations: a file for each camera, or one file of all cameras"


def only_file(folder: Path) -> Path | None:
    """Return the file of all cameras in a folder, in the folder ``calibration`` within it (of Pose2Sim) as well.

    Returns:
        The file; of EasyMocap's and COLMAP's two that of the intrinsics; None where there is a file for each camera.

    Raises:
        ValueError: no calibration, or several of all cameras.
    """
    files = _files(folder)
    inside = _inside(folder)
    if inside and _files(inside):
        return only_file(inside) or inside
    if not files:
        raise ValueError(f"{folder}: has no {', '.join(f'*{each}' for each in SUFFIXES)}; expected {_WHAT}")
    for file in files:
        if file.name.startswith("intri.") and any(each.name.startswith("extri.") for each in files):
            return file
        if file.name == CAMERAS:
            return file
    return files[0] if len(files) == 1 else None


def calibration_files(folder: Path) -> list[Path]:
    """Return the files that a reader of a folder may read, also those of the folder ``calibration`` within it."""
    inside = _inside(folder)
    return _files(folder) + (_files(inside) if inside else [])


def read_folder(folder: Path, *, size: tuple[int, int], only: Sequence[str]) -> Rig:
    """Read a folder with a file for each camera.

    Args:
        folder: the folder.
        size: width and height of the images in pixels, for files that do not hold them.
        only: names of the requested cameras; empty: all.

    Raises:
        ValueError: a file that is none of a single camera, or a fault of one.
    """
    entries = _entries(folder)
    with prefixed(folder):
        return Rig(
            [
                read_entry(name, {"name": name, **entry}) if entry.keys() >= OWN else read_camera(name, entry, size)
                for name, entry in entries.items()
                if not only or name in only
            ]
        )


def unit_of(folder: Path) -> str:
    """Return the unit that the files of a folder are known to have; "" where they are of no program with one."""
    return "cm" if any(entry.keys() >= OWN for entry in _entries(folder).values()) else ""


def _entries(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the values of each camera, by its name."""
    entries: dict[str, dict[str, Any]] = {}
    for file in _files(folder):
        values = _camera_values(file)
        name = _PARTS.sub("", file.stem) or file.stem
        both = entries.setdefault(name, {})
        twice = [key for key in values if key in both and not isinstance(values[key], dict | str)]
        if twice:
            raise ValueError(f"{file}: two files of the camera {name!r} have {shown(twice[0])}; remove one of them")
        both |= values
    return entries


def write_folder(folder: Path, rig: Rig, *, suffix: str) -> None:
    """Write a file for each camera, readable by OpenCV.

    Raises:
        ValueError: names of cameras that cannot be those of files.
    """
    for camera in rig:
        if not camera.name or "/" in camera.name:
            raise ValueError(f"camera {camera.name!r}: its name cannot be that of a file")
        write_values(folder / f"{camera.name}{suffix}", camera)


def suffix_of(folder: Path) -> str:
    """Return the ending of the files of a folder that FileStorage writes, ``.yml`` for others."""
    suffix = _files(folder)[0].suffix.lower()
    return suffix if suffix in (".json", ".yml", ".yaml", ".xml") else ".yml"


def _files(folder: Path) -> list[Path]:
    there = [each for each in folder.iterdir() if not each.name.startswith(".")]
    found = [each for each in there if each.suffix.lower() in SUFFIXES]
    found = found or [each for each in there if each.name.lower().endswith(_QUALISYS)]  # else converted from these
    found = found or [each for each in there if each.name in (CAMERAS, IMAGES)]
    settings = [folder / FILE] if folder / FILE in found and project_tables(folder) else []
    return sorted((each for each in found if each not in settings), key=natural_order)


def _inside(folder: Path) -> Path | None:
    """Return the folder of a project of Pose2Sim in which the calibration lies; None without one."""
    names = folder_names(folder, "calib_folder_name", ("calibration", "Calibration", "calib-2d"))
    return next((folder / name for name in names if (folder / name).is_dir()), None)


def _camera_values(file: Path) -> dict[str, Any]:
    """Return the values of the camera in a file: at its top, or in its only map."""
    values = values_of(CalibrationFile(file, _WHAT))
    inner = [each for each in values.values() if is_camera(each, placed=True)]
    if len(inner) > 1 or isinstance(values.get("cameras"), list):
        raise ValueError(f"{file}: holds several cameras, beside other files; give the file itself as the calibration")
    if inner:
        return dict(inner[0])
    if not values:
        raise ValueError(f"{file}: holds no values of a camera; expected {listed(['K', 'dist', 'R', 'T'])}")
    return values
