"""What is done frame by frame, in whatever process.

Imported by every worker, so it imports little; what else a worker needs comes with what it is sent.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mvpose import Detections, Estimate, Rig
from mvpose.pipeline import Estimator

if TYPE_CHECKING:
    from simharness.rendering.film import Eye
    from simharness.rendering.picture import Studio
    from simharness.rendering.renderer import Renderer, RendererName
    from simharness.rendering.views import Views
    from simharness.rigs.shots import Shots
    from simharness.scenario.models import Scenario
    from simharness.scene.build import Scene
    from simharness.scene.playback import Playback


@dataclass(frozen=True)
class Filming:
    """Film some frames. Holds the renderer's name, for a renderer may hold a GL context, which cannot travel."""

    scenario: Scenario
    scene: Scene
    shots: Shots
    previews: frozenset[int]

    def __call__(self, frames: range) -> Views:
        """The views of these frames."""
        from simharness.rendering.film import film
        from simharness.scene.playback import Playback

        playback = Playback(self.scene)
        return film(
            playback,
            self.shots,
            eye_of(self.scenario, playback),
            frames=frames,
            studio=studio_of(self.scenario, playback) if self.previews else None,
            previews=self.previews,
        )


def eye_of(scenario: Scenario, playback: Playback) -> Eye:
    """How a scenario finds out what its cameras see."""
    from simharness.rendering.film import PictureEye
    from simharness.rendering.rays import RayEye

    if scenario.rendering.renderer == "rays":
        return RayEye(playback)
    return PictureEye(playback, renderer_of(scenario.rendering.renderer))


def studio_of(scenario: Scenario, playback: Playback) -> Studio:
    """What makes a scenario's colour pictures; the rasteriser where the scenario itself needs none."""
    from simharness.rendering.picture import Studio

    name = "raster" if scenario.rendering.renderer == "rays" else scenario.rendering.renderer
    return Studio(playback, renderer_of(name), sensor=scenario.sensor, seed=scenario.seed)


@dataclass(frozen=True)
class Estimating:
    """Run every variant of the method on some frames."""

    rig: Rig
    detections: tuple[Detections, ...]
    pipelines: Mapping[str, Estimator]

    def __call__(self, frames: range) -> dict[str, list[Estimate]]:
        """What each variant says of these frames."""
        self._warm_up()
        return {
            name: [pipeline.estimate(self.rig, self.detections[frame]) for frame in frames]
            for name, pipeline in self.pipelines.items()
        }

    def _warm_up(self) -> None:
        """Compile and load what a process does once: it is no part of the time of a frame."""
        fresh = [name for name in self.pipelines if name not in _warm]
        for name in fresh:
            self.pipelines[name].estimate(self.rig, max(self.detections, key=len))
        _warm.update(fresh)


_warm: set[str] = set()  # variants that this process has run


@functools.cache
def renderer_of(name: RendererName) -> Renderer:
    """The one renderer of this process: two GL contexts cannot share a scene, and shaders load once."""
    from simharness.rendering.choice import make_renderer

    return make_renderer(name)
