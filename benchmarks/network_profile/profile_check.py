"""A network beside simulated detectors on scenes that no profile has seen: the same pictures, people and cameras.

Where the whole 95 % interval of a difference is inside its bound, the prediction holds; where it is outside, it fails;
else nobody can tell.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import threadpoolctl

from mvpose import preset
from mvpose.arrays import Floats
from simharness.detector.detect import Detected
from simharness.reality.annotated_recording import AnnotatedRecording, DetectorKind
from simharness.reality.detector_fit.detector_sums import Trials
from simharness.reality.validation.verdicts import VerdictState, equivalence
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.sections.detector_section import KINDS, DetectorSection
from simharness.scoring.assessment import assess
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import GROUPS, percent
from simharness.statistics.intervals import Interval, mean_interval
from simharness.trial.conditioned_trial import estimate_frames
from tools.jackknife import pseudo_values
from tools.network_profile.error_curves import part_counts
from tools.network_profile.exact_labels import label_scenes
from tools.network_profile.profiled_scenes import ProfiledScene

NETWORK = "network"
SCORES = ("pcp", "recall", "ghosts", "mpjpe_mm", *(f"pcp_{group}" for group in GROUPS))
BOUNDS: Mapping[str, float] = {"pcp": 2.0, "contrast": 1.0, "subset": 3.0, "errors": 1 / 3}
"""Largest differences: PCP of a variant and of a part of the body, of a contrast, of a subset of the cameras, points;
of rates of errors, as a share of the network's."""

_SUBSETS_OF = ("full", "fast")
_MOST_SUBSETS = 10  # of each size
_ERRORS = ("inversion", "miss", "gross")
_FEWEST = 20  # errors of a kind of joint, in both, below which rates are not compared


@dataclass(frozen=True)
class SceneCheck:
    """Scores of one scene with each detector."""

    case: str
    """Condition of the scene."""
    scores: Mapping[str, Mapping[str, Mapping[str, float]]]
    """Score by detector, variant and key."""
    subsets: Mapping[str, Mapping[str, Mapping[tuple[int, ...], float]]]
    """PCP by detector, variant and cameras."""
    errors: Mapping[str, Mapping[str, Trials]]
    """Joints and errors by detector and class, (9,) each."""


class CheckedFigure(NamedTuple):
    """A figure of the network, and by how much that of a simulated detector differs from it."""

    network: float
    """Its mean over the scenes."""
    difference: Interval
    """Simulated minus network, paired by scene; of rates of errors their ratio."""
    bound: float | None = None
    """Largest difference that is accepted; None where none is."""

    @property
    def verdict(self) -> VerdictState | None:
        """Whether the difference is within the bound, by its interval."""
        if self.bound is None or not np.isfinite(self.difference.mean):
            return None
        return equivalence(self.difference.low, self.difference.high, -self.bound, self.bound)


@dataclass(frozen=True)
class ProfileCheck:
    """Comparison of detectors with the network."""

    scenes: tuple[SceneCheck, ...]
    """Results of each scene."""
    detectors: tuple[str, ...]
    """Names of the simulated detectors, the fitted profile first."""
    variants: tuple[str, ...]
    """Variants of the method."""

    def score(self, detector: str, variant: str, key: str, *, case: str | None = None) -> CheckedFigure:
        """Return a score of a variant; in one condition or in all."""
        return self._paired(
            lambda scene, name: scene.scores[name][variant][key],
            detector,
            case,
            BOUNDS["pcp"] if key.startswith("pcp") else None,
        )

    def contrast(self, detector: str, one: str, other: str) -> CheckedFigure:
        """Return the PCP of one variant less that of another."""
        return self._paired(
            lambda scene, name: scene.scores[name][one]["pcp"] - scene.scores[name][other]["pcp"],
            detector,
            None,
            BOUNDS["contrast"],
        )

    def subset(self, detector: str, variant: str, cameras: tuple[int, ...]) -> CheckedFigure:
        """Return the PCP of a variant with some of the cameras."""
        return self._paired(lambda scene, name: scene.subsets[name][variant][cameras], detector, None, BOUNDS["subset"])

    def error(self, detector: str, error: str, kind: int) -> CheckedFigure:
        """Return the rate of a class of errors at a kind of joint, and the ratio of both rates less one."""
        counts = np.array(
            [
                [[each.n[kind], each.k[kind]] for each in (scene.errors[name][error] for name in (NETWORK, detector))]
                for scene in self.scenes
            ]
        )  # (scenes, 2, 2)

        def ratio(sums: Floats) -> Floats:
            with np.errstate(invalid="ignore", divide="ignore"):
                return np.asarray((sums[..., 1, 1] / sums[..., 1, 0]) / (sums[..., 0, 1] / sums[..., 0, 0]))

        whole = counts.sum(axis=0)
        rate = float(whole[0, 1] / whole[0, 0]) if whole[0, 0] else np.nan
        if len(counts) < 2 or whole[:, 1].max() < _FEWEST or not whole[0, 1]:
            return CheckedFigure(rate, Interval(np.nan, np.nan, np.nan, 0))
        values = pseudo_values(ratio, counts)
        n, mean = len(counts), float(ratio(whole)) - 1
        half = 1.96 * float(np.std(values, ddof=1)) / n**0.5
        return CheckedFigure(rate, Interval(mean, mean - half, mean + half, n), BOUNDS["errors"])

    @property
    def verdicts(self) -> dict[str, list[VerdictState]]:
        """Verdicts about the fitted profile, by group of figures."""
        name = self.detectors[0]
        cases = dict.fromkeys(scene.case for scene in self.scenes)
        groups: dict[str, list[CheckedFigure]] = {
            "PCP of variants": [self.score(name, variant, "pcp") for variant in self.variants],
            "PCP of variants by condition": [
                self.score(name, variant, "pcp", case=case) for variant in self.variants for case in cases
            ],
            "PCP of parts": [
                self.score(name, variant, f"pcp_{group}") for variant in self.variants for group in GROUPS
            ],
            "contrasts": [self.contrast(name, *pair) for pair in combinations(self.variants, 2)],
            "subsets of cameras": [
                self.subset(name, variant, cameras)
                for variant, of in self.scenes[0].subsets[name].items()
                for cameras in of
            ],
            "errors by part": [self.error(name, error, kind) for error in _ERRORS for kind in range(len(KINDS))],
        }
        return {group: [each.verdict for each in figures if each.verdict] for group, figures in groups.items()}

    def summary(self) -> dict[str, Any]:
        """Return all figures ready for JSON."""

        def plain(figure: CheckedFigure) -> dict[str, Any]:
            numbers = {
                "network": figure.network,
                "difference": figure.difference.mean,
                "low": figure.difference.low,
                "high": figure.difference.high,
            }
            clean = {key: float(value) if np.isfinite(value) else None for key, value in numbers.items()}
            return {**clean, "verdict": figure.verdict}

        cases = dict.fromkeys(scene.case for scene in self.scenes)
        return {
            "scenes": len(self.scenes),
            "verdicts": {group: {each: of.count(each) for each in VerdictState} for group, of in self.verdicts.items()},
            "detectors": {
                name: {
                    "scores": {v: {key: plain(self.score(name, v, key)) for key in SCORES} for v in self.variants},
                    "conditions": {
                        v: {case: plain(self.score(name, v, "pcp", case=case)) for case in cases} for v in self.variants
                    },
                    "contrasts": {
                        f"{one} - {other}": plain(self.contrast(name, one, other))
                        for one, other in combinations(self.variants, 2)
                    },
                    "subsets": {
                        v: {" ".join(map(str, cameras)): plain(self.subset(name, v, cameras)) for cameras in of}
                        for v, of in self.scenes[0].subsets.get(name, {}).items()
                    },
                    "errors": {
                        error: {KINDS[kind]: plain(self.error(name, error, kind)) for kind in range(len(KINDS))}
                        for error in _ERRORS
                    },
                }
                for name in self.detectors
            },
        }

    def _paired(
        self, value: Callable[[SceneCheck, str], float], detector: str, case: str | None, bound: float | None
    ) -> CheckedFigure:
        scenes = [scene for scene in self.scenes if case is None or scene.case == case]
        network = np.array([value(scene, NETWORK) for scene in scenes], float)
        simulated = np.array([value(scene, detector) for scene in scenes], float)
        mean = float(np.nanmean(network)) if np.isfinite(network).any() else np.nan
        return CheckedFigure(mean, mean_interval(simulated - network), bound)


def check_profile(
    scenes: Sequence[ProfiledScene],
    detectors: Mapping[str, DetectorSection],
    *,
    kind: DetectorKind,
    bias: Floats,
    workers: int = 1,
    progress: Callable[[int], None] = lambda scenes: None,
) -> ProfileCheck:
    """Score variants of the method on what a network finds in scenes, and on what simulated detectors find.

    Args:
        scenes: scenes that no profile has seen. Their scenarios name the variants.
        detectors: simulated detectors by name, the fitted profile first; subsets of cameras are those of this one.
        kind: kind of the network.
        bias: offset of the network's joints by kind, (9, 3) metres.
        workers: number of processes.
        progress: called with the number of finished scenes.

    Raises:
        RunError: a variant fails.
    """
    job = _Checking(tuple(scenes), dict(detectors), kind, bias)
    ranges = [(range(k, k + 1),) for k in range(len(scenes))]
    done = map_jobs(job, ranges, workers=workers, progress=progress)
    return ProfileCheck(tuple(done), tuple(detectors), scenes[0].scenario.method.variants)


@dataclass(frozen=True)
class _Checking:
    """Scenes by index; a function of :func:`simharness.runtime.frame_pool.map_jobs`."""

    scenes: tuple[ProfiledScene, ...]
    detectors: Mapping[str, DetectorSection]
    kind: DetectorKind
    bias: Floats

    def __call__(self, frames: range, /) -> SceneCheck:
        """Return the scores of the scene with each detector."""
        scene = self.scenes[frames.start]
        fitted = next(iter(self.detectors))
        results = {NETWORK: scene.found, **{name: scene.simulated(each) for name, each in self.detectors.items()}}
        scores, subsets, errors = {}, {}, {}
        with threadpoolctl.threadpool_limits(1):
            for name, detected in results.items():
                scores[name] = {
                    variant: _scores(scene, detected, variant) for variant in scene.scenario.method.variants
                }
                labels = label_scenes([scene], [detected], kind=self.kind, bias=self.bias)
                errors[name] = part_counts(labels)
                if name in (NETWORK, fitted):
                    subsets[name] = {
                        variant: _subset_pcp(scene, detected, variant)
                        for variant in _SUBSETS_OF
                        if variant in scene.scenario.method.variants
                    }
        return SceneCheck(scene.case, scores, subsets, errors)


def _scores(scene: ProfiledScene, detected: Sequence[Detected], variant: str) -> dict[str, float]:
    """Return the scores of a variant."""
    recording = scene.recording(detected)
    estimates = estimate_frames(preset(variant), recording.rig, recording.detections)
    scores = assess(recording, estimates).scores
    return {key: np.nan if scores[key] is None else float(scores[key] or 0.0) for key in SCORES}


def _subset_pcp(scene: ProfiledScene, detected: Sequence[Detected], variant: str) -> dict[tuple[int, ...], float]:
    """Return the PCP of a variant by cameras, of at most ten subsets of each size."""
    recording = scene.recording(detected)
    size, truth = len(detected), np.stack([each.truth.joints for each in detected])
    whole = AnnotatedRecording(recording.rig, np.zeros((size, 0, 14, 3)), recording.detections, np.arange(size))
    result = {}
    for count in range(2, len(recording.rig)):
        for cameras in list(combinations(range(len(recording.rig)), count))[:_MOST_SUBSETS]:
            part = whole.subset(cameras)
            estimates = estimate_frames(preset(variant), part.rig, part.detections)
            scores = score_frames(truth, [each.joints for each in estimates])
            value = percent(scores.parts)
            result[cameras] = np.nan if value is None else value
    return result
