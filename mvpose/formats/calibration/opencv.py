"""OpenCV calibrations (YAML or XML of ``cv2.FileStorage``): ``x_cam = R X + T``, metres.

OpenCV prescribes no layout for many cameras. The reader accepts:

- a list ``cameras`` of maps with a ``name``, or one map for each camera by its name, with the values that
  ``calibrateCamera`` returns, under any of the usual names (``camera_matrix`` or ``K``, ``distortion_coefficients`` or
  ``dist``, ``R`` or ``rvec``, ``T`` or ``tvec``, ``image_width`` and ``image_height``, or ``size``);
- a stereo calibration, as OpenCV's ``stereo_calib`` sample writes it: ``M1 D1 M2 D2`` (``intrinsics.yml``) and ``R T``
  (``extrinsics.yml``, beside it); R and T transform camera 1 into camera 2, and the world frame is that of camera 1.

The writer uses the first layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from mvpose.formats.calibration.calibration_format import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.entries import camera, check_names, image_size
from mvpose.formats.calibration.file_storage import matrix, missing_half, read_beside, write_storage

_K = ("camera_matrix", "K", "cameraMatrix", "intrinsics", "M")
_TERMS = ("distortion_coefficients", "dist", "distCoeffs", "distortion", "D")
_R = ("R", "rvec", "rotation", "Rot")
_T = ("T", "tvec", "t", "translation")
_SIZE = ("size", "image_size", "imageSize")
_EXPECTS = (
    "a map for each camera with camera_matrix, distortion_coefficients, R or rvec, T and "
    "image_width, image_height; or M1 D1 M2 D2 R T of a stereo pair"
)
_WHAT = f"an OpenCV calibration: {_EXPECTS}"
_LONGEST_BASELINE = 20.0  # metres, between the cameras of a stereo pair


def read_calibration(path: str | Path, *, size: tuple[int, int]) -> Rig:
    """Read a calibration written by ``cv2.FileStorage``.

    Args:
        path: the file; of a stereo pair in two files either of them.
        size: width and height of the images in pixels, for files that do not hold them.

    Returns:
        The cameras in the order of the file; those of a stereo pair are called "1" and "2".

    Raises:
        ValueError: the file does not exist or cannot be read, it holds no camera, a camera lacks a value or has one of
            a wrong shape, or the cameras make no rig.
    """
    path = Path(path)
    values = read_beside(path, what=_WHAT)
    try:
        stereo = _stereo(values, path)
        entries = stereo or _entries(values)
        if not entries:
            keys = ", ".join(list(values)[:8]) or "no keys"
            raise ValueError(f"no camera found, only {keys}; expected {_WHAT}")
        return Rig([_camera(name, entry, size) for name, entry in entries.items()])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write a rig as a list ``cameras``, readable by OpenCV.

    Raises:
        ValueError: camera names that are missing or not distinct, or that begin or end with a space, which OpenCV
            drops.
    """
    check_names(rig)
    for each in rig:
        if each.name != each.name.strip():
            raise ValueError(
                f"camera {each.name!r}: OpenCV drops spaces at the ends of a name; expected a name without them"
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


def _recognises(file: CalibrationFile) -> bool:
    return file.storage is not None


def _read(path: Path, *, size: tuple[int, int], only: Sequence[str]) -> Rig:
    return read_calibration(path, size=size)


FORMAT = CalibrationFormat("OpenCV (YAML or XML)", _EXPECTS, _recognises, _read, write_calibration)


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
            raise ValueError(
                f"R and T of a stereo pair without M1 and M2, which are missing in {missing_half(path)}, too"
            )
        return {}
    missing = [key for key in ("R", "T") if key not in values]
    if missing:
        raise ValueError(
            f"{matrices}1 and {matrices}2 without {' and '.join(missing)}, missing in {missing_half(path)}, too"
        )
    baseline = float(np.linalg.norm(values["T"]))
    if baseline > _LONGEST_BASELINE:
        raise ValueError(
            f"the two cameras are {baseline:g} apart, which cannot be metres: calibrate with the size of the board's "
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
    chosen = {}
    for keys in (_K, _R, _T):
        key = next((key for key in keys if key in entry), None)
        if key is None:
            raise ValueError(f"camera {name!r} has none of {', '.join(keys)}; expected {_WHAT}")
        chosen[keys] = entry[key]
    given = next((entry[key] for key in _SIZE if key in entry), None)
    if given is None:
        given = (entry.get("image_width", size[0]), entry.get("image_height", size[1]))
    return camera(
        name,
        K=chosen[_K],
        R=chosen[_R],
        t=chosen[_T],
        terms=next((entry[key] for key in _TERMS if key in entry), []),
        size=image_size(given, f"camera {name!r}: size"),
    )
