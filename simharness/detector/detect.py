"""The simulated 2D detector: what is in the pictures, seen with the errors of a real one.

    keypoints -> scores -> boxes -> people found; beside them phantoms and decoys -> what arrives -> frames

Every part makes or changes blocks of detections (:class:`Found`) of the whole sequence; every dial draws from a stream
of its own before anything is masked. So turning one changes no other draw.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mvpose import COCO17, Detections
from mvpose.camera import Rig
from simharness.detector.bias import shifts
from simharness.detector.boxes import in_boxes
from simharness.detector.conditions import Conditions
from simharness.detector.correlation import Chances
from simharness.detector.decoys import decoy_hits
from simharness.detector.detection_block import Found, Origin
from simharness.detector.drawn_descriptors import Describer, Looks
from simharness.detector.heatmaps import Peaks, in_crops
from simharness.detector.keypoints import find_keypoints
from simharness.detector.phantoms import phantoms
from simharness.detector.picture_delivery import delivered
from simharness.detector.scores import score_keypoints
from simharness.scenario.sections.detector import Bias, Detector
from simharness.types.sequence import Sequence
from simharness.types.truth import Truth
from simharness.types.views import Views


@dataclass(frozen=True)
class Detected:
    """What the detector says of one frame, and the truth about it.

    Attributes:
        detections: ordered by view and then by falling box score, as detectors give them.
        truth: the truth about them.
        peaks: what their heat maps are made of; None without heat maps.
    """

    detections: Detections
    truth: Truth
    peaks: Peaks | None = None


def detect(
    sequence: Sequence, views: Views, rig: Rig, config: Detector, *, seed: int, looks: Looks | None = None
) -> list[Detected]:
    """Detect the people of every frame in every view.

    A repeated picture gives the detections of the frame that it was taken in.

    Args:
        sequence: where everyone is, T frames.
        views: the same in the V pictures.
        rig: the cameras that take the pictures, not what is believed of them.
        config: how the detector errs.
        seed: of the scenario.
        looks: how descriptors are drawn; None: detections carry none.
    """
    chances = Chances(seed, sequence.time, len(rig))
    parts = [
        find_people(sequence, views, rig, config, chances),
        phantoms(views, rig, config.phantoms, chances),
        decoy_hits(views, rig, config.decoys, chances),
    ]
    found = Found.joined([part for part in parts if part.there.shape[2]] or parts[:1])
    if config.heatmaps.size != "none":
        found = in_crops(found)
    found = delivered(found, views.source)
    describe = None
    if looks is not None:
        describe = Describer(sequence, views, rig, looks, chances, life=config.correlation.scatter_life)
    return _frames(found, sequence, views, config, describe)


def find_people(sequence: Sequence, views: Views, rig: Rig, config: Detector, chances: Chances) -> Found:
    """The detections that show real people."""
    conditions = Conditions.of(views)
    shift = None if config.bias == Bias() else shifts(sequence.joints, config.bias, rig)
    keypoints = find_keypoints(
        views, conditions, sequence, rig, config.keypoints, config.correlation, chances, shift=shift
    )
    scores = score_keypoints(keypoints, conditions, config.scores, config.correlation, chances)
    shape = scores.shape[:3]
    number = np.broadcast_to(np.arange(shape[2]), shape)
    people = Found(
        there=np.any(scores > 0, axis=-1),
        keypoints=keypoints.pixels,
        scores=scores,
        boxes=views.boxes,
        box_scores=np.ones(shape),
        person=number,
        origin=np.full(shape, Origin.PERSON, np.int8),
        number=number,
        error=keypoints.error,
        rivals=keypoints.rivals,
    )
    return in_boxes(people, views, rig, config.boxes, chances)


def _frames(
    found: Found, sequence: Sequence, views: Views, config: Detector, describe: Describer | None
) -> list[Detected]:
    """Blocks to frames."""
    frame, view, slot = np.nonzero(found.there)
    order = np.lexsort((slot, -found.box_scores[frame, view, slot], view, frame))
    where = frame, view, slot = frame[order], view[order], slot[order]
    chosen = {
        key: getattr(found, key)[where]
        for key in ("keypoints", "scores", "boxes", "box_scores", "person", "error", "rivals")
    }
    descriptors = None if describe is None else describe(frame, view, found.origin[where], found.number[where])
    heat = config.heatmaps.size != "none"
    result = []
    for t, (start, end) in enumerate(itertools.pairwise(np.searchsorted(frame, np.arange(len(sequence) + 1)))):
        mine = {key: values[start:end] for key, values in chosen.items()}
        detections = Detections(
            view[start:end],
            mine["keypoints"],
            mine["scores"],
            mine["boxes"],
            mine["box_scores"],
            COCO17,
            None if descriptors is None else descriptors[start:end],
        )
        truth = Truth(
            joints=sequence.joints[t],
            pixels=views.pixels[t],
            visibility=views.visibility[t],
            boxes=views.boxes[t],
            person=mine["person"],
            error=mine["error"],
        )
        peaks = Peaks(detections.boxes, detections.keypoints, detections.scores, mine["rivals"], config.heatmaps)
        result.append(Detected(detections, truth, peaks if heat else None))
    return result
