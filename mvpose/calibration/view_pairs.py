"""Relative poses of pairs of cameras of which nothing but the lens is known, from the people whom both see.

Tracklets are all that two such views have in common. Each pair of tracklets that overlap in time may be of one person:
its joints over seconds are some hundred corresponding points, which give an essential matrix (the five-point method
within a robust search: Nister, PAMI 2004; Barath et al., "MAGSAC++", CVPR 2020). The matrix of a true pair explains all
other people as well; that of a wrong one explains nobody. So every hypothesis is judged by the evidence of all people
in both views (:mod:`.consistency`), and the best one is fitted again to everybody whom it matches.

An essential matrix leaves the length of the baseline open. People are as large in all pairs of views, so that the
lengths of their bones give all baselines in one unit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.rig_size import relative_size
from mvpose.calibration.tracklets import Tracklets
from mvpose.camera import Rig

_MOST_HYPOTHESES = 24  # pairs of tracklets that are tried, those with the most joints in common
_MOST_POINTS = 800  # correspondences from which a hypothesis is made
_FEWEST = 60  # correspondences of a pair of tracklets, and of all people of two views
_THRESHOLD = 1.5  # standard deviations of a keypoint within which it supports an essential matrix
_ROUNDS = 3  # of matching and fitting
_ROBUST = 2.0  # residual in standard deviations beyond which a keypoint counts less
_ITERATIONS = 2000  # of the random search, at most


@dataclass(frozen=True)
class RelativePose:
    """Pose of a camera seen from another one."""

    views: tuple[int, int]
    """The two cameras."""
    R: Floats
    """Rotation from the first camera to the second, (3, 3)."""
    t: Floats
    """Translation, ``x_second = R x_first + t``, (3,), in metres if people are as large as adults."""
    evidence: float
    """Log likelihood ratio of this pose to chance."""
    agreement: float
    """Evidence as a share of what it would be if all rays met as well as keypoints allow, 0 to 1."""
    points: int
    """Corresponding keypoints of the people who were matched."""


def relative_poses(rig: Rig, tracklets: Tracklets, consistency: Consistency) -> Iterator[RelativePose]:
    """Yield the pose of each pair of cameras that see the same people.

    Args:
        rig: cameras, of which only the intrinsics are used.
        tracklets: tracklets of all views.
        consistency: evidence on these tracklets.
    """
    views = len(rig)
    unposed = rig.packed.copy()
    unposed[:, 5:14], unposed[:, 14:17] = np.eye(3).ravel(), 0.0
    reading = Reading.as_given(unposed)
    for i in range(views):
        for j in range(i + 1, views):
            found = _pose_of_pair(consistency, reading, (i, j), tracklets)
            if found is not None:
                yield found


def placed(reading: Reading, views: tuple[int, int], R: Floats, t: Floats) -> Reading:
    """Return a reading in which the second camera has a pose relative to the first, which is at the origin."""
    cameras = reading.cameras.copy()
    i, j = views
    cameras[i, 5:14], cameras[i, 14:17] = np.eye(3).ravel(), 0.0
    cameras[j, 5:14], cameras[j, 14:17] = R.ravel(), -R.T @ t
    return replace(reading, cameras=cameras)


@dataclass(frozen=True)
class _Points:
    """Corresponding points of two views, in normalised coordinates."""

    first: Floats
    """(n, 2)."""
    second: Floats
    """(n, 2)."""
    sigma: Floats
    """Standard deviations in both, (n, 2)."""

    def __len__(self) -> int:
        return len(self.first)


def _pose_of_pair(
    consistency: Consistency, reading: Reading, views: tuple[int, int], tracklets: Tracklets
) -> RelativePose | None:
    best, most = None, 0.0
    for candidate in _candidates(consistency, reading, views):
        for R, t in _hypotheses(candidate):
            evidence = consistency.of_pair(placed(reading, views, R, t), *views)
            if evidence > most:
                best, most = (R, t), evidence
    if best is None:
        return None
    R, t = best
    points: _Points | None = None
    for _ in range(_ROUNDS):
        matched = _matched(consistency, placed(reading, views, R, t), views)
        if len(matched) < _FEWEST:
            break
        points = matched
        R, t = _refined(points, R, t)
    if points is None:
        return None
    pose = placed(reading, views, R, t)
    evidence = consistency.of_pair(pose, *views)
    ideal = consistency.of_pair(pose, *views, ideal=True)
    size, _ = relative_size(consistency, pose, tracklets.skeleton, views=views)
    if not np.isfinite(size) or not evidence > 0.0:
        return None
    return RelativePose(views, R, t / size, evidence, evidence / max(ideal, 1e-9), len(points))


def _candidates(consistency: Consistency, reading: Reading, views: tuple[int, int]) -> list[_Points]:
    """Return the correspondences of pairs of tracklets that overlap in time, those with the most first."""
    pieces = consistency.pieces
    rows = [slice(pieces.start[view, 0], pieces.stop[view, -1]) for view in views]
    (points_a, errors_a), (points_b, errors_b) = (consistency.normalised(reading, view) for view in views)
    (frames_a, names_a), (frames_b, names_b) = ((pieces.frame[each], pieces.tracklet[each]) for each in rows)
    found = []
    for a in np.unique(names_a):
        own_a = np.flatnonzero(names_a == a)
        for b in np.unique(names_b):
            own_b = np.flatnonzero(names_b == b)
            _, left, right = np.intersect1d(frames_a[own_a], frames_b[own_b], return_indices=True)
            if len(left):
                one, other = own_a[left], own_b[right]
                found.append(_joined(points_a[one], points_b[other], errors_a[one], errors_b[other]))
    found = [each for each in found if len(each) >= _FEWEST]
    return sorted(found, key=len, reverse=True)[:_MOST_HYPOTHESES]


def _joined(a: Floats, b: Floats, sigma_a: Floats, sigma_b: Floats) -> _Points:
    """Return the points (n, J, 2) that both views see."""
    known = np.isfinite(a[..., 0]) & np.isfinite(b[..., 0]) & np.isfinite(sigma_a) & np.isfinite(sigma_b)
    return _Points(a[known], b[known], np.stack([sigma_a[known], sigma_b[known]], axis=1))


def _matched(consistency: Consistency, reading: Reading, views: tuple[int, int]) -> _Points:
    """Return the correspondences of all pieces that are matched under a reading."""
    (points_a, errors_a), (points_b, errors_b) = (consistency.normalised(reading, view) for view in views)
    one, other = consistency.matched_rows(reading, *views)
    return _joined(points_a[one], points_b[other], errors_a[one], errors_b[other])


def _hypotheses(points: _Points) -> Iterator[tuple[Floats, Floats]]:
    """Yield relative poses of two views, of corresponding points."""
    rows = np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS)).astype(int)
    first, second = np.ascontiguousarray(points.first[rows]), np.ascontiguousarray(points.second[rows])
    threshold = _THRESHOLD * float(np.median(points.sigma))
    cv2.setRNGSeed(0)
    found, _ = cv2.findEssentialMat(
        first, second, np.eye(3), method=cv2.USAC_MAGSAC, prob=0.999, threshold=threshold, maxIters=_ITERATIONS
    )
    if found is None:
        return
    for E in found.reshape(-1, 3, 3):
        _, R, t, _ = cv2.recoverPose(E, first, second, np.eye(3))
        yield np.asarray(R, np.float64), np.asarray(t, np.float64).ravel()


def _refined(points: _Points, R: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Return the relative pose of least Sampson distances, whose large values count less; t has unit length."""
    first, second = (np.column_stack([each, np.ones(len(each))]) for each in (points.first, points.second))
    basis = np.linalg.svd(t[None])[2][1:]

    def pose(change: Floats) -> tuple[Floats, Floats]:
        moved = t + change[3:] @ basis
        return Rotation.from_rotvec(change[:3]).as_matrix() @ R, moved / np.linalg.norm(moved)

    def residuals(change: Floats) -> Floats:
        turn, base = pose(change)
        E = np.cross(base, turn.T).T
        one, other = first @ E.T, second @ E
        noise = (one[:, :2] ** 2).sum(axis=1) * points.sigma[:, 1] ** 2
        noise += (other[:, :2] ** 2).sum(axis=1) * points.sigma[:, 0] ** 2
        return np.asarray((second * one).sum(axis=1) / np.sqrt(np.maximum(noise, 1e-18)))

    found = least_squares(residuals, np.zeros(5), loss="cauchy", f_scale=_ROBUST, max_nfev=20)
    return pose(found.x)
