"""Colour pictures of a scene: meshes for the renderer, then the shutter and the sensor of a camera.

In the pictures of a flat mirror the scene is reflected at the plane of the glass, clipped at that plane and rendered
with the same camera; its colours replace those of the pixels that show the glass. Ids and depth stay those of the
glass. This needs no support by the renderer, so it works with all of them. Mirrors seen in mirrors are plain glass.
"""

from collections.abc import Mapping, Sequence
from collections.abc import Sequence as Many
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.capture.rendering.lens import lens_of
from simharness.capture.rendering.renderer import Image, Renderer
from simharness.capture.sensor import band_cameras, band_times, blur, develop
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.motion.motion import transform_points
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.rigs.projection import viewing_rays
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
    behind: dict[int, list[Mesh]] | None = None,
) -> Rgb:
    """Render an antialiased colour picture, with ``finer`` x ``finer`` samples per pixel.

    Args:
        renderer: renderer of the picture.
        camera: camera of the picture.
        meshes: meshes of the scene.
        finer: samples per pixel in each direction.
        lighting: lighting of the scene; ``Lighting()`` by default.
        mirrors: glass of the meshes that are mirrors, by mesh index.
        behind: see :func:`with_mirrors`.

    Returns:
        (h, w, 3) uint8.
    """
    lighting, large = lighting or Lighting(), scaled(camera, finer)
    # Mirrors come before the lens, so that of the whole picture only colours, not depth and ids, have to pass it.
    lens = lens_of(large) if large.distortion.any() else None
    pinhole = large if lens is None else lens.pinhole(large)
    image = renderer.render(pinhole, meshes, lighting=lighting)
    rgb = with_mirrors(renderer, pinhole, meshes, mirrors, image, behind=behind, lighting=lighting)
    rgb = rgb if lens is None else lens.colors(rgb)
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


@dataclass(frozen=True)
class _PosedMeshes:
    """Meshes of a scene at one time, and those behind its mirrors, which the first camera that needs them makes."""

    meshes: list[Mesh]
    behind: dict[int, list[Mesh]] = field(default_factory=dict)


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
        self._posed: dict[float, _PosedMeshes] = {}

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
        middles = self._exposure_times(exposures.time[frame, view])
        times = np.array([band_times(middle, exposures.readout) for middle in middles])
        strips, posed = band_cameras(camera, times.shape[1]), self._poses(times)
        exposed = []
        for row in times.tolist():
            bands = zip(row, strips, strict=True)
            exposed.append(np.concatenate([self._render(posed[time], strip, finer) for time, strip in bands]))
        taken = int(exposures.source[frame, view])
        return develop(blur(exposed), self._sensor, seed=self._seed, view=view, frame=taken, camera=camera, scale=scale)

    def image(self, exposures: ExposureSchedule, frame: int, view: int) -> Image:
        """Return depth, ids and body parts at the middle of the exposure.

        Raises:
            ValueError: the picture never arrives.
        """
        if not exposures.delivered[frame, view]:
            raise ValueError(f"view {view} delivers no picture in frame {frame}")
        times = band_times(exposures.time[frame, view], exposures.readout)
        bands = zip(times.tolist(), band_cameras(exposures.camera(frame, view), len(times)), strict=True)
        posed = self._poses(times)
        return stack_bands(
            [self._renderer.render(strip, posed[time].meshes, color=False, parts=True) for time, strip in bands]
        )

    def _poses(self, times: Floats) -> "dict[float, _PosedMeshes]":
        """Return the scene at times (...), as the last call made it where it did: cameras share their times."""
        wanted = np.unique(times).tolist()
        missing = [time for time in wanted if time not in self._posed]
        made = {
            state.time: _PosedMeshes(meshes_at(self._playback.scene, state)) for state in self._playback.over(missing)
        }
        self._posed = {time: made.get(time) or self._posed[time] for time in wanted}
        return self._posed

    def _exposure_times(self, middle: float) -> NDArray[np.float64]:
        """Return the times over which one exposure is averaged, seconds."""
        shutter = self._sensor.shutter
        steps = _BLUR_STEPS if shutter else 1
        return middle + shutter * ((np.arange(steps) + 0.5) / steps - 0.5)

    def _render(self, posed: "_PosedMeshes", camera: Camera, finer: int) -> Rgb:
        scene = self._playback.scene
        return antialiased(
            self._renderer,
            camera,
            posed.meshes,
            finer=finer,
            lighting=scene.lighting,
            mirrors=scene.mirrors,
            behind=posed.behind,
        )


_NEAR_GLASS = 0.004  # metres: accuracy of depth from a picture; frames stand out farther
_TILE = 64  # pixels
_REFLECTANCE = (0.87, 0.90, 0.89)  # glass is a little green; sRGB


def with_mirrors(
    renderer: Renderer,
    camera: Camera,
    meshes: Sequence[Mesh],
    mirrors: Mapping[int, Mirror],
    image: Image,
    behind: dict[int, list[Mesh]] | None = None,
    **options: Any,
) -> NDArray[np.uint8]:
    """Add reflections to the mirrors of a picture.

    Args:
        renderer: renderer of the picture.
        camera: camera of the picture.
        meshes: meshes that were rendered.
        mirrors: glass of the meshes that are mirrors, by mesh index.
        image: picture with depth and ids.
        behind: mirror images of the meshes by mesh index, which this function adds where they are missing: cameras that
            see the same meshes share them.
        options: further arguments of ``renderer.render``; a ``lighting`` among them is reflected too.

    Returns:
        Colours, (h, w, 3); the same array if no mirror is visible.
    """
    rgb, behind = image.rgb, {} if behind is None else behind
    for index, mirror in mirrors.items():
        glass = _glass(camera, image, index, mirror)
        if not glass.any():
            continue
        if index not in behind:
            images = [reflected(mesh, mirror) for k, mesh in enumerate(meshes) if k != index]
            behind[index] = [mesh for mesh in images if len(mesh.faces)]
        reflected_options = dict(options)
        if "lighting" in reflected_options:
            towards = np.asarray(options["lighting"].direction, float)
            turned = towards - 2 * (towards @ np.array(mirror.normal)) * np.array(mirror.normal)
            reflected_options["lighting"] = replace(
                options["lighting"], direction=tuple(turned.tolist()), mirror=mirror
            )
        rows, columns = window = _window(glass)
        K = camera.K.copy()
        K[:2, 2] -= columns.start, rows.start
        part = replace(camera, K=K, size=(columns.stop - columns.start, rows.stop - rows.start))
        other = renderer.render(part, behind[index], **reflected_options).rgb
        seen = glass[window]
        rgb = rgb.copy()
        rgb[window][seen] = np.round(other[seen] * np.array(_REFLECTANCE)).astype(np.uint8)
    return rgb


def _glass(camera: Camera, image: Image, index: int, mirror: Mirror) -> NDArray[np.bool_]:
    """Return the pixels (h, w) that show the reflecting side of the glass."""
    seen = image.ids == index
    if not seen.any() or mirror.in_front(camera.center) <= 0:
        return np.zeros_like(seen)
    row, column = np.nonzero(seen)
    rays = viewing_rays(camera, np.column_stack([column, row]))
    points = camera.center + rays * (image.depth[row, column] / (rays @ camera.R[2]))[:, None]
    seen[row, column] = mirror.on_glass(points) & (np.abs(mirror.in_front(points)) < _NEAR_GLASS)
    return seen


def _window(glass: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the rows and columns around the pixels (h, w) that show glass, in whole tiles, as most frames do."""
    spans = []
    for axis, length in enumerate(glass.shape):
        shown = np.flatnonzero(glass.any(axis=1 - axis))
        spans.append(slice(shown[0] // _TILE * _TILE, min((shown[-1] // _TILE + 1) * _TILE, length)))
    return spans[0], spans[1]


def reflected(mesh: Mesh, mirror: Mirror) -> Mesh:
    """Return the mirror image of a mesh: its part in front of the plane of the glass, reflected; may have no faces."""
    cut = _in_front(mesh, mirror)
    changed: dict[str, Any] = {"vertices": mirror.reflect(cut.vertices).astype(np.float32), "faces": cut.faces[:, ::-1]}
    changed["still"] = False  # a new mesh for every picture
    if cut.uv is not None:
        changed["uv"] = cut.uv[:, ::-1]
    return replace(cut, **changed)


def _in_front(mesh: Mesh, mirror: Mirror) -> Mesh:
    """Return the part of a mesh in front of the plane of a mirror; faces across the plane are cut."""
    height = mirror.in_front(mesh.vertices)[mesh.faces]
    count = (height > 0).sum(axis=1)
    if (count == 3).all():
        return mesh
    whole = np.flatnonzero(count == 3)
    source, weights = _pieces(height, count)
    corners = np.einsum("kij,kjc->kic", weights, mesh.vertices[mesh.faces[source]])
    cut_faces = len(mesh.vertices) + np.arange(3 * len(source)).reshape(-1, 3)  # pieces share no vertices
    kept = np.concatenate([whole, source])
    changed: dict[str, Any] = {}
    if mesh.uv is not None:
        changed["uv"] = np.concatenate([mesh.uv[whole], np.einsum("kij,kjc->kic", weights, mesh.uv[source])]).astype(
            np.float32
        )
    if mesh.parts is not None:
        changed["parts"] = mesh.parts[kept]
    if (finish := mesh.finish) is not None:  # a new corner has the grain of the nearest old one, and no folds
        near = np.take_along_axis(mesh.faces[source], weights.argmax(axis=2), axis=1).ravel()
        grain = np.where(finish.toward[near] == near, cut_faces.ravel(), finish.toward[near])
        changed["finish"] = replace(
            finish,
            materials=finish.materials[kept],
            toward=np.concatenate([finish.toward, grain]),
            rest=np.concatenate([finish.rest, finish.rest[near]]),
            place=np.concatenate([finish.place, finish.place[near]]),
            looseness=np.concatenate([finish.looseness, np.zeros(len(near))]),
        )
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, corners.reshape(-1, 3)]).astype(np.float32),
        faces=np.concatenate([mesh.faces[whole], cut_faces]).astype(np.int32),
        colors=mesh.colors[kept],
        **changed,
    )


def _pieces(height: Floats, count: NDArray[np.int_]) -> tuple[NDArray[np.int_], Floats]:
    """Cut faces at a plane and return the triangles above it.

    Args:
        height: heights of the corners of each face over the plane, (k, 3).
        count: number of corners above the plane, (k,).

    Returns:
        Face of each triangle, (p,), and its corners as weights of the corners of the face, (p, 3, 3).
    """
    sources, weights = [], []
    for above in (1, 2):
        cut = np.flatnonzero(count == above)
        lone = np.argmax((height[cut] > 0) == (above == 1), axis=1)  # the single corner on its side
        corner = np.eye(3)[(lone[:, None] + np.arange(3)) % 3]  # (c, 3, 3): the single one, then the two others
        h = np.einsum("kij,kj->ki", corner, height[cut])
        share = (h[:, :1] / (h[:, :1] - h[:, 1:]))[..., None]
        a, b, c = np.moveaxis(corner, 1, 0)
        ab, ac = a + share[:, 0] * (b - a), a + share[:, 1] * (c - a)
        pieces = [(a, ab, ac)] if above == 1 else [(ab, b, c), (ab, c, ac)]
        sources += [cut] * len(pieces)
        weights += [np.stack(piece, axis=1) for piece in pieces]
    return np.concatenate(sources), np.concatenate(weights)
