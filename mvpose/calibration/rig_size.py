"""Size of a rig by the bone lengths of the people it sees, for calibrations whose scale is not trusted.

Where the scale is trusted, the size of people relative to adults is the only evidence of a wrong unit of the whole rig
(:func:`relative_size`).
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.camera import Rig
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.bone_length_prior import STATURE_DEVIATION, published_bones
from mvpose.skeleton import Skeleton

_FEWEST = 30  # bones in frames of a person; fewer show nothing

_FEWEST_BONES = 30  # bones in frames; fewer show nothing
_LEAST_SINE = 0.2  # of the angle between two viewing rays; a place found by narrower ones is vague


def size_of_people(
    positions: Floats, body: Integers, person: Integers, kind: Integers, skeleton: Skeleton
) -> tuple[float, float]:
    """Return how many times as large as adults people are, and the standard deviation; NaN and infinity if unknown.

    Of each person the median over bones and frames counts, which wrong keypoints hardly change; statures of adults
    differ by 5.5 %, so that n people give the size up to 5.5 % / sqrt(n).

    Args:
        positions: joints, (G, 3), metres; NaN where unknown.
        body: number of the person in a frame that each joint belongs to, (G,).
        person: person of each joint, (G,).
        kind: index of each joint in the skeleton, (G,).
        skeleton: the joints.
    """
    bodies = int(body.max(initial=-1)) + 1
    joints, owner = np.full((bodies, len(skeleton), 3), np.nan), np.zeros(bodies, np.int64)
    joints[body, kind], owner[body] = positions, person
    parents, children, length = published_limbs(skeleton)
    ratio = np.linalg.norm(joints[:, parents] - joints[:, children], axis=-1) / length
    known = np.isfinite(ratio)
    people = [each for each in np.unique(owner) if known[owner == each].sum() >= _FEWEST]
    if not people:
        return np.nan, np.inf
    sizes = [np.median(ratio[owner == each][known[owner == each]]) for each in people]
    return float(np.median(sizes)), STATURE_DEVIATION / np.sqrt(len(people))


def published_limbs(skeleton: Skeleton) -> tuple[Integers, Integers, Floats]:
    """Return parents, children and lengths, metres, of bones whose joints detectors define clearly, (B,) each."""
    graph, published = bone_graph(skeleton), published_bones(skeleton)
    good = (graph.parents >= 0) & (published.length > 0.2) & (published.definition < 0.05)
    return graph.parents[good], graph.children[good], published.length[good]


def resized(rig: Rig, factor: float) -> Rig:
    """Return a rig of another size, about the mean of its optical centres."""
    middle = rig.centers.mean(axis=0)
    centers = middle + factor * (rig.centers - middle)
    return Rig([replace(camera, t=-camera.R @ center) for camera, center in zip(rig, centers, strict=True)])


def relative_size(
    consistency: Consistency, reading: Reading, skeleton: Skeleton, *, views: Sequence[int] | None = None
) -> tuple[float, int]:
    """Return how many times as large as adults people are, and from how many bones; NaN where too few are seen.

    Bones are those between joints triangulated by pairs of views from matched tracklets. Adults differ by 6 % of their
    stature (:mod:`mvpose.reconstruction.bone_length_prior`).

    Args:
        consistency: evidence on the detections.
        reading: the cameras.
        skeleton: the joints.
        views: views whose pairs count; by default all.
    """
    parents, children, length = published_limbs(skeleton)
    centers, ratios = reading.cameras[:, 14:17], [np.zeros(0)]
    for i, j in itertools.combinations(range(len(reading.cameras)) if views is None else views, 2):
        a, b = consistency.matched_rows(reading, i, j)
        joints = _midpoints(centers[i], consistency.rays(reading, i)[a], centers[j], consistency.rays(reading, j)[b])
        ratios.append((np.linalg.norm(joints[:, parents] - joints[:, children], axis=-1) / length).ravel())
    found = np.concatenate(ratios)
    found = found[np.isfinite(found)]
    return (float(np.median(found)), len(found)) if len(found) >= _FEWEST_BONES else (np.nan, len(found))


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
