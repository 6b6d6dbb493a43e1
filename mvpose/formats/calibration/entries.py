"""Conversion of calibration entries to cameras, shared by all readers; messages name the camera and the value."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.files.message_text import shown

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
