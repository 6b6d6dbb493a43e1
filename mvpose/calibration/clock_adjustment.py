"""Clocks by least squares: offsets at which the views agree best on where people are.

Unknown are the offset of every clock, a small correction of every camera (else an error of calibration would pass for
one of time) and the place of every joint at every time. Joints are eliminated, and equations of the cameras remain (the
Schur complement of bundle adjustment: Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000).

Errors of a detector are correlated in time, for a second and more. Residuals are correlated with those before, so the
predictable part is removed from them and from the equations (generalised least squares of a first-order autoregression:
Cochrane and Orcutt, Journal of the American Statistical Association 1949); the rest depends mostly on the swing of
limbs. Errors of the joints of a person are correlated, too. The covariance of the offsets is that of sums over a person
and a second (cluster-robust, with the correction "CR3" for few clusters: Cameron and Miller, "A Practitioner's Guide to
Cluster-Robust Inference", Journal of Human Resources 2015).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from mvpose.calibration.joint_tracks import ImageTracks
from mvpose.camera import Rig

_TURN, _SHIFT = np.radians(3.0), 0.3  # rad, m: standard deviations of the errors of cameras, before any data
_CLOCK = 1.0  # s: of an offset, before any data
_ROUNDS = 15
_STEP = 0.1  # s: most that an offset changes in one round; motions are not linear beyond
_SETTLED = 2e-4  # s
_ROBUST = 2.0  # residual in standard deviations at which a keypoint has half its weight
_WIDEST, _NARROWEST = 10.0, 0.1  # factors of the standard deviations, in the first round and at least
_BLOCK = 1.0  # s: errors of a detector are correlated in time for less than this
_PARAMETERS = 7  # of a camera: rotation vector (rad), centre (m), offset (s)
_MOST = 4e6  # joints at times, times the cube of the number of views: the time that equations take
_SPACING = 0.08  # s between instants: neighbours share the pictures around them
_NEAR = 0.02  # s: a step of the offsets, below which residuals are the errors of keypoints
_LONGEST = 0.98  # correlation of errors from one instant to the next, at most
_NEAREST = 0.2  # m: least depth of a joint


@dataclass(frozen=True)
class ClockAdjustment:
    """Solution of the least squares."""

    offsets: Floats
    """True time minus given time of the pictures of each camera, (V,), seconds; only differences count."""
    deviations: Floats
    """What each person in each second changes in the offsets, (B, V), seconds: the sum of their products is the
    covariance."""
    motion: Floats
    """Share of the motion in each view that is not noise of the keypoints, (V,), 0 to 1."""
    times: Floats
    """Instants, (K,), seconds."""
    scores: Floats
    """Information of each instant about each offset, (K, V): gradient of half the squared error, 1/s."""
    curvatures: Floats
    """Its curvature, (K, V), 1/s²: score / curvature is how much later the clock is at that instant."""
    spread: float
    """Standard deviation of residuals, in that of the sightings."""
    settled: bool = True
    """Whether the rounds ended because nothing changed any more."""


def adjust(rig: Rig, tracks: ImageTracks, start: Floats) -> ClockAdjustment:
    """Return the offsets of the clocks near a start.

    Args:
        rig: the calibrated cameras; errors of degrees are corrected on the way.
        tracks: tracks of joints.
        start: offsets to start from, (V,), seconds; right to a quarter of a second.
    """
    views, instants = len(rig), _instants(tracks)
    offsets, turns, centers = np.array(start, float), np.stack([camera.R for camera in rig]), rig.centers.copy()
    correction = np.zeros(views * _PARAMETERS)
    prior = np.tile(1.0 / np.repeat([_TURN, _SHIFT, _CLOCK], [3, 3, 1]) ** 2, views)
    scale, memory, settled = _WIDEST, 0.0, False
    before = np.zeros(views)
    for _ in range(_ROUNDS):
        terms = _terms(tracks, instants, offsets, turns, centers, scale)
        equations = _equations(tracks, terms, instants, memory)
        step = np.linalg.solve(equations.hessian + np.diag(prior), equations.gradient - prior * correction)
        step = np.asarray(step, np.float64).reshape(views, _PARAMETERS)
        step[:, 6] = np.clip(step[:, 6], -_STEP, _STEP)
        if step[:, 6] @ before < 0.0:  # steps overshoot, because weights change with them
            step *= 0.5
        before = step[:, 6].copy()
        correction += step.ravel()
        offsets = offsets + step[:, 6]
        turns = Rotation.from_rotvec(step[:, :3]).as_matrix() @ turns
        centers = centers + step[:, 3:6]
        narrower, last = max(terms.spread, _NARROWEST), memory
        memory = equations.memory if np.abs(step[:, 6]).max() < _NEAR else 0.0
        if np.abs(step[:, 6]).max() < _SETTLED and narrower > 0.95 * scale and abs(memory - last) < 0.02:
            settled = True
            break
        scale = min(scale, narrower)
    terms = _terms(tracks, instants, offsets, turns, centers, scale)
    equations = _equations(tracks, terms, instants, memory)
    return replace(_solution(equations, offsets, prior, instants, terms.spread), settled=settled)


def _instants(tracks: ImageTracks) -> Floats:
    """Return times at which the joints are compared, (K,), seconds: evenly spaced, as many as are of use."""
    times = np.nanmedian(tracks.times, axis=1)
    joints = (np.isfinite(tracks.points[..., 0]).sum(axis=1) >= 2).sum()
    every = max(np.ceil(joints * tracks.points.shape[1] ** 3 / _MOST), round(_SPACING / tracks.period), 1)
    return times[:: int(every)]


@dataclass(frozen=True)
class _Terms:
    """Terms of the equations of G tracks at K times in V views, by standard deviations; 0 where not seen."""

    residual: Floats
    """What is seen minus what is expected, (G, K, V, 2)."""
    to_joint: Floats
    """Change of the projection with the joint, (G, K, V, 2, 3)."""
    to_camera: Floats
    """Change with the seven parameters of the camera, (G, K, V, 2, 7)."""
    noise: Floats
    """Velocity in the picture minus that of the joint, (G, K, V, 2), 1/s."""
    seen: Bools
    """Whether a view sees the joint, (G, K, V); nowhere, where fewer than two do."""
    spread: float
    """Standard deviation of residuals, in that of the sightings."""

    def reduced(self, track: int) -> tuple[Floats, Floats]:
        """Return residuals (K, V, 2) and derivatives (K, V, 2, 7 V) of one track without what a joint explains."""
        to_joint, to_camera = self.to_joint[track], self.to_camera[track]
        times, views = to_joint.shape[:2]
        explained = np.linalg.inv(np.einsum("kvci,kvcj->kij", to_joint, to_joint) + 1e-9 * np.eye(3))
        pull = np.einsum("kvci,kvc->ki", to_joint, self.residual[track])
        residual = self.residual[track] - np.einsum("kvci,kij,kj->kvc", to_joint, explained, pull)
        pulls = np.einsum("kvci,kvcp->kivp", to_joint, to_camera).reshape(times, 3, -1)
        derivatives = -(to_joint.reshape(times, -1, 3) @ (explained @ pulls)).reshape(times, views, 2, views, -1)
        for view in range(views):
            derivatives[:, view, :, view] += to_camera[:, view]
        return residual, derivatives.reshape(times, views, 2, -1)


@dataclass(frozen=True)
class _Equations:
    """Normal equations of the cameras, with joints eliminated and the correlation of errors in time taken out."""

    hessian: Floats
    """(7V, 7V)."""
    gradient: Floats
    """(7V,)."""
    blocks: Mapping[tuple[int, int], tuple[Floats, Floats]]
    """Hessian (7V, 7V) and gradient (7V,) of each person and second."""
    scores: Floats
    """As in :class:`ClockAdjustment`."""
    curvatures: Floats
    """As in :class:`ClockAdjustment`."""
    motion: Floats
    """As in :class:`ClockAdjustment`."""
    memory: float
    """Correlation of a residual with the one before."""


def _equations(tracks: ImageTracks, terms: _Terms, instants: Floats, memory: float) -> _Equations:
    """Return the normal equations of all tracks, for residuals that go like ``memory`` times the one before."""
    views = terms.seen.shape[2]
    size, clocks = views * _PARAMETERS, np.arange(views) * _PARAMETERS + 6
    second = np.floor((instants - instants[0]) / _BLOCK).astype(int)
    blocks: dict[tuple[int, int], tuple[Floats, Floats]] = {}
    scores, curvatures = np.zeros((len(instants), views)), np.zeros((len(instants), views))
    motion, noise, freedom = np.zeros(views), 0.0, 0.0
    shares, before, squares = np.zeros(views), 0.0, 0.0
    for track, person in enumerate(tracks.person):
        seen = terms.seen[track]
        both = seen[1:] & seen[:-1]
        residual, derivatives = terms.reduced(track)
        before += float((residual[1:] * residual[:-1])[both].sum())
        squares += float(0.5 * ((residual[1:] ** 2)[both].sum() + (residual[:-1] ** 2)[both].sum()))
        residual, derivatives = _whitened(residual, both, memory), _whitened(derivatives, both, memory)
        each = np.einsum("kvcp,kvc->kp", derivatives, residual)
        np.add(scores, each[:, clocks], out=scores)
        np.add(curvatures, (derivatives[..., clocks] ** 2).sum(axis=(1, 2)), out=curvatures)
        moving = np.einsum("kvcw->kvw", _whitened(terms.to_camera[track][..., 6:], both, memory) ** 2).sum(axis=2)
        motion += moving.sum(axis=0)
        count = seen.sum(axis=1)
        noise += float((_whitened(terms.noise[track], both, memory) ** 2).sum())
        freedom += float(np.maximum(2 * count - 3, 0)[count > 0].sum())
        shares += (seen * (3.0 / np.maximum(count, 1))[:, None]).sum(axis=0)
        for block in np.unique(second[count > 0]):
            rows = second == block
            part = derivatives[rows].reshape(-1, size)
            hessian, gradient = blocks.get((int(person), int(block)), (0.0, 0.0))
            blocks[int(person), int(block)] = hessian + part.T @ part, gradient + each[rows].sum(axis=0)
    inside = shares * noise / max(freedom, 1.0)
    return _Equations(
        sum((hessian for hessian, _ in blocks.values()), np.zeros((size, size))),
        sum((gradient for _, gradient in blocks.values()), np.zeros(size)),
        blocks,
        scores,
        curvatures,
        np.clip(1.0 - inside / np.maximum(motion, 1e-12), 0.0, 1.0),
        float(np.clip(before / max(squares, 1e-12), 0.0, _LONGEST)),
    )


def _whitened(series: Floats, both: Bools, memory: float) -> Floats:
    """Return a series (K, V, ...) minus its prediction from the value before, where a view sees both (K - 1, V)."""
    known = both.reshape(*both.shape, *[1] * (series.ndim - 2))
    result = series.copy()
    result[1:] -= np.where(known, memory * series[:-1], 0.0)
    result[1:] /= np.where(known, np.sqrt(1.0 - memory**2), 1.0)
    return result


def _solution(equations: _Equations, offsets: Floats, prior: Floats, times: Floats, spread: float) -> ClockAdjustment:
    """Return the solution at which equations were made."""
    views, size = len(offsets), len(equations.gradient)
    inverse = np.linalg.inv(equations.hessian + np.diag(prior))
    clocks = np.arange(views) * _PARAMETERS + 6
    deviations = [
        (inverse @ np.linalg.solve((1.0 + 1e-9) * np.eye(size) - hessian @ inverse, gradient))[clocks]
        for hessian, gradient in equations.blocks.values()
    ]
    return ClockAdjustment(
        offsets,
        np.array(deviations).reshape(-1, views),
        equations.motion,
        times,
        equations.scores,
        equations.curvatures,
        spread,
    )


def _terms(
    tracks: ImageTracks, instants: Floats, offsets: Floats, turns: Floats, centers: Floats, scale: float
) -> _Terms:
    """Return the terms at offsets (V,) and cameras with rotations (V, 3, 3) and centres (V, 3)."""
    points, speeds, sigma = (np.moveaxis(each, 1, 2) for each in tracks.sample(instants[:, None] - offsets))
    seen = np.isfinite(sigma)
    seen &= seen.sum(axis=2, keepdims=True) >= 2
    sigma = np.where(seen, scale * sigma, 1.0)
    joints, weights = _triangulate(points, sigma, seen, turns, centers)
    residual, to_joint, to_camera = _derivatives(joints, points, turns, centers)
    spread = scale * _spread(residual, sigma, seen)
    root = np.sqrt(weights)[..., None]
    residual, speeds = root * np.where(seen[..., None], residual, 0.0), root * np.where(seen[..., None], speeds, 0.0)
    to_joint, to_camera = root[..., None] * to_joint, root[..., None] * to_camera
    normal = np.einsum("gkvci,gkvcj->gkij", to_joint, to_joint) + 1e-9 * np.eye(3)
    velocity = np.linalg.solve(normal, np.einsum("gkvci,gkvc->gki", to_joint, speeds)[..., None])[..., 0]
    moving = np.einsum("gkvci,gki->gkvc", to_joint, velocity)
    return _Terms(
        residual, to_joint, np.concatenate([to_camera, moving[..., None]], axis=-1), speeds - moving, seen, spread
    )


def _triangulate(points: Floats, sigma: Floats, seen: Bools, turns: Floats, centers: Floats) -> tuple[Floats, Floats]:
    """Return joints (G, K, 3) near the rays of points (G, K, V, 2), and weights of the points, (G, K, V)."""
    local = np.concatenate([np.where(seen[..., None], points, 0.0), np.ones((*seen.shape, 1))], axis=-1)
    directions = np.einsum("vij,gkvi->gkvj", turns, local)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    across = np.eye(3) - directions[..., None] * directions[..., None, :]
    sharp = np.where(seen, sigma**-2, 0.0)
    weights, depth = sharp, np.full(seen.shape, 4.0)
    for _ in range(5):
        normal = np.einsum("gkv,gkvij->gkij", weights / depth**2, across)
        normal += (1e-9 * np.trace(normal, axis1=-2, axis2=-1) + 1e-12)[..., None, None] * np.eye(3)
        pull = np.einsum("gkv,gkvij,vj->gki", weights / depth**2, across, centers)
        joints = np.linalg.solve(normal, pull[..., None])[..., 0]
        lead = joints[:, :, None] - centers
        depth = np.maximum(np.einsum("gkvi,vi->gkv", lead, turns[:, 2]), _NEAREST)
        square = (np.einsum("gkvij,gkvj->gkvi", across, lead) ** 2).sum(axis=-1) / depth**2 * sharp
        weights = sharp / (1.0 + square / _ROBUST**2)
    return joints, weights


def _derivatives(joints: Floats, points: Floats, turns: Floats, centers: Floats) -> tuple[Floats, Floats, Floats]:
    """Return residuals (..., V, 2) and the change of projections with joints (..., V, 2, 3) and cameras (..., 2, 6)."""
    local = np.einsum("vij,gkvj->gkvi", turns, joints[:, :, None] - centers)
    depth = np.maximum(local[..., 2], _NEAREST)
    flat = local[..., :2] / depth[..., None]
    to_local = np.zeros((*flat.shape, 3))
    to_local[..., 0, 0] = to_local[..., 1, 1] = 1.0 / depth
    to_local[..., 2] = -flat / depth[..., None]
    to_joint = to_local @ turns
    x, y, z = np.moveaxis(local, -1, 0)
    zero = np.zeros_like(x)
    turned = np.stack([zero, z, -y, -z, zero, x, y, -x, zero], axis=-1).reshape(*x.shape, 3, 3)  # -[local]x
    return points - flat, to_joint, np.concatenate([to_local @ turned, -to_joint], axis=-1)


def _spread(residual: Floats, sigma: Floats, seen: Bools) -> float:
    """Return the standard deviation of residuals (from their median, so that outliers do not count), by ``sigma``."""
    squares = ((residual[seen] / sigma[seen][:, None]) ** 2).sum(axis=1)
    if not len(squares):
        return 1.0
    count = seen.sum(axis=2)
    lost = 2.0 * count.sum() / np.maximum(2 * count - 3, 0).sum()  # by the joints, which were fitted
    return float(np.sqrt(np.median(squares) / (2.0 * np.log(2.0)) * lost))
