"""What went wrong with whom: one class for every wrong person-frame, and for every ghost.

A true person in a frame is wrong where they have no estimate of their own (:func:`simharness.pairing.pairing.pair`), where
a joint of theirs is displaced, or where a second estimate stands beside their own. A joint is displaced if it is more
than 150 mm off, or not placed at all although some view sees it: where nobody can see a joint, saying nothing is right,
and saying something wrong is still wrong. A person whom no camera sees is a failure all the same, as recall counts it:
whoever installs cameras wants to know.

Everybody who is wrong has the first class of these that applies, so the shares of the classes add up:

1. merged: detections of two or more people make one estimate. Somebody without an estimate had a detection in it; of
   somebody with a displaced joint, another person's keypoint in it has drawn the joint at least half of the way.
2. split: a second estimate, with a detection of the person in it, stands within 500 mm of them; or the person has no
   estimate and their detections are in several.
3. missed: no estimate of their own.
4. swapped limb: a displaced joint lies where its left-right counterpart or the same joint of another person is: within
   150 mm, and at least twice as near as to its own place.
5. displaced joint: any other.

An estimate that is nobody's is a ghost, unless it is the second one of a split. So failures are the wrong people and
the ghosts. Phantoms are nobody's detections: one among a person's merges nobody.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Estimate, Rig
from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array
from simharness.pairing.distance import mean_distances
from simharness.pairing.pairing import LIMIT, pair
from simharness.types.recording import Recording
from simharness.types.truth import Truth
from simharness.types.views import Visibility

DISPLACED = 0.15
"""Metres from which a joint is wrong: PCK@150 mm, as MPI-INF-3DHP (Mehta et al., 3DV 2017) and others score 3D pose."""

_NEARER = 0.5  # of its distance from its own place that a joint may be from where it is said to have gone
_MIRROR = np.array(COCO17.mirror)


class FailureKind(StrEnum):
    """The classes, in the order in which tables show them."""

    MISSED = "missed"
    GHOST = "ghost"
    MERGED = "merged"
    SPLIT = "split"
    SWAPPED_LIMB = "swapped_limb"
    DISPLACED_JOINT = "displaced_joint"


@dataclass(frozen=True)
class Failure:
    """Somebody who is wrong in one frame, or somebody who is not there.

    Attributes:
        frame: index.
        person: the true person; -1 for a ghost.
        estimate: the person's own, or the ghost; -1 where the person has none.
        kind: the class.
        joints: which of COCO-17 are displaced; none where the person has no estimate.
        error_mm: mean error of the joints that the pair shares; None where there is no pair.
    """

    frame: int
    person: int
    estimate: int
    kind: FailureKind
    joints: tuple[int, ...]
    error_mm: float | None


def find_failures(recording: Recording, estimates: Sequence[Estimate]) -> list[Failure]:
    """Every failure, by frame; in a frame the people come first, then the ghosts.

    Args:
        recording: T frames of people on COCO-17.
        estimates: what a variant says of them, T.

    Raises:
        ValueError: another number of estimates, joints that are not those of COCO-17, or labels of other detections.
    """
    if len(estimates) != len(recording.truth):
        raise ValueError(f"there are {len(recording.truth)} frames to judge, got {len(estimates)} estimates")
    frames = zip(recording.detections, recording.truth, estimates, strict=True)
    return [
        failure
        for frame, (detections, truth, estimate) in enumerate(frames)
        for failure in failures_of_frame(recording.rig, detections, truth, estimate, frame=frame)
    ]


def failures_of_frame(
    rig: Rig, detections: Detections, truth: Truth, estimate: Estimate, *, frame: int = 0
) -> list[Failure]:
    """The failures of one frame.

    Args:
        rig: as believed, V cameras.
        detections: m of them, what was estimated from.
        truth: about the same m detections.
        estimate: n people; person i is label i of the matching. Without labels nobody is merged or split.
        frame: its index.

    Raises:
        ValueError: as of :func:`find_failures`.
    """
    joints = as_array(estimate.joints, ("n", len(COCO17), 3), "estimated joints")
    truth_joints = as_array(truth.joints, ("P", len(COCO17), 3), "true joints")
    labels = estimate.matching.labels_of(len(truth.person))
    pairing = pair(truth_joints, joints)
    own = pairing.estimate
    missed = pairing.present & (own < 0)
    placed = np.full(truth_joints.shape, np.nan)
    placed[own >= 0] = joints[own[own >= 0]]
    error = np.linalg.norm(placed - truth_joints, axis=-1)
    displaced = _displaced(error, truth_joints, truth.visibility) & (own >= 0)[:, None]
    spare = np.setdiff1d(np.arange(len(joints)), own)
    if not (missed.any() or displaced.any() or len(spare)):
        return []

    holds = _holds(labels, truth.person, len(joints), len(own))
    beside = _beside(truth_joints, joints, spare, holds)
    doubled = np.bincount(beside[beside >= 0], minlength=len(own)) > 0
    failures = []
    for person in np.flatnonzero(missed | displaced.any(axis=1) | doubled).tolist():
        if missed[person]:
            kind = _of_nobody(holds, person)
        else:
            wrong = np.flatnonzero(displaced[person])
            intruders = np.flatnonzero((labels == own[person]) & (truth.person >= 0) & (truth.person != person))
            if _drawn(rig, detections, intruders, wrong, placed[person], truth_joints[person]):
                kind = FailureKind.MERGED
            elif doubled[person]:
                kind = FailureKind.SPLIT
            elif _swapped(placed[person], truth_joints, person, wrong, error[person]):
                kind = FailureKind.SWAPPED_LIMB
            else:
                kind = FailureKind.DISPLACED_JOINT
        off = None if missed[person] else 1000.0 * float(pairing.error[person])
        failures.append(
            Failure(frame, person, int(own[person]), kind, tuple(np.flatnonzero(displaced[person]).tolist()), off)
        )
    return failures + [Failure(frame, -1, ghost, FailureKind.GHOST, (), None) for ghost in spare[beside < 0].tolist()]


def _displaced(error: Floats, truth: Floats, visibility: NDArray[np.int8]) -> Bools:
    """Which joints are wrong, (P, J), of people who have an estimate: error (P, J), truth (P, J, 3)."""
    seen = (visibility <= Visibility.SELF_OCCLUDED).any(axis=0)
    return np.isfinite(truth).all(axis=-1) & ((error > DISPLACED) | (np.isnan(error) & seen))


def _holds(labels: Integers, person: Integers, estimates: int, people: int) -> Integers:
    """How many detections of each person every estimate is made of, (n, P)."""
    counted = (labels >= 0) & (labels < estimates) & (person >= 0)
    holds = np.zeros((estimates, people), np.int64)
    np.add.at(holds, (labels[counted], person[counted]), 1)
    return holds


def _beside(truth: Floats, joints: Floats, spare: Integers, holds: Integers) -> Integers:
    """Whom each of the s estimates that are left over repeats, (s,): the nearest of those whom it can; -1 for nobody.

    Whoever is that near has an estimate of their own, or this would have been it.
    """
    if not (len(spare) and len(truth)):
        return np.full(len(spare), -1)
    distance = np.where(holds[spare] > 0, mean_distances(truth, joints[spare]).T, np.inf)
    return np.where(distance.min(axis=1) <= LIMIT, distance.argmin(axis=1), -1)


def _of_nobody(holds: Integers, person: int) -> FailureKind:
    """Why somebody has no estimate, as far as the matching tells."""
    mine = np.flatnonzero(holds[:, person])
    if (np.count_nonzero(holds[mine], axis=1) > 1).any():
        return FailureKind.MERGED
    return FailureKind.SPLIT if len(mine) > 1 else FailureKind.MISSED


def _drawn(
    rig: Rig, detections: Detections, intruders: Integers, wrong: Integers, placed: Floats, truth: Floats
) -> bool:
    """Whether a keypoint of other people's detections has drawn one of the wrong joints half of the way or more."""
    for intruder in intruders.tolist():
        camera = rig[int(detections.view[intruder])]
        there = detections.keypoints[intruder, wrong]
        now, before = (np.linalg.norm(camera.project(at[wrong]) - there, axis=-1) for at in (placed, truth))
        if (now <= _NEARER * before).any():  # False where a joint is missing
            return True
    return False


def _swapped(placed: Floats, truth: Floats, person: int, wrong: Integers, error: Floats) -> bool:
    """Whether one of the wrong joints of a person lies at its counterpart, or at the same joint of another person."""
    others = np.delete(truth, person, axis=0)[:, wrong]
    places = np.concatenate([truth[person, _MIRROR[wrong]][None], others])
    reach = np.minimum(DISPLACED, _NEARER * error[wrong])
    return bool((np.linalg.norm(placed[wrong] - places, axis=-1) <= reach).any())
