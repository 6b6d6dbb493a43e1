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
from mvpose.kernels import njit
from simharness.capture.body_outlines import Outline, boxes, packed
from simharness.capture.filming import Observation
from simharness.capture.joint_visibility import classify
from simharness.capture.ray_casting import RayCaster
from simharness.capture.sensor import joints_at_exposure
from simharness.types.views import Visibility
from simharness.world.rigs.projection import bend, is_imaged, projection_matrix
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
    projections: Floats
    """``K [R | t]``, (V, 3, 4)."""
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
            np.array([projection_matrix(camera) for camera in cameras]).reshape(views, 3, 4),
            np.array([packed(camera) for camera in cameras]).reshape(views, 26),
        )

    def pixels_of(self, points: Floats) -> tuple[Floats, Bools]:
        """Project points in the world, (V, ..., 3) or the same for all views, (1, ..., 3).

        Returns:
            Pixels, (V, ..., 2), to the bit those of :func:`~simharness.world.rigs.projection.project_to_image`; and
            whether they are inside the pictures, (V, ...).
        """
        views, shape = len(self.cameras), points.shape[1:-1]
        count = int(np.prod(shape))
        pixels, inside = np.empty((views, count, 2)), np.empty((views, count), bool)
        flat = np.ascontiguousarray(points, float).reshape(len(points), count, 3)
        _project(flat, self.projections, self.table, pixels, inside)
        return pixels.reshape(views, *shape, 2), inside.reshape(views, *shape)


@njit(cache=True)
def _project(points, projections, table, pixels, inside):
    """Write pixels (V, n, 2) of points (V, n, 3) or (1, n, 3), and whether they are inside the pictures, (V, n)."""
    for view in range(len(pixels)):
        at, c = points[min(view, len(points) - 1)], table[view]
        bent, lens = c[25] != 0.0, c[17:22]
        matrix = projections[view].copy()
        if bent:
            for i in range(3):
                for j in range(3):
                    matrix[i, j] = c[5 + 3 * i + j]
                matrix[i, 3] = c[14 + i]
        for i in range(pixels.shape[1]):
            x, y, z = at[i, 0], at[i, 1], at[i, 2]
            depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
            u, v = np.nan, np.nan
            if depth > 0.0:
                u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / depth
                v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / depth
            if bent and depth > 0.0:
                if is_imaged(u, v, lens, c[24]):
                    u, v = bend(u, v, lens)
                    u, v = c[0] * u + c[1] * v + c[2], c[3] * v + c[4]
                else:
                    u, v = np.nan, np.nan
            pixels[view, i, 0], pixels[view, i, 1] = u, v
            inside[view, i] = -0.5 <= u < c[22] - 0.5 and -0.5 <= v < c[23] - 0.5
