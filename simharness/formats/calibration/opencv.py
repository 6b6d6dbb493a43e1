"""Calibrations in OpenCV's own YAML, as ``cv2.FileStorage`` writes it: ``x_cam = R X + T``, metres.

OpenCV prescribes no layout for many cameras. Read are:

- a list ``cameras`` of maps with a ``name``, or one map for each camera by its name, with the values that
  ``calibrateCamera`` returns, by any of the usual names (``camera_matrix`` or ``K``, ``distortion_coefficients`` or
  ``dist``, ``R`` or ``rvec``, ``T`` or ``tvec``, ``image_width`` and ``image_height``, or ``size``);
- a stereo calibration, as OpenCV's ``stereo_calib`` sample writes it: ``M1 D1 M2 D2`` (``intrinsics.yml``) and ``R T``
  (``extrinsics.yml``, beside it); R and T lead from camera 1 to camera 2, and the world is that of camera 1.

The first is what is written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from simharness.formats.calibration.entries import camera, check_names, image_size
from simharness.formats.calibration.file_storage import matrix, missing_half, read_beside, write_storage

_K = ("camera_matrix", "K", "cameraMatrix", "intrinsics", "M")
_TERMS = ("distortion_coefficients", "dist", "distCoeffs", "distortion", "D")
_R = ("R", "rvec", "rotation", "Rot")
_T = ("T", "tvec", "t", "translation")
_SIZE = ("size", "image_size", "imageSize")
_WHAT = (
    "an OpenCV calibration: a map for each camera with camera_matrix, distortion_coefficients, R or rvec, T and "
    "image_width, image_height; or M1 D1 M2 D2 R T of a stereo pair"
)
_LONGEST_BASELINE = 20.0  # metres, between the cameras of a stereo pair


def read_calibration(path: str | Path, *, size: tuple[int, int]) -> Rig:
    """Read a calibration that ``cv2.FileStorage`` wrote.

    Args:
        path: the file; of a stereo pair in two files either.
        size: width and height of the images in pixels, for files that do not carry them.

    Returns:
        The cameras in the order of the file; those of a stereo pair are called "1" and "2".

    Raises:
        ValueError: the file is missing or cannot be read, there is no camera in it, one lacks a value or has one of a
            wrong shape, or the cameras make no rig.
    """
    path = Path(path)
    values = read_beside(path, what=_WHAT)
    try:
        stereo = _stereo(values, path)
        entries = stereo or _entries(values)
        if not entries:
            found = ", ".join(list(values)[:8]) or "nothing"
            raise ValueError(f"no camera in it, it has {found}; expected {_WHAT}")
        return Rig([_camera(name, entry, size) for name, entry in entries.items()])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write a rig as a list ``cameras`` that OpenCV can read.

    Raises:
        ValueError: cameras without names of their own, or names that begin or end with a space, which OpenCV loses.
    """
    check_names(rig)
    for each in rig:
        if each.name != each.name.strip():
            raise ValueError(
                f"camera {each.name!r}: OpenCV's files lose spaces at the ends of a name; expected one without"
            )
    entries = [
        {
            "name": each.name,
            "image_width": each.size[0],
            "image_height": each.size[1],
            "camera_matrix": each.K,
            "distortion_coefficients": matrix(each.distortion),
            "R": each.R,
            "T": matrix(each.t).T,
        }
        for each in rig
    ]
    write_storage(Path(path), {"cameras": entries})


def _entries(values: dict[str, Any]) -> dict[str, dict[str, Any]]:
    listed = values.get("cameras")
    if isinstance(listed, dict):
        return _entries(listed)
    if isinstance(listed, list):
        if not all(isinstance(each, dict) for each in listed):
            raise ValueError(f"cameras must be a list of maps; expected {_WHAT}")
        return {f"{each.get('name', k)}": each for k, each in enumerate(listed)}
    return {name: each for name, each in values.items() if isinstance(each, dict) and any(key in each for key in _K)}


def _stereo(values: dict[str, Any], path: Path) -> dict[str, dict[str, Any]]:
    matrices = next(
        (name for name in (*_K, "camera_matrix_", "K_") if f"{name}1" in values and f"{name}2" in values), None
    )
    if matrices is None:
        if {"R", "T", "P1", "P2"} <= values.keys():
            raise ValueError(f"it has R and T of a stereo pair, but no M1 and M2, nor has {missing_half(path)}")
        return {}
    missing = [key for key in ("R", "T") if key not in values]
    if missing:
        raise ValueError(
            f"it has {matrices}1 and {matrices}2, but no {' and '.join(missing)}, nor has {missing_half(path)}"
        )
    baseline = float(np.linalg.norm(values["T"]))
    if baseline > _LONGEST_BASELINE:
        raise ValueError(
            f"the two cameras stand {baseline:g} apart, which cannot be metres: calibrate with the size of the board's "
            "squares in metres, or divide T by 1000"
        )
    terms: list[Any] = [next((values[f"{key}{k}"] for key in _TERMS if f"{key}{k}" in values), []) for k in (1, 2)]
    poses = ((np.eye(3), np.zeros(3)), (values["R"], values["T"]))
    sizes = {key: values[key] for key in (*_SIZE, "image_width", "image_height") if key in values}
    return {
        f"{k + 1}": {"K": values[f"{matrices}{k + 1}"], "dist": terms[k], "R": poses[k][0], "T": poses[k][1], **sizes}
        for k in (0, 1)
    }


def _camera(name: str, entry: dict[str, Any], size: tuple[int, int]) -> Camera:
    found = {}
    for keys in (_K, _R, _T):
        key = next((key for key in keys if key in entry), None)
        if key is None:
            raise ValueError(f"camera {name!r} has no {keys[0]}, nor {', '.join(keys[1:])}; expected {_WHAT}")
        found[keys] = entry[key]
    given = next((entry[key] for key in _SIZE if key in entry), None)
    if given is None:
        given = (entry.get("image_width", size[0]), entry.get("image_height", size[1]))
    return camera(
        name,
        K=found[_K],
        R=found[_R],
        t=found[_T],
        terms=next((entry[key] for key in _TERMS if key in entry), []),
        size=image_size(given, f"camera {name!r}: size"),
    )
