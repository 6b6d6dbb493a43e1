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
    from simharness.rendering.film import Views
    from simharness.rendering.renderer import Renderer, RendererName
    from simharness.scene.build import Scene
    from simharness.scene.sequence import Sequence


@dataclass(frozen=True)
class Filming:
    """Film some frames. Holds the renderer's name, for a renderer may hold a GL context, which cannot travel."""

    scene: Scene
    sequence: Sequence
    rig: Rig
    renderer: RendererName
    color: bool
    previews: frozenset[int]

    def __call__(self, frames: range) -> Views:
        """The views of these frames."""
        from simharness.rendering.film import film

        return film(
            self.scene,
            self.sequence,
            self.rig,
            renderer_of(self.renderer),
            frames=frames,
            color=self.color,
            previews=self.previews,
        )


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
