"""Network stage: pose heads and re-ID networks that read the rendered pictures; models of their descriptors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simharness.trial.stages.capture import picture_source_of

if TYPE_CHECKING:
    from mvpose.networks import PoseHead, ReId
    from simharness.detector.descriptors import DescriptorSettings
    from simharness.detector.detect import Detected
    from simharness.scenario.sections.scenario import Scenario
    from simharness.world.rigs.exposure_schedule import ExposureSchedule
    from simharness.world.scene.build import Scene


@dataclass(frozen=True)
class ReadFrames:
    """Frame function that lets the networks of a scenario read its pictures. Each process opens them separately.

    Attributes:
        scenario: the scenario that names the networks.
        scene: the built scene.
        exposures: time and camera of every picture.
        detected: simulated detections of all frames.
    """

    scenario: Scenario
    scene: Scene
    exposures: ExposureSchedule
    detected: tuple[Detected, ...]

    @staticmethod
    def needed(scenario: Scenario) -> bool:
        """Return whether a scenario has networks that read pictures."""
        return bool(scenario.detector.onnx) or scenario.appearance.source == "pictures"

    def __call__(self, frames: range) -> list[Detected]:
        """Return the detections of these frames with the networks' keypoints and descriptors."""
        from simharness.detector.network_readout import read_descriptors, read_keypoints
        from simharness.world.scene.playback import Playback

        picture_source = picture_source_of(self.scenario, Playback(self.scene))
        head = pose_head(self.scenario) if self.scenario.detector.onnx else None
        network = re_id(self.scenario) if self.scenario.appearance.source == "pictures" else None
        result = []
        for frame in frames:
            detected = self.detected[frame]
            images = [
                picture_source.picture(self.exposures, frame, view) if arrived else None
                for view, arrived in enumerate(self.exposures.delivered[frame])
            ]
            if head is not None:
                detected = read_keypoints(head, detected, images)
            if network is not None:
                detected = read_descriptors(network, detected, images)
            result.append(detected)
        return result


def pose_head(scenario: Scenario) -> PoseHead:
    """Open the pose head of a scenario.

    Raises:
        ValueError: the file is no pose head; the message names the key.
    """
    from mvpose.networks import PoseHead

    try:
        return PoseHead(scenario.detector.onnx, likelihoods=scenario.detector.heatmaps.size != "none")
    except ValueError as error:
        raise ValueError(f"detector.onnx: {error}") from None


def re_id(scenario: Scenario) -> ReId:
    """Open the re-ID network of a scenario.

    Raises:
        ValueError: the file is no re-ID network; the message names the key.
    """
    from mvpose.networks import ReId

    try:
        return ReId(scenario.appearance.network) if scenario.appearance.network else ReId()
    except ValueError as error:
        raise ValueError(f"appearance.network: {error}") from None


def descriptor_settings(scenario: Scenario) -> DescriptorSettings | None:
    """Return the model from which descriptors are drawn; None where the scenario draws none.

    Raises:
        ValueError: the network has no measured distances; the message names the key.
    """
    if scenario.appearance.source != "drawn":
        return None
    from mvpose.networks.reid import DEFAULT
    from simharness.detector.descriptor_model import DescriptorModel
    from simharness.detector.descriptors import DescriptorSettings

    try:
        model = DescriptorModel.of_network(Path(scenario.appearance.network or DEFAULT))
    except ValueError as error:
        raise ValueError(f"appearance.network: {error}") from None
    return DescriptorSettings(model, scenario.people.look_alike, scenario.people.alike)
