"""Faces of the mesh that expressions, beards and bald heads colour: ``python -m tools.body.faces FILE.npz``.

They are found on the mean body, so that the colours of two people do not depend on their shape. The shape of the head
does not change with them. A smile shows teeth between the lips and draws the corners of the mouth outwards and up; a
speaking mouth is open; a frown lowers the brows and draws the corners down. Every mouth has a dark line between the
lips, and lids shade the upper part of the eyes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.body import FacePart, body_model
from simharness.world.humans.face_colors import mean_centers

_LINE = 0.0013  # half the height of the line between the lips, metres
_INNER, _DEEP = 0.0035, 0.005  # half the height of the inner side of the lips, and how far its middle comes forward
_WIDE = 0.022  # half the width of a mouth, metres
_CREASE, _CREASE_SHADE = (0.0035, 0.80)  # half the width of creases in skin, metres, and the factor of their middle
_LID, _LID_SHADE = 0.005, 0.72  # height of the shadow of the upper lid on the eye, metres
_EDGE = 0.008  # width over which a beard fades out, metres
_MOUSTACHE, _NECK, _JAW = 0.017, 0.062, 0.075  # reach of a beard over, below and behind the mouth, metres
_CHEEK = 0.55  # slope of its upper edge towards the ears


@dataclass(frozen=True)
class Expression:
    """Expression of a face.

    Attributes:
        open: half the height of the opening between the lips, metres.
        reach: half its width, metres.
        corner: how far the corners of the mouth are drawn out and up, metres; zeros for none.
        frown: metres by which the inner ends of the brows reach lower.
    """

    open: float = 0.0
    reach: float = 0.0
    corner: tuple[float, float] = (0.0, 0.0)
    frown: float = 0.0


EXPRESSIONS = {
    "smile": Expression(open=0.0032, reach=0.018, corner=(0.009, 0.006)),
    "speaking": Expression(open=0.0048, reach=0.013),
    "frown": Expression(corner=(0.006, -0.006), frown=0.007),
}


def marked_faces() -> dict[str, np.ndarray]:
    """Return indices of faces, and factors or shares of each, by the names that the package uses."""
    part, centers = body_model().part, mean_centers()
    lips, skin = part == FacePart.LIPS, part == FacePart.SKIN
    mouth = centers[lips].mean(axis=0)
    across, up = np.abs(centers[:, 1]), centers[:, 2] - mouth[2]
    ahead = centers[:, 0] - mouth[0]
    inner = (np.abs(up) < _INNER) & (ahead < _DEEP * (1 - (across / _WIDE) ** 2) - 0.0005)
    marks: dict[str, np.ndarray] = {"line": np.flatnonzero(lips & ((np.abs(up) < _LINE) | inner))}
    front = skin & (centers[:, 0] > mouth[0] - 0.06)
    for name, shape in EXPRESSIONS.items():
        if shape.open > 0:
            shut = np.clip(1 - (across / shape.reach) ** 2, 0, 1)
            marks[f"{name} open"] = np.flatnonzero(lips & (np.abs(up) < shape.open * shut))
        out, rise = shape.corner
        if out > 0:
            share = np.clip((across - _WIDE) / out, 0, 1)
            away = np.hypot(across - _WIDE - share * out, up - share * rise)
            depth = np.clip(1 - away / _CREASE, 0, 1)
            faces = np.flatnonzero(front & (depth > 0))
            marks[f"{name} crease"] = faces
            marks[f"{name} shade"] = (1 - (1 - _CREASE_SHADE) * depth[faces]).astype(np.float32)
        if shape.frown > 0:
            brows = part == FacePart.BROW
            lowest = centers[brows, 2].min() - shape.frown * np.clip(1.6 - across / 0.02, 0, 1)
            between = front & (across > 0.008) & (across < 0.03)
            between &= (centers[:, 2] > lowest) & (centers[:, 2] < centers[brows, 2].max())
            marks[f"{name} brow"] = np.flatnonzero(between)
    eyes = np.flatnonzero(np.isin(part, [FacePart.SCLERA, FacePart.IRIS]))
    top = centers[eyes, 2].max()
    lid = np.clip((top - centers[eyes, 2]) / _LID - 0.6, 0, 1)
    marks |= {"eyes": eyes, "lid shade": (_LID_SHADE + (1 - _LID_SHADE) * lid).astype(np.float32)}
    face = np.flatnonzero(skin & (centers[:, 2] > mouth[2] - 0.2))
    density = _beard(centers[face] - mouth)
    marks |= {"beard": face[density > 0], "density": density[density > 0]}
    scalp = np.flatnonzero(part == FacePart.SCALP)
    height = centers[scalp, 2] - centers[scalp, 2].min()
    return marks | {"scalp": scalp, "height": height / height.max()}


def _beard(places: Floats) -> Floats:
    """Return the density of a beard at places relative to the middle of the mouth, (n, 3) metres, 0 to 1, (n,)."""
    behind = np.maximum(-places[:, 0] - 0.03, 0.0)
    inside = np.minimum(_MOUSTACHE + _CHEEK * behind - places[:, 2], places[:, 2] + _NECK)
    inside = np.minimum(inside, places[:, 0] + _JAW)
    return np.asarray(np.clip(inside / _EDGE, 0.0, 1.0))


if __name__ == "__main__":
    np.savez_compressed(Path(sys.argv[1]), allow_pickle=False, **marked_faces())
