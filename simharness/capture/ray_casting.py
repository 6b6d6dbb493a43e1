"""First hits of rays from the cameras: on MuJoCo geoms of objects and on capsules of people.

MuJoCo tests each ray against every geom of the model, so the cost of a ray grows with the number of people. People are
therefore tested by a separate kernel, which skips people far from the ray; a test compares it with ``mj_multiRay``. Of
the other geoms MuJoCo tests only rays that meet a box around one of them: most rays to people meet none.

Rays start at a camera and end at their target; of the surfaces between, the first one counts.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.capture.rendering.renderer import NEAR
from simharness.world.humans.mujoco_model import SKIN_GROUP
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import PlaybackState

_OBJECT_GROUPS = np.array([group != SKIN_GROUP for group in range(6)], np.uint8)  # geom groups tested by MuJoCo
_ROUNDING = 1e-5  # metres: boxes around objects are larger by this than those of MuJoCo, which rounds meshes
_ENDLESS = 1e9  # metres: half size of a plane
_STEEPEST = 1e30  # 1/m: greatest inverse of a direction; finite, so that no product with it is undefined
_ROUND_OFF = 1e-9  # metres: spheres that a ray must come near before the capsule in it is tested are this much larger


class RayCaster:
    """Ray caster for a scene. It holds a state of the scene, so it must not be shared between threads.

    Args:
        scene: scene with people and objects.
    """

    def __init__(self, scene: Scene) -> None:
        model = scene.model
        self._model, self._data = model, mujoco.MjData(model)
        self._moving = np.array([model.body(solid.name).mocapid[0] for solid in scene.moving], int)
        mujoco.mj_kinematics(model, self._data)
        self._people = len(scene.bodies)
        capsules = []
        for person, body in enumerate(scene.bodies):
            for bone, name in enumerate(body.bones):
                for geom in np.flatnonzero(model.geom_bodyid == model.body(f"person{person}/{name}").id):
                    if model.geom_group[geom] == SKIN_GROUP:
                        capsules.append(
                            (person, bone, *_ends(model, int(geom), body.heads[bone]), model.geom_size[geom, 0])
                        )
        self._person, self._bone = (np.array([c[k] for c in capsules], int) for k in (0, 1))
        self._rest = np.reshape([c[2:4] for c in capsules], (-1, 2, 3))
        self._radii = np.array([c[4] for c in capsules], float)
        self._first = np.searchsorted(self._person, np.arange(self._people + 1))
        placed, around = np.empty((len(capsules), 2, 3)), np.empty((self._people, 4))
        self._capsules = PlacedCapsules(placed, self._radii, self._first, around)
        self._objects = np.flatnonzero(model.geom_group != SKIN_GROUP)
        self._local = np.array(model.geom_aabb)
        self._local[model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, 3:] = _ENDLESS
        self._boxes = tuple(np.empty((2, 3, len(self._objects))))
        self._box_objects()

    def place(self, state: PlaybackState) -> None:
        """Move all people and objects to their positions in a state."""
        bones = np.ascontiguousarray(state.bones)
        place_capsules(self._rest, self._bone, bones, self._capsules)
        if len(self._moving):
            self._data.mocap_pos[self._moving] = state.placements[:, :3]
            self._data.mocap_quat[self._moving] = state.placements[:, 3:]
            mujoco.mj_kinematics(self._model, self._data)
            self._box_objects()

    def _box_objects(self) -> None:
        data = self._data
        box_geoms(self._objects, self._local, data.geom_xpos, data.geom_xmat, _ROUNDING, *self._boxes)

    def capsules_of(self, person: int) -> tuple[Floats, Floats]:
        """Return ends (c, 2, 3) and radii (c,), metres, of the capsules of a person in the state placed last."""
        own = slice(self._first[person], self._first[person + 1])
        return self._capsules.placed[own].copy(), self._radii[own]

    def cast(self, camera: Camera, targets: Floats) -> tuple[Integers, Floats]:
        """Cast rays from a camera to targets (n, 3), starting ``NEAR`` in front of it; return the first hits.

        Returns:
            Owner of the surface hit, (n,): 0 to P - 1 a person, P an object, -1 no hit before the target; and the
            distance of the hit in front of the target, (n,) metres, -inf without a hit.
        """
        owner, in_front = self.cast_views(
            camera.center[None], camera.R[2:], targets[None], np.ones((1, len(targets)), bool)
        )
        return owner[0], in_front[0]

    def cast_views(self, centers: Floats, axes: Floats, targets: Floats, wanted: Bools) -> tuple[Integers, Floats]:
        """Cast rays from several cameras; see :meth:`cast`.

        Args:
            centers: camera centres, (V, 3), metres.
            axes: directions of the optical axes, (V, 3).
            targets: ends of the rays, (V, n, 3), metres.
            wanted: which of them are cast, (V, n).

        Returns:
            Owner and distance in front of the target, (V, n) each; -1 and -inf without a ray.
        """
        count = np.count_nonzero(wanted)
        owner, distance, met = np.full(count, -1), np.full(count, np.inf), np.empty(count, bool)
        direction, length, near = np.empty((count, 3)), np.empty(count), np.empty(count)
        cast_rays = CastRays(direction, length, near, owner, distance, met)
        first = cast_views((centers, axes), targets, wanted, NEAR, self._capsules, self._boxes, cast_rays)
        rays = np.flatnonzero(met)
        for v, of_view in enumerate(np.split(rays, np.searchsorted(rays, first[1:-1]))):
            if len(of_view):
                found = self._hit_objects(centers[v], direction[of_view], near[of_view], length[of_view])
                hit = found < distance[of_view]
                owner[of_view[hit]], distance[of_view[hit]] = self._people, found[hit]
        owners, in_front = np.full(wanted.shape, -1), np.full(wanted.shape, -np.inf)
        owners[wanted], in_front[wanted] = owner, length - distance
        return owners, in_front

    def _hit_objects(self, start: Floats, direction: Floats, near: Floats, length: Floats) -> Floats:
        """Return the distances at which rays hit an object; infinite where they hit none before their ends."""
        geom, distance = np.empty(len(direction), np.int32), np.empty(len(direction))
        self._cast(start, direction, geom, distance, float(length.max()))
        for i in np.flatnonzero((geom >= 0) & (distance < near)):
            self._cast(
                start + near[i] * direction[i], direction[i : i + 1], geom[i : i + 1], distance[i : i + 1], length[i]
            )
            distance[i] += near[i]
        return np.where((geom >= 0) & (distance < length), distance, np.inf)

    def _cast(
        self, start: Floats, direction: Floats, geom: NDArray[np.int32], distance: Floats, farthest: float
    ) -> None:
        mujoco.mj_multiRay(
            self._model,
            self._data,
            pnt=start,
            vec=direction.ravel(),
            geomgroup=_OBJECT_GROUPS,
            flg_static=1,
            bodyexclude=-1,
            geomid=geom,
            dist=distance,
            normal=None,
            nray=len(direction),
            cutoff=farthest,
        )


def _ends(model: mujoco.MjModel, geom: int, head: Floats) -> tuple[Floats, Floats]:
    """Return the ends (3,) of the axis of a capsule in the rest pose; its bone begins at ``head`` (3,)."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    reach = model.geom_size[geom, 1] * turn.reshape(3, 3)[:, 2]
    return head + model.geom_pos[geom] - reach, head + model.geom_pos[geom] + reach


class PlacedCapsules(NamedTuple):
    """Capsules of people where they are."""

    placed: NDArray[np.float64]
    """Ends of their axes, (c, 2, 3), metres."""
    radii: NDArray[np.float64]
    """Their radii, (c,), metres."""
    first: NDArray[np.int64]
    """First capsule of each person, and the end, (P + 1,)."""
    around: NDArray[np.float64]
    """Bounding spheres of the people, centre and radius, (P, 4)."""


class CastRays(NamedTuple):
    """Rays of several views, one after the other, r in all."""

    direction: NDArray[np.float64]
    """Unit vectors, (r, 3)."""
    length: NDArray[np.float64]
    """Distance of the targets from the centres, metres, (r,)."""
    near: NDArray[np.float64]
    """Distance from the centres at which the rays start, metres, (r,)."""
    owner: NDArray[np.int64]
    """Person hit first, (r,)."""
    distance: NDArray[np.float64]
    """Distance of the hit from the centre, metres, (r,)."""
    met: NDArray[np.bool_]
    """Which rays meet a box, (r,) bool."""


@njit(cache=True)
def place_capsules(rest, bone, bones, people):
    """Place capsules.

    Args:
        rest: ends of their axes in the rest pose, (c, 2, 3).
        bone: bone of each, (c,).
        bones: transforms of the bones of each person, (P, B, 3, 4).
        people: the capsules; their places and bounding spheres are written.
    """
    placed, radii, first, around = people
    for person in range(len(bones)):
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for c in range(first[person], first[person + 1]):
            transform = bones[person, bone[c]]
            for end in range(2):
                for k in range(3):
                    at = transform[k, 3]
                    for j in range(3):
                        at += transform[k, j] * rest[c, end, j]
                    placed[c, end, k] = at
                    low[k], high[k] = min(low[k], at - radii[c]), max(high[k], at + radii[c])
        for k in range(3):
            around[person, k] = (low[k] + high[k]) / 2
        around[person, 3] = np.sqrt(((high - low) ** 2).sum()) / 2


@njit(cache=True)
def box_geoms(geoms, local, position, turn, margin, low, high):
    """Write boxes along the axes of the world around MuJoCo geoms, (3, m) each.

    Args:
        geoms: their numbers, (m,).
        local: centres and half sizes of their boxes in their own frames, (all, 6).
        position: origins of these frames, (all, 3).
        turn: their rotations to the world by rows, (all, 9).
        margin: metres added on all sides.
        low: output, lowest coordinates.
        high: output, highest coordinates.
    """
    for b in range(len(geoms)):
        g = geoms[b]
        for k in range(3):
            middle, reach = position[g, k], margin
            for j in range(3):
                middle += turn[g, 3 * k + j] * local[g, j]
                reach += abs(turn[g, 3 * k + j]) * local[g, 3 + j]
            low[k, b], high[k, b] = middle - reach, middle + reach


@njit(cache=True)
def cast_views(cameras, targets, wanted, nearest, people, boxes, rays):
    """Cast rays at people, and find those that may hit an object before their ends.

    Args:
        cameras: camera centres and directions of the optical axes, (V, 3) each.
        targets: ends of the rays, (V, n, 3).
        wanted: which of them are cast, (V, n), r in all.
        nearest: depth at which the rays start, metres.
        people: capsules of the people.
        boxes: lowest and highest coordinates of boxes around objects, (3, m) each.
        rays: the rays, written; owner and distance of a ray that hits nobody stay.

    Returns:
        Number of the first ray of each view, and the end, (V + 1,).
    """
    centers, axes = cameras
    low, high = boxes
    direction, length, near, owner, distance, met = rays
    starts, count = np.zeros(len(centers) + 1, np.int64), 0
    for v in range(len(centers)):
        start, axis = centers[v], axes[v]
        for i in range(targets.shape[1]):
            if not wanted[v, i]:
                continue
            x, y, z = targets[v, i, 0] - start[0], targets[v, i, 1] - start[1], targets[v, i, 2] - start[2]
            length[count] = np.sqrt(x * x + y * y + z * z)
            x, y, z = x / length[count], y / length[count], z / length[count]
            direction[count, 0], direction[count, 1], direction[count, 2] = x, y, z
            near[count] = nearest / (x * axis[0] + y * axis[1] + z * axis[2])
            count += 1
        a, starts[v + 1] = starts[v], count
        ways, ends = direction[a:count], length[a:count]
        meet_boxes(start, ways, ends, low, high, met[a:count])
        hit_people(start, ways, near[a:count], ends, people, owner[a:count], distance[a:count])
    return starts


@njit(cache=True)
def meet_boxes(start, direction, length, low, high, met):
    """Write which rays meet a box before their ends.

    Args:
        start: start of all rays, (3,).
        direction: unit vectors, (n, 3).
        length: metres, (n,).
        low: lowest coordinates of boxes along the axes of the world, (3, m).
        high: highest coordinates, (3, m).
        met: output, (n,) bool.
    """
    for i in range(len(direction)):
        u, v, w = _inverse(direction[i, 0]), _inverse(direction[i, 1]), _inverse(direction[i, 2])
        end, any_met = length[i], 0
        for b in range(low.shape[1]):  # branch-free, so that the compiler vectorises it
            one, two = (low[0, b] - start[0]) * u, (high[0, b] - start[0]) * u
            enter, leave = (one, two) if one < two else (two, one)
            one, two = (low[1, b] - start[1]) * v, (high[1, b] - start[1]) * v
            one, two = (one, two) if one < two else (two, one)
            enter, leave = one if one > enter else enter, two if two < leave else leave
            one, two = (low[2, b] - start[2]) * w, (high[2, b] - start[2]) * w
            one, two = (one, two) if one < two else (two, one)
            enter, leave = one if one > enter else enter, two if two < leave else leave
            any_met |= (enter <= leave) & (leave >= 0.0) & (enter <= end)
        met[i] = any_met != 0


@njit(cache=True)
def _inverse(share):
    """Return the inverse of a coordinate of a direction, finite for 0."""
    if abs(share) * _STEEPEST < 1.0:
        return _STEEPEST if share >= 0.0 else -_STEEPEST
    return 1.0 / share


@njit(cache=True)
def hit_people(start, direction, near, length, people, owner, distance):
    """Write the first person hit by each ray between ``near`` and ``length``, and the distance; none: unchanged.

    Args:
        start: start of all rays, (3,).
        direction: unit vectors, (n, 3).
        near: distance from which on hits count, metres, (n,).
        length: distance up to which hits count, metres, (n,).
        people: fields of :class:`PlacedCapsules`.
        owner: output, (n,).
        distance: output, metres, (n,).
    """
    placed, radii, first, around = people
    spheres = np.empty((len(placed), 4))
    for c in range(len(placed)):
        square = 0.0
        for k in range(3):
            spheres[c, k] = (placed[c, 0, k] + placed[c, 1, k]) / 2
            square += (placed[c, 1, k] - placed[c, 0, k]) ** 2
        spheres[c, 3] = radii[c] + 0.5 * np.sqrt(square) + _ROUND_OFF
    for i in range(len(direction)):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        x, y, z = start[0] + near[i] * dx, start[1] + near[i] * dy, start[2] + near[i] * dz
        best = length[i] - near[i]
        for person in range(len(around)):
            cx, cy, cz = around[person, 0] - x, around[person, 1] - y, around[person, 2] - z
            if _misses(cx, cy, cz, around[person, 3], dx, dy, dz, best):
                continue
            for c in range(first[person], first[person + 1]):
                cx, cy, cz = spheres[c, 0] - x, spheres[c, 1] - y, spheres[c, 2] - z
                if _misses(cx, cy, cz, spheres[c, 3], dx, dy, dz, best):
                    continue
                ax, ay, az = placed[c, 0, 0] - x, placed[c, 0, 1] - y, placed[c, 0, 2] - z
                bx, by, bz = placed[c, 1, 0] - x, placed[c, 1, 1] - y, placed[c, 1, 2] - z
                entry = _enter(ax, ay, az, bx, by, bz, radii[c], dx, dy, dz)
                if entry < 0.0:  # the ray starts inside the capsule: it hits the far side, from inside
                    entry = -_enter(ax, ay, az, bx, by, bz, radii[c], -dx, -dy, -dz)
                if 0.0 <= entry < best:
                    best = entry
                    owner[i], distance[i] = person, entry + near[i]


@njit(cache=True)
def _misses(cx, cy, cz, radius, dx, dy, dz, best):
    """Return whether a ray of length ``best`` from the origin misses a sphere."""
    along = cx * dx + cy * dy + cz * dz
    return along < -radius or along - radius > best or cx * cx + cy * cy + cz * cz - along * along > radius * radius


@njit(cache=True)
def _enter(ax, ay, az, bx, by, bz, radius, dx, dy, dz):
    """Return where the line from the origin along (dx, dy, dz) enters a capsule from a to b; infinite if it misses."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    square = ux * ux + uy * uy + uz * uz
    aligned, begins = ux * dx + uy * dy + uz * dz, ux * ax + uy * ay + uz * az
    seen, far = ax * dx + ay * dy + az * dz, ax * ax + ay * ay + az * az
    # First the infinite cylinder, in units of the squared length of the axis.
    p = square - aligned * aligned
    q = square * seen - begins * aligned
    r = square * far - begins * begins - radius * radius * square
    cap_b = False
    if p > 1e-12 * square:
        inner = q * q - p * r
        if inner < 0.0:
            return np.inf
        away = (q - np.sqrt(inner)) / p
        height = away * aligned - begins
        if 0.0 < height < square:
            return away
        cap_b = height >= square
    else:
        cap_b = aligned < 0.0  # parallel to the axis: the cap that is hit first
    if cap_b:
        seen, far = bx * dx + by * dy + bz * dz, bx * bx + by * by + bz * bz
    inner = seen * seen - far + radius * radius
    return seen - np.sqrt(inner) if inner >= 0.0 else np.inf
