"""Qualisys calibrations (XML, ``NAME.qca.txt``) as QTM exports them; read only.

Each camera has the pixels of its picture (``fov_video``), intrinsics in 64ths of a pixel, distortion terms of Brown's
model, its centre in millimetres, and a rotation whose rows are the camera's axes in the world: right, up and backwards.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from mvpose import Camera, Rig
from mvpose.files.input_files import CALIBRATION, read_bytes
from mvpose.files.message_text import one_line, prefixed
from mvpose.formats.calibration.calibration_file import CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera

_EXPECTS = "<calibration> with <cameras>, each with fov_video, transform and intrinsic"
_WHAT = f"a Qualisys calibration (XML): {_EXPECTS}"
_PARTS = 64.0  # of a pixel, in which intrinsics are given
_AXES = np.diag([1.0, -1.0, -1.0])  # right, up, backwards to right, down, forwards
_OF_VIDEO = ("video", "none")  # in the names of models: other cameras see markers alone


def read_calibration(path: str | Path) -> Rig:
    """Read a Qualisys calibration file.

    Returns:
        The active cameras that record video, by their serial numbers; of all cameras where the models do not say.

    Raises:
        ValueError: the file does not exist or is no such XML, a camera lacks a value, has a turned picture
            (``viewrotation``) or a wrong value, or fewer than two cameras record.
    """
    path = Path(path)
    content = read_bytes(path, what=_WHAT, most=CALIBRATION)
    try:
        if b"<!DOCTYPE" in content:
            raise ValueError(f"a document type (<!DOCTYPE), which is not of Qualisys; expected {_EXPECTS}")
        found = [each for each in ElementTree.fromstring(content).iter("camera") if each.get("active", "1") != "0"]
        recording = [each for each in found if any(part in each.get("model", "none").lower() for part in _OF_VIDEO)]
        return Rig([_camera(each) for each in (recording if len(recording) > 1 else found)])
    except (ValueError, ElementTree.ParseError) as error:
        raise ValueError(f"{path}: {one_line(str(error), 300)}; expected {_WHAT}") from None


def _camera(entry: ElementTree.Element) -> Camera:
    name = entry.get("serial", "")
    if (turn := entry.get("viewrotation", "0")) not in ("0", ""):
        raise ValueError(f"camera {name!r}: viewrotation {turn}: pictures that QTM turns are not supported")
    left, top, right, bottom = _values(entry, name, "fov_video", ("left", "top", "right", "bottom"))
    focal_u, focal_v, u, v, skew = _values(
        entry, name, "intrinsic", ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "skew")
    )
    radial = [f"radialDistortion{k}" for k in (1, 2, 3)]
    tangential = [f"tangentalDistortion{k}" for k in (1, 2)]  # as QTM spells it
    k1, k2, k3, p1, p2 = _values(entry, name, "intrinsic", (*radial, *tangential))
    center = _values(entry, name, "transform", ("x", "y", "z"))
    axes = _values(entry, name, "transform", tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)))
    rotation = _AXES @ np.reshape(axes, (3, 3))
    return camera(
        name,
        K=[[focal_u / _PARTS, skew / _PARTS, u / _PARTS - left], [0.0, focal_v / _PARTS, v / _PARTS - top], [0, 0, 1]],
        R=rotation,
        t=-rotation @ np.array(center) / 1000.0,
        terms=(k1, k2, p1, p2, k3),
        size=(round(right - left) + 1, round(bottom - top) + 1),
    )


def _values(entry: ElementTree.Element, name: str, part: str, keys: tuple[str, ...]) -> list[float]:
    """Return numbers of a part of a camera."""
    found = entry.find(part)
    if found is None:
        raise ValueError(f"camera {name!r} lacks <{part}>")
    if missing := [key for key in keys if key not in found.attrib]:
        raise ValueError(f"camera {name!r}: <{part}> lacks {missing[0]!r}")
    with prefixed(f"camera {name!r}: <{part}>"):
        return [float(found.attrib[key]) for key in keys]


FORMAT = CalibrationFormat(
    "Qualisys (XML)",
    lambda file: file.content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") and b"<fov_video" in file.content,
    lambda path, *, size, only: read_calibration(path),  # noqa: PLW0108  the file has sizes, and all cameras are read
    unit="mm",
)
