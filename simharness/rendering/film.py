"""Filming a scene: what every camera sees of every person in every frame.

Frames stream: one is posed, pictured and labelled before the next, and only what :class:`Views` holds is kept. They are
independent of each other, so processes can share them and :meth:`Views.concatenate` the parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.rendering.optics import appear
from simharness.rendering.picture import Studio, meshes_at
from simharness.rendering.renderer import NEAR, Renderer
from simharness.rendering.shutter import moments, rolled, stitched
from simharness.rendering.views import Views
from simharness.rendering.visibility import Visibility, label

if TYPE_CHECKING:
    from simharness.rigs.shots import Shots
    from simharness.scene.playback import Playback, State

PREVIEW = 320  # pixels: width of the reduced pictures


@dataclass(frozen=True)
class Seen:
    """What one camera sees in one picture: as :class:`Views`, without T and V."""

    pixels: NDArray[np.float64]
    visibility: NDArray[np.int8]
    boxes: NDArray[np.float64]
    area_visible: NDArray[np.int64]


class Eye(Protocol):
    """A way to find out what cameras see."""

    def see(self, states: Many[State], cameras: Many[Camera]) -> list[Seen]:
        """What cameras see whose shutters are open together.

        Args:
            states: the scene at the moments of a picture's bands (:func:`simharness.rendering.shutter.moments`); one
                state where all rows are taken at once.
            cameras: any number.
        """
        ...


class PictureEye:
    """Sees by pictures of depth and ids.

    Args:
        playback: the scene.
        renderer: makes the pictures.
    """

    def __init__(self, playback: Playback, renderer: Renderer) -> None:
        self._scene = playback.scene
        self._renderer = renderer
        people = len(self._scene.bodies)
        radii = [body.joint_radii for body in self._scene.bodies]
        self._radii = np.stack(radii) if people else np.zeros((0, 17))

    def see(self, states: Many[State], cameras: Many[Camera]) -> list[Seen]:
        """See :class:`Eye`."""
        people = len(self._scene.bodies)
        meshes = [meshes_at(self._scene, state) for state in states]
        result = []
        for camera in cameras:
            drawn = [self._renderer.render(camera, each, color=False) for each in meshes]
            image = replace(drawn[0], **{key: stitched([getattr(d, key) for d in drawn]) for key in ("depth", "ids")})
            joints = rolled(np.stack([state.joints for state in states]), camera)
            boxes = np.zeros((people, 4))
            for person in range(people):
                boxes[person] = silhouette_box(camera, [each[person].vertices for each in meshes])
            result.append(
                Seen(
                    pixels=appear(camera, joints),
                    visibility=label(image, camera, joints=joints, radii=self._radii),
                    boxes=boxes,
                    area_visible=np.bincount(image.ids.ravel() + 1, minlength=people + 1)[1 : people + 1],
                )
            )
        return result


def film(
    playback: Playback,
    shots: Shots,
    eye: Eye,
    *,
    frames: Many[int] | None = None,
    studio: Studio | None = None,
    previews: Collection[int] = (),
) -> Views:
    """Film ``frames`` (all by default) of a scene.

    Args:
        playback: the scene.
        shots: when and with which lens every picture is taken.
        eye: how it is found out what is seen.
        frames: indices of frames.
        studio: makes the colour pictures; not needed without previews.
        previews: frames of which to keep the colour pictures, reduced to a width of ``PREVIEW`` pixels.
    """
    frames = range(len(shots.time)) if frames is None else frames
    people, joints = len(playback.scene.bodies), 17
    views = len(shots.believed)
    shape = (len(frames), views, people)
    pixels = np.full((*shape, joints, 2), np.nan)
    visibility = np.full((*shape, joints), int(Visibility.OUTSIDE), np.int8)
    boxes, area = np.zeros((*shape, 4)), np.zeros(shape, np.int64)
    for f, view_group, states in _moments(playback, shots, frames):
        cameras = [shots.camera(frames[f], view) for view in view_group]
        for view, seen in zip(view_group, eye.see(states, cameras), strict=True):
            pixels[f, view], visibility[f, view] = seen.pixels, seen.visibility
            boxes[f, view], area[f, view] = seen.boxes, seen.area_visible
    kept: dict[int, tuple[NDArray[np.uint8], ...]] = {}
    for frame in frames:
        if studio is not None and frame in previews:
            kept[frame] = tuple(_reduced(studio.picture(shots, frame, view)) for view in range(views))
    return Views(
        pixels=pixels,
        visibility=visibility,
        boxes=boxes,
        area_visible=area,
        source=shots.source[list(frames)],
        previews=kept,
    )


_BLOCK = 64  # frames whose motions are sampled together


def _moments(
    playback: Playback, shots: Shots, frames: Many[int]
) -> Iterator[tuple[int, NDArray[np.int64], list[State]]]:
    """Position in ``frames``, views whose pictures are taken together, and the scene at the moments of their bands."""
    for start in range(0, len(frames), _BLOCK):
        groups = []
        for f in range(start, min(start + _BLOCK, len(frames))):
            delivered = np.flatnonzero(shots.source[frames[f]] >= 0)
            when = shots.time[frames[f], delivered]
            groups += [(f, delivered[when == time], moments(time, shots.readout)) for time in np.unique(when)]
        states = playback.over(np.concatenate([np.zeros(0), *(times for *_, times in groups)]))
        for f, views, times in groups:
            yield f, views, list(itertools.islice(states, len(times)))


def _reduced(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = rgb.shape[:2]
    size = (PREVIEW, max(1, round(PREVIEW * height / width)))
    return cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def silhouette_box(camera: Camera, bands: Many[NDArray]) -> NDArray[np.float64]:
    """Box x, y, width, height of the part of a body that projects onto the image; zeros where none does.

    Taken over the projected vertices that fall on the image, which lie a pixel or two apart; points nearer than
    the near plane are not seen.

    Args:
        camera: the camera.
        bands: vertices of the body's skin, (n, 3) metres, in the moments of the bands of rows from the top; one where
            all rows are taken at once.
    """
    height = camera.size[1]
    found = []
    for band, vertices in enumerate(bands):
        pixels = appear(camera, vertices, near=NEAR)
        pixels = pixels[camera.inside(pixels)]
        found.append(pixels[np.floor((pixels[:, 1] + 0.5) / height * len(bands)) == band])
    seen = np.concatenate(found)
    if not len(seen):
        return np.zeros(4)
    return np.concatenate([seen.min(axis=0), np.ptp(seen, axis=0)])
