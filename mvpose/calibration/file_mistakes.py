"""Catalogue of mistakes in the files of a rig: what each one is called, how it is mended, and the reading without it.

The prior of each mistake follows how often users report it (threads of Pose2Sim, caliscope, EasyMocap, OpenCV's forum):
extrinsics from camera to world and units are the most frequent ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

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


def _changes() -> Iterator[tuple[Mistake, Change]]:
    """Yield each mistake with the change that undoes it."""
    text = "the extrinsics of {who} map from camera to world; mvpose expects world to camera"
    yield Mistake("extrinsics-inverted", 4.0, text, "inverted"), extrinsics(lambda R, t, C: (R.T, t))
    transposed = Mistake("rotation-transposed", 2.0, "the rotation of {who} is transposed", "transposed")
    yield transposed, extrinsics(lambda R, t, C: (R.T, -R @ t))
    yield replace(transposed, mend="transposed-in-place"), extrinsics(lambda R, t, C: (R.T, C))
    text = "the translation of {who} is the position of the camera in the world"
    center = Mistake("translation-is-center", 2.0, text, "t-is-center")
    yield center, extrinsics(lambda R, t, C: (R, t))
    text = "the position of {who} was read as a translation twice"
    yield replace(center, text=text, mend="center-is-t"), extrinsics(lambda R, t, C: (R, -R.T @ C))
    text = "the axes of {who} are those of OpenGL and Blender (y up, z backwards); mvpose expects y down, z forward"
    gl = Mistake("axis-flipped", 1.0, text, "opengl")
    yield gl, extrinsics(lambda R, t, C: (_GL @ R, C))
    text = "the extrinsics of {who} are those of OpenGL, Blender or NeRF from camera to world"
    yield replace(gl, text=text, mend="opengl-inverted"), extrinsics(lambda R, t, C: (_GL @ R.T, t))
    turned = replace(gl, prior=0.5, text="{who}: two axes of the camera point the other way")
    for which, signs in (("xy", [-1.0, -1.0, 1.0]), ("xz", [-1.0, 1.0, -1.0])):
        yield replace(turned, mend=f"flipped-{which}"), extrinsics(turned_camera(np.diag(signs)))
    text = "the world of {who} has another vertical axis than that of the others"
    world = replace(gl, prior=0.5, text=text, of_all=False)
    for mend, turn in (("world-y-up", _UP), ("world-y-down", _UP.T)):
        yield replace(world, mend=mend), extrinsics(turned_world(turn))
    for factor, unit in ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.1, "decimetres"), (0.0254, "inches")):
        given, divided = f"is in {unit}", f"was divided by {1 / factor:g}"
        for scale, what in ((factor, given), (1.0 / factor, divided)):
            text, size = f"the translation of {{who}} {what}", (("factor", scale),)
            wrong = Mistake("wrong-unit", 0.5, text, f"unit:{scale:.6g}", size=size, of_all=False)
            yield wrong, extrinsics(rescaled(scale))
    for factor in (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2.0, 3.0, 4.0):
        text = f"the pictures of {{who}} are {1 / factor:.3g} times as large as those of the calibration"
        mend = f"resolution:{1 / factor:.6g}"
        yield Mistake("image-size", 0.4, text, mend, size=(("times", 1.0 / factor),)), scaled_picture(factor)
    yield from _changes_of_pixels()
    text = "the keypoints of {who} are of pictures whose distortion was removed already"
    model = Mistake("distortion-model", 1.0, text, "undistorted")
    yield model, other_lens(lambda terms: np.zeros(5))
    text = "the distortion of {who} has the other sign"
    yield replace(model, text=text, mend="distortion-sign"), other_lens(lambda terms: -terms)
    text = "the distortion terms of {who} are in the order k1 k2 k3 p1 p2; mvpose expects k1 k2 p1 p2 k3"
    yield replace(model, text=text, mend="distortion-order"), other_lens(lambda terms: terms[[0, 1, 3, 4, 2]])


def _changes_of_pixels() -> Iterator[tuple[Mistake, Change]]:
    """Yield mistakes about axes of pictures and sides of people."""
    text = "x and y of the keypoints of {who} are exchanged"
    advice = "exchange x and y of the keypoints in the files of {who}"
    axes = Mistake("axes-swapped", 1.0, text, "", advice)
    yield axes, mapped_pixels(lambda w, h: [[0, 1, 0], [1, 0, 0]])
    for way, matrix in (
        ("clockwise", lambda w, h: [[0, 1, 0], [-1, 0, h - 1]]),
        ("anticlockwise", lambda w, h: [[0, -1, w - 1], [1, 0, 0]]),
    ):
        text = f"the pictures of {{who}} are turned by 90 degrees {way} against those of the calibration"
        yield replace(axes, text=text, mend=f"rotated-{way}", advice=""), mapped_pixels(matrix)
    text = "y of the keypoints of {who} counts from the lower edge; mvpose expects it from the upper one"
    advice = "count y of the keypoints in the files of {who} from the upper edge: height - 1 - y"
    yield Mistake("axis-flipped", 0.5, text, "", advice), mapped_pixels(lambda w, h: [[1, 0, 0], [0, -1, h - 1]])
    # Of x in all pictures: the same to the views as mirrored pictures.
    text = "x of the keypoints of {who} counts from the right edge; mvpose expects it from the left one"
    advice = "count x of the keypoints in the files of {who} from the left edge: width - 1 - x"
    yield Mistake("axis-flipped", 0.5, text, "", advice, of_all=False), mapped_pixels(_mirrored)
    text, advice = "the pictures of {who} are mirrored", "mirror the pictures of {who} back before the detection"
    yield Mistake("mirrored-view", 1.0, text, "mirrored", advice), mapped_pixels(_mirrored, exchanged=True)
    text = "left and right joints of {who} have each other's names"
    advice = "exchange left and right joints in the files of {who}, or detect again in pictures that are not mirrored"
    yield Mistake("left-right-exchanged", 0.5, text, "", advice, of_all=False), exchanged_sides


def _mirrored(width: int, height: int) -> list[list[float]]:
    return [[-1, 0, width - 1], [0, 1, 0]]


CHANGES = tuple(_changes())
