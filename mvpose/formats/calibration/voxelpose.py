"""VoxelPose calibrations (JSON), as published for Shelf and Campus.

One JSON object with a key for each camera, with ``fx fy cx cy`` (pixels), ``R`` (3x3, world to camera), ``T``
(3x1), ``k`` (k1 k2 k3) and ``p`` (p1 p2). ``T`` is the camera centre in millimetres: ``x_cam = R (X - T)``.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from mvpose.checks import as_array
from mvpose.files.input_files import CALIBRATION, read_json_object
from mvpose.files.message_text import prefixed
from mvpose.formats.calibration.calibration_file import CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera, check_names

_KEYS = ("fx", "fy", "cx", "cy", "R", "T", "k", "p")
_WHAT = "a VoxelPose calibration: an object of cameras, each with " + ", ".join(_KEYS)
_METRES = 50.0  # centres that all lie within 50 mm of the origin were written in metres


def read_calibration(path: str | Path, *, size: tuple[int, int]) -> Rig:
    """Read a VoxelPose calibration file.

    Args:
        path: the JSON file.
        size: width and height of the images in pixels, which the file does not hold.

    Returns:
        The cameras in the order of the file, with their keys as names; metres.

    Raises:
        ValueError: the file does not exist or is truncated, a camera lacks a key or has a value of a wrong shape, the
            centres cannot be in millimetres, or the cameras make no rig.
    """
    path = Path(path)
    cameras = read_json_object(path, what=_WHAT, most=CALIBRATION)
    with prefixed(path):
        centers = np.array([_center(name, entry) for name, entry in cameras.items()]).reshape(-1, 3)
        if len(centers) and np.abs(centers).max() < _METRES:
            raise ValueError(
                "the camera centres T look like metres, expected millimetres: the largest coordinate is "
                f"{np.abs(centers).max():.3g}, a rig {np.ptp(centers, axis=0).max() / 1000:.2g} m across; "
                "multiply every T by 1000"
            )
        return Rig([_camera(name, entry, size) for name, entry in cameras.items()])


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write a rig as a VoxelPose calibration, without the size of the images.

    Raises:
        ValueError: a camera with a skew, or names that are missing or not distinct.
    """
    check_names(rig)
    entries = {}
    for each in rig:
        if each.K[0, 1]:
            raise ValueError(f"camera {each.name!r}: a VoxelPose calibration cannot hold a skew, got {each.K[0, 1]:g}")
        k1, k2, p1, p2, k3 = each.distortion.tolist()
        entries[each.name] = {
            "fx": each.K[0, 0],
            "fy": each.K[1, 1],
            "cx": each.K[0, 2],
            "cy": each.K[1, 2],
            "R": each.R.tolist(),
            "T": (1000.0 * each.center)[:, None].tolist(),
            "k": [[k1], [k2], [k3]],
            "p": [[p1], [p2]],
        }
    Path(path).write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


FORMAT = CalibrationFormat(
    "VoxelPose (JSON)",
    lambda file: any(isinstance(entry, dict) and "fx" in entry for entry in (file.json or {}).values()),
    lambda path, *, size, only: read_calibration(path, size=size),
    write_calibration,
    "mm",
)


def _center(name: str, entry: Any) -> np.ndarray:
    if not isinstance(entry, dict):
        raise ValueError(f"camera {name!r} must be an object with {', '.join(_KEYS)}, got a {type(entry).__name__}")
    missing = [key for key in _KEYS if key not in entry]
    if missing:
        raise ValueError(f"camera {name!r} lacks {', '.join(missing)}; expected {', '.join(_KEYS)}")
    return as_array(np.ravel(entry["T"]), (3,), f"camera {name!r}: T")


def _camera(name: str, entry: dict[str, Any], size: tuple[int, int]) -> Camera:
    fx, fy, cx, cy = (float(as_array(entry[key], (), f"camera {name!r}: {key}")) for key in ("fx", "fy", "cx", "cy"))
    k1, k2, k3 = as_array(np.ravel(entry["k"]), (3,), f"camera {name!r}: k")
    p1, p2 = as_array(np.ravel(entry["p"]), (2,), f"camera {name!r}: p")
    R, K = as_array(entry["R"], (3, 3), f"camera {name!r}: R"), [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    terms = (k1, k2, p1, p2, k3)  # OpenCV's order
    return camera(name, K=K, R=R, t=-R @ _center(name, entry) / 1000.0, terms=terms, size=size)
