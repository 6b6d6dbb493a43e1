"""Size of people relative to adults: the only evidence of a wrong unit of the whole rig."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.rig_size import published_limbs
from mvpose.skeleton import Skeleton

_FEWEST = 30  # bones in frames; fewer show nothing
_LEAST_SINE = 0.2  # of the angle between two viewing rays; a place found by narrower ones is vague


def relative_size(consistency: Consistency, reading: Reading, skeleton: Skeleton) -> tuple[float, int]:
    """Return how many times as large as adults people are, and from how many bones; NaN where too few are seen.

    Bones are those between joints triangulated by pairs of views from matched tracklets. Adults differ by 6 % of their
    stature (:mod:`mvpose.reconstruction.bone_length_prior`).
    """
    parents, children, length = published_limbs(skeleton)
    ratios = []
    for joints in _triangulated(consistency, reading):
        ratios.append((np.linalg.norm(joints[:, parents] - joints[:, children], axis=-1) / length).ravel())
    found = np.concatenate(ratios) if ratios else np.zeros(0)
    found = found[np.isfinite(found)]
    return (float(np.median(found)), len(found)) if len(found) >= _FEWEST else (np.nan, len(found))


def _triangulated(consistency: Consistency, reading: Reading) -> list[Floats]:
    """Return joints of matched pieces, each (n, J, 3); NaN where they are not seen by both views."""
    pieces = consistency.pieces
    rays = [consistency.rays(reading, view) for view in range(len(reading.cameras))]
    centers = reading.cameras[:, 14:17]
    result = []
    for i, j, w, matched in consistency.pairs(reading):
        cells = [slice(pieces.start[v, w], pieces.stop[v, w]) for v in (i, j)]
        offsets = [cell.start - pieces.start[v, 0] for cell, v in zip(cells, (i, j), strict=True)]
        for chosen in matched:
            rows = [np.flatnonzero(pieces.piece[cell] == each) for cell, each in zip(cells, chosen, strict=True)]
            frames = [pieces.frame[cell][row] for cell, row in zip(cells, rows, strict=True)]
            _, a, b = np.intersect1d(frames[0], frames[1], return_indices=True)
            result.append(
                _midpoints(centers[i], rays[i][offsets[0] + rows[0][a]], centers[j], rays[j][offsets[1] + rows[1][b]])
            )
    return result


def _midpoints(c: Floats, u: Floats, d: Floats, v: Floats) -> Floats:
    """Return the points nearest to two rays each, (..., 3); NaN where they are almost parallel."""
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    base = d - c
    determinant = uu * vv - uv * uv
    with np.errstate(invalid="ignore", divide="ignore"):
        determinant = np.where(determinant > _LEAST_SINE**2 * uu * vv, determinant, np.nan)
        s = (vv * (u @ base) - uv * (v @ base)) / determinant
        r = (uv * (u @ base) - uu * (v @ base)) / determinant
    return 0.5 * (c + s[..., None] * u + d + r[..., None] * v)
