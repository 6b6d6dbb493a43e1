"""Pictures of a scene: what is put before a renderer, and what comes out of a camera with a shutter and a sensor."""

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
from simharness.capture.shutter import moments, strips
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.motion.trajectory import posed

if TYPE_CHECKING:
    from simharness.scenario.sections.scenario import Sensor
    from simharness.world.rigs.exposure_schedule import ExposureSchedule
    from simharness.world.scene.build import Scene
    from simharness.world.scene.playback import Playback, State

Rgb = NDArray[np.uint8]

_BLUR_STEPS = 5  # moments that make up the blur of one picture


def meshes_at(scene: Scene, state: State) -> list[Mesh]:
    """Everything to be seen in one state: people first, so that a mesh index below P is a person; then things."""
    people = [
        figure.moved(body.skin(bones))
        for body, bones, figure in zip(scene.bodies, state.bones, scene.figures, strict=True)
    ]
    placements = iter(state.placements)
    things = [
        solid.mesh if solid.trajectory is None else solid.mesh.moved(posed(solid.mesh.vertices, next(placements)))
        for solid in scene.solids
    ]
    return [*people, *things]


def antialiased(
    renderer: Renderer,
    camera: Camera,
    meshes: Many[Mesh],
    *,
    finer: int = 2,
    lighting: Lighting | None = None,
    mirrors: Mapping[int, Mirror] = MappingProxyType({}),
) -> Rgb:
    """Picture for people to look at: ``finer`` x ``finer`` samples a pixel, so that outlines are smooth.

    Args:
        renderer: draws it.
        camera: takes it.
        meshes: what is there.
        finer: samples a pixel each way.
        lighting: the light; by default that of ``Lighting()``.
        mirrors: the glass of those meshes that are mirrors, by their index.

    Returns:
        (h, w, 3) uint8.
    """
    lighting = lighting or Lighting()
    large = scaled(camera, finer)
    image = renderer.render(large, meshes, lighting=lighting)
    rgb = with_mirrors(renderer, large, meshes, mirrors, image, lighting=lighting)
    return cv2.resize(rgb, camera.size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def scaled(camera: Camera, scale: float) -> Camera:
    """The same camera with pixels of another size: 2 gives it 2 x 2 for each of its own."""
    if scale == 1.0:
        return camera
    size = reduced_size(camera.size, scale)
    share = np.array(size) / camera.size
    K = camera.K.copy()
    K[:2] *= share[:, None]
    K[:2, 2] += (share - 1) / 2  # pixel centres are integers at any size
    return replace(camera, K=K, size=size)


def reduced_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Width and height of a picture of ``size`` at another scale, whole pixels."""
    return max(1, round(scale * size[0])), max(1, round(scale * size[1]))


def one_below_the_other(bands: Many[Image]) -> Image:
    """One image of images of bands of rows, from the top."""
    if len(bands) == 1:
        return bands[0]
    parts = [band.parts for band in bands if band.parts is not None]
    return Image(
        rgb=np.concatenate([band.rgb for band in bands]),
        depth=np.concatenate([band.depth for band in bands]),
        ids=np.concatenate([band.ids for band in bands]),
        parts=np.concatenate(parts) if len(parts) == len(bands) else None,
    )


class PictureSource:
    """Makes the pictures that the cameras deliver, with their shutters and sensors.

    Args:
        playback: the scene.
        renderer: draws it.
        sensor: what the pictures are like.
        seed: of the scenario.
    """

    def __init__(self, playback: Playback, renderer: Renderer, *, sensor: Sensor, seed: int) -> None:
        self._playback = playback
        self._renderer = renderer
        self._sensor = sensor
        self._seed = seed

    def picture(
        self, exposures: ExposureSchedule, frame: int, view: int, *, finer: int = 1, width: int | None = None
    ) -> Rgb:
        """The colour picture that ``view`` delivers in ``frame``, (h, w, 3); black where none arrives.

        Args:
            exposures: when and with which lens it is taken.
            frame: of the sequence.
            view: of the rig.
            finer: samples a pixel each way; 2 makes smooth outlines.
            width: of the picture, pixels, where it is to be smaller than the camera's.
        """
        size = exposures.believed_rig[view].size
        scale = 1.0 if width is None else min(1.0, width / size[0])
        if not exposures.delivered[frame, view]:
            return np.zeros((*reduced_size(size, scale)[::-1], 3), np.uint8)
        camera = scaled(exposures.camera(frame, view), scale)
        exposed = []
        for middle in self._open(exposures.time[frame, view]):
            times = moments(middle, exposures.readout)
            bands = zip(self._playback.over(times), strips(camera, len(times)), strict=True)
            exposed.append(np.concatenate([self._drawn(state, strip, finer) for state, strip in bands]))
        taken = int(exposures.source[frame, view])
        return develop(blur(exposed), self._sensor, seed=self._seed, view=view, frame=taken)

    def image(self, exposures: ExposureSchedule, frame: int, view: int) -> Image:
        """Depth, ids and body parts of the middle of the exposure.

        Raises:
            ValueError: a picture that never arrives.
        """
        if not exposures.delivered[frame, view]:
            raise ValueError(f"view {view} delivers no picture in frame {frame}")
        camera, scene = exposures.camera(frame, view), self._playback.scene
        times = moments(exposures.time[frame, view], exposures.readout)
        bands = zip(self._playback.over(times), strips(camera, len(times)), strict=True)
        return one_below_the_other(
            [self._renderer.render(strip, meshes_at(scene, state), color=False, parts=True) for state, strip in bands]
        )

    def _open(self, middle: float) -> NDArray[np.float64]:
        """Moments that one exposure is the mean of, seconds."""
        shutter = self._sensor.shutter
        steps = _BLUR_STEPS if shutter else 1
        return middle + shutter * ((np.arange(steps) + 0.5) / steps - 0.5)

    def _drawn(self, state: State, camera: Camera, finer: int) -> Rgb:
        scene = self._playback.scene
        return antialiased(
            self._renderer,
            camera,
            meshes_at(scene, state),
            finer=finer,
            lighting=scene.lighting,
            mirrors=scene.mirrors,
        )
