"""People filmed without a detector, from which samples and recordings with known detectors are made."""

from dataclasses import dataclass, replace

import numpy as np

from mvpose import Detections, Rig
from mvpose.commands.progress import Silence, Stages
from mvpose.recording import People
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.detect import detect
from simharness.detector.viewing_conditions import Conditions
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.sample import Sample
from simharness.reality.filmed_recording import FilmedRecording
from simharness.scenario.load import load
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import capture_trial
from simharness.types.sequence import Sequence
from simharness.types.views import Views, Visibility

LOWER = ("people.count=3", "clutter.racks=0", 'people.activities=["reach", "turn", "point"]')


@dataclass(frozen=True)
class FilmedPeople:
    """Truth in space and in the pictures of a scene that holds nothing but people."""

    sequence: Sequence
    views: Views
    rig: Rig

    def __len__(self) -> int:
        return len(self.sequence)

    def detections(self, *, seed: int = 1, **parameters) -> tuple[Detections, ...]:
        """Return the detections of a detector with some parameters of [detector]; perfect without any."""
        config = DetectorSection.model_validate(parameters)
        found = detect(self.sequence, self.views, self.rig, config, seed=seed)
        return tuple(each.detections for each in found)

    def sample(self, *, seed: int = 1, staged: bool = False, **parameters) -> Sample:
        """Return the sample of a detector whose people are known exactly; ``staged``: also what hides what."""
        kind = parameters.get("kind", "top-down")
        found = self.detections(seed=seed, **parameters)
        joints = self.sequence.joints
        occlusion = Conditions.of_views(self.views).occlusion if staged else None
        bodies = joints if staged else None
        return Sample("filmed", self.rig, self.sequence.time, joints, found, kind, staged=bodies, occlusion=occlusion)

    def recording(self, *, seed: int = 1, **parameters) -> AnnotatedRecording:
        """Return the recording of a detector, with an exact truth of everybody."""
        truth = coco17_to_shelf14(self.sequence.joints)
        found = self.detections(seed=seed, **parameters)
        kind = parameters.get("kind", "top-down")
        return AnnotatedRecording(self.rig, truth, found, np.arange(len(self)), name="filmed", kind=kind)


@dataclass(frozen=True)
class Reenacted:
    """Recording, its people, and the film in which bodies re-enact them."""

    recording: AnnotatedRecording
    people: People
    film: FilmedRecording


def film_people(*changes: str, duration: float = 8.0, seed: int = 0) -> FilmedPeople:
    """Film the people of the scenario `shelf`, without its rack; ``changes`` are overrides of its keys."""
    scenario = load("scenarios/shelf.toml", overrides=[f"duration={duration}", f"seed={seed}", *LOWER, *changes])
    simulation = capture_trial(build_trial(scenario), Stages(Silence()))
    return FilmedPeople(simulation.sequence, simulation.views, simulation.trial.exposures.true_rig)


def without_views(recording: AnnotatedRecording, dropped) -> AnnotatedRecording:
    """Return a recording without the detections in some frames and views: ``dropped(frame, view, keypoints)``."""
    detections = []
    for frame, found in enumerate(recording.detections):
        kept = np.array([not dropped(frame, v, k) for v, k in zip(found.view, found.keypoints, strict=True)], bool)
        detections.append(
            Detections(found.view[kept], found.keypoints[kept], found.scores[kept], found.boxes[kept],
                       found.box_scores[kept], found.skeleton)
        )  # fmt: skip
    return replace(recording, detections=tuple(detections))


def narrowed(filmed: FilmedPeople, *, width: int) -> FilmedPeople:
    """Return the people as cameras film them that see only the middle columns of their pictures."""
    cameras, left = [], (filmed.rig[0].size[0] - width) / 2
    for camera in filmed.rig:
        K = camera.K.copy()
        K[0, 2] -= left
        cameras.append(replace(camera, K=K, size=(width, camera.size[1])))
    views = filmed.views
    pixels = views.pixels - [left, 0.0]
    inside = (pixels[..., 0] >= -0.5) & (pixels[..., 0] < width - 0.5)
    low = np.clip(views.boxes[..., 0] - left, 0, width - 1)
    high = np.clip(views.boxes[..., 0] + views.boxes[..., 2] - left, 0, width - 1)
    boxes = np.stack([low, views.boxes[..., 1], high - low, views.boxes[..., 3]], axis=-1)
    boxes[high == low] = 0.0
    visibility = np.where(inside, views.visibility, Visibility.OUTSIDE).astype(np.int8)
    return replace(filmed, views=replace(views, pixels=pixels, boxes=boxes, visibility=visibility), rig=Rig(cameras))
