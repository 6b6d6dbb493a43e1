"""OpenCV calibrations (YAML, XML or JSON of ``cv2.FileStorage``, and plain JSON or TOML): ``x_cam = R X + T``, metres.

OpenCV prescribes no layout for many cameras. The reader accepts:

- a list ``cameras`` of maps with a ``name``, or one map for each camera by its name, with the values that
  ``calibrateCamera`` returns, under any of the usual names (:mod:`.camera_entry`);
- a stereo calibration, as OpenCV's ``stereo_calib`` sample writes it: ``M1 D1 M2 D2`` (``intrinsics.yml``) and ``R T``
  (``extrinsics.yml``, beside it); R and T transform camera 1 into camera 2, and the world frame is that of camera 1;
- ``camera_array.toml`` of caliscope, which has a table for each camera in ``cameras``, also for those that it has not
  calibrated yet;
- one file for each camera, whose name is that of the file: :mod:`.camera_folder`.

The writer uses the first layout.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from mvpose.camera import UnlikelyRigError
from mvpose.files.message_text import listed, prefixed
from mvpose.formats.calibration import file_storage
from mvpose.formats.calibration.calibration_file import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.camera_entry import check_names, is_camera, lacking, read_camera

_K = ("camera_matrix", "K", "cameraMatrix", "intrinsics", "M")  # of a stereo pair, with 1 and 2 appended
_TERMS = ("distortion_coefficients", "dist", "distCoeffs", "distortion", "D")
_SIZE = ("size", "image_size", "imageSize", "image_width", "image_height")
_WHAT = (
    "an OpenCV calibration: a map for each camera with camera_matrix, distortion_coefficients, R or rvec, T and "
    "image_width, image_height; or M1 D1 M2 D2 R T of a stereo pair"
)
_LONGEST_BASELINE = 20.0  # metres, between the cameras of a stereo pair


def read_calibration(path: str | Path, *, size: tuple[int, int], only: Sequence[str] = ()) -> Rig:
    """Read a calibration written by ``cv2.FileStorage``.

    Args:
        path: the file; of a stereo pair in two files either of them.
        size: width and height of the images in pixels, for files that do not hold them.
        only: names of cameras to take, if the file has them all; empty: all.

    Returns:
        The cameras in the order of the file; those of a stereo pair are called "1" and "2".

    Raises:
        ValueError: the file does not exist or cannot be read, it holds no camera, a camera lacks a value or has one of
            a wrong shape, or the cameras make no rig.
    """
    path = Path(path)
    plain = _plain_values(CalibrationFile(path, _WHAT))
    values = file_storage.read_beside(path, what=_WHAT) if plain is None else plain
    with prefixed(path):
        stereo = _stereo(values, path)
        entries = stereo or camera_entries(values)
        if not entries:
            keys = ", ".join(list(values)[:8]) or "no keys"
            raise ValueError(f"no camera found, only {keys}; expected {_WHAT}")
        if only and set(only) <= entries.keys():
            entries = {name: entries[name] for name in only}
        _check_calibrated(entries)
        cameras = [read_camera(name, entry, size) for name, entry in entries.items()]
        if stereo and (baseline := float(np.linalg.norm(cameras[1].t))) > _LONGEST_BASELINE:
            raise UnlikelyRigError(
                f"the two cameras are {baseline:g} apart, which cannot be metres: state the unit (--unit mm), or "
                "divide T by 1000",
                cameras,
            )
        return Rig(cameras)


def _check_calibrated(entries: dict[str, dict[str, Any]]) -> None:
    """Check that no camera lacks its intrinsics, or its pose, as those that caliscope has not calibrated yet.

    Raises:
        ValueError: one that does; the message names what is missing, and the cameras that are complete.
    """
    missing = {name: lacking(entry) for name, entry in entries.items()}
    complete = [name for name, each in missing.items() if not each]
    bare = [f"{name} lacks {', '.join(each)}" for name, each in missing.items() if each]
    if bare and (complete or any("size" in entry for entry in entries.values())):
        others = f", or take the others: --cameras {','.join(complete)}" if len(complete) > 1 else ""
        raise ValueError(f"not all cameras are calibrated: {listed(bare)}; finish the calibration{others}")


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
    file_storage.write_storage(Path(path), {"cameras": [{"name": each.name, **_entry(each)} for each in rig]})


def write_values(path: Path, camera: Camera) -> None:
    """Write one camera into a file of its own, without its name."""
    file_storage.write_storage(path, _entry(camera))


def _entry(camera: Camera) -> dict[str, Any]:
    return {
        "image_width": camera.size[0],
        "image_height": camera.size[1],
        "camera_matrix": camera.K,
        "distortion_coefficients": file_storage.matrix(camera.distortion),
        "R": camera.R,
        "T": file_storage.matrix(camera.t).T,
    }


def values_of(file: CalibrationFile) -> dict[str, Any]:
    """Return the named values of a YAML, XML, JSON or TOML file.

    Raises:
        ValueError: it does not exist or cannot be parsed.
    """
    plain = _plain_values(file)
    return file_storage.read_storage(file.path, what=_WHAT) if plain is None else plain


FORMAT = CalibrationFormat(
    "OpenCV (YAML, XML, JSON)",
    lambda file: file.storage is not None or bool(camera_entries(file.json or {})),
    read_calibration,
    write_calibration,
)


def camera_entries(values: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the values of each camera by its name; none where the file has no camera of this layout."""
    found = values.get("cameras")
    if isinstance(found, dict):
        known = camera_entries(found) or any(isinstance(each, dict) and "size" in each for each in found.values())
        return {name: each for name, each in found.items() if isinstance(each, dict)} if known else {}
    if isinstance(found, list):
        if not all(isinstance(each, dict) for each in found):
            raise ValueError(f"cameras must be a list of maps; expected {_WHAT}")
        return {f"{each.get('name', k)}": each for k, each in enumerate(found)}
    return {name: each for name, each in values.items() if is_camera(each)}


def _plain_values(file: CalibrationFile) -> dict[str, Any] | None:
    """Return the named values of a JSON or TOML file; None for other files."""
    plain = file.json if file.json is not None else None if file.storage is not None else file.toml
    with prefixed(file.path):
        return None if plain is None else dict(file_storage.with_matrices(plain))


def _stereo(values: dict[str, Any], path: Path) -> dict[str, dict[str, Any]]:
    matrices = next(
        (name for name in (*_K, "camera_matrix_", "K_") if f"{name}1" in values and f"{name}2" in values), None
    )
    if matrices is None:
        if {"R", "T", "P1", "P2"} <= values.keys():
            raise ValueError(
                f"R and T of a stereo pair without M1 and M2, missing in {file_storage.missing_half(path)}, too"
            )
        return {}
    missing = [key for key in ("R", "T") if key not in values]
    if missing:
        raise ValueError(
            f"{matrices}1 and {matrices}2 without {' and '.join(missing)}, "
            f"missing in {file_storage.missing_half(path)}, too"
        )
    terms: list[Any] = [next((values[f"{key}{k}"] for key in _TERMS if f"{key}{k}" in values), []) for k in (1, 2)]
    poses = ((np.eye(3), np.zeros(3)), (values["R"], values["T"]))
    sizes = {key: values[key] for key in _SIZE if key in values}
    return {
        f"{k + 1}": {"K": values[f"{matrices}{k + 1}"], "dist": terms[k], "R": poses[k][0], "T": poses[k][1], **sizes}
        for k in (0, 1)
    }
