"""Fit of the errors of a truth: the annotation of a recording, compared with what the detections of all views say."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose import SHELF14
from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.viewing_conditions import BESIDE, SIDE, body_axes
from simharness.reality.annotation_errors import AnnotationModel, median_over_frames
from simharness.reality.detector_fit.consensus import Consensus
from simharness.reality.detector_fit.frame_sums import lags
from simharness.reality.detector_fit.tetrachoric import fit_noisy_life
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS, actors_of
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS

_LIMBS = len(LIMB_JOINTS)
_AGREEING = 3  # views that have to agree on a joint that the truth is compared with
_FEWEST = 10  # frames in which an actor's joint has to be compared to say something about it
_TELLING = 100  # frames, a few times as long as errors last, from which its own usual distance tells most of a joint
_SHIFT_ROUNDS = 2
_OUTLYING = 4.0  # usual deviations from which an offset is a gross error of the track

_PUBLISHED, _PUBLISHED_SPREAD = 0.017, 1.0
"""Usual deviation of published annotations along each axis, metres, and the spread of its logarithm: the truth of Shelf
is off by 22 to 38 mm in space."""

_DEVIATIONS = np.geomspace(0.0005, 0.15, 60)  # metres, that joints may have
_TAIL = 3  # degrees of freedom of their distribution
_BESIDE = SHELF14_OF_LIMBS[np.array(BESIDE) - LIMB_JOINTS[0]]
_HEAD = np.array([[12, 13]])  # both ends
_CLOSEST = 0.95  # correlation of the errors of two joints
_SPREADS = (0.1, 0.2, 0.4, 0.7)  # of the logarithms of the joints of one recording

# Left and right of each joint of SHELF14: 1 for left joints and the head, -1 for right ones.
_SIDE14 = np.ones(len(SHELF14))
_SIDE14[SHELF14_OF_LIMBS] = SIDE[LIMB_JOINTS]


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
            "near": self.annotation.near,
            "head": self.annotation.head,
            "gross": np.broadcast_to(self.annotation.gross, self.compared.shape).tolist(),
            "gross_deviation": np.broadcast_to(self.annotation.gross_deviation, self.compared.shape).tolist(),
            "bias": self.bias.tolist(),
            "compared": self.compared.tolist(),
        }


def annotation_offsets(truth: Floats, people: People, consensus: Consensus) -> Floats:
    """Return by how much a truth is off what the detections of all views say, in the frames of the bodies.

    Args:
        truth: annotated joints, SHELF14, (F, A, 14, 3) metres; NaN where unknown.
        people: joints of everyone, as the method places them with all cameras: nothing places them better.
        consensus: joints on which the views agree, of the same people; limbs are compared where three views do.

    Returns:
        Annotation minus track, forward, left and up, (F, A, 14, 3) metres; NaN where not compared.
    """
    away = np.full(truth.shape, np.nan)
    agreeing = consensus.agrees.sum(axis=1) >= _AGREEING
    for person, actor in enumerate(actors_of(people, truth)):
        if actor >= 0:
            joints = np.where(agreeing[:, person, :, None], people.joints[:, person], np.nan)
            joints[:, : LIMB_JOINTS[0]] = people.joints[:, person, : LIMB_JOINTS[0]]
            offset = truth[:, actor] - coco17_to_shelf14(joints)
            away[:, actor] = np.einsum("fjc,fkc->fjk", offset, body_axes(people.joints[:, person]))
    return away


def common_bias(away: Floats) -> Floats:
    """Return the offset of the detector's joints that all actors share, (9, 3) metres, from annotation offsets."""
    return -_common(*_shifts(away))


def fit_annotation(away: Floats, of_tracks: Sequence[Floats], time: Floats) -> AnnotationFit:
    """Fit the errors of a truth, by comparing it with what the detections of all views say.

    What the tracks are off, by noise, shared errors and smoothing, is taken from simulated recordings whose truth is
    exact; the rest of the variance is the annotation's. The random part of each joint of each actor has a prior that
    all of them share (empirical Bayes), so that a joint in few frames, or less visible than the errors of its track,
    has the deviation of the others, and none is taken for exact by chance.

    Args:
        away: offsets of the truth, of :func:`annotation_offsets`, (F, A, 14, 3) metres.
        of_tracks: the same of simulated recordings of the same people with an exact truth.
        time: times of the frames, (F,) seconds.
    """
    shift, compared = _shifts(away)
    bias = -_common(shift, compared)
    rest, others = _rest(away), [_rest(each) for each in of_tracks]
    life, white = _memory(rest, others, time)
    total, expected = _variance(rest), _mean(np.stack([_variance(each) for each in others]))
    # The random part lasts: its squares in successive frames say less than independent ones.
    independent = 3 * compared / (1 + (1 - white) ** 2 * life / _step(time))
    freedom = independent / (1 + 1 / len(others))
    freedom = np.where((compared >= _FEWEST) & np.isfinite(total) & np.isfinite(expected), freedom, 0.0)
    deviation = _deviations(np.nan_to_num(total), np.nan_to_num(expected), freedom)
    gross = _gross_errors(away, of_tracks)
    together = [_correlation(rest, others, deviation, pairs) for pairs in (_BESIDE, _HEAD)]
    errors = AnnotationModel(shift + _per_joint(bias), deviation, life, white, *gross, *together)
    return AnnotationFit(errors, bias, compared)


def _correlation(rest: Floats, others: Sequence[Floats], deviation: Floats, pairs: NDArray[np.int64]) -> float:
    """Return the correlation of the random parts of pairs of joints (N, 2), of all actors and pairs.

    Args:
        rest: offsets of the truth without their means, (F, A, 14, 3) metres.
        others: the same of recordings with an exact truth: the errors of joints of one track are correlated, too.
        deviation: deviation of the random part of each joint, (A, 14) metres.
        pairs: pairs of joints.
    """
    one, other = pairs.T
    both = [(each[:, :, one] * each[:, :, other]).sum(axis=-1) / 3 for each in (rest, *others)]
    excess = _mean(both[0]) - _mean(np.stack([_mean(each) for each in both[1:]]))
    weight = np.where(np.isfinite(excess), np.isfinite(both[0]).sum(axis=0), 0)
    scale = (weight * deviation[:, one] * deviation[:, other]).sum()
    return float(np.clip((weight * np.nan_to_num(excess)).sum() / max(scale, 1e-12), 0.0, _CLOSEST))


def _gross_errors(away: Floats, of_tracks: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Return the share of gross errors of each joint beyond those of the tracks, and their deviation, metres, (A, 14).

    Joints in few frames take from the others: each counts as _FEWEST frames more, at the share and deviation of all.
    """
    known = np.isfinite(away[..., 0])
    wrong, others = known & ~np.isfinite(_rest(away)[..., 0]), []
    for each in of_tracks:
        seen = np.isfinite(each[..., 0])
        others.append((seen & ~np.isfinite(_rest(each)[..., 0])).sum() / max(seen.sum(), 1))
    count = known.sum(axis=0)
    excess = np.maximum(wrong.sum(axis=0) - np.mean(others) * count, 0.0)
    if not excess.any():
        return np.zeros(count.shape), np.zeros(count.shape)
    far = np.where(wrong, ((away - _robust_mean(away)) ** 2).sum(axis=-1), 0.0).sum(axis=0) / 3
    number = wrong.sum(axis=0)
    variance = (far + _FEWEST * far.sum() / number.sum()) / (number + _FEWEST)
    return (excess + _FEWEST * excess.sum() / count.sum()) / (count + _FEWEST), np.sqrt(variance)


def _shifts(away: Floats) -> tuple[Floats, Floats]:
    """Return the mean offset of each joint of each actor, (A, 14, 3), and in how many frames it is known, (A, 14)."""
    compared = np.isfinite(away[..., 0]).sum(axis=0)
    return np.where((compared >= _FEWEST)[..., None], _robust_mean(away), 0.0), compared


def _rest(away: Floats) -> Floats:
    """Return offsets (F, A, 14, 3) without their means and without outliers, NaN there."""
    rest = away - _robust_mean(away)
    far = np.linalg.norm(rest, axis=-1)
    return np.where((far < _outlying(far))[..., None], rest, np.nan)


def _outlying(far: Floats) -> Floats:
    """Return the distance from which offsets are gross errors, (A, 14), from all distances to the mean, (F, A, 14).

    An error that lasts may take half of the few frames of a joint, so that these also take from the usual distances of
    all joints.
    """
    usual, frames = np.nan_to_num(median_over_frames(far)), np.isfinite(far).sum(axis=0)
    of_all = np.median(usual[frames > 0]) if frames.any() else 0.0
    return np.asarray(_OUTLYING / 1.54 * (frames * usual + _TELLING * of_all) / (frames + _TELLING))


def _variance(rest: Floats) -> Floats:
    """Return the mean square along each axis, (A, 14)."""
    return _mean((rest**2).sum(axis=-1)) / 3


def _deviations(total: Floats, expected: Floats, freedom: Floats) -> Floats:
    """Return the deviation of the random part of each joint, (A, 14) metres: the mean square of its posterior.

    Logarithms of the deviations have Student's distribution, so that a joint that is annotated much worse stays so;
    mean and spread of that prior are the most likely ones for all joints.

    Args:
        total: variance of the offsets, (A, 14) square metres.
        expected: variance that the tracks have, likewise.
        freedom: degrees of freedom of the total, (A, 14); 0 where it is unknown.
    """
    if not freedom.any():
        return np.zeros(total.shape)
    grid = np.log(_DEVIATIONS)
    variance = np.exp(2 * grid) + expected[..., None]
    fit = -freedom[..., None] / 2 * (np.log(variance) + total[..., None] / variance)
    fit -= fit.max(axis=-1, keepdims=True)
    best, priors = -np.inf, np.zeros(len(grid))
    for mean in grid:
        for spread in _SPREADS:
            prior = (1 + ((grid - mean) / spread) ** 2 / _TAIL) ** (-(_TAIL + 1) / 2)
            prior /= prior.sum()
            likelihood = np.log(np.exp(fit) @ prior + 1e-300)[freedom > 0].sum()
            likelihood -= ((mean - np.log(_PUBLISHED)) / _PUBLISHED_SPREAD) ** 2 / 2
            if likelihood > best:
                best, priors = likelihood, prior
    posterior = np.exp(fit) * priors
    return np.asarray(np.sqrt(posterior @ np.exp(2 * grid) / posterior.sum(axis=-1)))


def _robust_mean(away: Floats) -> Floats:
    """Return the mean over frames (F, ...) to (...) without values beyond four deviations of the median."""
    center = median_over_frames(away)
    for _ in range(_SHIFT_ROUNDS):
        far = np.linalg.norm(away - center, axis=-1)
        kept = far < _outlying(far)
        center = _mean(np.where(kept[..., None], away, np.nan))
    return np.nan_to_num(center)


def _mean(values: Floats) -> Floats:
    """Return the mean over the first axis without NaN; NaN where nothing is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of joints that are never compared
        return np.asarray(np.nanmean(values, axis=0))


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


def _memory(rest: Floats, others: Sequence[Floats], time: Floats) -> tuple[float, float]:
    """Return life, seconds, and share of white noise of the random part.

    Args:
        rest: offsets of the truth without their means, (F, A, 14, 3) metres.
        others: the same of recordings with an exact truth.
        time: times of the frames, (F,) seconds.
    """
    step = _step(time)
    steps = lags(step)
    products = [_products(each[:, :, :_LIMBS], time, steps) for each in (rest, *others)]
    product, square = products[0] - np.mean(products[1:], axis=0)
    square = np.maximum(square, 0.0)
    if not square.any():
        return 0.0, 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        life, noise = fit_noisy_life(steps, step, (product / square)[None], square[None])
    return float(life[0]), float(noise[0])


def _products(rest: Floats, time: Floats, steps: NDArray[np.int64]) -> Floats:
    """Return the mean products of offsets some lags apart, and of their squares, (2, L)."""
    result = np.zeros((2, len(steps)))
    for index, lag in enumerate(steps[steps < len(time)]):
        near = time[lag:] - time[:-lag] < (lag + 0.5) * _step(time)
        now, later = rest[:-lag][near], rest[lag:][near]
        both = np.isfinite(now[..., 0]) & np.isfinite(later[..., 0])
        if both.any():
            result[:, index] = (
                (now * later).sum(axis=-1)[both].mean(),
                (now**2 + later**2).sum(axis=-1)[both].mean() / 2,
            )
    return result
