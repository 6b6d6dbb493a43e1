"""Normal equations of the errors of cameras, with the joints eliminated by the Schur complement.

Each joint is seen by two views or more. Its position is free, so only the disagreement of the views is evidence about
the cameras: bundle adjustment with a Schur complement (Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000).
Errors of keypoints have a Student distribution. Both the diagnosis, which compares faults of single cameras over time
(:mod:`.cameras`), and the repair, which adjusts all cameras (:mod:`.adjustment`), use these equations.

Parameters of a camera, :data:`~mvpose.calibration.joint_elimination.PARAMETERS`: rotation about its own axes (rad;
``R' = exp(w) R``), centre along the axes of the world (m), logarithm of the focal length, principal point (pixels), k1
of the lens, and the offset of the clock (true minus given time of its pictures, s): keypoints move back by their
velocity times the offset.

The joints are those that several views see, in blocks of time. A camera that moved misplaces all people alike. One
wrong tracklet among right ones would be taken for a camera that moved, because it misplaces its person in all frames:
people whose keypoints in one view fit much worse than the rest are left out there (:func:`without_mismatches`).
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.joint_elimination import PARAMETERS, SightingArrays, TriangulatedJoints, accumulate, triangulate
from mvpose.calibration.sightings import Sightings
from mvpose.calibration.tracklets import frame_times
from mvpose.camera import Camera

ROTATION, TRANSLATION, POSE = slice(0, 3), slice(3, 6), slice(0, 6)
FOCAL, CENTER, K1, CLOCK = slice(6, 7), slice(7, 9), slice(9, 10), slice(10, 11)
"""Places of the parameters of a camera."""

FREEDOM = 4.0
"""Degrees of freedom of the Student distribution of keypoints, whose tails are those of real detectors."""

_RAYLEIGH = float(np.sqrt(2.0 * np.log(2.0)))  # median distance of two Gaussian errors of unit variance
_USUAL_SCALE = 0.5
"""Standard deviation of keypoints relative to the error model, of simulated detectors in rigs without errors."""

_UNSEEN = 400.0  # squared residual of a keypoint that no joint explains, in standard deviations

_JOINT_SPACING = 0.1  # seconds between frames that are used
_BLOCK = 0.5  # seconds: blocks of time; errors of detectors last less
_MOST_BLOCKS = 48  # of a long recording, whose blocks are longer

_TIMES = 3.0  # as far off as the best quarter of the people in that view
_SIGMAS = 4.0  # standard deviations of a keypoint; farther is not noise
_FEWEST = 20  # sightings of a person in a view


@dataclass(frozen=True)
class JointViews:
    """Sightings of the same joint of the same person at the same time, one after the other."""

    start: Integers
    """First sighting of each of G joints, and k at the end, (G + 1,)."""
    block: Integers
    """Block of time of each joint, (G,)."""
    person: Integers
    """Person of each joint, (G,)."""
    view: Integers
    """View of each sighting, (k,)."""
    pixels: Floats
    """Keypoints as detected, (k, 2)."""
    sigma: Floats
    """Standard deviation of each keypoint, pixels, (k,)."""
    velocity: Floats
    """Velocity of each keypoint in its picture, pixels/s, (k, 2); 0 where it is unknown."""
    blocks: int
    """Number of blocks, B."""
    cluster: Integers | None = None
    """Cluster of each joint, (G,), for which gradients are summed; by default its block."""
    importance: Floats | None = None
    """Weight of the evidence of each joint, (G,); by default 1."""

    @property
    def joint(self) -> Integers:
        """Joint of each sighting, (k,)."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    def of_person(self, person: int) -> Self:
        """Return the joints of one person, in the same blocks of time."""
        joints = self.person == person
        counts = np.diff(self.start)
        rows = np.repeat(joints, counts)
        of_joints = {name: getattr(self, name) for name in ("block", "person", "cluster", "importance")}
        chosen: dict[str, Any] = {k: None if v is None else v[joints] for k, v in of_joints.items()}
        chosen |= {name: getattr(self, name)[rows] for name in ("view", "pixels", "sigma", "velocity")}
        return replace(self, start=np.append(0, np.cumsum(counts[joints])), **chosen)


@dataclass(frozen=True)
class NormalEquations:
    """Quadratic form of the errors of the cameras around a state: ``0.5 dᵀ H d + gᵀ d`` for a change ``d``."""

    H: Floats
    """Curvature of each block of time, (B, 11 V, 11 V)."""
    g: Floats
    """Gradient of each cluster, (clusters, 11 V)."""
    joints: Floats
    """Places of the joints, (G, 3), metres."""
    residuals: Floats
    """Projected minus detected pixels, (k, 2); NaN where the joint has no place."""
    weights: Floats
    """Weights of the sightings relative to their error model, (k,)."""
    scale: float
    """Standard deviation of keypoints relative to the error model."""
    cost: float
    """Minus the logarithm of the likelihood, up to a constant."""


def normal_equations(
    cameras: Floats, sightings: JointViews, *, scale: float = 0.0, joints: Floats | None = None
) -> NormalEquations:
    """Return the normal equations of all cameras at a state.

    Args:
        cameras: cameras in each block of time, from :func:`with_errors`, (B, V, 23).
        sightings: sightings of joints.
        scale: standard deviation of keypoints relative to the error model; 0: estimated.
        joints: places from which the search for the joints starts, (G, 3), NaN where unknown; by default they are
            triangulated.
    """
    s = sightings
    scale_now = scale or 0.5
    first = np.full((len(s.start) - 1, 3), np.nan) if joints is None else joints
    for _ in range(1 if scale else 2):
        found, residuals, weights, squared, freedom = triangulate(
            cameras, s.start, s.block, s.view, s.pixels, s.velocity, s.sigma, scale_now, FREEDOM, first
        )
        kept = freedom > 0
        if not scale and kept.any():
            # The median of squared residuals is little affected by wrong keypoints; that of chi² with the freedom f is
            # about f (1 - 2 / (9 f))³.
            f = freedom[kept]
            scale_now = float(np.clip(np.sqrt(np.median(squared[kept] / (f * (1 - 2 / (9 * f)) ** 3))), 0.1, 3.0))
    size = PARAMETERS * cameras.shape[1]
    cluster = s.block if s.cluster is None else s.cluster
    importance = np.ones(len(first)) if s.importance is None else s.importance
    H = np.zeros((s.blocks, size, size))
    g = np.zeros((s.blocks if s.cluster is None else int(cluster.max(initial=0)) + 1, size))
    seen = SightingArrays(s.start, s.block, s.view, s.velocity, s.sigma)
    accumulate(H, g, cameras, seen, cluster, importance, TriangulatedJoints(found, residuals, weights), scale_now)
    square = np.nan_to_num((residuals**2).sum(axis=1) / (scale_now * s.sigma) ** 2, nan=_UNSEEN)
    cost = 0.5 * (FREEDOM + 2.0) * float(importance[s.joint] @ np.log1p(square / FREEDOM))
    return NormalEquations(H, g, found, residuals, weights, scale_now, cost)


def changed(camera: Camera, change: Floats) -> Camera:
    """Return a camera with changed parameters, (11,); the same one where all are 0 but that of the clock."""
    if not np.delete(change, CLOCK).any():
        return camera
    R = Rotation.from_rotvec(change[ROTATION]).as_matrix() @ camera.R
    K, distortion = camera.K.copy(), camera.distortion.copy()
    K[:2, :2] *= np.exp(change[FOCAL])
    K[:2, 2] += change[CENTER]
    distortion[0] += change[K1].item()
    return replace(camera, K=K, R=R, t=-R @ (camera.center + change[TRANSLATION]), distortion=distortion)


def difference(given: Camera, other: Camera) -> Floats:
    """Return the parameters that change a camera into another one, (11,), with 0 for the clock."""
    result = np.zeros(PARAMETERS)
    result[ROTATION] = Rotation.from_matrix(other.R @ given.R.T).as_rotvec()
    result[TRANSLATION] = other.center - given.center
    result[FOCAL] = np.log(other.K[0, 0] / given.K[0, 0])
    result[CENTER] = other.K[:2, 2] - given.K[:2, 2]
    result[K1] = other.distortion[0] - given.distortion[0]
    return result


def with_errors(cameras: Floats, change: Floats) -> Floats:
    """Return cameras with changed parameters.

    Args:
        cameras: packed cameras, (V, 22).
        change: change of the parameters in each block of time, (B, 11 V).

    Returns:
        (B, V, 23): the 22 numbers of :attr:`mvpose.Rig.packed`, and the offset of the clock in seconds.
    """
    views = len(cameras)
    change = change.reshape(-1, views, PARAMETERS)
    result = np.zeros((len(change), views, 23))
    result[:, :, :22] = cameras
    turns = Rotation.from_rotvec(change[:, :, :3].reshape(-1, 3)).as_matrix().reshape(-1, views, 3, 3)
    result[:, :, 5:14] = (turns @ cameras[:, 5:14].reshape(views, 3, 3)).reshape(-1, views, 9)
    result[:, :, 14:17] += change[:, :, 3:6]
    result[:, :, [0, 1, 3]] *= np.exp(change[:, :, 6:7])
    result[:, :, [2, 4]] += change[:, :, 7:9]
    result[:, :, 17] += change[:, :, 9]
    result[:, :, 22] = change[:, :, 10]
    return result


def residuals_of_others(cameras: Floats, sightings: JointViews, *, scale: float) -> tuple[Floats, Floats]:
    """Return the median distance of each view's keypoints from the joints that the other views see, (V,), pixels.

    The second result is what these medians are in a rig without errors: that of the error model of keypoints, for
    people as large in the pictures as these, with the error of the joint by the other views.

    Args:
        cameras: packed cameras, (V, 22).
        sightings: sightings of joints.
        scale: standard deviation of keypoints relative to the error model.
    """
    s = sightings
    views = len(cameras)
    states = with_errors(cameras, np.zeros((s.blocks, PARAMETERS * views)))
    seen = np.repeat(np.diff(s.start), np.diff(s.start))  # views of the joint of each sighting
    start, result, usual = np.full((len(s.start) - 1, 3), np.nan), np.full(views, np.nan), np.full(views, np.nan)
    for view in range(views):
        own = s.view == view
        sigma = np.where(own, 1e4 * s.sigma, s.sigma)
        _, residuals, *_ = triangulate(
            states, s.start, s.block, s.view, s.pixels, s.velocity, sigma, scale, FREEDOM, start
        )
        rows = np.flatnonzero(own & (seen > 2))
        distance = np.linalg.norm(residuals[rows], axis=1)
        known = np.isfinite(distance)
        if known.any():
            result[view] = np.median(distance[known])
            others = 1.0 + 2.0 / (seen[rows] - 1.0)  # variance of a joint that so many rays place, and of its keypoint
            usual[view] = _RAYLEIGH * _USUAL_SCALE * np.median((s.sigma[rows] * np.sqrt(others))[known])
    return result, usual


def joint_views(sightings: Sightings) -> tuple[JointViews, Integers]:
    """Return the joints seen by two views or more, in frames 0.1 s apart, and the sightings' rows.

    Returns:
        The joints by blocks of time, and the row of each of their sightings among those given, (k,).
    """
    when = frame_times(sightings.times)
    pictures = np.isfinite(when)
    slot = np.where(pictures, np.floor((when - when[pictures].min(initial=np.inf)) / _JOINT_SPACING + 1e-9), -1)
    chosen = np.zeros(len(when), np.bool_)
    chosen[np.unique(slot, return_index=True)[1]] = True
    chosen &= pictures
    rows = np.flatnonzero(chosen[sightings.frame] & sightings.shared)
    joints, people = len(sightings.skeleton), int(sightings.person.max(initial=0)) + 1
    key = (sightings.frame[rows] * people + sightings.person[rows]) * joints + sightings.joint[rows]
    order = np.argsort(key, kind="stable")
    rows, key = rows[order], key[order]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    times = when[sightings.frame[rows[start]]]
    length = max(_BLOCK, float(np.ptp(times)) / _MOST_BLOCKS) if len(times) else _BLOCK
    used, number = np.unique(np.floor((times - times.min(initial=np.inf)) / length + 1e-9), return_inverse=True)
    velocity = sightings.velocity
    assert velocity is not None
    views = JointViews(
        np.append(start, len(rows)).astype(np.int64),
        number.astype(np.int64),
        sightings.person[rows[start]],
        sightings.view[rows],
        np.ascontiguousarray(sightings.pixels[rows]),
        sightings.sigma[rows],
        np.ascontiguousarray(velocity[rows]),
        max(len(used), 1),
    )
    return views, rows


def without_mismatches(cameras: Floats, sightings: Sightings, joints: JointViews, rows: Integers) -> Sightings:
    """Return the sightings without those of a person in a view who was matched wrongly there.

    Args:
        cameras: packed cameras, (V, 22).
        sightings: all sightings.
        joints: joints of them that several views see.
        rows: rows of the sightings of ``joints``, (k,).
    """
    views, count = len(cameras), int(sightings.person.max(initial=-1)) + 1
    equations = normal_equations(with_errors(cameras, np.zeros((joints.blocks, PARAMETERS * views))), joints)
    distance = np.linalg.norm(equations.residuals, axis=1) / (equations.scale * joints.sigma)
    cell = sightings.person[rows] * views + joints.view
    off = np.full(count * views, np.nan)
    known = np.isfinite(distance)
    for each in np.unique(cell[known]):
        part = distance[known & (cell == each)]
        if len(part) >= _FEWEST:
            off[each] = np.median(part)
    wrong = _much_farther(off.reshape(count, views))
    return sightings.select(~wrong[sightings.person, sightings.view])


def _much_farther(off: Floats) -> Bools:
    """Return the people (n, V) who are much farther off than the others in a view; NaN is unknown."""
    wrong = np.zeros(off.shape, np.bool_)
    for view in range(off.shape[1]):
        known = np.isfinite(off[:, view])
        if known.sum() > 1:
            usual = np.quantile(off[known, view], 0.25, method="lower")
            wrong[known, view] = off[known, view] > max(_TIMES * usual, _SIGMAS)
    return wrong
