"""A simulated twin of Shelf: its rig, four people who work together in a small space, a shelf among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Rig
from simharness.capture.film import film
from simharness.capture.ray_visibility import RayObserver
from simharness.detector.conditions import OUTSIDE, Conditions
from simharness.detector.detect import detect
from simharness.reality.detector_fit.joint_labels import judge
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
class Twin:
    """What happens and what the cameras see of it, before any detector.

    Attributes:
        sequence: where everyone is.
        views: the same in the pictures.
        rig: the cameras.
    """

    sequence: Sequence
    views: Views
    rig: Rig

    def detected(self, config: Detector, *, seed: int = 0, known: NDArray[np.bool_] | None = None) -> Sample:
        """What a detector finds, and of the truth what Shelf would tell.

        Args:
            config: the detector.
            seed: of its draws.
            known: who is annotated when, (T, P); None: everybody.
        """
        found = detect(self.sequence, self.views, self.rig, config, seed=seed)
        detections = [each.detections for each in found]
        return of_simulation(self.sequence.joints, self.sequence.time, detections, self.rig, known=known)


def film_twin(*, seconds: float = 12.0, seed: int = 0, shelves: int = 0) -> Twin:
    """Film the twin of Shelf by rays, at its 25 frames a second.

    Args:
        seconds: how long.
        seed: of who is there, what they do and where the shelf is.
        shelves: how many stand among them.
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
    return Twin(simulate(scene), film(playback, exposures, RayObserver(playback)), rig)


def confusion(twin: Twin, sample: Sample) -> NDArray[np.int64]:
    """How often joints that skeletons tell to be VISIBLE, SELF_OCCLUDED or OCCLUDED truly are, (9, 3, 3): ``sight.CONFUSION``.

    Args:
        twin: what truly happened.
        sample: what a detector found of it.
    """
    judged = judge(sample)
    truly = Conditions.of(twin.views).occlusion
    counted = judged.risk["drop"] & (truly != OUTSIDE)
    kind = np.broadcast_to(np.array(KIND_OF_JOINT), counted.shape)
    result = np.zeros((len(KINDS), 3, 3), np.int64)
    np.add.at(result, (kind[counted], judged.seen[counted], truly[counted]), 1)
    return result
