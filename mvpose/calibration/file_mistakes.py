"""Catalogue of mistakes in the files of a rig: what each one is called, how it is mended, and the reading without it.

The prior of each mistake follows how often users report it (threads of Pose2Sim, caliscope, EasyMocap, OpenCV's forum):
extrinsics from camera to world and units are the most frequent ones.
"""

from __future__ import annotations

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
    """A mistake that may be in the files.

    Attributes:
        kind: kind of finding (:data:`mvpose.calibration.findings.KINDS`).
        prior: how often users make it, relative to the others.
        text: what the user reads; ``{who}`` is the camera, or "all cameras".
        mend: lines of Python that mend it; ``{camera}`` is the expression of the camera.
        views: the cameras that it concerns; empty before it is applied.
        size: size of the mistake, names with units.
        of_all: whether it changes the agreement of the views if all cameras have it; another scale and other axes of
            the world do not.
    """

    kind: str
    prior: float
    text: str
    mend: str
    views: tuple[int, ...] = ()
    size: tuple[tuple[str, float], ...] = ()
    of_all: bool = True


_GL = np.diag([1.0, -1.0, -1.0])  # camera axes of OpenGL and Blender: y up, z backwards
_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # a world with y up in one with z up

_INVERT = "R, t = {camera}.R.T, -{camera}.R.T @ {camera}.t  # use these as R and t of the camera"
SWAPPED = Mistake(
    "cameras-swapped", 2.0, "the calibrations of {who} are exchanged", "exchange the calibration files of {who}"
)
CROPPED = Mistake(
    "image-cropped",
    0.01,
    "the pictures of {who} are cropped, the calibration is of the uncropped ones",
    "K[:2, 2] -= offset  # of the cropped picture's first pixel in the uncropped one",
)
TURNED = Mistake(
    "moved-camera", 0.05, "{who} is turned against its calibration", "mvpose repair CALIBRATION DETECTIONS --out NEW"
)


def _changes() -> Iterator[tuple[Mistake, Change]]:
    """Yield each mistake with the change that undoes it."""
    yield (
        Mistake(
            "extrinsics-inverted",
            4.0,
            "the extrinsics of {who} map from camera to world; mvpose expects world to camera",
            _INVERT,
        ),
        extrinsics(lambda R, t, C: (R.T, t)),
    )
    transposed = Mistake(
        "rotation-transposed", 2.0, "the rotation of {who} is transposed", "R = {camera}.R.T  # the translation stays"
    )
    yield transposed, extrinsics(lambda R, t, C: (R.T, -R @ t))
    yield (
        replace(transposed, mend="R = {camera}.R.T; t = -R @ {camera}.center  # the position stays"),
        extrinsics(lambda R, t, C: (R.T, C)),
    )
    center = Mistake(
        "translation-is-center",
        2.0,
        "the translation of {who} is the position of the camera in the world",
        "t = -{camera}.R @ {camera}.t",
    )
    yield center, extrinsics(lambda R, t, C: (R, t))
    yield (
        replace(
            center,
            text="the position of {who} was read as a translation twice",
            mend="t = {camera}.center  # the reader took t for the position: it is the translation",
        ),
        extrinsics(lambda R, t, C: (R, -R.T @ C)),
    )
    gl = Mistake(
        "axis-flipped",
        1.0,
        "the axes of {who} are those of OpenGL and Blender (y up, z backwards); mvpose expects y down, z forward",
        "F = np.diag([1, -1, -1]); R, t = F @ {camera}.R, F @ {camera}.t",
    )
    yield gl, extrinsics(lambda R, t, C: (_GL @ R, C))
    yield (
        replace(
            gl,
            text="the extrinsics of {who} are those of OpenGL, Blender or NeRF from camera to world",
            mend="F = np.diag([1, -1, -1]); R = F @ {camera}.R.T; t = -R @ {camera}.t",
        ),
        extrinsics(lambda R, t, C: (_GL @ R.T, t)),
    )
    turned = replace(gl, prior=0.5, text="{who}: two axes of the camera point the other way")
    for signs in ([-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]):
        flip = np.diag(signs)
        mend = f"F = np.diag({[int(s) for s in signs]}); R, t = F @ {{camera}}.R, F @ {{camera}}.t"
        yield replace(turned, mend=mend), extrinsics(turned_camera(flip))
    world = replace(
        gl, prior=0.5, of_all=False, text="the world of {who} has another vertical axis than that of the others"
    )
    for turn in (_UP, _UP.T):
        mend = f"R = {{camera}}.R @ np.array({turn.astype(int).tolist()})"
        yield replace(world, mend=mend), extrinsics(turned_world(turn))
    for factor, unit in ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.1, "decimetres"), (0.0254, "inches")):
        for scale, text, mend in (
            (factor, f"the translation of {{who}} is in {unit}", f"t = {{camera}}.t * {factor:g}"),
            (
                1.0 / factor,
                f"the translation of {{who}} was divided by {1 / factor:g}",
                f"t = {{camera}}.t / {factor:g}",
            ),
        ):
            yield (
                Mistake("wrong-unit", 0.5, text, mend, size=(("factor", scale),), of_all=False),
                extrinsics(rescaled(scale)),
            )
    for factor in (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2.0, 3.0, 4.0):
        text = f"the pictures of {{who}} are {1 / factor:.3g} times as large as those of the calibration"
        mend = f"K[:2] *= {1 / factor:.4g}  # and the size of the picture"
        yield Mistake("image-size", 0.4, text, mend, size=(("times", 1.0 / factor),)), scaled_picture(factor)
    axes = Mistake(
        "axes-swapped",
        1.0,
        "x and y of the keypoints of {who} are exchanged",
        "keypoints = keypoints[..., ::-1]",
    )
    yield axes, mapped_pixels(lambda w, h: [[0, 1, 0], [1, 0, 0]])
    for text, matrix in (
        ("clockwise", lambda w, h: [[0, 1, 0], [-1, 0, h - 1]]),
        ("anticlockwise", lambda w, h: [[0, -1, w - 1], [1, 0, 0]]),
    ):
        yield (
            replace(
                axes,
                text=f"the pictures of {{who}} are turned by 90 degrees {text} against those of the calibration",
                mend="turn the pictures back before detection, or calibrate with pictures as they are",
            ),
            mapped_pixels(matrix),
        )
    flipped = Mistake("axis-flipped", 0.5, "", "")  # of x in all pictures: the same to the views as mirrored pictures
    yield (
        replace(
            flipped,
            text="y of the keypoints of {who} counts from the lower edge; mvpose expects it from the upper one",
            mend="keypoints[..., 1] = height - 1 - keypoints[..., 1]",
        ),
        mapped_pixels(lambda w, h: [[1, 0, 0], [0, -1, h - 1]]),
    )
    yield (
        replace(
            flipped,
            text="x of the keypoints of {who} counts from the right edge; mvpose expects it from the left one",
            mend="keypoints[..., 0] = width - 1 - keypoints[..., 0]",
            of_all=False,
        ),
        mapped_pixels(lambda w, h: [[-1, 0, w - 1], [0, 1, 0]]),
    )
    yield (
        Mistake(
            "mirrored-view",
            1.0,
            "the pictures of {who} are mirrored",
            "flip the pictures before detection, or: keypoints[..., 0] = width - 1 - keypoints[..., 0]; "
            "keypoints = keypoints[:, skeleton.mirror]",
        ),
        mapped_pixels(lambda w, h: [[-1, 0, w - 1], [0, 1, 0]], exchanged=True),
    )
    yield (
        Mistake(
            "left-right-exchanged",
            0.5,
            "left and right joints of {who} have each other's names",
            "keypoints, scores = keypoints[:, skeleton.mirror], scores[:, skeleton.mirror]",
            of_all=False,
        ),
        exchanged_sides,
    )
    model = Mistake(
        "distortion-model",
        1.0,
        "the keypoints of {who} are of pictures whose distortion was removed already",
        "distortion = np.zeros(5)",
    )
    yield model, other_lens(lambda terms: np.zeros(5))
    yield (
        replace(model, text="the distortion of {who} has the other sign", mend="distortion = -{camera}.distortion"),
        other_lens(lambda terms: -terms),
    )
    yield (
        replace(
            model,
            text="the distortion terms of {who} are in the order k1 k2 k3 p1 p2; mvpose expects k1 k2 p1 p2 k3",
            mend="distortion = {camera}.distortion[[0, 1, 3, 4, 2]]",
        ),
        other_lens(lambda terms: terms[[0, 1, 3, 4, 2]]),
    )


CHANGES = tuple(_changes())
