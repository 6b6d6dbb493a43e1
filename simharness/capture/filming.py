"""Filming of a scene: ground truth of every picture of every camera.

Frames are processed one at a time (posed, rendered, labelled), and only the content of :class:`Views` is kept. They are
independent of each other, so several processes can film parts, which :meth:`~simharness.types.views.Views.concatenate`
joins.
"""

import itertools
from collections.abc import Collection, Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.joint_visibility import label_joints
from simharness.capture.picture import ScenePictures, meshes_at, stack_bands
from simharness.capture.rendering.renderer import Image, Renderer
from simharness.capture.sensor import band_cameras, band_times, joints_at_exposure
from simharness.types.views import LookalikeViews, Views, Visibility
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.rigs.projection import project_to_image
from simharness.world.scene.lookalikes import Lookalikes
from simharness.world.scene.playback import Playback, PlaybackState

PREVIEW = 320  # width of the reduced pictures, pixels


@dataclass(frozen=True)
class Observation:
    """Ground truth of one picture of one camera: the arrays of :class:`Views` without the axes T and V.

    ``lookalike_pixels`` (D, J, 2) and ``lookalike_visible`` (D, J) are those of ``Lookalikes.from_scene(scene)``.
    """

    pixels: NDArray[np.float64]
    visibility: NDArray[np.int8]
    boxes: NDArray[np.float64]
    area_visible: NDArray[np.int64]
    lookalike_pixels: NDArray[np.float64]
    lookalike_visible: NDArray[np.bool_]


class Observer(Protocol):
    """Method to determine what cameras see."""

    def observe(self, states: Many[PlaybackState], cameras: Many[Camera]) -> list[Observation]:
        """Return the observations of cameras that expose at the same time.

        Args:
            states: scene at the times of the bands of a picture (:func:`simharness.capture.sensor.band_times`); one
                state if all rows are exposed at once.
            cameras: any number of cameras.
        """
        ...


class PictureObserver:
    """Observer that renders depth and ids.

    Args:
        playback: scene to observe.
        renderer: renderer of the pictures.
    """

    def __init__(self, playback: Playback, renderer: Renderer) -> None:
        self._scene = playback.scene
        self._lookalikes = Lookalikes.from_scene(playback.scene)
        self._renderer = renderer
        people = len(self._scene.bodies)
        radii = [body.joint_radii for body in self._scene.bodies]
        self._radii = np.stack(radii) if people else np.zeros((0, 17))

    def observe(self, states: Many[PlaybackState], cameras: Many[Camera]) -> list[Observation]:
        """Return the observations: see :class:`Observer`."""
        people = len(self._scene.bodies)
        meshes = [meshes_at(self._scene, state) for state in states]
        framed = boxes([[mesh.vertices for mesh in each[:people]] for each in meshes], [NO_EDGES] * people, cameras)
        result = []
        for view, camera in enumerate(cameras):
            image = stack_bands(
                [
                    self._renderer.render(strip, each, color=False)
                    for strip, each in zip(band_cameras(camera, len(meshes)), meshes, strict=True)
                ]
            )
            bands = np.stack([state.joints for state in states])
            joints = joints_at_exposure(bands, camera)
            lookalike_joints = joints_at_exposure(self._lookalikes.joints(bands), camera)
            lookalike_pixels = project_to_image(camera, lookalike_joints)
            result.append(
                Observation(
                    pixels=project_to_image(camera, joints),
                    visibility=label_joints(image, camera, joints=joints, radii=self._radii),
                    boxes=framed[view],
                    area_visible=_areas(image.ids, people),
                    lookalike_pixels=lookalike_pixels,
                    lookalike_visible=_visible(image, camera, self._lookalikes, lookalike_joints, lookalike_pixels),
                )
            )
        return result


def film(
    playback: Playback,
    exposures: ExposureSchedule,
    observer: Observer,
    *,
    frames: Many[int] | None = None,
    picture_source: ScenePictures | None = None,
    previews: Collection[int] = (),
) -> Views:
    """Film ``frames`` of a scene (all by default).

    Args:
        playback: scene to film.
        exposures: time and camera of every picture.
        observer: method to determine what the cameras see.
        frames: indices of frames.
        picture_source: source of the colour pictures; needed for previews only.
        previews: frames for which colour pictures are kept, ``PREVIEW`` pixels wide.
    """
    frames = range(len(exposures.time)) if frames is None else frames
    people, joints = len(playback.scene.bodies), 17
    views = len(exposures.believed_rig)
    shape = (len(frames), views, people)
    pixels = np.full((*shape, joints, 2), np.nan)
    visibility = np.full((*shape, joints), int(Visibility.OUTSIDE), np.int8)
    boxed, area = np.zeros((*shape, 4)), np.zeros(shape, np.int64)
    lookalikes = Lookalikes.from_scene(playback.scene)
    names = lookalikes.names
    lookalike_pixels = np.full((*shape[:2], len(names), joints, 2), np.nan)
    lookalike_visible = np.zeros(lookalike_pixels.shape[:-1], bool)
    for f, view_group, states in simultaneous_exposures(playback, exposures, frames):
        cameras = [exposures.camera(frames[f], view) for view in view_group]
        for view, one in zip(view_group, observer.observe(states, cameras), strict=True):
            here = np.all([state.present for state in states], axis=0)
            pixels[f, view, here], visibility[f, view, here] = one.pixels[here], one.visibility[here]
            boxed[f, view, here], area[f, view, here] = one.boxes[here], one.area_visible[here]
            lookalike_pixels[f, view] = one.lookalike_pixels
            lookalike_visible[f, view] = one.lookalike_visible & lookalikes.exist(here)[:, None]
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
        lookalikes=LookalikeViews(names, lookalike_pixels, lookalike_visible),
    )


_BLOCK = 64  # frames for which motions are sampled together


def simultaneous_exposures(
    playback: Playback, exposures: ExposureSchedule, frames: Many[int]
) -> Iterator[tuple[int, NDArray[np.int64], list[PlaybackState]]]:
    """Yield an index into ``frames``, the views exposed at the same time, and the scene at the times of their bands."""
    for start in range(0, len(frames), _BLOCK):
        groups = []
        for f in range(start, min(start + _BLOCK, len(frames))):
            delivered = np.flatnonzero(exposures.source[frames[f]] >= 0)
            when = exposures.time[frames[f], delivered]
            groups += [(f, delivered[when == time], band_times(time, exposures.readout)) for time in np.unique(when)]
        states = playback.over(np.concatenate([np.zeros(0), *(times for *_, times in groups)]))
        for f, views, times in groups:
            yield f, views, list(itertools.islice(states, len(times)))


def _areas(ids: NDArray[np.int16], people: int) -> NDArray[np.int64]:
    """Return the number of pixels that show each person, (P,)."""
    if not people:
        return np.zeros(0, np.int64)
    # Several times as fast as np.bincount, which first converts everything to 64 bits.
    counts = cv2.calcHist([np.ascontiguousarray(ids).view(np.uint16)], [0], None, [people], [0, people])
    return counts.ravel().astype(np.int64)


def _visible(
    image: Image, camera: Camera, lookalikes: Lookalikes, joints: NDArray[np.float64], pixels: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether joints of lookalikes are visible, (D, J), given their apparent positions (D, J, 3) and pixels.

    A joint is visible if the picture shows the surface of the lookalike at its pixel (for a mirror image: the glass),
    or no surface in front of the joint.
    """
    targets, shown = lookalikes.targets(camera.center, joints)
    shown &= camera.inside(pixels)
    column, row = np.moveaxis(np.floor(np.where(shown[..., None], pixels, 0) + 0.5).astype(int), -1, 0)
    same_object = image.ids[row, column] == lookalikes.mesh[:, None]
    return shown & (same_object | (camera.depth(targets) <= image.depth[row, column]))
