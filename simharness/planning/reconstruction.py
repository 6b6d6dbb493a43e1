"""What the method makes of the people of all scenes with a set of cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Rig, preset
from mvpose.arrays import Floats
from mvpose.rays import Rays
from mvpose.reconstruction import Triangulation
from mvpose.skeleton import coco17_to_shelf14
from simharness.planning.camera_terms import CameraTerms
from simharness.planning.standing_people import StandingScenes
from simharness.scoring.pairing import LIMIT, mean_distances, pair
from simharness.scoring.pcp import nearest

_SCENES_AT_ONCE = 64  # whose people are triangulated in one call, which searches its detections for each of them


@dataclass(frozen=True)
class Reconstruction:
    """Estimates of everyone in S scenes of Q people.

    Attributes:
        nearest: joints of the estimate nearest to everyone, by which PCP is scored, (S, Q, 17, 3), metres; NaN where
            missing.
        paired: joints of the estimate paired one to one with everyone, (S, Q, 17, 3), metres; NaN where missing.
        mixed: who is matched with a detection of somebody else, or twice, (S, Q), 0 or 1; NaN where matching was not
            tried.
    """

    nearest: Floats
    paired: Floats
    mixed: Floats


def reconstruct(terms: Sequence[CameraTerms], *, variant: str = "") -> Reconstruction:
    """Return what the method makes of everyone in every scene.

    Args:
        terms: what each camera contributes.
        variant: variant of the method; "": robust triangulation of each person's own detections.

    Raises:
        ValueError: fewer than two cameras, cameras that all stand in one point, terms of different scenes, or an
            unknown variant.
    """
    rig = Rig([each.camera for each in terms])
    if any(each.scenes is not terms[0].scenes for each in terms):
        raise ValueError("all terms must be of the same scenes: compute those of all cameras with one FastLayer")
    return _by_variant(rig, terms, terms[0].scenes, variant) if variant else _by_truth(terms)


def _by_truth(terms: Sequence[CameraTerms]) -> Reconstruction:
    """Return estimates by robust triangulation of each person's own detections."""
    scenes, method = terms[0].scenes, Triangulation()
    count, people = len(scenes), scenes.people
    parts = []
    for start in range(0, count, _SCENES_AT_ONCE):
        chosen = slice(start, min(start + _SCENES_AT_ONCE, count))
        many = (chosen.stop - start) * people
        labels = [np.where(each.block.present[chosen, 0, :people].ravel(), np.arange(many), -1) for each in terms]
        poses = method(_rays(terms, chosen, many), np.concatenate(labels), COCO17)
        joints = np.full((many, 17, 3), np.nan)
        joints[: len(poses.joints)] = poses.joints
        parts.append(joints)
    everyone = np.concatenate(parts).reshape(count, people, 17, 3)
    distance = np.linalg.norm(everyone - scenes.joints, axis=-1)
    known = np.isfinite(distance)
    total = np.where(known, distance, 0.0).sum(axis=-1)
    paired = np.where((total <= LIMIT * known.sum(axis=-1))[..., None, None], everyone, np.nan)
    return Reconstruction(everyone, paired, np.full((count, people), np.nan))


def _rays(terms: Sequence[CameraTerms], chosen: slice, many: int) -> Rays:
    """Return the rays of the people of some scenes, ``many`` of them in each camera."""
    directions, scores = (
        np.concatenate([each.rays[k][chosen].reshape(many, *each.rays[k].shape[2:]) for each in terms])
        for k in range(2)
    )
    focal = [np.sqrt(each.camera.K[0, 0] * each.camera.K[1, 1]) for each in terms]
    return Rays(
        view=np.repeat(np.arange(len(terms)), many),
        origins=np.repeat([each.camera.center for each in terms], many, axis=0),
        directions=directions,
        weights=scores,
        pixel=np.repeat(1.0 / np.array(focal), many),
    )


def _by_variant(rig: Rig, terms: Sequence[CameraTerms], scenes: StandingScenes, variant: str) -> Reconstruction:
    """Return the estimates of a variant of the method."""
    pipeline = preset(variant)
    shape = (len(scenes), scenes.people)
    close, paired = np.full((*shape, 17, 3), np.nan), np.full((*shape, 17, 3), np.nan)
    mixed = np.zeros(shape)
    for s in range(len(scenes)):
        detections, person = _detections(terms, s)
        estimate = pipeline.estimate(rig, detections)
        truth = np.where(scenes.present[s][:, None, None], scenes.joints[s], np.nan)
        if len(estimate.joints):
            partner = nearest(mean_distances(coco17_to_shelf14(truth), coco17_to_shelf14(estimate.joints)))
            close[s] = np.where((partner >= 0)[:, None, None], estimate.joints[partner], np.nan)
            partner = pair(truth, estimate.joints, limit=LIMIT).estimate
            paired[s] = np.where((partner >= 0)[:, None, None], estimate.joints[partner], np.nan)
        labels = estimate.matching.labels_of(len(detections))
        for q in range(scenes.people):
            own = np.unique(labels[(person == q) & (labels >= 0)])
            mixed[s, q] = len(own) > 1 or (person[np.isin(labels, own)] != q).any()
    return Reconstruction(close, paired, mixed)


def _detections(terms: Sequence[CameraTerms], scene: int) -> tuple[Detections, NDArray[np.int64]]:
    """Return the detections of one scene in all cameras, ordered as detectors report them, and whom each shows."""
    columns: dict[str, list[NDArray]] = {key: [] for key in ("keypoints", "scores", "boxes", "box_scores", "person")}
    view = []
    for v, each in enumerate(terms):
        block = each.block
        slots = np.flatnonzero(block.present[scene, 0])
        slots = slots[np.argsort(-block.box_scores[scene, 0, slots], kind="stable")]
        for key, values in columns.items():
            values.append(getattr(block, key)[scene, 0, slots])
        view.append(np.full(len(slots), v))
    keypoints, scores, boxes, box_scores, person = (np.concatenate(each) for each in columns.values())
    return Detections(np.concatenate(view), keypoints, scores, boxes, box_scores, COCO17), person
