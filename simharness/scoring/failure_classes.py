"""Classification of failures: one class for every wrong person in a frame, and for every ghost.

A true person in a frame is wrong if the person has no estimate (:func:`simharness.scoring.pairing.pair`), if a joint is
displaced, or if a second estimate lies close to the person. A joint is displaced if its error is over 150 mm, or if it
is missing although visible or self-occluded in some view. If it is hidden in all views, a missing joint is correct
and a joint with an error over 150 mm still displaced. A person whom no camera sees is a failure as well, as in recall,
because users who install cameras need to know.

Every wrong person has the first of these classes that applies, so the shares of the classes add up:

1. merged: detections of two or more people make one estimate. Either the person has no estimate but a detection in that
   estimate; or the person has a displaced joint, and a keypoint of another person in the person's estimate has drawn
   the joint at least half of the way.
2. split: a second estimate that contains a detection of the person lies within 500 mm; or the person has no estimate,
   and the person's detections are in several estimates.
3. missed: no estimate.
4. swapped limb: a displaced joint lies where its left-right counterpart or the same joint of another person is: within
   150 mm, and at least twice as near as to its true position.
5. displaced joint: any other displaced joint.

An estimate that matches no person is a ghost, unless it is the second estimate of a split. The failures of a frame are
its wrong people and its ghosts. Phantoms show no person, so a phantom in an estimate does not make it merged.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Estimate, Rig
from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array
from simharness.scoring.pairing import LIMIT, mean_distances, pair, placed_joints
from simharness.types.recording import Recording
from simharness.types.truth import Truth
from simharness.types.views import Visibility

DISPLACED = 0.15
"""Error above which a joint is displaced, metres: the limit of PCK@150 mm (MPI-INF-3DHP, Mehta et al., 3DV 2017)."""

_NEARER = 0.5
"""Largest distance of a drawn or swapped joint from its supposed target, as a share of its error."""

_MIRROR = np.array(COCO17.mirror)


class FailureKind(StrEnum):
    """Classes of failures, in the order of tables."""

    MISSED = "missed"
    GHOST = "ghost"
    MERGED = "merged"
    SPLIT = "split"
    SWAPPED_LIMB = "swapped_limb"
    DISPLACED_JOINT = "displaced_joint"


@dataclass(frozen=True)
class Failure:
    """Wrong person or ghost in one frame."""

    frame: int
    """Index of the frame."""
    person: int
    """Index of the true person; -1 for a ghost."""
    estimate: int
    """Index of the estimate paired with the person, or of the ghost; -1 where the person has no estimate."""
    kind: FailureKind
    """Class of the failure."""
    joints: tuple[int, ...]
    """Indices of the displaced joints in COCO-17; empty where the person has no estimate."""
    error_mm: float | None
    """Mean error of the joints that the pair shares, mm; None without a pair."""


def find_failures(recording: Recording, estimates: Sequence[Estimate]) -> list[Failure]:
    """Return all failures of a recording by frame; within a frame people come first, then ghosts.

    Args:
        recording: T frames of people on COCO-17.
        estimates: estimates of a variant, T.

    Raises:
        ValueError: another number of estimates, joints that are not those of COCO-17, or labels that do not fit the
            detections.
    """
    if len(estimates) != len(recording.truth):
        raise ValueError(f"estimates must be {len(recording.truth)}, one for each frame, got {len(estimates)}")
    frames = zip(recording.detections, recording.at_times_of(estimates).truth, estimates, strict=True)
    return [
        failure
        for frame, (detections, truth, estimate) in enumerate(frames)
        for failure in failures_of_frame(recording.rig, detections, truth, estimate, frame=frame)
    ]


def failures_of_frame(
    rig: Rig, detections: Detections, truth: Truth, estimate: Estimate, *, frame: int = 0
) -> list[Failure]:
    """Return the failures of one frame.

    Args:
        rig: believed rig, V cameras.
        detections: the m detections that the estimate was made from.
        truth: truth of the frame and of these m detections.
        estimate: n people; estimate i has label i in the matching. Without labels no person is merged or split.
        frame: index of the frame, copied to the failures.

    Raises:
        ValueError: as for :func:`find_failures`.
    """
    joints = as_array(estimate.joints, ("n", len(COCO17), 3), "estimated joints")
    truth_joints = as_array(truth.joints, ("P", len(COCO17), 3), "true joints")
    labels = estimate.matching.labels_of(len(truth.person))
    pairing = pair(truth_joints, joints)
    partner = pairing.estimate
    missed = pairing.present & (partner < 0)
    placed = placed_joints(partner, joints)
    error = np.linalg.norm(placed - truth_joints, axis=-1)
    displaced = _displaced(error, truth_joints, truth.visibility) & (partner >= 0)[:, None]
    unpaired = np.setdiff1d(np.arange(len(joints)), partner)
    if not (missed.any() or displaced.any() or len(unpaired)):
        return []

    counts = _count_detections(labels, truth.person, len(joints), len(partner))
    doubles = _doubled_person(truth_joints, joints, unpaired, counts)
    doubled = np.bincount(doubles[doubles >= 0], minlength=len(partner)) > 0
    failures = []
    for person in np.flatnonzero(missed | displaced.any(axis=1) | doubled).tolist():
        if missed[person]:
            kind = _kind_without_estimate(counts, person)
        else:
            wrong = np.flatnonzero(displaced[person])
            intruders = np.flatnonzero((labels == partner[person]) & (truth.person >= 0) & (truth.person != person))
            if _drawn_by_others(rig, detections, intruders, wrong, placed[person], truth_joints[person]):
                kind = FailureKind.MERGED
            elif doubled[person]:
                kind = FailureKind.SPLIT
            elif _swapped(placed[person], truth_joints, person, wrong, error[person]):
                kind = FailureKind.SWAPPED_LIMB
            else:
                kind = FailureKind.DISPLACED_JOINT
        error_mm = None if missed[person] else 1000.0 * float(pairing.error[person])
        failures.append(
            Failure(
                frame, person, int(partner[person]), kind, tuple(np.flatnonzero(displaced[person]).tolist()), error_mm
            )
        )
    ghosts = unpaired[doubles < 0].tolist()
    return failures + [Failure(frame, -1, ghost, FailureKind.GHOST, (), None) for ghost in ghosts]


def _displaced(error: Floats, truth: Floats, visibility: NDArray[np.int8]) -> Bools:
    """Return which joints of people with an estimate are displaced, (P, J), from errors (P, J) and truth (P, J, 3)."""
    in_some_view = (visibility <= Visibility.SELF_OCCLUDED).any(axis=0)
    return np.isfinite(truth).all(axis=-1) & ((error > DISPLACED) | (np.isnan(error) & in_some_view))


def _count_detections(labels: Integers, person: Integers, estimates: int, people: int) -> Integers:
    """Count the detections of each person in each estimate, (n, P)."""
    counted = (labels >= 0) & (labels < estimates) & (person >= 0)
    counts = np.zeros((estimates, people), np.int64)
    np.add.at(counts, (labels[counted], person[counted]), 1)
    return counts


def _doubled_person(truth: Floats, joints: Floats, unpaired: Integers, counts: Integers) -> Integers:
    """Return the person of whom each of the s unpaired estimates is a second estimate, (s,); -1 for none.

    It is the nearest person with a detection in the estimate, if within ``LIMIT``. Such a person always has an
    estimate, because otherwise this estimate would have been paired with the person.
    """
    if not (len(unpaired) and len(truth)):
        return np.full(len(unpaired), -1)
    distance = np.where(counts[unpaired] > 0, mean_distances(truth, joints[unpaired]).T, np.inf)
    return np.where(distance.min(axis=1) <= LIMIT, distance.argmin(axis=1), -1)


def _kind_without_estimate(counts: Integers, person: int) -> FailureKind:
    """Return the class of a person without an estimate, from the estimates that contain the person's detections."""
    estimates = np.flatnonzero(counts[:, person])
    if (np.count_nonzero(counts[estimates], axis=1) > 1).any():
        return FailureKind.MERGED
    return FailureKind.SPLIT if len(estimates) > 1 else FailureKind.MISSED


def _drawn_by_others(
    rig: Rig, detections: Detections, intruders: Integers, wrong: Integers, placed: Floats, truth: Floats
) -> bool:
    """Return whether a keypoint of another person's detection has drawn a displaced joint at least half of the way."""
    for intruder in intruders.tolist():
        camera = rig[int(detections.view[intruder])]
        keypoints = detections.keypoints[intruder, wrong]
        estimated, true = (
            np.linalg.norm(camera.project(joints[wrong]) - keypoints, axis=-1) for joints in (placed, truth)
        )
        if (estimated <= _NEARER * true).any():  # False where a joint is missing
            return True
    return False


def _swapped(placed: Floats, truth: Floats, person: int, wrong: Integers, error: Floats) -> bool:
    """Return whether a displaced joint lies at its left-right counterpart or at the same joint of another person."""
    others = np.delete(truth, person, axis=0)[:, wrong]
    targets = np.concatenate([truth[person, _MIRROR[wrong]][None], others])
    limit = np.minimum(DISPLACED, _NEARER * error[wrong])
    return bool((np.linalg.norm(placed[wrong] - targets, axis=-1) <= limit).any())
