"""Predicted PCP of every subset of Shelf's five cameras beside that of the real detections.

    python -m benchmarks.planning.shelf_subsets FOLDER [--detector openpose-shelf] [--detector typical]

FOLDER holds the files of Shelf that ``scenarios/recordings/shelf.toml`` names. The prediction knows the calibration,
where four people walk (the true paths, smoothed by nothing), and a detector profile; it sees no detection. Nothing is
fitted to the subsets. PCP is that of ``full``, with missing joints of the head filled from the others, mean over the
three scored actors.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from mvpose import COCO17, SHELF14, Camera
from mvpose.arrays import Floats
from mvpose.skeleton import coco17_to_shelf14
from simharness.planning import FastLayer, Volume
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS
from simharness.reality.recording_file import read_recording
from simharness.reality.validation.head_joints import fill_face
from simharness.reality.validation.passes import Cameras, annotated, run_passes
from simharness.reality.validation.subsets import FILLED, camera_subsets
from simharness.scenario.presets import read_profile
from simharness.scoring.pcp import Part, part_states

Subset = tuple[int, ...]

_ANKLE = 0.09  # metres: height of the ankle of a standing person, in shoes
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
            f"Spearman: {self.rank():.3f} over all (bar .93), {self.rank(2):.3f} over pairs (bar .85); "
            f"mean absolute difference {self.mean_difference:.2f} (bar 3)"
        )
        for size in sorted({len(each) for each in self.real}):
            chosen, best = self.chosen(size)
            lines.append(
                f"best of {size}: predicted {chosen} with a real PCP of {self.real[chosen]:.1f}; really {best} with "
                f"{self.real[best]:.1f}: {self.real[best] - self.real[chosen]:.1f} lost (bar 1)"
            )
        return "\n".join(lines)


def real_pcp(recording: AnnotatedRecording, *, variant: str = "full") -> dict[Subset, float]:
    """Return the PCP of a variant on the real detections of every subset of two cameras and more."""
    subsets = camera_subsets(len(recording.rig))
    (passes,) = run_passes([annotated(recording)], [Cameras(each) for each in subsets], variants=(variant,))
    return {
        change.views: float(of_variant[variant].total().pcp(FILLED))
        for change, of_variant in passes.items()
        if isinstance(change, Cameras)
    }


def walked(recording: AnnotatedRecording) -> tuple[list[Camera], Floats]:
    """Return the cameras and the true paths over a floor at z = 0, COCO-17, (F, A, 17, 3); NaN where not annotated."""
    truth = recording.truth
    joints = np.full((*truth.shape[:2], len(COCO17), 3), np.nan)
    joints[:, :, LIMB_JOINTS] = truth[:, :, SHELF14_OF_LIMBS]
    ankles = [SHELF14.index(name) for name in ("right_ankle", "left_ankle")]
    floor = float(np.nanquantile(truth[:, :, ankles, 2].min(axis=-1), _STANDING)) - _ANKLE
    joints[..., 2] -= floor
    return [replace(camera, t=camera.t + camera.R[:, 2] * floor) for camera in recording.rig], joints


def everyone_stays(joints: Floats) -> Floats:
    """Return paths (F, A, 17, 3) on which those who are not annotated stay where they are next: four people work."""
    rows, result = np.arange(len(joints)), joints.copy()
    for actor in range(joints.shape[1]):
        known = np.isfinite(joints[:, actor, 5:17]).all(axis=(1, 2))
        result[:, actor] = joints[np.flatnonzero(known)[np.abs(rows[:, None] - rows[known]).argmin(axis=1)], actor]
    return result


def predicted_pcp(
    recording: AnnotatedRecording, *, detector: str, seed: int = 0, subsets: Sequence[Subset] = (), repeats: int = 16
) -> dict[Subset, float]:
    """Return the PCP of ``full`` that the fast layer predicts for every subset."""
    cameras, joints = walked(recording)
    layer = FastLayer.of(
        Volume.around(everyone_stays(joints)), detector=read_profile(detector), orientations=repeats, seed=seed
    )
    terms = [layer.terms(camera) for camera in cameras]
    scenes, result = layer.scenes, {}
    truth = coco17_to_shelf14(scenes.joints)
    for views in subsets or camera_subsets(len(cameras)):
        made = layer.reconstruct([terms[view] for view in views], variant="full")
        states = part_states(truth, coco17_to_shelf14(fill_face(made.nearest)))
        result[views] = float(100.0 * (states == Part.CORRECT)[:, list(recording.scored)].mean())
    return result


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--detector", action="append", help="profile; default: openpose-shelf and typical")
    arguments = parser.parse_args()
    recording = read_recording("shelf", arguments.folder)
    real = real_pcp(recording)
    for detector in arguments.detector or ("openpose-shelf", "typical"):
        print(f"\ndetector {detector}\n{SubsetFigures(real, predicted_pcp(recording, detector=detector))}")


if __name__ == "__main__":
    main()
