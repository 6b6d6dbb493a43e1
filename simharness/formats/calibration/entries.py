"""What the readers of calibration files share: one camera from its numbers, with the file's own words in messages."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from mvpose.checks import as_array


def rotation(value: Any, name: str) -> Floats:
    """A rotation matrix (3, 3) from one, or from a Rodrigues vector of three numbers, radians.

    Raises:
        ValueError: neither.
    """
    given = as_array(np.asarray(value, dtype=object).ravel(), ("n",), name)
    if given.size == 3 and np.isfinite(given).all():
        return Rotation.from_rotvec(given.copy()).as_matrix()  # which takes no read-only array
    if given.size == 9:
        return given.reshape(3, 3)
    raise ValueError(f"{name} must be a 3 x 3 rotation or a Rodrigues vector of 3 finite numbers, got {given.size}")


def distortion(value: Any, name: str) -> Floats:
    """Brown's five terms, k1 k2 p1 p2 k3, from as many as OpenCV writes; what is left out is 0.

    Raises:
        ValueError: not 0, 4, 5, 8, 12 or 14 numbers, or terms beyond the fifth (rational or thin prism) that are not 0.
    """
    terms = as_array(np.asarray(value, dtype=object).ravel(), ("n",), name)
    if terms.size not in (0, 4, 5, 8, 12, 14):
        raise ValueError(f"{name} must be 4 or 5 numbers (k1 k2 p1 p2 k3), got {terms.size}")
    if terms[5:].any():
        raise ValueError(f"{name} has terms of the rational model, {terms[5:].tolist()}: calibrate with k1 k2 p1 p2 k3")
    return np.resize(np.append(terms[:5], np.zeros(5 - min(terms.size, 5))), 5)


def image_size(value: Any, name: str) -> tuple[int, int]:
    """Width and height from two numbers, which some write as floats.

    Raises:
        ValueError: anything else.
    """
    sides = as_array(np.asarray(value, dtype=object).ravel(), (2,), name)
    if not np.isfinite(sides).all():
        raise ValueError(f"{name} must be a width and a height in pixels, got {sides.tolist()}")
    return round(sides[0]), round(sides[1])


def camera(
    name: str, *, K: Any, R: Any, t: Any, terms: Any, size: tuple[int, int], places: Floats | None = None
) -> Camera:
    """A camera from the values of a file, ``x_cam = R x + t`` with ``t`` in metres.

    Args:
        name: of the camera.
        K: intrinsics, 3 x 3.
        R: rotation matrix or Rodrigues vector.
        t: translation, 3 numbers in any shape.
        terms: distortion as OpenCV orders it.
        size: width and height in pixels.
        places: the axes of the file's world in ours, (3, 3): ``x_file = places x_ours``; the same by default.

    Raises:
        ValueError: a value of another form, naming the camera.
    """
    where = f"camera {name!r}"
    turn = rotation(R, f"{where}: rotation")
    return Camera(
        K=as_array(K, (3, 3), f"{where}: K"),
        R=turn if places is None else turn @ places,
        t=as_array(np.asarray(t, dtype=object).ravel(), (3,), f"{where}: translation"),
        distortion=distortion(terms, f"{where}: distortion"),
        size=size,
        name=name,
    )


def check_names(rig: Rig) -> None:
    """Check that a file that tells cameras by their names can hold a rig.

    Raises:
        ValueError: a camera without a name, or two of one name.
    """
    names = [each.name for each in rig]
    for name in names:
        if not name or names.count(name) > 1:
            raise ValueError(f"a calibration file tells cameras by name: expected each its own, got {names}")
