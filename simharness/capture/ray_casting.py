"""First hits of rays from the cameras: on MuJoCo geoms of objects and on capsules of people.

MuJoCo tests each ray against every geom of the model, so the cost of a ray grows with the number of people. People are
therefore tested by a separate kernel, which skips people far from the ray; a test compares it with ``mj_multiRay``.

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
        self._capsules = PlacedCapsules(self._rest, self._radii, self._first, np.empty((self._people, 4)))

    def place(self, state: PlaybackState) -> None:
        """Move all people and objects to their positions in a state."""
        bones = state.bones[self._person, self._bone][:, None]
        placed = bones[..., 3]
        for axis in range(3):
            placed = placed + bones[..., axis] * self._rest[..., axis, None]
        reach = self._radii[:, None]
        low = np.minimum.reduceat(placed.min(axis=1) - reach, self._first[:-1])
        high = np.maximum.reduceat(placed.max(axis=1) + reach, self._first[:-1])
        spheres = np.column_stack([(low + high) / 2, np.sqrt(((high - low) ** 2).sum(axis=1)) / 2])
        self._capsules = PlacedCapsules(placed, self._radii, self._first, spheres)
        if len(self._moving):
            self._data.mocap_pos[self._moving] = state.placements[:, :3]
            self._data.mocap_quat[self._moving] = state.placements[:, 3:]
            mujoco.mj_kinematics(self._model, self._data)

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
        owners, in_front = np.full(wanted.shape, -1), np.full(wanted.shape, -np.inf)
        for view in np.flatnonzero(wanted.any(axis=1)):
            way = targets[view, wanted[view]] - centers[view]
            length = np.linalg.norm(way, axis=1)
            way /= length[:, None]
            near = NEAR / (way * axes[view]).sum(axis=1)
            owner, distance = np.full(len(way), -1), np.full(len(way), np.inf)
            hit_people(centers[view], way, near, length, self._capsules, owner, distance)
            found = self._hit_objects(centers[view], way, near, length)
            owner[found < distance] = self._people
            owners[view, wanted[view]] = owner
            in_front[view, wanted[view]] = length - np.minimum(distance, found)
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
