"""What the detections of a recording show: the annotated people, others, and nobody."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from mvpose import COCO17, SHELF14, Detections
from mvpose.arrays import Bools, Floats
from simharness.detector.viewing_conditions import OCCLUDED, OUTSIDE
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.association import Association, associate
from simharness.reality.detector_fit.occlusion import complete_face, in_picture, occlusion_classes, person_boxes
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample

_OF_SHELF14 = [SHELF14.index(COCO17.joints[joint]) for joint in LIMB_JOINTS]


@dataclass(frozen=True)
class ShownPeople:
    """Detections of a recording by the annotated person whom they show.

    Attributes:
        recording: the recording.
        reference: limb joints of the actors, COCO-17, (F, A, 17, 3) metres; NaN where not annotated, and in the face.
        association: detections by actor.
        triangulated: joints of the actors, the points nearest to the rays of all views, each of equal weight,
            (F, A, 17, 3) metres; NaN with fewer than two views. They are not robust on purpose: they show gross errors.
        inside: which joints lie on the pictures, (F, V, A, 17).
        behind: which of these are hidden by another person, (F, V, A, 17).
    """

    recording: AnnotatedRecording
    reference: Floats
    association: Association
    triangulated: Floats
    inside: Bools
    behind: Bools

    @property
    def annotated(self) -> Bools:
        """Which actors are annotated, (F, A)."""
        return cast(Bools, np.isfinite(self.reference[:, :, LIMB_JOINTS, 0]).all(axis=-1))


def shown_people(recording: AnnotatedRecording) -> ShownPeople:
    """Find out whom the detections show, by the distance of their limb joints from those of the truth.

    A person with some unknown limb joints counts as not annotated.
    """
    reference = np.full((*recording.truth.shape[:2], len(COCO17), 3), np.nan)
    reference[:, :, LIMB_JOINTS] = recording.truth[:, :, _OF_SHELF14]
    reference[~np.all(np.isfinite(reference[:, :, LIMB_JOINTS]), axis=(2, 3))] = np.nan
    rig = recording.rig
    pixels = np.stack([camera.project(reference) for camera in rig], axis=1)
    sample = Sample(recording.name, rig, np.arange(len(recording)) / recording.rate, reference, recording.detections)
    association = associate(sample, pixels, person_boxes(reference, rig))
    triangulated = _triangulate(recording, association)
    joints, normals = complete_face(reference, association.consensus)
    classes = occlusion_classes(joints, normals, association.unannotated, rig)
    known = np.all(np.isfinite(joints), axis=-1)[:, None]
    inside = in_picture(joints, rig) & known & (classes != OUTSIDE)
    return ShownPeople(recording, reference, association, triangulated, inside, inside & (classes == OCCLUDED))


def people_detections(association: Association, frame: int) -> tuple[Detections, np.ndarray]:
    """Return the detections of annotated people in a frame, and the actor of each, (m,)."""
    view, actor = np.nonzero(association.detected[frame])
    keypoints, scores = association.keypoints[frame, view, actor], association.scores[frame, view, actor]
    return Detections.from_keypoints(view, keypoints, scores), actor


def _triangulate(recording: AnnotatedRecording, association: Association) -> Floats:
    """Return the points nearest to the rays of all views, in the sense of least squares, (F, A, 17, 3) metres."""
    rig = recording.rig
    rays = np.stack([camera.rays(association.keypoints[:, view]) for view, camera in enumerate(rig)], axis=1)
    reported = np.all(np.isfinite(rays), axis=-1)
    rays = np.where(reported[..., None], rays, 0.0)
    across = np.where(reported[..., None, None], np.eye(3) - rays[..., :, None] * rays[..., None, :], 0.0)
    matrix, target = across.sum(axis=1), np.einsum("fvajxy,vy->fajx", across, rig.centers)
    enough = reported.sum(axis=1) >= 2
    result = np.full(target.shape, np.nan)
    result[enough] = np.linalg.solve(matrix[enough], target[enough][..., None])[..., 0]
    return result
