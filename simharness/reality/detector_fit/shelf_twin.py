"""Simulated twin of the Shelf recording, to check a fit: its rig, four people at work in a small space, shelves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Rig
from simharness.capture.film import film
from simharness.capture.ray_visibility import RayObserver
from simharness.detector.conditions import OUTSIDE, Conditions
from simharness.detector.detect import detect
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.sample import SHELF_RATE, Sample, of_simulation
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS, Detector
from simharness.scenario.sections.scenario import Scenario
from simharness.types.sequence import Sequence
from simharness.types.views import Views
from simharness.world.rigs.faults import schedule_exposures
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from simharness.world.scene.playback import Playback, simulate


@dataclass(frozen=True)
class ShelfTwin:
    """Ground truth of the twin, before any detector.

    Attributes:
        sequence: ground truth in space.
        views: ground truth in the pictures.
        rig: the cameras.
    """

    sequence: Sequence
    views: Views
    rig: Rig

    def detected(self, config: Detector, *, seed: int = 0, known: NDArray[np.bool_] | None = None) -> Sample:
        """Return the sample of a simulated detector, with as little truth as Shelf has.

        Args:
            config: parameters of the detector.
            seed: seed of its draws.
            known: which people are annotated in which frames, (T, P); None: all.
        """
        found = detect(self.sequence, self.views, self.rig, config, seed=seed)
        detections = [each.detections for each in found]
        return of_simulation(self.sequence.joints, self.sequence.time, detections, self.rig, known=known)


def film_shelf_twin(*, seconds: float = 12.0, seed: int = 0, shelves: int = 0) -> ShelfTwin:
    """Simulate and film the twin of Shelf with the renderer of rays, at the 25 Hz of Shelf.

    Args:
        seconds: duration.
        seed: seed of the people, their motion and the places of shelves.
        shelves: number of shelves among the people.
    """
    scenario = Scenario.model_validate(
        {
            "name": "shelf-twin",
            "seed": seed,
            "duration": seconds,
            "rate": SHELF_RATE,
            "room": {"size": (9.0, 9.0, 3.0), "walls": False},
            "people": {"count": 4, "activities": ("reach", "walk", "point", "turn"), "area": 1.3, "spacing": 0.6},
            "clutter": {"shelves": shelves},
            "cameras": {"layout": "preset", "preset": "shelf"},
            "rendering": {"renderer": "rays"},
        }
    )
    rig = build_rig(scenario.cameras, seed=seed, room=None)
    scene = build(scenario, rig)
    exposures = schedule_exposures(rig, scenario.faults, scene.time, seed=seed)
    playback = Playback(scene)
    return ShelfTwin(simulate(scene), film(playback, exposures, RayObserver(playback)), rig)


def count_occlusion(twin: ShelfTwin, sample: Sample) -> NDArray[np.int64]:
    """Count joints by kind, estimated and true occlusion class, (9, 3, 3): the counts behind ``occlusion.CONFUSION``.

    Args:
        twin: ground truth.
        sample: detections of the twin.
    """
    labels = label_joints(sample)
    true = Conditions.of(twin.views).occlusion
    counted = labels.risk["drop"] & (true != OUTSIDE)
    kind = np.broadcast_to(np.array(KIND_OF_JOINT), counted.shape)
    result = np.zeros((len(KINDS), 3, 3), np.int64)
    np.add.at(result, (kind[counted], labels.occlusion[counted], true[counted]), 1)
    return result
