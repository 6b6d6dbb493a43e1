"""Visibility without rendering: rays from every camera to every joint, and boxes from the outlines of bodies.

For studies that need no images. :mod:`simharness.capture.ray_casting` finds the first hit of each ray; the rule for
visibility is the same as for pictures, :func:`simharness.capture.joint_visibility.classify`.
"""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from simharness.capture.body_outlines import Outline, boxes, packed
from simharness.capture.filming import Observation
from simharness.capture.joint_visibility import classify
from simharness.capture.ray_casting import RayCaster
from simharness.capture.sensor import joints_at_exposure
from simharness.types.views import Visibility
from simharness.world.rigs.projection import project_to_image
from simharness.world.scene.lookalikes import Lookalikes
from simharness.world.scene.playback import Playback, PlaybackState

# Share of a box that the person fills: median over simulated people who walk and wave (10th to 90th percentile: 0.33 to
# 0.60).
_FILLED = 0.47
_HEIGHT = 23  # column of the height of a picture in the parameters of a camera


class RayObserver:
    """Observer that casts rays and projects the outlines of bodies.

    ``area_visible`` is an estimate: 0.47 times the area of the box times the share of the joints inside the picture
    that no other person or object occludes.

    Args:
        playback: scene to observe.
    """

    def __init__(self, playback: Playback) -> None:
        bodies = playback.scene.bodies
        self._caster = RayCaster(playback.scene)
        self._radii = np.reshape([body.joint_radii for body in bodies], (len(bodies), 17))
        self._outlines = [Outline.from_body(body) for body in bodies]
        self._lookalikes = Lookalikes.from_scene(playback.scene)
        self._cameras: CameraArrays | None = None  # those of the last observation
        self._allowed = np.concatenate([np.zeros(len(bodies)), self._lookalikes.allowed])

    def observe(self, states: Sequence[PlaybackState], cameras: Sequence[Camera]) -> list[Observation]:
        """Return the observations: see :class:`simharness.capture.filming.Observer`."""
        people = len(self._radii)
        self._cameras = views = CameraArrays.of_cameras(cameras, self._cameras)
        bands = np.stack([state.joints for state in states])
        bands = np.concatenate([bands, self._lookalikes.joints(bands)], axis=1)  # lookalikes after the people
        if len(bands) > 1:
            targets = np.stack([joints_at_exposure(bands, camera) for camera in cameras])
        else:
            targets = np.repeat(bands, len(cameras), axis=0)
        pixels, in_picture = views.pixels_of(targets)
        for v, center in enumerate(views.centers if len(self._lookalikes) else ()):
            targets[v, people:], shown = self._lookalikes.targets(center, targets[v, people:])
            in_picture[v, people:] &= shown
        owner, in_front = cast_bands(self._caster, states, views, pixels, targets, in_picture)
        inside = in_picture[:, :people]
        labels = classify(owner[:, :people], in_front[:, :people], inside, radii=self._radii)
        same_object = (owner == people) & (in_front <= self._allowed[:, None])
        visible = in_picture & ((owner < 0) | same_object)
        skins = [
            [outline.at(bones) for outline, bones in zip(self._outlines, state.bones, strict=True)] for state in states
        ]
        framed = boxes(skins, [outline.edges for outline in self._outlines], cameras, views.table)
        unoccluded = ((labels == Visibility.VISIBLE) | (labels == Visibility.SELF_OCCLUDED)).sum(axis=-1)
        share = unoccluded / np.maximum(inside.sum(axis=-1), 1)
        areas = np.rint(_FILLED * framed[..., 2] * framed[..., 3] * share).astype(np.int64)
        return [
            Observation(at[:people], label, box, area, at[people:], shown[people:])
            for at, label, box, area, shown in zip(pixels, labels, framed, areas, visible, strict=True)
        ]


def cast_bands(
    caster: RayCaster,
    states: Sequence[PlaybackState],
    cameras: "CameraArrays",
    pixels: Floats,
    targets: Floats,
    in_picture: Bools,
) -> tuple[Integers, Floats]:
    """Cast a ray to each target in a picture, each at the time of its row.

    Results are those of :meth:`~simharness.capture.ray_casting.RayCaster.cast`.

    Args:
        caster: ray caster of the scene.
        states: scene at the times of the bands of a picture.
        cameras: the V cameras.
        pixels: pixels of the targets, (V, n, J, 2).
        targets: targets in the world, (V, n, J, 3).
        in_picture: which targets get a ray, (V, n, J).

    Returns:
        Owner and distance in front of the target, (V, n, J) each; -1 and -inf without a ray.
    """
    views, rays = len(in_picture), in_picture[0].size
    ends, wanted = targets.reshape(views, rays, 3), in_picture.reshape(views, rays)
    owner, in_front = np.full(wanted.shape, -1), np.full(wanted.shape, -np.inf)
    share = (pixels[..., 1].reshape(views, rays) + 0.5) / cameras.table[:, _HEIGHT, None]
    band = np.floor(np.where(wanted, share, -1.0) * len(states))
    for k, state in enumerate(states):
        caster.place(state)
        now = band == k if len(states) > 1 else wanted
        found, before = caster.cast_views(cameras.centers, cameras.axes, ends, now)
        owner, in_front = np.where(now, found, owner), np.where(now, before, in_front)
    return owner.reshape(in_picture.shape), in_front.reshape(in_picture.shape)


@dataclass(frozen=True)
class CameraArrays:
    """Parameters of V cameras."""

    cameras: tuple[Camera, ...]
    """The cameras."""
    centers: Floats
    """Their centres in the world, (V, 3), metres."""
    axes: Floats
    """Directions of their optical axes, (V, 3)."""
    table: Floats
    """All parameters, (V, 26), see :func:`~simharness.capture.body_outlines.packed`."""

    @classmethod
    def of_cameras(cls, cameras: Sequence[Camera], last: "CameraArrays | None" = None) -> "CameraArrays":
        """Return the parameters of cameras, or ``last`` if it holds these same objects: a rig that stands still."""
        if last is not None and len(cameras) == len(last.cameras) and all(map(operator.is_, cameras, last.cameras)):
            return last
        views = len(cameras)
        return cls(
            tuple(cameras),
            np.array([camera.center for camera in cameras]).reshape(views, 3),
            np.array([camera.R[2] for camera in cameras]).reshape(views, 3),
            np.array([packed(camera) for camera in cameras]).reshape(views, 26),
        )

    def pixels_of(self, points: Floats) -> tuple[Floats, Bools]:
        """Project points in the world, (V, ..., 3) or the same for all views, (1, ..., 3).

        Returns:
            Pixels, (V, ..., 2), and whether they are inside the pictures, (V, ...).
        """
        points = np.broadcast_to(points, (len(self.cameras), *points.shape[1:]))
        pixels = np.stack([project_to_image(*each) for each in zip(self.cameras, points, strict=True)])
        return pixels, np.stack([camera.inside(at) for camera, at in zip(self.cameras, pixels, strict=True)])
