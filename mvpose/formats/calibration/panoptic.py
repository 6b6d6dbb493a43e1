"""CMU Panoptic Studio calibrations (JSON of panoptic-toolbox).

``cameras`` is a list, each with ``name type resolution K distCoef R t``: centimetres, ``x_cam = R X + t``, distCoef
k1 k2 p1 p2 k3. The file's world has y down; ours is (x, y, z) = (X, Z, -Y) / 100, so the floor Y = 0 is z = 0.
A file of one camera holds an entry of the list, which :data:`OWN` tells from those of other programs.
"""

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from mvpose.checks import as_array
from mvpose.files.input_files import CALIBRATION, read_json_object
from mvpose.files.message_text import prefixed
from mvpose.formats.calibration.calibration_file import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera, check_names, image_size, is_camera

_KEYS = ("name", "resolution", "K", "distCoef", "R", "t")
_WHAT = "a Panoptic calibration: {'cameras': [{" + ", ".join(_KEYS) + "}, ...]}"
_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # X = x, Y = -z, Z = y
_CENTIMETRES = 100.0

OWN = {"type", "panel", "node", "distCoef"}
"""Keys that a camera of the Panoptic Studio has, and those of other programs have not together."""


def read_calibration(path: str | Path, *, types: Collection[str] = ("hd",)) -> Rig:
    """Read a Panoptic calibration file.

    Args:
        path: the JSON file.
        types: types of the cameras to take: "hd", "vga", "kinect-color"; empty: all.

    Returns:
        The cameras in the order of the file, in metres, z up.

    Raises:
        ValueError: the file does not exist or is truncated, a camera lacks a key or has a value of a wrong shape, or
            fewer than two cameras are of these types.
    """
    path = Path(path)
    entries = read_json_object(path, what=_WHAT, most=CALIBRATION).get("cameras")
    if not isinstance(entries, list):
        raise ValueError(f"{path}: no list 'cameras'; expected {_WHAT}")
    with prefixed(path):
        chosen = [
            read_entry(f"cameras[{index}]", entry)
            for index, entry in enumerate(entries)
            if not types or not isinstance(entry, dict) or entry.get("type", "hd") in types
        ]
        if len(chosen) < 2:
            found = sorted({str(entry.get("type")) for entry in entries if isinstance(entry, dict)})
            raise ValueError(
                f"{len(chosen)} of {len(entries)} cameras are of type {' or '.join(types) or 'any'}, expected at least "
                f"2; the file has {', '.join(found) or 'none'}: name the cameras (cameras.only) to take others"
            )
        return Rig(chosen)


def write_calibration(path: str | Path, rig: Rig, *, kind: str = "hd") -> None:
    """Write a rig as a Panoptic calibration, with all cameras of type ``kind``.

    Raises:
        ValueError: camera names that are missing or not distinct.
    """
    check_names(rig)
    entries = [
        {
            "name": each.name,
            "type": kind,
            "resolution": list(each.size),
            "K": each.K.tolist(),
            "distCoef": each.distortion.tolist(),
            "R": (each.R @ _AXES.T).tolist(),
            "t": (_CENTIMETRES * each.t)[:, None].tolist(),
        }
        for each in rig
    ]
    Path(path).write_text(json.dumps({"cameras": entries}, indent=1) + "\n", encoding="utf-8")


def _recognises(file: CalibrationFile) -> bool:
    entries = (file.json or {}).get("cameras")
    if not isinstance(entries, list):
        return False
    ours = {"distCoef", "resolution", "type"}  # a list of cameras with other keys is of OpenCV
    return not any(map(is_camera, entries)) or any(isinstance(each, dict) and ours & each.keys() for each in entries)


FORMAT = CalibrationFormat(
    "Panoptic (JSON)",
    _recognises,
    lambda path, *, size, only: read_calibration(path, types=() if only else ("hd",)),
    write_calibration,
    "cm",
)


def read_entry(where: str, entry: Any) -> Camera:
    """Return the camera of an entry of the list.

    Raises:
        ValueError: a key that is missing, or a value of a wrong shape; the message names the place or the camera.
    """
    missing = [key for key in _KEYS if key not in entry] if isinstance(entry, dict) else list(_KEYS)
    if missing:
        raise ValueError(f"{where} lacks {', '.join(missing)}; expected {', '.join(_KEYS)}")
    name = str(entry["name"])
    t = as_array(np.asarray(entry["t"], dtype=object).ravel(), (3,), f"camera {name!r}: t")
    return camera(
        name,
        K=entry["K"],
        R=entry["R"],
        t=t / _CENTIMETRES,
        terms=entry["distCoef"],
        size=image_size(entry["resolution"], f"camera {name!r}: resolution"),
        axes=_AXES,
    )
