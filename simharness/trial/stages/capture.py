"""Capture stage: the pictures and visibility of every camera, frame by frame, in any process."""

import functools
from dataclasses import dataclass

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton
from simharness.capture.filming import Observer, PictureObserver, film
from simharness.capture.outer_views import OuterJointFilm
from simharness.capture.picture import ScenePictures
from simharness.capture.ray_visibility import RayObserver
from simharness.capture.rendering.raster import RendererName, make_renderer
from simharness.capture.rendering.renderer import Renderer
from simharness.scenario.sections.scenario import Scenario
from simharness.types.outer_joints import OuterViews
from simharness.types.views import Views
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback


@dataclass(frozen=True)
class CaptureFrames:
    """Frame function that captures frames of a scene.

    It carries the renderer's name and not the renderer: a GL context cannot be sent to another process.
    """

    scenario: Scenario
    """The scenario that names the renderer and the sensor."""
    scene: Scene
    """The built scene."""
    exposures: ExposureSchedule
    """Time and camera of every picture."""
    previews: frozenset[int]
    """Frames whose colour pictures are kept."""

    def __call__(self, frames: range) -> Views:
        """Return the views of these frames."""
        return film(
            self._playback,
            self.exposures,
            self._observer,
            frames=frames,
            picture_source=picture_source_of(self.scenario, self._playback) if self.previews else None,
            previews=self.previews,
        )

    @functools.cached_property
    def _playback(self) -> Playback:
        """The playback of the scene in this process."""
        return Playback(self.scene)

    @functools.cached_property
    def _observer(self) -> Observer:
        """The observer of this process. It is made once: the outlines of bodies take longer than some frames."""
        return observer_of(self.scenario, self._playback)


@dataclass(frozen=True)
class FilmOuterJoints:
    """Frame function that films joints beyond COCO17, such as feet and hands."""

    scene: Scene
    """The built scene."""
    exposures: ExposureSchedule
    """Time and camera of every picture."""
    skeleton: Skeleton
    """The skeleton that has them."""

    def __call__(self, frames: range) -> OuterViews:
        """Return the joints in the pictures of these frames."""
        return self._film.views(self.exposures, frames)

    def truth(self) -> Floats:
        """Return the true joints at the times of all frames, (T, P, E, 3), metres."""
        return self._film.truth()

    @functools.cached_property
    def _film(self) -> OuterJointFilm:
        """The film of this process."""
        return OuterJointFilm(Playback(self.scene), self.skeleton)


def observer_of(scenario: Scenario, playback: Playback) -> Observer:
    """Return the method by which a scenario determines visibility: rendered pictures or cast rays."""
    if scenario.rendering.renderer == "rays":
        return RayObserver(playback)
    return PictureObserver(playback, renderer_of(scenario.rendering.renderer))


def picture_source_of(scenario: Scenario, playback: Playback) -> ScenePictures:
    """Return the source of a scenario's colour pictures; the rasteriser where the scenario itself renders none."""
    name = "raster" if scenario.rendering.renderer == "rays" else scenario.rendering.renderer
    return ScenePictures(playback, renderer_of(name), sensor=scenario.sensor, seed=scenario.seed)


@functools.cache
def renderer_of(name: RendererName) -> Renderer:
    """Return the renderer of this process by name.

    Each renderer is made once, because two GL contexts cannot share a scene, and shaders need to be loaded only once.
    """
    return make_renderer(name)
