"""COLMAP models (text): ``cameras.txt`` and ``images.txt`` in one folder, with one picture of each camera.

The pose of a picture is world to camera, with a quaternion of w x y z. COLMAP's pixels have their corner at integers:
its principal points are half a pixel larger than ours. Its world has no unit and no up axis until
``colmap model_aligner`` gives it those of known places. See https://colmap.github.io/format.html.
"""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.files.input_files import CALIBRATION, TABLE, read_bytes
from mvpose.files.message_text import prefixed, shown
from mvpose.formats.calibration.calibration_file import CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera, check_names

CAMERAS, IMAGES, POINTS = FILES = "cameras.txt", "images.txt", "points3D.txt"
"""Files of a model; the first two hold its cameras."""

MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
"""Lens models that are read, with the order of their parameters."""

_EXPECTS = "lines of CAMERA_ID MODEL WIDTH HEIGHT PARAMS, beside images.txt"
_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_HALF = 0.5  # pixels from the corner of a pixel, where COLMAP counts from, to its centre


def read_calibration(path: Path, *, size: tuple[int, int] = (0, 0), only: Sequence[str] = ()) -> Rig:
    """Read the cameras of a model.

    Args:
        path: one of its files.
        size: not used: the file has the sizes of its pictures.
        only: not used: all cameras are read.

    Returns:
        The cameras in the order of their pictures. The name of a camera is that of its picture without ending, or that
        of the picture's folder where each picture has its own.

    Raises:
        ValueError: a file does not exist, a line is not of the format, the lens is a fisheye or another model than
            :data:`MODELS`, or two pictures are of one camera.
    """
    path, images = path.with_name(CAMERAS), path.with_name(IMAGES)
    with prefixed(path):
        text = read_bytes(path, what=f"COLMAP's {CAMERAS}: {_EXPECTS}", most=CALIBRATION).decode(errors="replace")
        lenses = {line.split()[0]: line.split() for line in _lines(text) if line.strip()}
    with prefixed(images):
        text = read_bytes(images, what=f"COLMAP's {IMAGES} beside {CAMERAS}", most=TABLE).decode(errors="replace")
        pictures = [line.split(maxsplit=9) for line in _lines(text)[::2]]  # the points of each have the other lines
        for values in pictures:
            if len(values) != 10:
                raise ValueError(
                    f"expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME in every other line, got {shown(values)}"
                )
        pictures.sort(key=lambda values: values[0].zfill(9))  # COLMAP writes them in any order
        names = _names([values[9].strip() for values in pictures])
        return Rig([_camera(name, values, lenses) for name, values in zip(names, pictures, strict=True)])


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write a rig as a model without points; its pictures are called ``NAME.png``.

    Args:
        path: any path in the folder of the model, in which all files are written, ``points3D.txt`` empty.
        rig: the cameras.

    Raises:
        ValueError: a camera with a skew or a name that cannot be that of a picture, or names that are not distinct.
    """
    check_names(rig)
    lenses, pictures = [f"# {_EXPECTS}"], ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points"]
    for number, each in enumerate(rig, 1):
        if each.K[0, 1] or "/" in each.name or each.name != each.name.strip() or len(each.name.splitlines()) > 1:
            raise ValueError(f"camera {each.name!r}: COLMAP holds no skew ({each.K[0, 1]:g}), nor every name")
        k1, k2, p1, p2, k3 = each.distortion.tolist()
        model, terms = ("FULL_OPENCV", (k1, k2, p1, p2, k3, 0, 0, 0)) if k3 else ("OPENCV", (k1, k2, p1, p2))
        inner = (each.K[0, 0], each.K[1, 1], each.K[0, 2] + _HALF, each.K[1, 2] + _HALF, *terms)
        lenses.append(" ".join([str(number), model, *map(str, each.size), *(f"{float(value)!r}" for value in inner)]))
        x, y, z, w = Rotation.from_matrix(each.R).as_quat()
        pose = " ".join(f"{float(value)!r}" for value in (w, x, y, z, *each.t))
        pictures += [f"{number} {pose} {number} {each.name}.png", ""]
    for name, lines in ((CAMERAS, lenses), (IMAGES, pictures), (POINTS, ["# no points"])):
        Path(path).with_name(name).write_text("\n".join(lines) + "\n", encoding="utf-8")


FORMAT = CalibrationFormat("COLMAP (text)", lambda file: file.path.name in FILES, read_calibration, write_calibration)


def _lines(text: str) -> list[str]:
    """Return the lines from the first that is neither empty nor a comment on; empty ones between are lines."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    first = next((index for index, line in enumerate(lines) if line.strip()), len(lines))
    return "\n".join(lines[first:]).rstrip().splitlines()


def _names(pictures: list[str]) -> list[str]:
    """Return the names of the cameras of pictures: those of their folders where each has its own."""
    places = [PurePosixPath(each) for each in pictures]
    folders = [each.parent.name for each in places]
    names = folders if all(folders) and len(set(folders)) == len(folders) else [each.stem for each in places]
    for name in names:
        if names.count(name) > 1:
            both = [each for each, of in zip(pictures, names, strict=True) if of == name][:2]
            raise ValueError(f"{both[0]} and {both[1]} are of one camera, {name!r}; keep one picture of each camera")
    return names


def _camera(name: str, values: list[str], lenses: dict[str, list[str]]) -> Camera:
    lens = lenses.get(values[8])
    if lens is None or len(lens) < 4:
        raise ValueError(f"camera {name!r}: no CAMERA_ID {values[8]} with model and size in {CAMERAS}")
    if lens[1] not in MODELS:
        raise ValueError(
            f"camera {name!r} has the lens model {shown(lens[1])}; expected one of {', '.join(MODELS)}: let COLMAP "
            "calibrate with OPENCV, or undistort the pictures"
        )
    keys = MODELS[lens[1]].split()
    try:
        w, x, y, z, *t = (float(value) for value in values[1:8])
        width, height = int(lens[2]), int(lens[3])
        given = dict(zip(keys, (float(value) for value in lens[4:]), strict=True))
    except ValueError as error:
        raise ValueError(f"camera {name!r}: {error}; {lens[1]} has the numbers {' '.join(keys)}") from None
    fx, fy = given.get("fx", given.get("f")), given.get("fy", given.get("f"))
    if not np.linalg.norm([w, x, y, z]) > 0:
        raise ValueError(f"camera {name!r}: the quaternion {shown([w, x, y, z])} is no rotation")
    return camera(
        name,
        K=[[fx, 0.0, given["cx"] - _HALF], [0.0, fy, given["cy"] - _HALF], [0.0, 0.0, 1.0]],
        R=Rotation.from_quat([x, y, z, w]).as_matrix(),
        t=t,
        terms=[given.get(key, 0.0) for key in _TERMS],
        size=(width, height),
    )
