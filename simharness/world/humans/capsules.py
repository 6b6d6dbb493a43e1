"""Capsules fitted to a body's skin: what people collide with, and what rays meet where no pictures are made.

The skin that moves with one bone gets a few capsules, laid out roughly at first and then fitted as k-means fits
centres: every point of the skin goes to the capsule it is nearest to, every capsule takes a Gauss-Newton step to its
points, and again. There are no absolute sizes, so that a child is fitted as well as a giant, and the clothes and the
hair count, for they are what is seen and touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from simharness.world.humans.body import Body

_POINTS = 4000  # of the skin, spread evenly over its area
_ROUNDS = (4, 8)  # with own points only, then with all points for all, so that no end sticks out of the skin
_STAY = 0.02  # of the weight of all its points holds a capsule where it began, in directions that they leave free
_TYPICAL = 3.0  # median distances beyond which a point counts less and less


@dataclass(frozen=True)
class Capsule:
    """All that is within ``radius`` of a segment, in a bone's frame at rest: from the bone's head, axes of the world.

    Attributes:
        bone: that carries it.
        start, end: of the segment, (3,) metres.
        radius: metres.
    """

    bone: str
    start: Floats
    end: Floats
    radius: float

    @property
    def volume(self) -> float:
        """Cubic metres."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4 / 3 * self.radius))


@dataclass(frozen=True)
class _Patch:
    """Skin that moves as one, and how its capsules lie at first.

    Attributes:
        bone: that carries the capsules.
        bones: whose skin it is; none of them turns against the carrier.
        count: of capsules.
        lie: "stacked" one on the other, each along the wider way of its slice; "chained" from one bone's head to the
            next; "beside" each other, all along the way from bone to bone.
        way: the two bones, from head to head.
        part: of a chain's way, from and to.
    """

    bone: str
    bones: tuple[str, ...]
    count: int
    lie: Literal["stacked", "chained", "beside"]
    way: tuple[str, str] = ("", "")
    part: tuple[float, float] = (0.0, 1.0)


_TRUNK = (
    _Patch("Hips", ("Hips", "LHipJoint", "RHipJoint"), 1, "stacked"),
    _Patch("LowerBack", ("LowerBack", "Spine"), 4, "stacked"),
    _Patch("Spine1", ("Spine1",), 3, "stacked"),
    _Patch("Neck", ("Neck", "Neck1"), 1, "chained", ("Neck", "Head")),
    _Patch("Head", ("Head",), 5, "stacked"),
)
# Without the side. A twist bone begins where its parent does and moves the far half of the limb.
_LIMBS = (
    _Patch("Shoulder", ("Shoulder",), 1, "chained", ("Shoulder", "Arm")),
    _Patch("Arm", ("Arm",), 1, "chained", ("Arm", "ForeArm"), (0.0, 0.5)),
    _Patch("ArmTwist", ("ArmTwist",), 1, "chained", ("Arm", "ForeArm"), (0.5, 1.0)),
    _Patch("ForeArm", ("ForeArm",), 1, "chained", ("ForeArm", "Hand"), (0.0, 0.5)),
    _Patch("ForeArmTwist", ("ForeArmTwist",), 1, "chained", ("ForeArm", "Hand"), (0.5, 1.0)),
    _Patch("Hand", ("Hand", "FingerBase", "HandFinger1"), 2, "beside", ("Hand", "HandFinger1")),
    _Patch("Hand", ("Thumb",), 1, "beside", ("Thumb", "FingerBase")),
    _Patch("UpLeg", ("UpLeg",), 3, "chained", ("UpLeg", "Leg")),
    _Patch("Leg", ("Leg",), 2, "chained", ("Leg", "Foot")),
    _Patch("Foot", ("Foot", "ToeBase"), 3, "beside", ("Foot", "ToeBase")),
)


def _sided(name: str, side: str) -> str:
    return f"{side[0]}Thumb" if name == "Thumb" else f"{side}{name}"


def _patches() -> Iterator[_Patch]:
    yield from _TRUNK
    for side in ("Left", "Right"):
        for patch in _LIMBS:
            bones = tuple(_sided(bone, side) for bone in patch.bones)
            way = (_sided(patch.way[0], side), _sided(patch.way[1], side))
            yield replace(patch, bone=_sided(patch.bone, side), bones=bones, way=way)


def fit_capsules(body: Body) -> tuple[Capsule, ...]:
    """Fit capsules to the whole skin of a body, dressed or not, as it stands at rest: 46 of them, bone by bone."""
    patches = tuple(_patches())
    points, patch_of = _sample(body, patches)
    first, own = [], []
    for k, patch in enumerate(patches):
        first += list(_laid_out(body, patch, points[patch_of == k]))
        own += [patch_of == k] * patch.count
    capsules = _fitted(np.array(first), points, np.column_stack(own))
    carriers = [patch.bone for patch in patches for _ in range(patch.count)]
    heads = [body.heads[body.index(bone)] for bone in carriers]
    return tuple(
        Capsule(bone, capsule[:3] - head, capsule[3:6] - head, float(capsule[6]))
        for bone, head, capsule in zip(carriers, heads, capsules, strict=True)
    )


def _sample(body: Body, patches: tuple[_Patch, ...]) -> tuple[Floats, Integers]:
    """Points (n, 3) spread evenly over the skin, and the patch whose bones move each most, (n,)."""
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


def _laid_out(body: Body, patch: _Patch, points: Floats) -> Floats:
    """The capsules of a patch at first, (count, 7): start, end and radius, metres."""
    if patch.lie == "stacked":
        return _stacked(points, patch.count)
    begin, end = (body.heads[body.index(bone)] for bone in patch.way)
    if patch.lie == "beside":
        return _beside(points, end - begin, patch.count)
    share = np.linspace(*patch.part, patch.count + 1)[:, None]
    knots = (1 - share) * begin + share * end
    capsules = np.column_stack([knots[:-1], knots[1:], np.zeros(patch.count)])
    capsules[:, 6] = np.median(_nearest(points, capsules, np.ones((len(points), patch.count), bool))[1])
    return capsules


def _stacked(points: Floats, count: int) -> Floats:
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


def _beside(points: Floats, way: Floats, count: int) -> Floats:
    way = way / np.linalg.norm(way)
    middle = points.mean(axis=0)
    along = (points - middle) @ way
    off = points - middle - along[:, None] * way
    place = off @ np.linalg.svd(off, full_matrices=False)[2][0]
    strip = np.searchsorted(np.quantile(place, np.arange(1, count) / count), place)
    capsules = np.empty((count, 7))
    for k in range(count):
        core = off[strip == k].mean(axis=0)
        radius = float(np.median(np.linalg.norm(off[strip == k] - core, axis=1)))
        low, high = along[strip == k].min() + radius, along[strip == k].max() - radius
        capsules[k] = *(middle + core + low * way), *(middle + core + high * way), radius
    return capsules


def _fitted(first: Floats, points: Floats, own: NDArray[np.bool_]) -> Floats:
    """Capsules (c, 7), ``first`` at first, fitted to points (n, 3) of which each has some of its ``own``, (n, c)."""
    capsules = first.copy()
    soles, crown = points[:, 2].min(), points[:, 2].max()
    stiff, force = np.empty((len(first), 7, 7)), np.empty((len(first), 7))
    for k in range(sum(_ROUNDS)):
        nearest, error = _nearest(points, capsules, own if k < _ROUNDS[0] else np.ones_like(own))
        # Cauchy's weights inside: what lies under hair or a skirt is skin too, but neither seen nor touched.
        deep = np.minimum(error, 0.0) / (_TYPICAL * np.median(np.abs(error)))
        _gather(points, capsules, nearest, 1 / (1 + deep**2), stiff, force)
        stiff += _STAY * np.eye(7)
        force += _STAY * (capsules - first)
        capsules -= np.linalg.solve(stiff, force[..., None])[..., 0]
        capsules[:, 6] = np.maximum(capsules[:, 6], first[:, 6] / 3)  # none may vanish, whatever points it is left with
        # Soles are flat and capsules round: who stands must stand on the floor, not in it.
        radius = capsules[:, 6:]
        capsules[:, [2, 5]] = np.clip(capsules[:, [2, 5]], soles + radius, crown - radius)
    return capsules


@njit(cache=True)
def _nearest(points, capsules, own):
    """For each point (n, 3) the nearest of its ``own`` (n, c) capsules (c, 7), and its signed distance to that."""
    nearest, error = np.zeros(len(points), np.int64), np.full(len(points), np.inf)
    for i in range(len(points)):
        for c in range(len(capsules)):
            if own[i, c]:
                _, out = _foot(points[i], capsules[c])
                distance = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]) - capsules[c, 6]
                if distance < error[i]:
                    nearest[i], error[i] = c, distance
    return nearest, error


@njit(cache=True)
def _gather(points, capsules, nearest, weights, stiff, force):
    """Normal equations (c, 7, 7) and (c, 7) of a Gauss-Newton step of each capsule to its points, a mean over them.

    The foot of a point on the axis is where the distance is least, so in its derivative the foot may stand still.
    """
    stiff[:], force[:] = 0.0, 0.0
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
            force[c, row] += weights[i] * slope[row] * (length - capsules[c, 6])
            for column in range(7):
                stiff[c, row, column] += weights[i] * slope[row] * slope[column]
    for c in range(len(capsules)):
        stiff[c] /= total[c]
        force[c] /= total[c]


@njit(cache=True)
def _foot(point, capsule):
    """How far along a capsule's axis the foot of a point is, 0 to 1, and the way from there to the point."""
    ax, ay, az = capsule[3] - capsule[0], capsule[4] - capsule[1], capsule[5] - capsule[2]
    x, y, z = point[0] - capsule[0], point[1] - capsule[1], point[2] - capsule[2]
    share = (x * ax + y * ay + z * az) / max(ax * ax + ay * ay + az * az, 1e-12)
    share = min(max(share, 0.0), 1.0)
    return share, (x - share * ax, y - share * ay, z - share * az)
