"""Published rigs: Campus, Shelf, and the sets of Panoptic HD cameras that papers use.

The numbers are data of the package, one file a rig, rounded to what matters (half a pixel in the picture) and
in our frame: metres, z up, the floor at z = 0, the middle of the captured space at the origin. Of each camera: focal
lengths, principal point and image size in pixels, distortion k1 k2 p1 p2 k3 (none where it is absent), its position in
metres, and the rotation world to camera as a Rodrigues vector, radians.
"""

from __future__ import annotations

import importlib.resources
import tomllib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.camera import Camera, Rig
from simharness.formats.calibration.selection import select

# HD cameras of the Panoptic Studio. CMU0 to CMU4: the rigs between which methods are transferred; the others are CMU0
# with fewer and more cameras, each set a beginning of the next.
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
    """A published rig.

    Args:
        name: one of ``PRESETS``.
        only: names of the cameras to take, in this order; empty: all. Panoptic's are "00_00" to "00_30".

    Raises:
        ValueError: no such rig, or no such camera in it.
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
