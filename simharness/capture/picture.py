"""Colour pictures of a scene: meshes for the renderer, then the shutter and the sensor of a camera."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.mirrors import with_mirrors
from simharness.capture.rendering.renderer import Image, Renderer
from simharness.capture.sensor import blur, develop
from simharness.capture.shutter import band_cameras, band_times
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.motion.trajectory import transform_points

if TYPE_CHECKING:
    from simharness.scenario.sections.cameras_section import SensorSection
    from simharness.world.rigs.exposure_schedule import ExposureSchedule
    from simharness.world.scene.build import Scene
    from simharness.world.scene.playback import Playback, PlaybackState

Rgb = NDArray[np.uint8]

_BLUR_STEPS = 5  # times averaged for the motion blur of one picture


def meshes_at(scene: Scene, state: PlaybackState) -> list[Mesh]:
    """Return the meshes of a scene in one state: the P people, then the solids, so mesh indices < P are people.

    The mesh of an absent person is a point on the floor: it has no area in a picture and does not extend the scene.
    """
    people = [
        figure.moved(body.skin(bones) if here else np.zeros_like(figure.vertices))
        for body, bones, figure, here in zip(scene.bodies, state.bones, scene.figures, state.present, strict=True)
    ]
    placements = iter(state.placements)
    objects = [
        solid.mesh
        if solid.trajectory is None
        else solid.mesh.moved(transform_points(solid.mesh.vertices, next(placements)))
        for solid in scene.solids
    ]
    return [*people, *objects]


def antialiased(
    renderer: Renderer,
    camera: Camera,
    meshes: Many[Mesh],
    *,
    finer: int = 2,
    lighting: Lighting | None = None,
    mirrors: Mapping[int, Mirror] = MappingProxyType({}),
) -> Rgb:
    """Render an antialiased colour picture, with ``finer`` x ``finer`` samples per pixel.

    Args:
        renderer: renderer of the picture.
        camera: camera of the picture.
        meshes: meshes of the scene.
        finer: samples per pixel in each direction.
        lighting: lighting of the scene; ``Lighting()`` by default.
        mirrors: glass of the meshes that are mirrors, by mesh index.

    Returns:
        (h, w, 3) uint8.
    """
    lighting = lighting or Lighting()
    large = scaled(camera, finer)
    image = renderer.render(large, meshes, lighting=lighting)
    rgb = with_mirrors(renderer, large, meshes, mirrors, image, lighting=lighting)
    return cv2.resize(rgb, camera.size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def scaled(camera: Camera, scale: float) -> Camera:
    """Return the camera with another resolution: a scale of 2 gives 2 x 2 pixels for each original one."""
    if scale == 1.0:
        return camera
    size = reduced_size(camera.size, scale)
    share = np.array(size) / camera.size
    K = camera.K.copy()
    K[:2] *= share[:, None]
    K[:2, 2] += (share - 1) / 2  # pixel centres are integers at any size
    return replace(camera, K=K, size=size)


def reduced_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Return width and height of a picture of ``size`` at another scale, in whole pixels."""
    return max(1, round(scale * size[0])), max(1, round(scale * size[1]))


def stack_bands(bands: Many[Image]) -> Image:
    """Join the images of bands of rows, given from the top, to one image."""
    if len(bands) == 1:
        return bands[0]
    parts = [band.parts for band in bands if band.parts is not None]
    return Image(
        rgb=np.concatenate([band.rgb for band in bands]),
        depth=np.concatenate([band.depth for band in bands]),
        ids=np.concatenate([band.ids for band in bands]),
        parts=np.concatenate(parts) if len(parts) == len(bands) else None,
    )


class ScenePictures:
    """Source of the pictures that the cameras deliver, shutter and sensor included.

    Args:
        playback: scene to picture.
        renderer: renderer of the pictures.
        sensor: parameters of the sensor.
        seed: seed of the scenario.
    """

    def __init__(self, playback: Playback, renderer: Renderer, *, sensor: SensorSection, seed: int) -> None:
        self._playback = playback
        self._renderer = renderer
        self._sensor = sensor
        self._seed = seed

    def picture(
        self, exposures: ExposureSchedule, frame: int, view: int, *, finer: int = 1, width: int | None = None
    ) -> Rgb:
        """Return the colour picture that ``view`` delivers in ``frame``, (h, w, 3); black if none arrives.

        Args:
            exposures: time and camera of every picture.
            frame: index of the frame.
            view: index of the view.
            finer: samples per pixel in each direction; 2 gives smooth outlines.
            width: width of the picture in pixels, if it should be smaller than that of the camera.
        """
        size = exposures.believed_rig[view].size
        scale = 1.0 if width is None else min(1.0, width / size[0])
        if not exposures.delivered[frame, view]:
            return np.zeros((*reduced_size(size, scale)[::-1], 3), np.uint8)
        camera = scaled(exposures.camera(frame, view), scale)
        exposed = []
        for middle in self._exposure_times(exposures.time[frame, view]):
            times = band_times(middle, exposures.readout)
            bands = zip(self._playback.over(times), band_cameras(camera, len(times)), strict=True)
            exposed.append(np.concatenate([self._render(state, strip, finer) for state, strip in bands]))
        taken = int(exposures.source[frame, view])
        return develop(blur(exposed), self._sensor, seed=self._seed, view=view, frame=taken, camera=camera, scale=scale)

    def image(self, exposures: ExposureSchedule, frame: int, view: int) -> Image:
        """Return depth, ids and body parts at the middle of the exposure.

        Raises:
            ValueError: the picture never arrives.
        """
        if not exposures.delivered[frame, view]:
            raise ValueError(f"view {view} delivers no picture in frame {frame}")
        camera, scene = exposures.camera(frame, view), self._playback.scene
        times = band_times(exposures.time[frame, view], exposures.readout)
        bands = zip(self._playback.over(times), band_cameras(camera, len(times)), strict=True)
        return stack_bands(
            [self._renderer.render(strip, meshes_at(scene, state), color=False, parts=True) for state, strip in bands]
        )

    def _exposure_times(self, middle: float) -> NDArray[np.float64]:
        """Return the times over which one exposure is averaged, seconds."""
        shutter = self._sensor.shutter
        steps = _BLUR_STEPS if shutter else 1
        return middle + shutter * ((np.arange(steps) + 0.5) / steps - 0.5)

    def _render(self, state: PlaybackState, camera: Camera, finer: int) -> Rgb:
        scene = self._playback.scene
        return antialiased(
            self._renderer,
            camera,
            meshes_at(scene, state),
            finer=finer,
            lighting=scene.lighting,
            mirrors=scene.mirrors,
        )
