"""Pose2Sim calibrations (``Calib.toml``); Anipose (``calibration.toml``) and caliscope write almost the same.

One section for each camera with ``name size matrix distortions rotation translation fisheye``: ``rotation`` is a
Rodrigues vector, ``x_cam = R X + T``, metres, z up. Pose2Sim itself writes four distortion terms, k1 k2 p1 p2, without
k3; files with five terms are read, too. Anipose's lengths are in the unit of its board, which the file does not state.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.files.input_files import CALIBRATION, parse_toml, read_bytes
from mvpose.files.message_text import one_line, prefixed, shown
from mvpose.formats.calibration.calibration_file import CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera, check_names, image_size

_KEYS = ("size", "matrix", "distortions", "rotation", "translation")
_METADATA = "metadata"
_WHAT = "a Pose2Sim calibration (TOML): a section for each camera, with " + ", ".join(_KEYS)


def read_calibration(path: str | Path, *, only: Sequence[str] = ()) -> Rig:
    """Read a Pose2Sim calibration file, at least the cameras named in ``only`` if there are any.

    Returns:
        The cameras in the order of the file; their names are the key ``name``, or else the name of the section.

    Raises:
        ValueError: the file does not exist or is not TOML, a camera lacks a key, has a value of a wrong shape or a
            fisheye lens, or the cameras make no rig.
    """
    path = Path(path)
    content = read_bytes(path, what=_WHAT, most=CALIBRATION)
    try:
        sections = parse_toml(content.decode("utf-8-sig"))
    except ValueError as error:
        raise ValueError(f"{path}: not TOML ({one_line(str(error), 160)}); expected {_WHAT}") from None
    sections.pop(_METADATA, None)
    names = {key: str(each.get("name", key)) if isinstance(each, dict) else key for key, each in sections.items()}
    if set(only) <= set(names.values()):
        sections = {key: each for key, each in sections.items() if not only or names[key] in only}
    with prefixed(path):
        return Rig([_camera(name, entry) for name, entry in sections.items()])


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write a rig as a Pose2Sim calibration, with four distortion terms, or five where k3 is not 0.

    Raises:
        ValueError: camera names that are missing or not distinct, or a camera called "metadata", the name of another
            section.
    """
    check_names(rig)
    lines = []
    for each in rig:
        if each.name == _METADATA:
            raise ValueError(f"a Pose2Sim calibration cannot hold a camera called {_METADATA!r}: give it another name")
        terms = each.distortion if each.distortion[4] else each.distortion[:4]
        lines += [
            f"[{_quoted(each.name)}]",
            f"name = {_quoted(each.name)}",
            f"size = {[float(side) for side in each.size]}",
            f"matrix = {each.K.tolist()}",
            f"distortions = {terms.tolist()}",
            f"rotation = {Rotation.from_matrix(each.R).as_rotvec().tolist()}",
            f"translation = {each.t.tolist()}",
            "fisheye = false",
            "",
        ]
    Path(path).write_text(
        "\n".join([*lines, f"[{_METADATA}]", "adjusted = false", "error = 0.0", ""]), encoding="utf-8"
    )


FORMAT = CalibrationFormat(
    "Pose2Sim (TOML)",
    lambda file: any(isinstance(entry, dict) and "matrix" in entry for entry in (file.toml or {}).values()),
    lambda path, *, size, only: read_calibration(path, only=only),
    write_calibration,
)


def _quoted(text: str) -> str:
    # JSON and TOML share their escapes, except for one control character that JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _camera(section: str, entry: Any) -> Camera:
    if not isinstance(entry, dict):
        raise ValueError(f"{section!r} must be a section with {', '.join(_KEYS)}, got {shown(entry)}")
    missing = [key for key in _KEYS if key not in entry]
    if missing:
        raise ValueError(f"camera {section!r} lacks {', '.join(missing)}; expected {', '.join(_KEYS)}")
    if entry.get("fisheye"):
        raise ValueError(f"camera {section!r} has a fisheye lens; calibrate it as a pinhole with k1 k2 p1 p2")
    name = str(entry.get("name", section))
    return camera(
        name,
        K=np.asarray(entry["matrix"], dtype=object),
        R=entry["rotation"],
        t=entry["translation"],
        terms=entry["distortions"],
        size=image_size(entry["size"], f"camera {name!r}: size"),
    )
