"""Published rigs: Campus, Shelf, and the sets of Panoptic HD cameras that papers use.

The calibrations are package data, one file per rig, rounded to a precision of half a pixel in the picture, in the
frame of this project: metres, z up, floor at z = 0, centre of the captured space at the origin. For each camera: focal
lengths, principal point and image size in pixels, distortion k1 k2 p1 p2 k3 (none if absent), position in metres, and
rotation from world to camera as a Rodrigues vector in radians.
"""

from __future__ import annotations

import importlib.resources
import tomllib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.camera import Camera, Rig
from mvpose.formats.calibration.calibration_formats import select

# HD cameras of the Panoptic Studio. cmu0 to cmu4: the rigs used to test transfer of methods between rigs; the others
# are cmu0 with fewer or more cameras, each set a prefix of the next.
_PANOPTIC = {
    "panoptic": tuple(range(31)),
    "cmu0": (3, 6, 12, 13, 23),
    "cmu1": (1, 2, 3, 4, 6, 7, 10),
    "cmu2": (12, 16, 18, 19, 22, 23, 30),
    "cmu3": (10, 12, 16, 18),
    "cmu4": (6, 7, 10, 12),
    "panoptic3": (3, 6, 12),
    "panoptic4": (3, 6, 12, 13),
    "panoptic6": (3, 6, 12, 13, 23, 10),
    "panoptic7": (3, 6, 12, 13, 23, 10, 16),
}
PRESETS = ("campus", "shelf", *_PANOPTIC)


def preset_rig(name: str, *, only: Sequence[str] = ()) -> Rig:
    """Return a published rig.

    Args:
        name: one of ``PRESETS``.
        only: names of the cameras to use, in this order; all if empty. Those of Panoptic are "00_00" to "00_30".

    Raises:
        ValueError: unknown rig or camera.
    """
    if name not in PRESETS:
        raise ValueError(f"cameras.preset = {name!r} is no published rig; expected one of {', '.join(PRESETS)}")
    file = (
        importlib.resources.files("simharness.world.rigs")
        / "data"
        / f"{'panoptic' if name in _PANOPTIC else name}.toml"
    )
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    cameras = [_camera(key, entry, data["size"]) for key, entry in data["cameras"].items()]
    if name in _PANOPTIC:
        cameras = [cameras[index] for index in _PANOPTIC[name]]
    return select(cameras, only)


def _camera(name: str, entry: dict[str, Any], size: list[int]) -> Camera:
    R = Rotation.from_rotvec(entry["rotation"]).as_matrix()
    return Camera(
        K=np.array(
            [[entry["focal"][0], 0.0, entry["center"][0]], [0.0, entry["focal"][1], entry["center"][1]], [0, 0, 1]]
        ),
        R=R,
        t=-R @ np.array(entry["position"]),
        distortion=np.array(entry.get("distortion", np.zeros(5))),
        size=(size[0], size[1]),
        name=name,
    )
