"""Figures of the detections of a recording, beside those of its twins: what a sceptic compares between two recordings.

They need no estimates of the method. Each is a ratio of sums over frames, so that its interval comes from a bootstrap,
or the variation of bone lengths.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from mvpose import COCO17, SHELF14, Detections
from mvpose.affinity import FusedAffinity
from mvpose.arrays import Bools, Floats
from mvpose.rays import viewing_rays
from simharness.detector.viewing_conditions import OCCLUDED, OUTSIDE, oks_units
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.association import Association, associate
from simharness.reality.detector_fit.occlusion import complete_face, in_picture, occlusion_classes, person_boxes
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample
from simharness.reality.validation.evidence import Compared, Ratio, by_frame, compared
from simharness.reality.validation.view_disagreement import view_disagreement
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS

TREE = {
    "wrist|elbow": ((9, 7), (10, 8)),
    "elbow|shoulder": ((7, 5), (8, 6)),
    "ankle|knee": ((15, 13), (16, 14)),
    "knee|hip": ((13, 11), (14, 12)),
}
"""Joints of COCO-17 (child, parent) on both sides, by the name of P(child missing | parent missing)."""

BONES = {
    "shank": ((13, 15), (14, 16)),
    "thigh": ((11, 13), (12, 14)),
    "forearm": ((7, 9), (8, 10)),
    "upper arm": ((5, 7), (6, 8)),
}
"""Joints of COCO-17 at the ends of each bone, on both sides."""

AMBIGUOUS = 0.5
"""Affinity from which the method may match two detections."""

_OF_SHELF14 = [SHELF14.index(COCO17.joints[joint]) for joint in LIMB_JOINTS]
_EARS = slice(3, 5)
_MAD_TO_DEVIATION = 1.4826  # of a normal distribution
_IN_PICTURE = 0.5  # share of a person's limb joints on the picture, from which a detection is expected
_SCORE_QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True)
class DetectionFigures:
    """Figures of the detections of a recording of F frames."""

    ratios: Mapping[str, Ratio]
    """Ratios by key: ``affinity.different`` (share of pairs of detections of different people, in different views, with
    an affinity above 0.5), ``affinity.same`` (share of pairs of one person below 0.5), ``behind`` (share of limb joints
    of annotated people in the pictures that another person hides), ``ears`` (share of ears that fewer than two views
    report), ``tree.CHILD|PARENT`` (share of missing children where the parent is missing), ``missing.KIND`` (share of
    joints in the picture that detections of annotated people do not report), ``detected`` and ``detected_views.VIEW``
    (share of people in a picture who are detected, in all views and in one, numbered from 1), ``phantoms`` (detections
    of nobody, per view and frame), ``others`` (people who are not annotated, per frame), and those of
    :func:`.view_disagreement`."""
    bones: Floats
    """Length of every bone of every actor, (F, A, 2 sides, 4), mm, from joints triangulated from all detections; NaN
    where unknown. In the order of :data:`BONES`."""
    true_bones: Floats
    """The same from the truth."""
    scores: tuple[float, ...]
    """10, 50 and 90 % quantiles of the scores of reported limb joints."""

    def values(self) -> dict[str, float]:
        """Return all numbers by key; also ``bones.BONE`` and ``true_bones.BONE``, mm, and ``score.q10`` and so on."""
        result = {key: ratio.value for key, ratio in self.ratios.items()}
        for name, lengths in (("bones", self.bones), ("true_bones", self.true_bones)):
            spreads = bone_variation(lengths)
            result |= {f"{name}.{bone}": float(each) for bone, each in zip(BONES, spreads, strict=True)}
        return result | {f"score.q{100 * q:.0f}": each for q, each in zip(_SCORE_QUANTILES, self.scores, strict=True)}


@dataclass(frozen=True)
class ShownPeople:
    """Detections of a recording by the annotated person whom they show."""

    recording: AnnotatedRecording
    """The recording."""
    reference: Floats
    """Limb joints of the actors, COCO-17, (F, A, 17, 3) metres; NaN where not annotated, and in the face."""
    association: Association
    """Detections by actor."""
    triangulated: Floats
    """Joints of the actors, the points nearest to the rays of all views, each of equal weight, (F, A, 17, 3) metres;
    NaN with fewer than two views. They are not robust on purpose: they show gross errors."""
    inside: Bools
    """Which joints lie on the pictures, (F, V, A, 17)."""
    behind: Bools
    """Which of these are hidden by another person, (F, V, A, 17)."""

    @property
    def annotated(self) -> Bools:
        """Which actors are annotated, (F, A)."""
        return cast(Bools, np.isfinite(self.reference[:, :, LIMB_JOINTS, 0]).all(axis=-1))


def measure_detections(recording: AnnotatedRecording) -> DetectionFigures:
    """Measure the detections of a recording; see :class:`DetectionFigures`."""
    shown = shown_people(recording)
    reported = shown.association.scores[..., LIMB_JOINTS]
    reported = reported[reported > 0]
    unit = oks_units(person_boxes(shown.reference, recording.rig))
    step = np.diff(recording.frames, prepend=-(10**9))
    apart = view_disagreement(
        recording.rig, shown.association.keypoints, unit, shown.reference, step == step.min(initial=10**9)
    )
    return DetectionFigures(
        ratios={**_ambiguity(_affinities(shown)), **_hidden(shown), **_missing(shown), **_people(shown), **apart},
        bones=_bone_lengths(np.where(shown.annotated[..., None, None], shown.triangulated, np.nan)),
        true_bones=_bone_lengths(shown.reference),
        scores=tuple(float(np.quantile(reported, q)) if reported.size else float("nan") for q in _SCORE_QUANTILES),
    )


def compare_detections(
    real: DetectionFigures, twins: Sequence[DetectionFigures], weights: Floats
) -> dict[str, Compared]:
    """Return all measurements of a recording beside those of its twins, by the keys of ``DetectionFigures.values``.

    Args:
        real: measurements of the recording of F frames.
        twins: measurements of the twins.
        weights: bootstrap weights of the recording's frames, (R, F).
    """
    resamples: dict[str, Floats] = {key: ratio.resampled(weights) for key, ratio in real.ratios.items()}
    for name, lengths in (("bones", real.bones), ("true_bones", real.true_bones)):
        drawn = np.stack([bone_variation(np.repeat(lengths, row.astype(int), axis=0)) for row in weights], axis=-1)
        keys = [key for key in real.values() if key.startswith(f"{name}.")]
        resamples |= dict(zip(keys, drawn, strict=True))
    values, of_twins = real.values(), [each.values() for each in twins]
    return {
        key: compared(value, resamples.get(key, np.array([np.nan])), [twin[key] for twin in of_twins])
        for key, value in values.items()
    }


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


def bone_variation(lengths: Floats) -> Floats:
    """Return the standard deviation over time of bone lengths, from the median absolute deviation, (4,).

    Args:
        lengths: lengths (F, A, 2, 4); NaN where unknown.

    Returns:
        Means over actors and sides, in the unit of the lengths; NaN without any bone.
    """
    known = np.isfinite(lengths).any(axis=0)
    lengths = np.where(known, lengths, 0.0)  # without empty columns, which nanmedian warns about
    deviation = _MAD_TO_DEVIATION * np.nanmedian(np.abs(lengths - np.nanmedian(lengths, axis=0)), axis=0)
    count = known.sum(axis=(0, 1))
    total = np.where(known, deviation, 0.0).sum(axis=(0, 1))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _affinities(shown: ShownPeople) -> dict[str, list[Floats]]:
    """Return the affinities of pairs of detections of annotated people in different views, by frame."""
    affinity, rig = FusedAffinity(), shown.recording.rig
    result: dict[str, list[Floats]] = {"same": [], "different": []}
    for frame in range(len(shown.recording)):
        found, actor = people_detections(shown.association, frame)
        matrix = affinity(rig, found, viewing_rays(rig, found))
        one, other = np.triu_indices(len(found), 1)
        one, other = (each[found.view[one] != found.view[other]] for each in (one, other))
        same = actor[one] == actor[other]
        result["same"].append(matrix[one, other][same])
        result["different"].append(matrix[one, other][~same])
    return result


def _ambiguity(affinities: Mapping[str, list[Floats]]) -> dict[str, Ratio]:
    same, different = affinities["same"], affinities["different"]
    return {
        "affinity.different": _ratio([each > AMBIGUOUS for each in different]),
        "affinity.same": _ratio([each < AMBIGUOUS for each in same]),
    }


def _ratio(events: list[Bools]) -> Ratio:
    """Return the share of events among the trials of each frame."""
    return Ratio(np.array([each.sum() for each in events], float), np.array([each.size for each in events], float))


def _hidden(shown: ShownPeople) -> dict[str, Ratio]:
    limbs = shown.inside[..., LIMB_JOINTS], shown.behind[..., LIMB_JOINTS]
    views = (shown.association.scores[..., _EARS] > 0).sum(axis=1)  # (F, A, 2)
    return {
        "behind": Ratio(by_frame(limbs[1]), by_frame(limbs[0])),
        "ears": Ratio(by_frame((views < 2) & shown.annotated[..., None]), 2 * by_frame(shown.annotated)),
    }


def _missing(shown: ShownPeople) -> dict[str, Ratio]:
    detected = shown.association.detected[..., None]
    missing = (shown.association.scores == 0) & detected
    result = {}
    for name, pairs in TREE.items():
        children, parents = (list(each) for each in zip(*pairs, strict=True))
        parent = missing[..., parents]
        result[f"tree.{name}"] = Ratio(by_frame(parent & missing[..., children]), by_frame(parent))
    kinds = np.array(KIND_OF_JOINT)
    for index, kind in enumerate(KINDS):
        expected = (shown.inside & detected)[..., kinds == index]
        result[f"missing.{kind}"] = Ratio(by_frame(expected & missing[..., kinds == index]), by_frame(expected))
    return result


def _people(shown: ShownPeople) -> dict[str, Ratio]:
    expected = shown.inside[..., LIMB_JOINTS].mean(axis=-1) > _IN_PICTURE
    frames, views = expected.shape[:2]
    others = np.any(np.isfinite(shown.association.unannotated), axis=(2, 3))
    found = expected & shown.association.detected
    by_view = {
        f"detected_views.{view + 1}": Ratio(by_frame(found[:, view]), by_frame(expected[:, view]))
        for view in range(views)
    }
    return {
        "detected": Ratio(by_frame(found), by_frame(expected)),
        **by_view,
        "phantoms": Ratio(by_frame(shown.association.false), np.full(frames, float(views))),
        "others": Ratio(by_frame(others), np.ones(frames)),
    }


def _bone_lengths(joints: Floats) -> Floats:
    """Return the lengths of bones in mm, (F, A, 2, 4), of joints (F, A, 17, 3) in metres."""
    ends = np.array(list(BONES.values()))  # (4, 2 sides, 2 ends)
    lengths = np.linalg.norm(joints[:, :, ends[..., 0]] - joints[:, :, ends[..., 1]], axis=-1)
    return 1000.0 * np.swapaxes(lengths, 2, 3)


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
