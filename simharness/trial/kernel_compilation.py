"""Compilation of kernels in a second process while this one builds and films.

Compilation takes most of the first run after an installation. The second process compiles those kernels that pictures
need last, because this process needs the others first, and then those of the method in the order of its stages. When
this process has nothing else to do, it begins with the last stage, reconstruction, which takes as long as the others.
All are written to the cache on disk, from which the processes that film and estimate load them (:mod:`mvpose.kernels`).
A process that needs a kernel that another one compiles waits for it.
"""

import multiprocessing
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mvpose import COCO17, Camera, Detections, Pipeline, Rig, preset
from mvpose.estimate import Matching
from mvpose.estimators import SequenceEstimator
from mvpose.presets import NEED_DESCRIPTORS, PRESETS
from mvpose.rays import ordered_rays
from simharness.types.lighting import AreaLight, Lighting, LightSources
from simharness.types.mesh import Finish, Mesh

_PICTURES = "pictures"  # stands for the kernels of pictures among the names of variants


class Compilation:
    """Process that compiles kernels. If it fails, kernels are compiled later, when they are first used.

    Args:
        variants: presets of :class:`mvpose.Pipeline`.
        pictures: compile kernels of colour pictures of ``raster``, too.
    """

    _compiled: ClassVar[set[str]] = set()

    def __init__(self, variants: Iterable[str], *, pictures: bool = False) -> None:
        self._names = {*variants, *([_PICTURES] if pictures else [])} - self._compiled
        spawn = multiprocessing.get_context("spawn")
        self._process = spawn.Process(target=_compile, args=(self._names,), daemon=True)

    def start(self) -> None:
        """Start the process, unless all has been compiled."""
        if self._names:
            self._process.start()

    def wait(self) -> None:
        """Compile the last stage of the method, and wait until all other kernels are compiled."""
        if self._names:
            compile_reconstruction(self._names & PRESETS.keys())
            self._process.join()
            self._compiled.update(self._names)


def _compile(names: set[str]) -> None:
    if _PICTURES in names:
        compile_pictures()
    compile_kernels(names - {_PICTURES})


def compile_pictures() -> None:
    """Compile the kernels that light and shade pictures, or load them from the cache.

    A lamp lights a floor and a body, of which no pixel is seen: what draws pixels is left out.
    """
    from simharness.capture.rendering.backgrounds import Background
    from simharness.capture.rendering.lit_scene import LitScene
    from simharness.capture.rendering.scene_geometry import SceneGeometry
    from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays
    from simharness.capture.sensor import develop
    from simharness.scenario.sections.cameras_section import SensorSection

    triangle = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
    faces, colors, zeros = np.array([[0, 1, 2]], np.int32), np.ones((1, 3), np.float32), np.zeros(3, np.float32)
    skin = Finish(np.ones(1, np.int8), np.zeros(3, np.int32), zeros, zeros, zeros)
    meshes = [Mesh(triangle, faces, colors, still=True), Mesh(triangle + zeros, faces, colors, finish=skin)]
    lamp = AreaLight((0.0, 0.0, 3.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    geometry = SceneGeometry.from_meshes(meshes)
    scene = LitScene.in_light(geometry, Lighting(sources=LightSources((lamp,))))
    assert scene is not None  # it has sources and a floor
    shown, inverse_depth = np.full((2, 2), -1, np.int32), np.zeros((2, 2), np.float32)
    drawn, view = DrawnPixels(shown, inverse_depth, np.zeros((6, 3))), PixelRays(np.zeros(3), np.eye(3))
    rgb = scene.draw(scene.background(Background(view.to_rays, inverse_depth, shown, drawn.corners), view), drawn, view)
    develop(rgb, SensorSection(shot_noise=0.01), seed=0, view=0, frame=0)


def compile_kernels(variants: Iterable[str]) -> None:
    """Compile the kernels of presets of :class:`mvpose.Pipeline`, or load them from the cache."""
    rig, bare = _seen_person()
    described = replace(bare, descriptors=np.ones((2, 8)))
    for variant in variants:
        for detections in (described,) if variant in NEED_DESCRIPTORS else (bare, described):
            estimator = preset(variant)
            if len(estimator.estimate(rig, detections)) != 1:
                raise RuntimeError(f"{variant}: expected one person from two perfect views, got another number")
            if isinstance(estimator, SequenceEstimator):
                for _ in estimator.track(rig, _coming_and_going(detections)):
                    pass


def compile_reconstruction(variants: Iterable[str]) -> None:
    """Compile the kernels of the last stage of presets of :class:`mvpose.Pipeline`, or load them from the cache.

    Presets without separate stages are left out.
    """
    rig, detections = _seen_person()
    _, rays = ordered_rays(rig, detections)
    for variant in variants:
        estimator = preset(variant)
        if isinstance(estimator, Pipeline):
            estimator.reconstruction(rays, Matching(np.zeros(2, np.int64)).labels, COCO17)


def _seen_person() -> tuple[Rig, Detections]:
    """Return one simple person seen by two cameras: the least that runs through every stage."""
    K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    rig = Rig([Camera(K, np.eye(3), np.array([x, 0.0, 3.0]), size=(640, 480)) for x in (-0.5, 0.5)])
    body = np.column_stack([np.zeros(len(COCO17)), np.linspace(-0.8, 0.8, len(COCO17)), np.zeros(len(COCO17))])
    return rig, Detections.from_keypoints([0, 1], rig.project(body), np.ones((2, len(COCO17))))


def _coming_and_going(detections: Detections) -> Iterator[Detections]:
    """Yield the frames of somebody who stays for a while, leaves, and comes back."""
    for time in (0.0, 0.04, 0.08, 1.0, 3.0, 5.0, 5.04, 5.08):
        here = detections if time < 1.0 or time >= 5.0 else detections.select(np.zeros(len(detections), np.bool_))
        yield replace(here, time=np.full(2, time))
