"""Build stage: everything that a scenario describes, built and checked before any work is done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mvpose import Rig
from mvpose.affinity import AppearanceAffinity
from mvpose.pipeline import NEED_DESCRIPTORS, Estimator
from simharness.capture.rendering.renderer import Unavailable
from simharness.detector.descriptors import DescriptorSettings
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.capture import renderer_of
from simharness.trial.stages.estimators import estimators_of
from simharness.trial.stages.networks import descriptor_settings, pose_head, re_id
from simharness.world.rigs.exposure_schedule import ExposureSchedule
from simharness.world.rigs.faults import schedule_exposures
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import Scene, build


@dataclass(frozen=True)
class Trial:
    """A built scenario: everything in it exists and is checked.

    Attributes:
        scenario: the resolved scenario at its seed.
        scene: the compiled room with its people and their motions.
        exposures: time and true camera of every picture; also the believed calibration.
        pipelines: variants of the method, by name.
        descriptors: how descriptors are drawn; None where none are drawn.
    """

    scenario: Scenario
    scene: Scene
    exposures: ExposureSchedule
    pipelines: Mapping[str, Estimator]
    descriptors: DescriptorSettings | None


def build_trial(scenario: Scenario) -> Trial:
    """Build what a scenario describes.

    Raises:
        ValueError: it cannot be built: people that do not fit, a camera in a wall, an unknown variant, no network.
    """
    descriptors = descriptor_settings(scenario)
    if scenario.detector.onnx:
        pose_head(scenario)
    pipelines = build_variants(scenario)
    if scenario.rendering.renderer != "rays":
        try:
            renderer_of(scenario.rendering.renderer)
        except Unavailable as error:
            raise ValueError(f"rendering.renderer: {error}") from None
    rig = true_rig(scenario)
    scene = build(scenario, rig)
    exposures = schedule_exposures(rig, scenario.faults, scene.time, seed=scenario.seed)
    return Trial(scenario, scene, exposures, pipelines, descriptors)


def build_variants(scenario: Scenario) -> dict[str, Estimator]:
    """Build the variants of the method that a scenario names, by name.

    Raises:
        ValueError: an unknown variant, a user-defined estimator that cannot be loaded, a network that cannot be
            opened, or a variant that needs descriptors where detections have none.
    """
    described = scenario.appearance.source != "none"
    appearance = re_id(scenario).affinity if described else AppearanceAffinity()
    pipelines = estimators_of(scenario.method, appearance=appearance)
    if not described and (blind := NEED_DESCRIPTORS & pipelines.keys()):
        raise ValueError(
            f"method.variants: {', '.join(blind)} uses descriptors alone, and detections have none; choose "
            'appearance.source = "pictures" or "drawn", or another variant'
        )
    return pipelines


def true_rig(scenario: Scenario) -> Rig:
    """Build the true cameras of a scenario.

    Raises:
        ValueError: an impossible rig; the message names the key or the file.
    """
    room = scenario.room.size if scenario.room.walls else None
    return build_rig(scenario.cameras, seed=scenario.seed, room=room)
