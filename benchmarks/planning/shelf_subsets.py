"""Predicted PCP of every subset of Shelf's five cameras beside that of the real detections.

    python -m benchmarks.planning.shelf_subsets FOLDER [--detector openpose-shelf] [--detector typical]

FOLDER holds the files of Shelf that ``scenarios/recordings/shelf.toml`` names. The prediction knows the calibration, a
detector profile, and where four people walk: the true paths of those who are annotated (1.7 of 4 people in a frame), or
the paths of everybody as they are tracked. The recording is scored against a truth that has errors, measured by
``simharness fit-detector`` against the consensus of three views and more, and so is the prediction. Nothing is fitted
to the subsets. PCP is that of ``full``, with missing joints of the head filled from the others, mean over the three
scored actors.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from benchmarks.planning.recorded_scenes import recorded_scenes
from mvpose import COCO17, SHELF14, Camera
from mvpose.arrays import Bools, Floats
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.viewing_conditions import world_offsets
from simharness.planning import FastLayer, Volume
from simharness.planning.fast_layer import reconstruct
from simharness.planning.standing_people import pose_pool
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationModel
from simharness.reality.detector_fit.fit import fit
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS, track_people
from simharness.reality.recording_file import read_recording
from simharness.reality.validation.passes import CameraSubset, annotated, run_passes
from simharness.reality.validation.variant_comparison import FILLED, camera_subsets
from simharness.scenario.presets import read_profile
from simharness.scoring.frame_scores import fill_face
from simharness.scoring.pcp import Part, part_states

Subset = tuple[int, ...]

_ANKLE = 0.09  # metres: height of the ankle of a standing person, in shoes
_FACE = slice(5)  # of COCO-17
_LIMBS_14 = slice(12)  # limb joints of SHELF14; the head follows
_STANDING = 0.25  # quantile of the heights of the lower ankle


@dataclass(frozen=True)
class SubsetFigures:
    """Predicted and real PCP of subsets of cameras, and the figures by which a prediction is judged.

    Attributes:
        real, predicted: PCP by subset, percent.
    """

    real: Mapping[Subset, float]
    predicted: Mapping[Subset, float]

    def rank(self, size: int = 0) -> float:
        """Return Spearman's correlation over the subsets of one size; 0: over all."""
        chosen = [each for each in self.real if size in (0, len(each))]
        return float(spearmanr([self.real[each] for each in chosen], [self.predicted[each] for each in chosen])[0])

    @property
    def mean_difference(self) -> float:
        """Mean absolute difference over all subsets, points."""
        return float(np.mean([abs(self.predicted[each] - pcp) for each, pcp in self.real.items()]))

    def chosen(self, size: int) -> tuple[Subset, Subset]:
        """Return the subset of a size that is predicted to be best, and the one that really is."""
        of_size = [each for each in self.real if len(each) == size]
        return max(of_size, key=lambda each: self.predicted[each]), max(of_size, key=lambda each: self.real[each])

    def __str__(self) -> str:
        lines = [
            f"{each!s:17} real {self.real[each]:5.1f}  predicted {self.predicted[each]:5.1f}" for each in self.real
        ]
        lines.append(
            f"Spearman: {self.rank():.3f} over all (bound .93), {self.rank(2):.3f} over pairs (bound .85); "
            f"mean absolute difference {self.mean_difference:.2f} (bound 3)"
        )
        for size in sorted({len(each) for each in self.real}):
            chosen, best = self.chosen(size)
            lines.append(
                f"best of {size}: predicted {chosen} with a real PCP of {self.real[chosen]:.1f}; really {best} with "
                f"{self.real[best]:.1f}: {self.real[best] - self.real[chosen]:.1f} lost (bound 1)"
            )
        return "\n".join(lines)


def real_pcp(recording: AnnotatedRecording, *, variant: str = "full") -> dict[Subset, float]:
    """Return the PCP of a variant on the real detections of every subset of two cameras and more."""
    subsets = camera_subsets(len(recording.rig))
    (passes,) = run_passes([annotated(recording)], [CameraSubset(each) for each in subsets], variants=(variant,))
    return {
        change.views: float(of_variant[variant].total().pcp(FILLED))
        for change, of_variant in passes.items()
        if isinstance(change, CameraSubset)
    }


@dataclass(frozen=True)
class WalkingPeople:
    """Where people walk in a recording, over a floor at z = 0.

    Attributes:
        cameras: the cameras, over the same floor.
        joints: COCO-17, (F, A, 17, 3), metres.
        scored: who is annotated in which frames, and therefore scored, (F, A).
    """

    cameras: tuple[Camera, ...]
    joints: Floats
    scored: Bools


def annotated_people(recording: AnnotatedRecording) -> WalkingPeople:
    """Return the true paths; people who are not annotated stay where the truth knows them next.

    This knows nothing but the truth, which is silent on people whom some camera does not show whole.
    """
    truth = recording.truth
    joints = np.full((*truth.shape[:2], len(COCO17), 3), np.nan)
    joints[:, :, LIMB_JOINTS] = truth[:, :, SHELF14_OF_LIMBS]
    known = np.asarray(np.isfinite(joints[:, :, LIMB_JOINTS]).all(axis=(2, 3)))
    rows, filled = np.arange(len(joints)), joints.copy()
    for actor in range(joints.shape[1]):
        frames = np.flatnonzero(known[:, actor])
        filled[:, actor] = joints[frames[np.abs(rows[:, None] - frames).argmin(axis=1)], actor]
    return _over_the_floor(recording, filled, known)


def tracked_people(recording: AnnotatedRecording) -> WalkingPeople:
    """Return the paths of everybody, annotated or not, as the method tracks them with all cameras.

    They come from the detections, but say only who is where: what a planner knows who has seen the people work.
    """
    tracked = track_people(recording)
    known = np.asarray(np.isfinite(recording.truth[:, :, _LIMBS_14]).all(axis=(2, 3)))
    people = [int(np.flatnonzero(tracked.ids == actor)[0]) for actor in range(recording.people)]
    return _over_the_floor(recording, tracked.joints[:, people], known)


def _over_the_floor(recording: AnnotatedRecording, joints: Floats, scored: Bools) -> WalkingPeople:
    """Return people and cameras with the floor at z = 0, an ankle's height under the ankles of standing people."""
    ankles = [SHELF14.index(name) for name in ("right_ankle", "left_ankle")]
    floor = float(np.nanquantile(recording.truth[:, :, ankles, 2].min(axis=-1), _STANDING)) - _ANKLE
    cameras = tuple(replace(camera, t=camera.t + camera.R[:, 2] * floor) for camera in recording.rig)
    return WalkingPeople(cameras, joints - [0.0, 0.0, floor], scored)


def predicted_pcp(
    people: WalkingPeople,
    actors: Sequence[int],
    *,
    detector: str,
    annotation: AnnotationModel | None = None,
    seed: int = 0,
    repeats: int = 96,
) -> dict[Subset, float]:
    """Return the PCP of ``full`` that the fast layer predicts for every subset, mean over actors.

    Args:
        people: where people walk.
        actors: indices of the actors whose PCP is averaged.
        detector: profile.
        annotation: errors of the truth by which the recording is scored; None: an exact truth.
        seed: seed of all draws.
        repeats: number of people at each place.
    """
    volume = Volume.around(people.joints)
    scenes, frames = recorded_scenes(people.joints, pose_pool(), volume.places(0.5), repeats=repeats, seed=seed)
    layer = FastLayer(volume, scenes, read_profile(detector), seed=seed)
    terms, result = [layer.terms(camera) for camera in people.cameras], {}
    truth = coco17_to_shelf14(scenes.joints)
    if annotation is not None:
        shown = scenes.joints.copy()  # annotated heads are fitted to the detected face, as in twins
        shown[:, :, _FACE] += world_offsets(shown, layer.detector.bias)[:, :, _FACE]
        truth = annotation.annotate(
            shown, np.arange(0.0, 10.0 * len(scenes), 10.0), seed=seed
        )  # errors last less than 10 s
    scored = people.scored[frames] & scenes.present
    for views in camera_subsets(len(people.cameras)):
        made = reconstruct([terms[view] for view in views], variant="full")
        correct = part_states(truth, coco17_to_shelf14(fill_face(made.nearest))) == Part.CORRECT
        result[views] = float(np.mean([100.0 * correct[:, actor][scored[:, actor]].mean() for actor in actors]))
    return result


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--exact-truth", action="store_true", help="score the prediction against an exact truth")
    parser.add_argument("--detector", action="append", help="profile; default: openpose-shelf and typical")
    arguments = parser.parse_args()
    recording = read_recording("shelf", arguments.folder)
    real = real_pcp(recording)
    annotation = None if arguments.exact_truth else fit(recording).annotation.annotation
    for name, paths in (("annotated", annotated_people), ("tracked", tracked_people)):
        people = paths(recording)
        for detector in arguments.detector or ("openpose-shelf", "typical"):
            predicted = predicted_pcp(people, recording.scored, detector=detector, annotation=annotation)
            print(f"\n{name} people, detector {detector}\n{SubsetFigures(real, predicted)}", flush=True)


if __name__ == "__main__":
    main()
