"""Outer joints in the pictures: feet, hands and others beyond COCO17, their pixels and their visibility by rays.

They are filmed apart from the joints of COCO17, so that nothing of these depends on them. Rays hit the capsules of the
bodies, also where the scene itself is rendered; the rule for visibility is the same,
:func:`simharness.capture.joint_visibility.classify`.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from typing import TYPE_CHECKING

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton
from mvpose.wholebody.estimator import rows_of
from simharness.capture.filming import simultaneous_exposures
from simharness.capture.joint_visibility import classify
from simharness.capture.ray_casting import RayCaster
from simharness.capture.ray_visibility import CameraArrays, cast_bands
from simharness.capture.shutter import joints_at_exposure
from simharness.types.outer_joints import OuterViews
from simharness.types.views import Visibility
from simharness.world.humans.outer_landmarks import OuterJoints

if TYPE_CHECKING:
    from simharness.world.rigs.exposure_schedule import ExposureSchedule
    from simharness.world.scene.playback import Playback, PlaybackState


class OuterJointFilm:
    """Film of the outer joints of a scene.

    Args:
        playback: scene to film.
        skeleton: skeleton whose joints beyond COCO17 are filmed, E of them.
    """

    def __init__(self, playback: Playback, skeleton: Skeleton) -> None:
        self._playback = playback
        self._joints = [OuterJoints.of(body, skeleton) for body in playback.scene.bodies]
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
