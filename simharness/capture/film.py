"""Filming a scene: what every camera sees of every person in every frame.

Frames stream: one is posed, pictured and labelled before the next, and only what :class:`Views` holds is kept. They are
independent of each other, so processes can share them and :meth:`Views.concatenate` the parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.joint_visibility import label
from simharness.capture.picture import PictureSource, meshes_at, one_below_the_other
from simharness.capture.rendering.lens import project_to_image
from simharness.capture.rendering.renderer import Image, Renderer
from simharness.capture.shutter import moments, rolled, strips
from simharness.types.views import LookalikeViews, Views, Visibility
from simharness.world.scene.lookalikes import Lookalikes

if TYPE_CHECKING:
    from simharness.world.rigs.exposure_schedule import ExposureSchedule
    from simharness.world.scene.playback import Playback, State

PREVIEW = 320  # pixels: width of the reduced pictures


@dataclass(frozen=True)
class Observation:
    """What one camera sees in one picture: as :class:`Views`, without T and V.

    ``lookalike_pixels`` (D, J, 2) and ``lookalike_visible`` (D, J) are those of ``Lookalikes.of(scene)``.
    """

    pixels: NDArray[np.float64]
    visibility: NDArray[np.int8]
    boxes: NDArray[np.float64]
    area_visible: NDArray[np.int64]
    lookalike_pixels: NDArray[np.float64]
    lookalike_visible: NDArray[np.bool_]


class Observer(Protocol):
    """A way to find out what cameras see."""

    def observe(self, states: Many[State], cameras: Many[Camera]) -> list[Observation]:
        """What cameras see whose shutters are open together.

        Args:
            states: the scene at the moments of a picture's bands (:func:`simharness.capture.shutter.moments`); one
                state where all rows are taken at once.
            cameras: any number.
        """
        ...


class PictureObserver:
    """Sees by pictures of depth and ids.

    Args:
        playback: the scene.
        renderer: makes the pictures.
    """

    def __init__(self, playback: Playback, renderer: Renderer) -> None:
        self._scene = playback.scene
        self._lookalikes = Lookalikes.of(playback.scene)
        self._renderer = renderer
        people = len(self._scene.bodies)
        radii = [body.joint_radii for body in self._scene.bodies]
        self._radii = np.stack(radii) if people else np.zeros((0, 17))

    def observe(self, states: Many[State], cameras: Many[Camera]) -> list[Observation]:
        """See :class:`Observer`."""
        people = len(self._scene.bodies)
        meshes = [meshes_at(self._scene, state) for state in states]
        framed = boxes([[mesh.vertices for mesh in each[:people]] for each in meshes], [NO_EDGES] * people, cameras)
        result = []
        for view, camera in enumerate(cameras):
            image = one_below_the_other(
                [
                    self._renderer.render(strip, each, color=False)
                    for strip, each in zip(strips(camera, len(meshes)), meshes, strict=True)
                ]
            )
            bands = np.stack([state.joints for state in states])
            joints, seeming = rolled(bands, camera), rolled(self._lookalikes.joints(bands), camera)
            seeming_at = project_to_image(camera, seeming)
            result.append(
                Observation(
                    pixels=project_to_image(camera, joints),
                    visibility=label(image, camera, joints=joints, radii=self._radii),
                    boxes=framed[view],
                    area_visible=_areas(image.ids, people),
                    lookalike_pixels=seeming_at,
                    lookalike_visible=_seen(image, camera, self._lookalikes, seeming, seeming_at),
                )
            )
        return result


def film(
    playback: Playback,
    exposures: ExposureSchedule,
    observer: Observer,
    *,
    frames: Many[int] | None = None,
    picture_source: PictureSource | None = None,
    previews: Collection[int] = (),
) -> Views:
    """Film ``frames`` (all by default) of a scene.

    Args:
        playback: the scene.
        exposures: when and with which lens every picture is taken.
        observer: how it is found out what is seen.
        frames: indices of frames.
        picture_source: makes the colour pictures; not needed without previews.
        previews: frames of which to keep the colour pictures, taken ``PREVIEW`` pixels wide.
    """
    frames = range(len(exposures.time)) if frames is None else frames
    people, joints = len(playback.scene.bodies), 17
    views = len(exposures.believed_rig)
    shape = (len(frames), views, people)
    pixels = np.full((*shape, joints, 2), np.nan)
    visibility = np.full((*shape, joints), int(Visibility.OUTSIDE), np.int8)
    boxed, area = np.zeros((*shape, 4)), np.zeros(shape, np.int64)
    names = Lookalikes.of(playback.scene).names
    seeming = np.full((*shape[:2], len(names), joints, 2), np.nan)
    seeming_visible = np.zeros(seeming.shape[:-1], bool)
    for f, view_group, states in _moments(playback, exposures, frames):
        cameras = [exposures.camera(frames[f], view) for view in view_group]
        for view, seen in zip(view_group, observer.observe(states, cameras), strict=True):
            pixels[f, view], visibility[f, view] = seen.pixels, seen.visibility
            boxed[f, view], area[f, view] = seen.boxes, seen.area_visible
            seeming[f, view], seeming_visible[f, view] = seen.lookalike_pixels, seen.lookalike_visible
    kept: dict[int, tuple[NDArray[np.uint8], ...]] = {}
    for frame in frames:
        if picture_source is not None and frame in previews:
            kept[frame] = tuple(
                picture_source.picture(exposures, frame, view, width=PREVIEW, finer=2) for view in range(views)
            )
    return Views(
        pixels=pixels,
        visibility=visibility,
        boxes=boxed,
        area_visible=area,
        source=exposures.source[list(frames)],
        previews=kept,
        lookalikes=LookalikeViews(names, seeming, seeming_visible),
    )


_BLOCK = 64  # frames whose motions are sampled together


def _moments(
    playback: Playback, exposures: ExposureSchedule, frames: Many[int]
) -> Iterator[tuple[int, NDArray[np.int64], list[State]]]:
    """Position in ``frames``, views whose pictures are taken together, and the scene at the moments of their bands."""
    for start in range(0, len(frames), _BLOCK):
        groups = []
        for f in range(start, min(start + _BLOCK, len(frames))):
            delivered = np.flatnonzero(exposures.source[frames[f]] >= 0)
            when = exposures.time[frames[f], delivered]
            groups += [(f, delivered[when == time], moments(time, exposures.readout)) for time in np.unique(when)]
        states = playback.over(np.concatenate([np.zeros(0), *(times for *_, times in groups)]))
        for f, views, times in groups:
            yield f, views, list(itertools.islice(states, len(times)))


def _areas(ids: NDArray[np.int16], people: int) -> NDArray[np.int64]:
    """Pixels in which each person is seen, (P,)."""
    if not people:
        return np.zeros(0, np.int64)
    # Several times as fast as np.bincount, which first makes 64 bits of everything.
    counts = cv2.calcHist([np.ascontiguousarray(ids).view(np.uint16)], [0], None, [people], [0, people])
    return counts.ravel().astype(np.int64)


def _seen(
    image: Image, camera: Camera, lookalikes: Lookalikes, joints: NDArray[np.float64], pixels: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which joints of lookalikes are seen, (D, J), from where they appear to be (D, J, 3) and in the picture (D, J, 2).

    At their pixels their own surface is seen, be it a mirror's glass, or none that is in front of it.
    """
    targets, shown = lookalikes.targets(camera.center, joints)
    shown &= camera.inside(pixels)
    column, row = np.moveaxis(np.floor(np.where(shown[..., None], pixels, 0) + 0.5).astype(int), -1, 0)
    own = image.ids[row, column] == lookalikes.mesh[:, None]
    return shown & (own | (camera.depth(targets) <= image.depth[row, column]))
