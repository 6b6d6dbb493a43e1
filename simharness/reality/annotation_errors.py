"""Annotation: the errors of a truth that people made.

Published truth of real recordings is clicked by people. It differs from the joints of a body by a shift of each joint
that stays the same for an actor, and by a random part that changes from frame to frame and has a memory. A simulated
recording that is to be scored as a real one needs a truth with the same errors; everywhere else the truth is exact.
"""

import warnings
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mvpose import SHELF14, Rig
from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.viewing_conditions import SIDE, body_axes
from simharness.reality.detector_fit.consensus import Consensus
from simharness.reality.detector_fit.frame_sums import lags
from simharness.reality.detector_fit.tetrachoric import fit_noisy_life
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS, SMOOTHING, actors_of
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS
from simharness.scenario.sections.scenario import AnnotationSection, Scenario
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence

_LIMBS = len(LIMB_JOINTS)  # limb joints of SHELF14 come first, then the head
_AGREEING = 3  # views that have to agree on a joint that the truth is compared with
_FEWEST = 10  # frames in which an actor's joint has to be compared to say something about it
_SHIFT_ROUNDS = 2
_STEADIEST = 0.5  # of the usual deviation

# Left and right of each joint of SHELF14: 1 for left joints and the head, -1 for right ones.
_SIDE14 = np.ones(len(SHELF14))
_SIDE14[SHELF14_OF_LIMBS] = SIDE[LIMB_JOINTS]


@dataclass(frozen=True)
class AnnotationModel:
    """Errors of the annotated joints of A actors, on SHELF14."""

    shift: Floats
    """Mean offset of each annotated joint from the true one in the body's frame, forward, left and up, (A, 14, 3)
    metres. For the head: from the joints of the head that the rule of VoxelPose computes from the true face."""
    deviation: Floats
    """Standard deviation of the random part of each joint along each axis, (A, 14) metres."""
    life: float
    """Correlation time of the random part, seconds."""
    noise: float
    """Share of the variance of the random part that is drawn anew in every frame."""

    @classmethod
    def drawn(cls, config: AnnotationSection, actors: int, *, seed: int) -> Self:
        """Return the errors of a simulated annotation of A actors, whose shifts are drawn.

        Args:
            config: section of the scenario.
            actors: number of actors.
            seed: seed of the scenario.
        """
        shift = config.shift * stream(seed, "annotation", "shift").standard_normal((actors, len(SHELF14), 3))
        return cls(shift, np.full((actors, len(SHELF14)), config.random), config.life, config.noise)

    def annotate(self, joints: Floats, time: Floats, *, seed: int, base: Floats | None = None) -> Floats:
        """Return the annotation of true joints, (F, A, 14, 3) metres.

        Args:
            joints: true joints of the actors, COCO-17, (F, A, 17, 3) metres; NaN where an actor is not annotated.
            time: times of the frames, (F,) seconds, increasing.
            seed: seed of the random part.
            base: true joints on SHELF14; None: those of ``joints``, with the head by the rule of VoxelPose.
        """
        base = coco17_to_shelf14(joints) if base is None else base
        shift = np.einsum("ajk,fakc->fajc", self.shift, body_axes(joints))
        return base + shift + self._random(time, seed)

    def _random(self, time: Floats, seed: int) -> Floats:
        """Draw the random part, (F, A, 14, 3) metres."""
        actors = len(self.shift)
        step = float(np.diff(time).min(initial=np.inf))
        # The memory runs on a regular clock, so that gaps between frames count as they last.
        ticks = np.round((time - time[0]) / step).astype(int) if len(time) > 1 else np.zeros(1, int)
        shape = (ticks[-1] + 1, actors, len(SHELF14), 3)
        slow = stream(seed, "annotation", "slow").standard_normal(shape)
        fast = stream(seed, "annotation", "fast").standard_normal(shape)
        kept = np.exp(-step / self.life) if self.life > 0 and len(time) > 1 else 0.0
        slow[1:] *= np.sqrt(1 - kept**2)
        slow = lfilter([1.0], [1.0, -kept], slow, axis=0)
        drawn = np.sqrt(1 - self.noise) * slow + np.sqrt(self.noise) * fast
        return np.asarray(drawn[ticks] * self.deviation[..., None])


def annotate_simulation(scenario: Scenario, sequence: Sequence, rig: Rig) -> Floats:
    """Return the truth of a simulated recording as annotators would publish it, (T, P, 14, 3) metres, NaN where not.

    Args:
        scenario: its section ``[annotation]`` says how.
        sequence: true poses.
        rig: the cameras.
    """
    config, truth = scenario.annotation, sequence.of_skeleton(SHELF14)
    if config.shift or config.random:
        model = AnnotationModel.drawn(config, truth.shape[1], seed=scenario.seed)
        truth = model.annotate(sequence.joints, sequence.time, seed=scenario.seed, base=truth)
    if config.people == "whole":
        limbs = sequence.of_skeleton(SHELF14)[..., :_LIMBS, :]
        inside = np.stack([camera.inside(camera.project(limbs)).all(axis=-1) for camera in rig])
        truth[inside.sum(axis=0) < max(2, len(rig) - 1)] = np.nan
    return truth


@dataclass(frozen=True)
class AnnotationFit:
    """Annotation of a recording, and the bias that the detector has against all its actors alike.

    The two cannot be separated with one recording: an offset that all actors share is booked on the detector, because
    annotators and detectors define joints (hips, above all) differently; what differs between actors is the annotation.
    """

    annotation: AnnotationModel
    """Errors of the truth."""
    bias: Floats
    """Offset of the detector's joints from the annotated ones by kind of joint, forward, outward and up, (9, 3) metres;
    0 for the face."""
    compared: Floats
    """Frames in which each actor's joint was compared, (A, 14)."""

    @property
    def of_detected(self) -> AnnotationModel:
        """Errors of the truth relative to the joints as the detector finds them, which have its bias."""
        return replace(self.annotation, shift=self.annotation.shift - _per_joint(self.bias))

    def summary(self) -> dict[str, Any]:
        """Return all numbers ready for JSON, metres and seconds."""
        return {
            "shift": self.annotation.shift.tolist(),
            "deviation": self.annotation.deviation.tolist(),
            "life": self.annotation.life,
            "noise": self.annotation.noise,
            "bias": self.bias.tolist(),
            "compared": self.compared.tolist(),
        }


def fit_annotation(
    truth: Floats,
    people: People,
    consensus: Consensus,
    time: Floats,
    *,
    sigma: Floats,
    scatter_life: float = 0.0,
    scatter_noise: float = 0.0,
) -> AnnotationFit:
    """Fit the errors of a truth, by comparing it with what the detections of all views say.

    Args:
        truth: annotated joints, SHELF14, (F, A, 14, 3) metres; NaN where unknown.
        people: joints of everyone, as the method places them with all cameras: nothing places them better.
        consensus: joints on which the views agree, of the same people; limbs are compared where three views do.
        time: times of the frames, (F,) seconds.
        sigma: scatter of keypoints by joint, (17,) units of OKS sigma x sqrt(area): what smoothing leaves of it in the
            joints is not the annotation's.
        scatter_life: correlation time of that scatter, seconds; 0: drawn anew in every frame.
        scatter_noise: share of its variance that is drawn anew in every frame, whatever its correlation time.
    """
    actors = truth.shape[1]
    away = np.full(truth.shape, np.nan)  # annotation minus track in the body's frame
    expected = np.full(truth.shape[:3], np.nan)
    step = _step(time)
    noise = _smoothed(np.arange(1), step, life=scatter_life, noise=scatter_noise)
    agreeing = consensus.agrees.sum(axis=1) >= _AGREEING
    for person, actor in enumerate(actors_of(people, truth)):
        if actor < 0:
            continue
        joints = np.where(agreeing[:, person, :, None], people.joints[:, person], np.nan)
        joints[:, : LIMB_JOINTS[0]] = people.joints[:, person, : LIMB_JOINTS[0]]
        offset = truth[:, actor] - coco17_to_shelf14(joints)
        away[:, actor] = np.einsum("fjc,fkc->fjk", offset, body_axes(people.joints[:, person]))
        expected[:, actor, :_LIMBS] = _limbs14(consensus.variance[:, person] * sigma**2 * noise)
    compared = np.isfinite(away[..., 0]).sum(axis=0)
    shift = _robust_mean(away)
    shift = np.where((compared >= _FEWEST)[..., None], shift, 0.0)
    rest = away - shift
    total = _mean((rest**2).sum(axis=-1)) / 3 - np.nan_to_num(_mean(expected))
    usual = np.sqrt(_median(np.where(compared >= _FEWEST, np.maximum(total, 0.0), np.nan).ravel()))
    # The noise of the consensus can exceed what is seen in few frames; nobody annotates much better than usual.
    least = _STEADIEST * np.nan_to_num(usual)
    deviation = np.where(compared >= _FEWEST, np.maximum(np.sqrt(np.maximum(total, 0.0)), least), np.nan_to_num(usual))
    bias = -_common(shift, compared)
    shift = shift + _per_joint(bias)
    scale = np.where(deviation > 0, deviation, np.inf)
    steps = lags(step)
    kept = _smoothed(steps, step, life=scatter_life, noise=scatter_noise) / noise
    life, white = _memory(rest / scale[..., None], expected / scale**2, time, steps, kept)
    return AnnotationFit(AnnotationModel(shift.reshape(actors, -1, 3), deviation, life, white), bias, compared)


def _limbs14(values: Floats) -> Floats:
    """Return values of limb joints of COCO-17 (F, 17) in the order of SHELF14, (F, 12)."""
    result = np.empty((len(values), _LIMBS))
    result[:, SHELF14_OF_LIMBS] = values[:, LIMB_JOINTS]
    return result


def _robust_mean(away: Floats) -> Floats:
    """Return the mean over frames (F, ...) to (...) without values beyond four deviations of the median."""
    center = _median(away)
    for _ in range(_SHIFT_ROUNDS):
        far = np.linalg.norm(away - center, axis=-1)
        kept = far < 4 * _median(far) / 1.54
        center = _mean(np.where(kept[..., None], away, np.nan))
    return np.nan_to_num(center)


def _mean(values: Floats) -> Floats:
    """Return the mean over the first axis without NaN; NaN where nothing is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of joints that are never compared
        return np.asarray(np.nanmean(values, axis=0))


def _median(values: Floats) -> Floats:
    """Return the median over the first axis without NaN; NaN where nothing is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmedian(values, axis=0))


def _common(shift: Floats, compared: Floats) -> Floats:
    """Return the mean shift by kind of joint over actors and sides, forward, outward and up, (9, 3)."""
    outward = shift * np.stack([np.ones(14), _SIDE14, np.ones(14)], axis=-1)
    result = np.zeros((len(KINDS), 3))
    of_limb = np.array(KIND_OF_JOINT)[LIMB_JOINTS]
    for kind in set(of_limb):
        joints = SHELF14_OF_LIMBS[of_limb == kind]
        # Every actor counts alike: an actor with more frames says no more about the next one.
        known = compared[:, joints] >= _FEWEST
        if known.any():
            result[kind] = outward[:, joints][known].mean(axis=0)
    return result


def _per_joint(bias: Floats) -> Floats:
    """Return offsets by kind (9, 3), forward, outward and up, as those of SHELF14, forward, left and up, (14, 3)."""
    result = np.zeros((len(SHELF14), 3))
    result[SHELF14_OF_LIMBS] = bias[np.array(KIND_OF_JOINT)[LIMB_JOINTS]]
    result[:, 1] *= _SIDE14
    return result


def _step(time: Floats) -> float:
    """Return the seconds between consecutive frames, (F,)."""
    return float(np.diff(time).min(initial=np.inf)) if len(time) > 1 else 1.0


def _smoothed(lag: NDArray[np.int64], step: float, *, life: float, noise: float) -> Floats:
    """Return the autocovariance of smoothed scatter, (L,), as a share of the variance of scatter.

    Args:
        lag: lags, (L,) frames.
        step: seconds between frames.
        life: correlation time of scatter, seconds; 0: drawn anew in every frame.
        noise: share of its variance that is drawn anew in every frame.
    """
    reach = np.arange(-np.ceil(6 * SMOOTHING / step), np.ceil(6 * SMOOTHING / step) + 1)
    weight = np.exp(-((reach * step / SMOOTHING) ** 2) / 4)  # the kernel's autocorrelation
    apart = np.abs(lag[:, None] + reach)
    correlation = (1 - noise) * np.exp(-apart * step / life) if life > 0 else np.zeros(apart.shape)
    return np.where(apart == 0, 1.0, correlation) @ (weight / weight.sum())


def _memory(
    rest: Floats, expected: Floats, time: Floats, steps: NDArray[np.int64], kept: Floats
) -> tuple[float, float]:
    """Return life, seconds, and share of white noise of the random part.

    Args:
        rest: annotation minus track without the shift, (F, A, 14, 3), in deviations of the random part.
        expected: variance of the tracks along each axis, (F, A, 14), in squares of these deviations.
        time: times of the frames, (F,) seconds.
        steps: lags, (L,) frames.
        kept: autocorrelation of the errors of the tracks, (L,).
    """
    step = _step(time)
    product, square = np.zeros(len(steps)), np.zeros(len(steps))
    rest, expected = rest[:, :, :_LIMBS], 3 * expected[:, :, :_LIMBS]
    for index, lag in enumerate(steps[steps < len(time)]):
        near = time[lag:] - time[:-lag] < (lag + 0.5) * step
        now, later = rest[:-lag][near], rest[lag:][near]
        both = np.isfinite(now).all(axis=-1) & np.isfinite(later).all(axis=-1)
        of_tracks = (expected[:-lag][near] + expected[lag:][near])[both].sum() / 2
        product[index] = (now * later).sum(axis=-1)[both].sum() - kept[index] * of_tracks
        square[index] = ((now**2 + later**2).sum(axis=-1) / 2)[both].sum() - of_tracks
    square = np.maximum(square, 0.0)
    if not square.any():
        return 0.0, 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        life, noise = fit_noisy_life(steps, step, (product / square)[None], square[None])
    return float(life[0]), float(noise[0])
