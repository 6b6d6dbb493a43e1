"""Catalogue of mistakes in the files of a rig: what each one is called, how it is mended, and the reading without it.

The prior of each mistake follows how often users report it (threads of Pose2Sim, caliscope, EasyMocap, OpenCV's forum):
extrinsics from camera to world and units are the most frequent ones.
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose.calibration.reading_changes import (
    Change,
    exchanged_sides,
    extrinsics,
    mapped_pixels,
    other_lens,
    rescaled,
    scaled_picture,
    turned_camera,
    turned_world,
)


@dataclass(frozen=True)
class Mistake:
    """A mistake that may be in the files."""

    kind: str
    """Kind of finding (:data:`mvpose.calibration.findings.KINDS`)."""
    prior: float
    """How often users make it, relative to the others."""
    text: str
    """What the user reads; ``{who}`` is the camera, or "all cameras"."""
    mend: str
    """Name and values of the change of the calibration that mends it (:mod:`.mends`); empty where none does."""
    advice: str = ""
    """What to do where no change of the calibration mends it."""
    views: tuple[int, ...] = ()
    """The cameras that it concerns; empty before it is applied."""
    size: tuple[tuple[str, float], ...] = ()
    """Size of the mistake, names with units."""
    of_all: bool = True
    """Whether it changes the agreement of the views if all cameras have it; another scale and other axes of the world
    do not."""


_GL = np.diag([1.0, -1.0, -1.0])  # camera axes of OpenGL and Blender: y up, z backwards
_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # a world with y up in one with z up

SWAPPED = Mistake("cameras-swapped", 2.0, "the calibrations of {who} are exchanged", "exchanged")
CROPPED = Mistake(
    "image-cropped", 0.01, "the pictures of {who} are cropped, but the calibration is for whole pictures", "crop"
)
TURNED = Mistake("moved-camera", 0.05, "{who} is turned against its calibration", "")


def _mirrored(width: int, height: int) -> list[list[float]]:
    return [[-1, 0, width - 1], [0, 1, 0]]


_CHANGES: dict[str, Change] = {
    "inverted": extrinsics(lambda R, t, C: (R.T, t)),
    "transposed": extrinsics(lambda R, t, C: (R.T, -R @ t)),
    "transposed-in-place": extrinsics(lambda R, t, C: (R.T, C)),
    "t-is-center": extrinsics(lambda R, t, C: (R, t)),
    "center-is-t": extrinsics(lambda R, t, C: (R, -R.T @ C)),
    "opengl": extrinsics(lambda R, t, C: (_GL @ R, C)),
    "opengl-inverted": extrinsics(lambda R, t, C: (_GL @ R.T, t)),
    "flipped-xy": extrinsics(turned_camera(np.diag([-1.0, -1.0, 1.0]))),
    "flipped-xz": extrinsics(turned_camera(np.diag([-1.0, 1.0, -1.0]))),
    "world-y-up": extrinsics(turned_world(_UP)),
    "world-y-down": extrinsics(turned_world(_UP.T)),
    "xy-exchanged": mapped_pixels(lambda w, h: [[0, 1, 0], [1, 0, 0]]),
    "rotated-clockwise": mapped_pixels(lambda w, h: [[0, 1, 0], [-1, 0, h - 1]]),
    "rotated-anticlockwise": mapped_pixels(lambda w, h: [[0, -1, w - 1], [1, 0, 0]]),
    "y-from-below": mapped_pixels(lambda w, h: [[1, 0, 0], [0, -1, h - 1]]),
    "x-from-the-right": mapped_pixels(_mirrored),  # in all pictures the same to the views as mirrored pictures
    "mirrored": mapped_pixels(_mirrored, exchanged=True),
    "sides-exchanged": exchanged_sides,
    "undistorted": other_lens(lambda terms: np.zeros(5)),
    "distortion-sign": other_lens(lambda terms: -terms),
    "distortion-order": other_lens(lambda terms: terms[[0, 1, 3, 4, 2]]),
}
_BY: dict[str, Callable[[float], Change]] = {
    "unit": lambda scale: extrinsics(rescaled(scale)),
    "resolution": scaled_picture,
}


def _read() -> Iterator[tuple[Mistake, Change]]:
    """Yield each mistake of ``mistakes.toml`` with the change that undoes it."""
    file = Path(__file__).parent / "data" / "mistakes.toml"
    for entry in tomllib.loads(file.read_text(encoding="utf-8"))["mistakes"]:
        change, by = entry.pop("change", entry["mend"]), entry.pop("by", None)
        mistake = Mistake(**{**entry, "size": tuple(entry.get("size", {}).items())})
        yield mistake, _CHANGES[change] if by is None else _BY[change](by)


CHANGES = tuple(_read())
