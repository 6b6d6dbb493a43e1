"""A scenario that can be run: everything in it built and checked before any work is done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mvpose import Rig
from mvpose.affinity import AppearanceAffinity
from mvpose.pipeline import NEED_DESCRIPTORS, Estimator
from simharness.capture.rendering.renderer import Unavailable
from simharness.detector.drawn_descriptors import Looks
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.estimators import estimators_of
from simharness.trial.stages.frame_tasks import looks_of, pose_head, re_id, renderer_of
from simharness.world.rigs.faults import shoot
from simharness.world.rigs.layouts import build_rig
from simharness.world.rigs.shots import Shots
from simharness.world.scene.build import Scene, build


@dataclass(frozen=True)
class Trial:
    """A scenario that can be run: everything in it is built and checked.

    Attributes:
        scenario: what was asked for.
        scene: the compiled room with its people, and how they move.
        shots: when and with which lens every picture is taken; also the calibration that the method is told.
        pipelines: the variants of the method, by name.
        looks: how descriptors are drawn, where they are.
    """

    scenario: Scenario
    scene: Scene
    shots: Shots
    pipelines: Mapping[str, Estimator]
    looks: Looks | None


def prepare(scenario: Scenario) -> Trial:
    """Build what a scenario describes.

    Raises:
        ValueError: it cannot be built: people that do not fit, a camera in a wall, an unknown variant, no network.
    """
    looks = looks_of(scenario)
    described = scenario.appearance.source != "none"
    if scenario.detector.onnx:
        pose_head(scenario)
    appearance = re_id(scenario).affinity if described else AppearanceAffinity()
    pipelines = estimators_of(scenario.method, appearance=appearance)
    if not described and (blind := NEED_DESCRIPTORS & pipelines.keys()):
        raise ValueError(
            f"method.variants: {', '.join(blind)} goes by descriptors alone, and detections have none; choose "
            'appearance.source = "pictures" or "drawn", or another variant'
        )
    if scenario.rendering.renderer != "rays":
        try:
            renderer_of(scenario.rendering.renderer)
        except Unavailable as error:
            raise ValueError(f"rendering.renderer: {error}") from None
    rig = rig_of(scenario)
    scene = build(scenario, rig)
    shots = shoot(rig, scenario.faults, scene.time, seed=scenario.seed)
    return Trial(scenario, scene, shots, pipelines, looks)


def rig_of(scenario: Scenario) -> Rig:
    """The true cameras of a scenario.

    Raises:
        ValueError: a rig that cannot be: the message names the key or the file.
    """
    room = scenario.room.size if scenario.room.walls else None
    return build_rig(scenario.cameras, seed=scenario.seed, room=room)
