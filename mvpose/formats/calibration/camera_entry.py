"""One camera under any of the names that programs give its values: ``camera_matrix`` or ``K``, ``rvec`` or ``R`` ...

Names of two letters or fewer count as they are written, because K and k, T and t differ; longer ones without regard to
case and punctuation. Values may lie in maps within the entry (``intrinsics: {camera_matrix: ...}``).
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.files.message_text import shown

MATRIX = ("K", "M", "cameramatrix", "intrinsicmatrix", "intrinsics", "intrinsic", "mtx", "matrix", "kmatrix")
"""Names of the intrinsic matrix, 3 x 3."""

TERMS = ("D", "distortioncoefficients", "distcoeffs", "distcoef", "distcoefs", "distortion", "distortions", "dist")
"""Names of the distortion terms, k1 k2 p1 p2 k3."""

ROTATION = ("R", "rvec", "rotation", "rot", "rotationmatrix", "rotationvector", "rmat", "rvecs")
"""Names of the rotation from world to camera: a matrix, or a Rodrigues vector in radians."""

TRANSLATION = ("T", "t", "tvec", "translation", "translationvector", "tvecs", "trans")
"""Names of the translation of ``x_cam = R x + T``, metres."""

BOTH = ("Rt", "RT", "extrinsicmatrix", "extrinsics", "extrinsic", "worldtocamera", "w2c")
"""Names of a matrix 3 x 4 or 4 x 4 of rotation and translation, world to camera."""

SIZE = ("size", "imagesize", "resolution", "imgsize", "framesize", "calibrationsize")
"""Names of width and height, pixels."""

_SIDES = (("imagewidth", "imageheight"), ("width", "height"), ("W", "H"))
_FOCAL = ("fx", "fy", "cx", "cy")
_INVERSE = ("cameratoworld", "c2w", "camtoworld")
_INTRINSICS, _POSE = "intrinsics", "rotation and translation"
_NONE = (None, "null", "None")  # that programs write for what is not known yet
_EXPECTED = "camera_matrix (or K), distortion_coefficients, R or rvec, T or tvec, and the size of the pictures"


def is_camera(entry: Any, *, placed: bool = False) -> bool:
    """Return whether a value is a map with intrinsics of a camera, and if ``placed`` with its pose as well."""
    if not isinstance(entry, dict):
        return False
    return not (lacking(entry) if placed else lacking(entry)[:1] == [_INTRINSICS])


def lacking(entry: Mapping[str, Any]) -> list[str]:
    """Return what an entry has nothing of: the intrinsics, the pose."""
    flat = _flat(entry)
    intrinsics = find(flat, MATRIX) is not None or all(key in flat for key in _FOCAL)
    placed = any(find(flat, names) is not None for names in (ROTATION, BOTH, _INVERSE))
    return [*([] if intrinsics else [_INTRINSICS]), *([] if placed else [_POSE])]


def read_camera(name: str, entry: Mapping[str, Any], size: tuple[int, int]) -> Camera:
    """Return the camera of an entry.

    Args:
        name: its name.
        entry: its values.
        size: width and height of its pictures where the entry does not state them.

    Raises:
        ValueError: a value that is missing or of a wrong form; the message names the camera.
    """
    flat = _flat(entry)
    if find(flat, ("fisheye",)) is True:
        raise ValueError(f"camera {name!r} has a fisheye lens; calibrate it as a pinhole with k1 k2 p1 p2")
    K = find(flat, MATRIX)
    if K is None and all(key in flat for key in _FOCAL):
        fx, fy, cx, cy = (float(as_array(flat[key], (), f"camera {name!r}: {key}")) for key in _FOCAL)
        K = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    R, t = find(flat, ROTATION), find(flat, TRANSLATION)
    if R is None or t is None:
        R, t = _of_both(name, flat, R, t)
    for usual, value in (("camera_matrix, K, mtx", K), ("R, rvec, rotation", R), ("T, tvec, translation", t)):
        if value is None:
            has = ", ".join(list(flat)[:8]) or "nothing"
            raise ValueError(f"camera {name!r} has none of {usual} ...: it has {has}; expected {_EXPECTED}")
    terms = find(flat, TERMS)
    return camera(
        name,
        K=np.asarray(K, dtype=object).reshape(3, 3) if np.size(np.asarray(K, dtype=object)) == 9 else K,
        R=R,
        t=t,
        terms=[] if terms is None else terms,
        size=_size(name, flat, size),
    )


def find(entry: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    """Return the value of the first of some names in an entry; None where it has none of them, or only maps."""
    plain = {_plain(key): value for key, value in reversed(list(entry.items())) if not isinstance(value, dict)}
    for name in names:
        if name in plain and not (plain[name] is None or (isinstance(plain[name], str) and plain[name] in _NONE)):
            return plain[name]
    return None


def _plain(key: str) -> str:
    short = re.sub(r"[^A-Za-z0-9]", "", key)
    return short if len(short) <= 2 else short.lower()


def _flat(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of an entry and of the maps in it."""
    flat: dict[str, Any] = {}
    for key, value in entry.items():
        if isinstance(value, dict):
            flat |= {inner: each for inner, each in value.items() if inner not in entry}
        else:
            flat[str(key)] = value
    return flat


def _of_both(name: str, flat: Mapping[str, Any], R: Any, t: Any) -> tuple[Any, Any]:
    """Return rotation and translation of a matrix that holds both, in the place of those that are missing."""
    joined, inverse = find(flat, BOTH), find(flat, _INVERSE)
    given = inverse if joined is None else joined
    if given is None or np.size(np.asarray(given, dtype=object)) not in (12, 16):
        return R, t
    values = np.asarray(given, dtype=object)
    matrix: Floats = as_array(values.reshape(-1, 4)[:3], (3, 4), f"camera {name!r}: extrinsics")
    if joined is None:  # camera to world
        return matrix[:, :3].T, -matrix[:, :3].T @ matrix[:, 3]
    return matrix[:, :3], matrix[:, 3]


def _size(name: str, flat: Mapping[str, Any], size: tuple[int, int]) -> tuple[int, int]:
    given = find(flat, SIZE)
    if given is not None:
        return image_size(given, f"camera {name!r}: size")
    for width, height in _SIDES:
        sides = find(flat, (width,)), find(flat, (height,))
        if None not in sides:
            return image_size(sides, f"camera {name!r}: {width} and {height}")
    return size


_FULL_TURN = 6.3  # radians; longer vectors are in degrees


def rotation(value: Any, name: str) -> Floats:
    """Return a rotation matrix (3, 3), given a matrix or a Rodrigues vector of three numbers, radians.

    Raises:
        ValueError: the value is neither.
    """
    given = as_array(np.asarray(value, dtype=object).ravel(), ("n",), name)
    if given.size in (3, 9) and not np.isfinite(given).all():
        raise ValueError(f"{name} must be finite, got {shown(given.tolist())}")
    if given.size == 3:
        angle = float(np.linalg.norm(given))
        if angle > _FULL_TURN:
            raise ValueError(
                f"{name} must be a Rodrigues vector in radians, at most 2 pi long, got {shown(given.tolist())}, "
                f"{angle:.4g} long: degrees (multiply by pi / 180) or Euler angles (convert to a 3 x 3 matrix)"
            )
        return Rotation.from_rotvec(given.copy()).as_matrix()  # SciPy refuses read-only arrays
    if given.size == 9:
        return given.reshape(3, 3)
    raise ValueError(f"{name} must be a 3 x 3 rotation or a Rodrigues vector of 3 finite numbers, got {given.size}")


def distortion(value: Any, name: str) -> Floats:
    """Return the five terms of Brown's model, k1 k2 p1 p2 k3, given as many as OpenCV writes; missing terms are 0.

    Raises:
        ValueError: a number of terms other than 0, 4, 5, 8, 12 or 14, or terms beyond the fifth (rational or thin
            prism model) that are not 0.
    """
    terms = as_array(np.asarray(value, dtype=object).ravel(), ("n",), name)
    if terms.size not in (0, 4, 5, 8, 12, 14):
        raise ValueError(f"{name} must be 4 or 5 numbers (k1 k2 p1 p2 k3), got {terms.size}")
    if terms[5:].any():
        rational = shown(terms[5:].tolist())
        raise ValueError(f"{name} has terms of the rational model, {rational}: calibrate with k1 k2 p1 p2 k3")
    return np.resize(np.append(terms[:5], np.zeros(5 - min(terms.size, 5))), 5)


def image_size(value: Any, name: str) -> tuple[int, int]:
    """Return width and height in pixels, given two numbers, which some programs write as floats.

    Raises:
        ValueError: the value is not two finite numbers.
    """
    sides = as_array(np.asarray(value, dtype=object).ravel(), (2,), name)
    if not np.isfinite(sides).all():
        raise ValueError(f"{name} must be a width and a height in pixels, got {sides.tolist()}")
    return round(sides[0]), round(sides[1])


def camera(
    name: str, *, K: Any, R: Any, t: Any, terms: Any, size: tuple[int, int], axes: Floats | None = None
) -> Camera:
    """Return a camera, given the values of a file: ``x_cam = R x + t`` with ``t`` in metres.

    Args:
        name: name of the camera.
        K: intrinsic matrix, 3 x 3.
        R: rotation matrix or Rodrigues vector.
        t: translation, 3 numbers in any shape, metres.
        terms: distortion terms in OpenCV's order.
        size: width and height in pixels.
        axes: axes of the file's world in ours, (3, 3): ``x_file = axes x_ours``; None: the same axes.

    Raises:
        ValueError: a value of a wrong form; the message names the camera.
    """
    where = f"camera {name!r}"
    turn = rotation(R, f"{where}: rotation")
    return Camera(
        K=as_array(K, (3, 3), f"{where}: K"),
        R=turn if axes is None else turn @ axes,
        t=as_array(np.asarray(t, dtype=object).ravel(), (3,), f"{where}: translation"),
        distortion=distortion(terms, f"{where}: distortion"),
        size=size,
        name=name,
    )


def check_names(rig: Rig) -> None:
    """Check that the cameras of a rig have distinct names, which calibration files need.

    Raises:
        ValueError: a camera without a name, or two cameras of one name.
    """
    names = [each.name for each in rig]
    for name in names:
        if not name or names.count(name) > 1:
            raise ValueError(
                f"a calibration file needs a distinct name for every camera, got {names}; rename the cameras"
            )
