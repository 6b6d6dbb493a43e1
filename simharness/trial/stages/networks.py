"""Network stage: detectors, pose heads and re-ID networks that read the rendered pictures; drawn descriptors."""

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mvpose import COCO17, Detections
from mvpose.files.message_text import prefixed
from mvpose.networks import PoseHead, ReId
from mvpose.networks.catalogue.store import path_of
from mvpose.networks.crops import Images
from mvpose.networks.detector import PeopleFinder, open_head
from mvpose.networks.finders import open_finder
from mvpose.networks.reid import DEFAULT
from simharness.detector.descriptors import DescriptorModel, DescriptorSettings
from simharness.detector.detect import Detected
from simharness.detector.error_classes import classify
from simharness.detector.network_truth import with_detections
from simharness.detector.viewing_conditions import oks_units
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.capture import picture_source_of
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback


@dataclass(frozen=True)
class ReadFrames:
    """Frame function that lets the networks of a scenario read its pictures. Each process opens them separately."""

    scenario: Scenario
    """The scenario that names the networks."""
    scene: Scene
    """The built scene."""
    exposures: ExposureSchedule
    """Time and camera of every picture."""
    detected: tuple[Detected, ...]
    """Simulated detections of all frames."""

    @staticmethod
    def needed(scenario: Scenario) -> bool:
        """Return whether a scenario has networks that read pictures."""
        return bool(scenario.detector.networks) or scenario.appearance.source == "pictures"

    def __call__(self, frames: range) -> list[Detected]:
        """Return the detections of these frames with the networks' keypoints and descriptors."""
        picture_source = picture_source_of(self.scenario, Playback(self.scene))
        finder = people_finder(self.scenario) if self.scenario.detector.source == "network" else None
        head = pose_head(self.scenario) if self.scenario.detector.onnx else None
        network = re_id(self.scenario) if self.scenario.appearance.source == "pictures" else None
        result = []
        for frame in frames:
            detected = self.detected[frame]
            images = [
                picture_source.picture(self.exposures, frame, view) if arrived else None
                for view, arrived in enumerate(self.exposures.delivered[frame])
            ]
            if finder is not None:
                found = find_people(finder, images)
                if head is not None:  # before persons are assigned: a detector of boxes has no keypoints
                    found = head.detect(images, found.view, found.boxes, box_scores=found.box_scores)
                ids = functools.cache(lambda view, frame=frame: picture_source.image(self.exposures, frame, view).ids)
                detected = Detected(found, with_detections(detected.truth, found, ids))
            elif head is not None:
                detected = read_keypoints(head, detected, images)
            if network is not None:
                detected = read_descriptors(network, detected, images)
            result.append(detected)
        return result


def network_file(scenario: Scenario, key: str) -> Path:
    """Return the ONNX file of a network that a scenario names by its name or its file.

    Args:
        scenario: the scenario.
        key: "detector.network" or "detector.onnx".

    Raises:
        ValueError: no such name; the message names the key.
    """
    with prefixed(key):
        return path_of(str(scenario.named_files[key]))


def people_finder(scenario: Scenario) -> PeopleFinder:
    """Open the detector of people of a scenario.

    Raises:
        ValueError: no such name, the file is no detector, or it gives boxes alone and there is no pose head; the
            message names the key.
    """
    file = network_file(scenario, "detector.network")
    with prefixed("detector.network"):
        finder = open_finder(file)
    if not finder.one_stage and not scenario.detector.onnx:
        raise ValueError(f"detector.network: {file.name} gives boxes alone; name a pose head in detector.onnx")
    return finder


def pose_head(scenario: Scenario) -> PoseHead:
    """Open the pose head of a scenario.

    Raises:
        ValueError: the file is no pose head; the message names the key.
    """
    file = network_file(scenario, "detector.onnx")
    with prefixed("detector.onnx"):
        return open_head(file, skeleton=COCO17, likelihoods=scenario.detector.heatmaps.size != "none")


def re_id(scenario: Scenario) -> ReId:
    """Open the re-ID network of a scenario.

    Raises:
        ValueError: the file is no re-ID network; the message names the key.
    """
    with prefixed("appearance.network"):
        return ReId(scenario.appearance.network) if scenario.appearance.network else ReId()


def descriptor_settings(scenario: Scenario) -> DescriptorSettings | None:
    """Return the model from which descriptors are drawn; None where the scenario draws none.

    Raises:
        ValueError: the network has no measured distances; the message names the key.
    """
    if scenario.appearance.source != "drawn":
        return None
    with prefixed("appearance.network"):
        model = DescriptorModel.of_network(Path(scenario.appearance.network or DEFAULT))
    return DescriptorSettings(model, scenario.people.look_alike, scenario.people.alike)


def find_people(finder: PeopleFinder, images: Images) -> Detections:
    """Return the people whom a detector finds in the pictures of a frame, by view, then by falling box score.

    Args:
        finder: the detector of people.
        images: picture of each view, (h, w, 3) uint8, or None where none arrives.
    """
    found = [(view, finder.find(image)) for view, image in enumerate(images) if image is not None]
    counts = [len(people.scores) for _, people in found]
    keypoints, scores = np.full((sum(counts), len(COCO17), 2), np.nan), np.zeros((sum(counts), len(COCO17)))
    for (_, people), end in zip(found, np.cumsum(counts), strict=True):
        if people.keypoints is not None and people.keypoint_scores is not None:  # none of a detector of boxes
            rows = slice(end - len(people.scores), end)
            keypoints[rows], scores[rows] = people.keypoints, people.keypoint_scores
    keypoints[scores == 0] = np.nan
    return Detections(
        np.repeat([view for view, _ in found], counts).astype(int),
        keypoints,
        scores,
        np.concatenate([np.zeros((0, 4)), *(people.boxes for _, people in found)]),
        np.concatenate([np.zeros(0), *(people.scores for _, people in found)]),
    )


def read_keypoints(head: PoseHead, detected: Detected, images: Images) -> Detected:
    """Return the same boxes and descriptors with the keypoints that a pose head reads, classified by distance.

    Args:
        head: a top-down head for COCO-17.
        detected: simulated detections of one frame; everything except the boxes and their descriptors is replaced.
        images: picture of each view, (h, w, 3) uint8, or None where none arrives.
    """
    boxes = detected.detections
    read = head.detect(images, boxes.view, boxes.boxes, box_scores=boxes.box_scores)
    truth = detected.truth
    real = truth.person >= 0
    shown = truth.boxes[boxes.view, truth.person]
    target = np.where(real[:, None, None], truth.pixels[boxes.view, truth.person], np.nan)
    error = classify(read.keypoints, target, oks_units(shown))
    error[~real] = np.where(read.scores[~real] > 0, truth.error[~real], error[~real])
    return Detected(replace(read, descriptors=boxes.descriptors), replace(truth, error=error))


def read_descriptors(network: ReId, detected: Detected, images: Images) -> Detected:
    """Return the same detections with the descriptors that a re-ID network reads in their boxes."""
    return replace(detected, detections=network.describe(detected.detections, images))
