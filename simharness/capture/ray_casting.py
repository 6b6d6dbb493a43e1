"""First hits of rays from the cameras: on MuJoCo geoms of objects and on capsules of people.

MuJoCo tests each ray against every geom of the model, so the cost of a ray grows with the number of people. People are
therefore tested by a separate kernel, which skips people far from the ray; a test compares it with ``mj_multiRay``. Of
the other geoms MuJoCo tests only rays that meet a box around one of them: most rays to people meet none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from simharness.capture.ray_kernels import box_geoms, cast_views, place_capsules
from simharness.capture.rendering.renderer import NEAR
from simharness.world.humans.mujoco_model import SKIN_GROUP

if TYPE_CHECKING:
    from simharness.world.scene.build import Scene
    from simharness.world.scene.playback import PlaybackState


_OBJECT_GROUPS = np.array([group != SKIN_GROUP for group in range(6)], np.uint8)  # geom groups tested by MuJoCo
_ROUNDING = 1e-5  # metres: boxes around objects are larger by this than those of MuJoCo, which rounds meshes
_ENDLESS = 1e9  # metres: half size of a plane


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
        self._placed = np.empty((len(capsules), 2, 3))
        self._around = np.empty((self._people, 4))
        self._objects = np.flatnonzero(model.geom_group != SKIN_GROUP)
        self._local = np.array(model.geom_aabb)
        self._local[model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, 3:] = _ENDLESS
        self._low, self._high = np.empty((2, 3, len(self._objects)))
        self._box_objects()

    def place(self, state: PlaybackState) -> None:
        """Move all people and objects to their positions in a state."""
        bones = np.ascontiguousarray(state.bones)
        place_capsules(self._rest, self._bone, self._radii, self._first, bones, self._placed, self._around)
        if len(self._moving):
            self._data.mocap_pos[self._moving] = state.placements[:, :3]
            self._data.mocap_quat[self._moving] = state.placements[:, 3:]
            mujoco.mj_kinematics(self._model, self._data)
            self._box_objects()

    def _box_objects(self) -> None:
        data = self._data
        box_geoms(self._objects, self._local, data.geom_xpos, data.geom_xmat, _ROUNDING, self._low, self._high)

    def capsules_of(self, person: int) -> tuple[Floats, Floats]:
        """Return ends (c, 2, 3) and radii (c,), metres, of the capsules of a person in the state placed last."""
        own = slice(self._first[person], self._first[person + 1])
        return self._placed[own].copy(), self._radii[own]

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
        first = cast_views(
            centers, axes, targets, wanted, NEAR, self._placed, self._radii, self._first, self._around, self._low,
            self._high, direction, length, near, owner, distance, met,
        )  # fmt: skip
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
