"""What is done frame by frame, in whatever process.

Imported by every worker, so it imports little; what else a worker needs comes with what it is sent.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mvpose import Detections, Estimate, Rig
from mvpose.pipeline import PRESETS, READ_HEATMAPS, Estimator
from simharness.runtime.frame_pool import RunError

if TYPE_CHECKING:
    from mvpose.networks import PoseHead, ReId
    from simharness.capture.film import Eye
    from simharness.capture.picture import Studio
    from simharness.capture.rendering.renderer import Renderer, RendererName
    from simharness.detector.detect import Detected
    from simharness.detector.drawn_descriptors import Looks
    from simharness.scenario.sections.scenario import Scenario
    from simharness.types.views import Views
    from simharness.world.rigs.shots import Shots
    from simharness.world.scene.build import Scene
    from simharness.world.scene.playback import Playback


@dataclass(frozen=True)
class Filming:
    """Film some frames. Holds the renderer's name, for a renderer may hold a GL context, which cannot travel."""

    scenario: Scenario
    scene: Scene
    shots: Shots
    previews: frozenset[int]

    def __call__(self, frames: range) -> Views:
        """The views of these frames."""
        from simharness.capture.film import film
        from simharness.world.scene.playback import Playback

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
    from simharness.capture.film import PictureEye
    from simharness.capture.ray_visibility import RayEye

    if scenario.rendering.renderer == "rays":
        return RayEye(playback)
    return PictureEye(playback, renderer_of(scenario.rendering.renderer))


def studio_of(scenario: Scenario, playback: Playback) -> Studio:
    """What makes a scenario's colour pictures; the rasteriser where the scenario itself needs none."""
    from simharness.capture.picture import Studio

    name = "raster" if scenario.rendering.renderer == "rays" else scenario.rendering.renderer
    return Studio(playback, renderer_of(name), sensor=scenario.sensor, seed=scenario.seed)


@dataclass(frozen=True)
class Reading:
    """Let the networks of a scenario read the pictures of some frames. Each process opens them for itself."""

    scenario: Scenario
    scene: Scene
    shots: Shots
    detected: tuple[Detected, ...]

    @staticmethod
    def needed(scenario: Scenario) -> bool:
        """Whether a scenario has networks that look at pictures."""
        return bool(scenario.detector.onnx) or scenario.appearance.source == "pictures"

    def __call__(self, frames: range) -> list[Detected]:
        """The detections of these frames with what the networks read."""
        from simharness.detector.network_readout import read_descriptors, read_keypoints
        from simharness.world.scene.playback import Playback

        studio = studio_of(self.scenario, Playback(self.scene))
        head = pose_head(self.scenario) if self.scenario.detector.onnx else None
        network = re_id(self.scenario) if self.scenario.appearance.source == "pictures" else None
        result = []
        for frame in frames:
            seen = self.detected[frame]
            images = [
                studio.picture(self.shots, frame, view) if arrived else None
                for view, arrived in enumerate(self.shots.delivered[frame])
            ]
            if head is not None:
                seen = read_keypoints(head, seen, images)
            if network is not None:
                seen = read_descriptors(network, seen, images)
            result.append(seen)
        return result


def pose_head(scenario: Scenario) -> PoseHead:
    """The pose head of a scenario.

    Raises:
        ValueError: its file is no pose head; the message names the key.
    """
    from mvpose.networks import PoseHead

    try:
        return PoseHead(scenario.detector.onnx, likelihoods=scenario.detector.heatmaps.size != "none")
    except ValueError as error:
        raise ValueError(f"detector.onnx: {error}") from None


def re_id(scenario: Scenario) -> ReId:
    """The re-ID network of a scenario.

    Raises:
        ValueError: its file is none; the message names the key.
    """
    from mvpose.networks import ReId

    try:
        return ReId(scenario.appearance.network) if scenario.appearance.network else ReId()
    except ValueError as error:
        raise ValueError(f"appearance.network: {error}") from None


def looks_of(scenario: Scenario) -> Looks | None:
    """How the descriptors of a scenario are drawn; None where they are not.

    Raises:
        ValueError: nobody measured the distances of its network; the message names the key.
    """
    if scenario.appearance.source != "drawn":
        return None
    from mvpose.networks.reid import DEFAULT
    from simharness.detector.descriptor_model import DescriptorModel
    from simharness.detector.drawn_descriptors import Looks

    try:
        model = DescriptorModel.of_network(Path(scenario.appearance.network or DEFAULT))
    except ValueError as error:
        raise ValueError(f"appearance.network: {error}") from None
    return Looks(model, scenario.people.look_alike, scenario.people.alike)


@dataclass(frozen=True)
class Estimating:
    """Run every variant of the method on some frames. Heat maps are made frame by frame, for those that read them.

    Attributes:
        rig: the cameras as believed.
        detected: all frames.
        pipelines: the variants by name.
    """

    rig: Rig
    detected: tuple[Detected, ...]
    pipelines: Mapping[str, Estimator]

    def __call__(self, frames: range) -> dict[str, list[Estimate]]:
        """What each variant says of these frames."""
        self._warm_up()
        answers: dict[str, list[Estimate]] = {name: [] for name in self.pipelines}
        for frame in frames:
            for name, seen in self._seen(frame, self.pipelines):
                with naming_frame(frame):
                    answers[name].append(self.pipelines[name].estimate(self.rig, seen))
        return answers

    def seen(self, frame: int, variant: str) -> Detections:
        """What a variant sees of a frame."""
        return dict(self._seen(frame, (variant,)))[variant]

    def _seen(self, frame: int, names: Iterable[str]) -> Iterator[tuple[str, Detections]]:
        """What variants see of a frame."""
        mapped = plain = self.detected[frame].detections
        peaks = self.detected[frame].peaks
        if plain.likelihoods is not None:
            plain = replace(plain, likelihoods=None)
        elif peaks is not None and set(names) - _PASS_BY_HEATMAPS:
            mapped = replace(plain, likelihoods=peaks.heatmaps())
        for name in names:
            yield name, plain if name in _PASS_BY_HEATMAPS else mapped

    def _warm_up(self) -> None:
        """Compile and load what a process does once: it is no part of the time of a frame."""
        fresh = [name for name in self.pipelines if name not in _warm]
        fullest = max(range(len(self.detected)), key=lambda frame: len(self.detected[frame].detections))
        for name, seen in self._seen(fullest, fresh):
            with naming_frame(fullest):
                self.pipelines[name].estimate(self.rig, seen)
        _warm.update(fresh)


_warm: set[str] = set()  # variants that this process has run
_PASS_BY_HEATMAPS = PRESETS.keys() - READ_HEATMAPS


@contextlib.contextmanager
def naming_frame(frame: int) -> Iterator[None]:
    """Say which frame a method failed at.

    Raises:
        RunError: in place of one.
    """
    try:
        yield
    except RunError as error:
        raise RunError(f"frame {frame}: {error}") from error


@functools.cache
def renderer_of(name: RendererName) -> Renderer:
    """The one renderer of this process: two GL contexts cannot share a scene, and shaders load once."""
    from simharness.capture.rendering.choice import make_renderer

    return make_renderer(name)
