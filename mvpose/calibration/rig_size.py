"""Size of a rig by the bone lengths of the people it sees, for calibrations whose scale is not trusted.

Where the scale is trusted, the size of people relative to adults is the only evidence of a wrong unit of the whole rig
(:func:`relative_size`).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.sightings import Sightings
from mvpose.camera import Rig
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.bone_length_prior import STATURE_DEVIATION, published_bones
from mvpose.skeleton import Skeleton

_FEWEST = 30  # bones in frames, of a person and of all; fewer show nothing
_LEAST_SINE = 0.2  # of the angle between two viewing rays; a place found by narrower ones is vague


@dataclass(frozen=True)
class Bodies:
    """People in frames, by the joints that several views see."""

    joints: Floats
    """(n, J, 3), metres; NaN where unknown."""
    person: Integers
    """Person of each, (n,)."""
    frame: Integers
    """Frame of each, (n,)."""
    skeleton: Skeleton
    """The J joints."""

    @classmethod
    def of_joints(cls, sightings: Sightings, first: Integers, positions: Floats) -> Self:
        """Return the bodies of joints that were placed.

        Args:
            sightings: matched keypoints.
            first: a sighting of each joint, (G,).
            positions: of the joints, (G, 3), metres; NaN where unknown.
        """
        who = np.stack([sightings.frame[first], sightings.person[first]])
        names, body = np.unique(who, axis=1, return_inverse=True)
        joints = np.full((names.shape[1], len(sightings.skeleton), 3), np.nan)
        joints[body.ravel(), sightings.joint[first]] = positions
        return cls(joints, names[1], names[0], sightings.skeleton)

    def joint(self, name: str) -> Floats:
        """Return the places of a joint, (n, 3)."""
        return self.joints[:, self.skeleton.index(name)]

    def middle(self, pair: str) -> Floats:
        """Return the middle of a left and a right joint, such as "hip", (n, 3)."""
        return 0.5 * (self.joint(f"left_{pair}") + self.joint(f"right_{pair}"))

    @property
    def upright(self) -> Floats:
        """Unit vectors from hips to shoulders, of the bodies of which both are known, (m, 3)."""
        trunks = self.middle("shoulder") - self.middle("hip")
        trunks = trunks[np.isfinite(trunks[:, 0])]
        return np.asarray(trunks / np.linalg.norm(trunks, axis=1, keepdims=True), np.float64)


def size_of_people(bodies: Bodies) -> tuple[float, float]:
    """Return how many times as large as adults people are, and the standard deviation; NaN and infinity if unknown.

    Of each person the median over bones and frames counts, which wrong keypoints hardly change; statures of adults
    differ by 5.5 %, so that n people give the size up to 5.5 % / sqrt(n).
    """
    parents, children, length = published_limbs(bodies.skeleton)
    ratio = np.linalg.norm(bodies.joints[:, parents] - bodies.joints[:, children], axis=-1) / length
    known, owner = np.isfinite(ratio), bodies.person
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
    return (float(np.median(found)), len(found)) if len(found) >= _FEWEST else (np.nan, len(found))


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
