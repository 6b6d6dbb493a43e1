"""Capsules fitted to the skin of a body, for collisions and for visibility by ray casting.

The skin that moves with one bone gets a few capsules. They are placed roughly and then fitted in the manner of
k-means: every skin point is assigned to its nearest capsule, every capsule takes a Gauss-Newton step towards its
points, and this is repeated. No size is absolute, so that a child is fitted as well as a tall adult. Clothes and hair
belong to the skin here, because they are what is seen and touched.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from simharness.world.humans.anatomy import ANATOMY
from simharness.world.humans.body import Body

_POINTS = 4000  # points on the skin, spread evenly over its area
_ROUNDS = (4, 8)  # first with the points of a patch only, then with all points, so that no end sticks out of the skin
_DAMPING = 0.02  # weight of the initial placement against all points: it fixes directions that the points leave free
_CAUCHY = 3.0  # scale of Cauchy's weights, in median distances


@dataclass(frozen=True)
class Capsule:
    """Capsule: all points within ``radius`` of a line segment.

    The frame is that of the bone at rest: its origin is the head of the bone, its axes are those of the world.

    Attributes:
        bone: name of the bone that carries the capsule.
        start, end: ends of the segment, (3,) metres.
        radius: metres.
    """

    bone: str
    start: Floats
    end: Floats
    radius: float

    @property
    def volume(self) -> float:
        """Volume in cubic metres."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4 / 3 * self.radius))


@dataclass(frozen=True)
class _Patch:
    """Region of skin that moves rigidly, and the initial layout of its capsules: see ``anatomy.toml``."""

    bone: str
    bones: Sequence[str]
    count: int
    layout: Literal["stacked", "chained", "beside"]
    ends: Sequence[str] = ("", "")
    span: tuple[float, float] = (0.0, 1.0)


def _sided(name: str, side: str) -> str:
    return f"{side[0]}Thumb" if name == "Thumb" else f"{side}{name}"


def _patches() -> Iterator[_Patch]:
    yield from (_Patch(**patch) for patch in ANATOMY["capsules"]["trunk"])
    for side in ("Left", "Right"):
        for patch in (_Patch(**patch) for patch in ANATOMY["capsules"]["limbs"]):
            bones = tuple(_sided(bone, side) for bone in patch.bones)
            ends = (_sided(patch.ends[0], side), _sided(patch.ends[1], side))
            yield replace(patch, bone=_sided(patch.bone, side), bones=bones, ends=ends)


def fit_capsules(body: Body) -> tuple[Capsule, ...]:
    """Fit 46 capsules, ordered by bone, to the whole skin of a rest body, dressed or bare."""
    patches = tuple(_patches())
    points, patch_of = _sample(body, patches)
    initial, allowed = [], []
    for k, patch in enumerate(patches):
        initial += list(_initial_capsules(body, patch, points[patch_of == k]))
        allowed += [patch_of == k] * patch.count
    capsules = _fit(np.array(initial), points, np.column_stack(allowed))
    carriers = [patch.bone for patch in patches for _ in range(patch.count)]
    heads = [body.heads[body.index(bone)] for bone in carriers]
    return tuple(
        Capsule(bone, capsule[:3] - head, capsule[3:6] - head, float(capsule[6]))
        for bone, head, capsule in zip(carriers, heads, capsules, strict=True)
    )


def _sample(body: Body, patches: tuple[_Patch, ...]) -> tuple[Floats, Integers]:
    """Return points (n, 3) spread evenly over the skin, and for each the patch with the largest weight, (n,)."""
    corners = body.vertices[body.faces].astype(float)
    area = np.cumsum(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1))
    chosen = np.searchsorted(area, (np.arange(_POINTS) + 0.5) / _POINTS * area[-1])
    patch_of_bone = np.empty(len(body.bones), int)
    for k, patch in enumerate(patches):
        patch_of_bone[[body.index(bone) for bone in patch.bones]] = k
    vertices = body.faces[chosen].ravel()
    share = np.zeros((len(chosen), len(patches)))
    rows = np.repeat(np.arange(len(chosen)), 3)
    for bone, weight in zip(body.weight_bones[vertices].T, body.weights[vertices].T, strict=True):
        np.add.at(share, (rows, patch_of_bone[bone]), weight)
    return corners[chosen].mean(axis=1), share.argmax(axis=1)


def _initial_capsules(body: Body, patch: _Patch, points: Floats) -> Floats:
    """Return the initial capsules of a patch, (count, 7): start, end and radius, metres."""
    if patch.layout == "stacked":
        return _stacked(points, patch.count)
    begin, end = (body.heads[body.index(bone)] for bone in patch.ends)
    if patch.layout == "beside":
        return _beside(points, end - begin, patch.count)
    share = np.linspace(*patch.span, patch.count + 1)[:, None]
    knots = (1 - share) * begin + share * end
    capsules = np.column_stack([knots[:-1], knots[1:], np.zeros(patch.count)])
    capsules[:, 6] = np.median(_nearest(points, capsules, np.ones((len(points), patch.count), bool))[1])
    return capsules


def _stacked(points: Floats, count: int) -> Floats:
    """Return capsules (count, 7), one per horizontal slice of the points (n, 3), along its wider axis x or y."""
    edges = np.linspace(points[:, 2].min(), points[:, 2].max(), count + 1)
    capsules = np.empty((count, 7))
    for k in range(count):
        slab = points[(points[:, 2] >= edges[k]) & (points[:, 2] <= edges[k + 1])]
        size, middle = np.ptp(slab, axis=0), (slab.min(axis=0) + slab.max(axis=0)) / 2
        wide = int(size[1] > size[0])
        reach = np.zeros(3)
        reach[wide] = (size[wide] - size[1 - wide]) / 2
        capsules[k] = *(middle - reach), *(middle + reach), size[1 - wide] / 2
    return capsules


def _beside(points: Floats, axis: Floats, count: int) -> Floats:
    """Return capsules (count, 7) parallel to an axis (3,), next to each other along the widest way across it."""
    axis = axis / np.linalg.norm(axis)
    middle = points.mean(axis=0)
    along = (points - middle) @ axis
    off = points - middle - along[:, None] * axis
    across = off @ np.linalg.svd(off, full_matrices=False)[2][0]
    strip = np.searchsorted(np.quantile(across, np.arange(1, count) / count), across)
    capsules = np.empty((count, 7))
    for k in range(count):
        core = off[strip == k].mean(axis=0)
        radius = float(np.median(np.linalg.norm(off[strip == k] - core, axis=1)))
        low, high = along[strip == k].min() + radius, along[strip == k].max() - radius
        capsules[k] = *(middle + core + low * axis), *(middle + core + high * axis), radius
    return capsules


def _fit(initial: Floats, points: Floats, allowed: NDArray[np.bool_]) -> Floats:
    """Fit capsules to points (n, 3).

    Args:
        initial: capsules at the start, (c, 7).
        points: points on the skin, (n, 3).
        allowed: whether a point may be assigned to a capsule in the first rounds, (n, c).

    Returns:
        Capsules (c, 7).
    """
    capsules = initial.copy()
    soles, crown = points[:, 2].min(), points[:, 2].max()
    hessian, gradient = np.empty((len(initial), 7, 7)), np.empty((len(initial), 7))
    for k in range(sum(_ROUNDS)):
        nearest, error = _nearest(points, capsules, allowed if k < _ROUNDS[0] else np.ones_like(allowed))
        # Cauchy's weights for points inside: skin under hair or a skirt is neither seen nor touched.
        deep = np.minimum(error, 0.0) / (_CAUCHY * np.median(np.abs(error)))
        _normal_equations(points, capsules, nearest, 1 / (1 + deep**2), hessian, gradient)
        hessian += _DAMPING * np.eye(7)
        gradient += _DAMPING * (capsules - initial)
        capsules -= np.linalg.solve(hessian, gradient[..., None])[..., 0]
        capsules[:, 6] = np.maximum(capsules[:, 6], initial[:, 6] / 3)  # no capsule may vanish, even with few points
        # Soles are flat and capsules are round: a standing person must stand on the floor, not in it.
        radius = capsules[:, 6:]
        capsules[:, [2, 5]] = np.clip(capsules[:, [2, 5]], soles + radius, crown - radius)
    return capsules


@njit(cache=True)
def _nearest(points, capsules, allowed):
    """Return for each point (n, 3) the nearest ``allowed`` (n, c) capsule of (c, 7) and the signed distance to it."""
    nearest, error = np.zeros(len(points), np.int64), np.full(len(points), np.inf)
    for i in range(len(points)):
        for c in range(len(capsules)):
            if allowed[i, c]:
                _, out = _foot(points[i], capsules[c])
                distance = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]) - capsules[c, 6]
                if distance < error[i]:
                    nearest[i], error[i] = c, distance
    return nearest, error


@njit(cache=True)
def _normal_equations(points, capsules, nearest, weights, hessian, gradient):
    """Write the normal equations (c, 7, 7), (c, 7) of a Gauss-Newton step of each capsule, means over its points.

    The foot of a point on the axis minimises the distance, so the derivative of the distance needs no derivative of
    the foot (envelope theorem).
    """
    hessian[:], gradient[:] = 0.0, 0.0
    total, slope = np.full(len(capsules), 1e-12), np.empty(7)
    for i in range(len(points)):
        c = nearest[i]
        share, out = _foot(points[i], capsules[c])
        length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
        for k in range(3):
            normal = out[k] / max(length, 1e-9)
            slope[k], slope[3 + k] = (share - 1.0) * normal, -share * normal
        slope[6] = -1.0
        total[c] += weights[i]
        for row in range(7):
            gradient[c, row] += weights[i] * slope[row] * (length - capsules[c, 6])
            for column in range(7):
                hessian[c, row, column] += weights[i] * slope[row] * slope[column]
    for c in range(len(capsules)):  # element by element: an array divided in place takes three seconds to compile
        for row in range(7):
            gradient[c, row] /= total[c]
            for column in range(7):
                hessian[c, row, column] /= total[c]


@njit(cache=True)
def _foot(point, capsule):
    """Return the position of a point's foot on a capsule's axis, 0 to 1, and the vector from the foot to the point."""
    ax, ay, az = capsule[3] - capsule[0], capsule[4] - capsule[1], capsule[5] - capsule[2]
    x, y, z = point[0] - capsule[0], point[1] - capsule[1], point[2] - capsule[2]
    share = (x * ax + y * ay + z * az) / max(ax * ax + ay * ay + az * az, 1e-12)
    share = min(max(share, 0.0), 1.0)
    return share, (x - share * ax, y - share * ay, z - share * az)
