"""Build stage: build and check everything that a scenario describes, before any other stage runs."""

from collections.abc import Mapping
from dataclasses import dataclass

from mvpose import Rig
from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Floats
from mvpose.estimators import Estimator
from mvpose.presets import NEED_DESCRIPTORS, without_repair
from simharness.capture.rendering.renderer import Unavailable
from simharness.detector.descriptors import DescriptorSettings
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.capture import renderer_of
from simharness.trial.stages.estimators import estimators_of
from simharness.trial.stages.networks import descriptor_settings, people_finder, pose_head, re_id
from simharness.world.rigs.faults import ExposureSchedule, camera_phases, schedule_exposures
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import Scene, build


@dataclass(frozen=True)
class Trial:
    """Built and checked scenario."""

    scenario: Scenario
    """The resolved scenario at its seed."""
    scene: Scene
    """The compiled scene with its people and their motions."""
    exposures: ExposureSchedule
    """Time and true camera of every picture, and the believed calibration."""
    pipelines: Mapping[str, Estimator]
    """Variants of the method, by name."""
    descriptors: DescriptorSettings | None
    """Settings of drawn descriptors; None where none are drawn."""


def build_trial(scenario: Scenario) -> Trial:
    """Build what a scenario describes.

    Raises:
        ValueError: the scenario cannot be built, for example because people do not fit, a camera is in a wall, or a
            variant or network does not exist.
    """
    descriptors = descriptor_settings(scenario)
    if scenario.detector.source == "network":
        people_finder(scenario)
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
    return Trial(scenario, scene, exposures_of(scenario, rig, scene.time), pipelines, descriptors)


def exposures_of(scenario: Scenario, rig: Rig, time: Floats) -> ExposureSchedule:
    """Return when and with which cameras the pictures of a scene are taken, with the faults of its scenario.

    Args:
        scenario: the resolved scenario at its seed.
        rig: the true cameras.
        time: times of the frames, (T,), seconds.
    """
    cameras = scenario.cameras
    phases = camera_phases(cameras, len(rig), period=1.0 / scenario.rate, seed=scenario.seed)
    return schedule_exposures(rig, scenario.faults, time, seed=scenario.seed, phases=phases, every=cameras.every)


def build_variants(scenario: Scenario) -> dict[str, Estimator]:
    """Build the variants of the method that a scenario names, by name.

    Raises:
        ValueError: an unknown variant, a user-defined estimator that cannot be loaded, a network that cannot be
            opened, or a variant that needs descriptors where detections have none.
    """
    described = scenario.appearance.source != "none"
    appearance = re_id(scenario).affinity if described else AppearanceAffinity()
    pipelines = estimators_of(scenario.method, appearance=appearance, period=1.0 / scenario.rate)
    if not described and (unusable := [name for name in pipelines if without_repair(name) in NEED_DESCRIPTORS]):
        raise ValueError(
            f"method.variants: {', '.join(unusable)} needs descriptors, but detections have none; choose "
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
