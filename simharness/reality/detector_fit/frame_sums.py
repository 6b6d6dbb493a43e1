"""Sums of each frame from which all parameters are estimated: a bootstrap resample costs one matrix product."""

import warnings

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from simharness.detector.draws import GROSS, LIMB_OF_JOINT, PARENT
from simharness.detector.error_classes import MIRROR
from simharness.detector.viewing_conditions import BESIDE, OCCLUDED, OUTSIDE, SELF_OCCLUDED, VISIBLE, at_edges
from simharness.reality.detector_fit import detector_sums
from simharness.reality.detector_fit.joint_labels import CLASSES, LabelledJoints
from simharness.reality.detector_fit.tetrachoric import correlation_grid, joint_probability
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS, KeypointsSection
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError

REACH = 1.15 * float(KeypointsSection().reach)
"""Distance, in units, from which a miss is a stray: the reach of misses and 15 % for errors of the unit."""

LOGITS = np.linspace(-5.0, 5.0, 101)
"""Edges of the histograms of scores, on the logit scale."""

SCORED = ("good", "jitter", "miss", "inversion", "swap", "unknown")
"""Classes with histograms of scores: those of KeypointError, and joints whose truth is unknown."""

OCCLUSIONS = (VISIBLE, SELF_OCCLUDED, OCCLUDED)

TERCILES = ("small", "medium", "large")

_OF_KIND = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
_LONGEST = 2.0  # seconds, longest lag: beyond it, differences between people dominate
_LAGS = 8
BONES = ((5, 7), (6, 8), (7, 9), (8, 10), (11, 13), (12, 14), (13, 15), (14, 16))
"""Limb bones whose length does not change, as pairs of joints."""

BORDER = np.linspace(0.0, 6.0, 49)
"""Edges of the histogram of distances from the border of the image, units."""

APART = np.linspace(0.0, 0.6, 31)
"""Edges of the histogram of distances of left-right counterparts in the picture, heights of the box."""

DEPTHS = np.linspace(-0.2, 0.5, 15)
"""Edges of the histogram of depths of self-occluded joints behind the middle of the trunk from the side, metres."""

_OUTLYING = 3.5  # deviations of a bone's length from which a joint is wrong
_CELLS = 12  # in each direction, of the grid on a person's box


def lags(step: float) -> NDArray[np.int64]:
    """Return the lags of autocorrelations, (L,) frames: from 1 to one second, geometrically spaced."""
    return np.unique(np.geomspace(1, max(1.0, round(_LONGEST / step)), _LAGS).round().astype(np.int64))


def frame_sums(labels: LabelledJoints) -> detector_sums.FrameSums:
    """Return the sums of each frame alone."""
    size, size_drop = _sizes(labels)
    border, outside = _border(labels)
    return detector_sums.FrameSums(
        classes=_shares(labels),
        edge=_at_edges(labels),
        depth=_by_depth(labels),
        face=_face(labels),
        size=size,
        size_drop=size_drop,
        apart=_apart(labels),
        miss=_misses(labels),
        scatter=_scatter(labels),
        jitter=_jitters(labels),
        dependence=_dependence(labels),
        scores=_scores(labels),
        people=_people(labels),
        false=_false_detections(labels),
        bones=_bones(labels),
        border=border,
        outside=outside,
    )


def _by_kind(values: NDArray) -> Floats:
    """Return sums (T, 9) by kind of joint of values (T, V, P, 17)."""
    return values.sum(axis=(1, 2), dtype=float) @ _OF_KIND


def _by_occlusion(values: Bools, labels: LabelledJoints) -> Floats:
    """Return sums by occlusion class and kind of joint, (T, 3, 9)."""
    return np.stack([_by_kind(values & (labels.occlusion == occlusion)) for occlusion in OCCLUSIONS], axis=1)


def _shares(labels: LabelledJoints) -> dict[str, detector_sums.Trials]:
    """Return the joints each class could have taken and took, by occlusion class, (T, 3, 9).

    The number of misses that look like inversions and swaps by chance is subtracted from these and added to misses.
    """
    n = {key: _by_occlusion(labels.risk[key], labels) for key in CLASSES}
    k = {key: _by_occlusion(labels.taken[key], labels) for key in CLASSES}
    for key, chance in labels.chance.items():
        by_chance = _by_occlusion(chance, labels)
        k[key] -= by_chance
        n["miss"] += by_chance
        k["miss"] += by_chance
    return {key: detector_sums.Trials(n[key], k[key]) for key in CLASSES}


def _at_edges(labels: LabelledJoints) -> detector_sums.Trials:
    """Return hidden joints beside a visible one, and those dropped, by occlusion class and kind, (T, 2, 9)."""
    edge = at_edges(np.where(labels.inside, labels.occlusion, np.int8(OUTSIDE)))
    both = (_by_occlusion(each["drop"] & edge, labels)[:, 1:] for each in (labels.risk, labels.taken))
    return detector_sums.Trials(*both)


def _by_depth(labels: LabelledJoints) -> detector_sums.Trials:
    """Return self-occluded limb joints that may be dropped, and those dropped, by kind and depth, (T, 9, B)."""
    hidden = (labels.occlusion == SELF_OCCLUDED) & (LIMB_OF_JOINT > 0)
    place = np.clip(np.digitize(np.nan_to_num(labels.depth), DEPTHS) - 1, 0, len(DEPTHS) - 2)
    in_bin = [hidden & (place == index) for index in range(len(DEPTHS) - 1)]
    return detector_sums.Trials(
        *(
            np.stack([_by_kind(which["drop"] & each) for each in in_bin], axis=-1)
            for which in (labels.risk, labels.taken)
        )
    )


def _face(labels: LabelledJoints) -> detector_sums.Trials:
    """Return joints of the face that nobody else hides, and those not reported, by kind and bearing, (T, 3, 24).

    Bearings count towards the side of the joint, so that left and right joints are alike.
    """
    seen, dropped = labels.risk["drop"] & (labels.occlusion != OCCLUDED), labels.taken["drop"]
    result = detector_sums.Trials(*np.zeros((2, len(seen), 3, len(BEARINGS))))
    for joint in range(LIMB_JOINTS[0]):
        towards = labels.bearing if MIRROR[joint] >= joint else -labels.bearing % len(BEARINGS)
        at = towards[..., None] == np.arange(len(BEARINGS))
        for sums, which in zip(result, (seen, seen & dropped), strict=True):
            sums[:, KIND_OF_JOINT[joint]] += (at & which[..., joint, None]).sum(axis=(1, 2))
    return result


def _bones(labels: LabelledJoints) -> detector_sums.BoneSums:
    """Return sums of limb lengths on which three views or more agree."""
    joints, agree = labels.consensus.joints, labels.consensus.agrees.sum(axis=1)
    one, other = np.array(BONES).T
    length = np.linalg.norm(joints[:, :, one] - joints[:, :, other], axis=-1)
    known = (agree[:, :, one] >= 3) & (agree[:, :, other] >= 3) & labels.known[..., None]
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # bones on which three views never agree
        usual = np.nanmedian(np.where(known, length, np.nan), axis=0)
        spread = 1.4826 * np.nanmedian(np.abs(np.where(known, length, np.nan) - usual), axis=0)
        known &= np.abs(length - usual) < _OUTLYING * spread
    away = np.where(known, length - np.nan_to_num(usual), 0.0)
    variance = labels.consensus.variance
    noise = np.where(known, variance[:, :, one] + variance[:, :, other], 0.0)
    scale = np.where(known, labels.consensus.scale[:, :, one] + labels.consensus.scale[:, :, other], 0.0)
    return detector_sums.BoneSums(known.astype(float), away, away**2, noise.sum(axis=(1, 2)), scale.sum(axis=(1, 2)))


def _sizes(labels: LabelledJoints) -> tuple[detector_sums.Trials, detector_sums.Trials]:
    """Return limb joints that are reported and not good, and dropped ones, by tercile of the person's size, (T, 3)."""
    size = np.sqrt(labels.boxes[..., 2] * labels.boxes[..., 3])
    present = labels.association.detected & labels.known[:, None]
    third = (
        np.digitize(size, np.quantile(size[present], [1 / 3, 2 / 3])) if present.any() else np.zeros(size.shape, int)
    )
    reported, wrong = labels.risk["swap"] | labels.risk["miss"] | labels.risk["jitter"], _wrong(labels)
    in_third = [(third == index)[..., None] for index in range(len(TERCILES))]

    def by_tercile(what: Bools) -> Floats:
        return np.stack([(what & each)[..., LIMB_JOINTS].sum(axis=(1, 2, 3)) for each in in_third], axis=1).astype(
            float
        )

    dropped = detector_sums.Trials(by_tercile(labels.risk["drop"]), by_tercile(labels.taken["drop"]))
    return detector_sums.Trials(by_tercile(reported), by_tercile(wrong)), dropped


def _wrong(labels: LabelledJoints) -> Bools:
    """Return the joints that are reported and not good, (T, V, P, 17)."""
    return labels.taken["swap"] | labels.taken["inversion"] | labels.taken["miss"] | labels.taken["jitter"]


def _apart(labels: LabelledJoints) -> detector_sums.Trials:
    """Return limb joints that may be inverted, and those inverted, by the distance of the counterpart, (T, B)."""
    at_risk, taken = (each["inversion"][..., LIMB_JOINTS] for each in (labels.risk, labels.taken))
    away = (labels.target - labels.target[..., MIRROR, :])[..., LIMB_JOINTS, :]
    far = np.hypot(away[..., 0], away[..., 1]) / np.maximum(labels.boxes[..., 3, None], 1.0)
    place = np.digitize(far, APART[1:-1])[..., None] == np.arange(len(APART) - 1)
    return detector_sums.Trials(
        *((place & each[..., None]).sum(axis=(1, 2, 3)).astype(float) for each in (at_risk, taken))
    )


def _misses(labels: LabelledJoints) -> detector_sums.MissSums:
    """Return the sums of misses of limbs."""
    miss = labels.taken["miss"].copy()
    miss[..., : LIMB_JOINTS[0]] = False
    far = np.where(miss, np.hypot(labels.residual[..., 0], labels.residual[..., 1]), 0.0)
    frame, view, person, _ = np.nonzero(miss)
    box, target, unit = labels.boxes[frame, view, person], labels.target[miss], labels.unit[miss]
    at = (np.arange(_CELLS) + 0.5) / _CELLS
    x, y = box[:, :1] + at * box[:, 2:3], box[:, 1:2] + at * box[:, 3:]
    away = np.hypot((x - target[:, :1])[:, :, None], (y - target[:, 1:])[:, None]) / unit[:, None, None]
    counts = (each.sum(axis=(1, 2, 3)).astype(float) for each in (miss, far >= REACH))
    shares = (np.bincount(frame, (away >= limit).mean(axis=(1, 2)), len(miss)) for limit in (MISS_FROM, REACH))
    return detector_sums.MissSums(*counts, *(each.astype(float) for each in shares))


def _scatter(labels: LabelledJoints) -> detector_sums.ScatterSums:
    """Return the sums of good keypoints."""
    good = labels.risk["jitter"] & (labels.error == KeypointError.GOOD)
    square = np.where(good, (labels.residual**2).sum(axis=-1), 0.0)
    n, k = _by_kind(good), _by_kind(square)
    with np.errstate(invalid="ignore", divide="ignore"):
        usual = np.sqrt(k.sum(axis=0) / n.sum(axis=0) / 2)[list(KIND_OF_JOINT)]
        offset = np.where(good[..., None], labels.residual / usual[:, None], 0.0)
    steps = lags(labels.step)
    later = [_later(offset, good, lag, labels) for lag in steps]
    one, other = np.array(BESIDE).T
    both = good[..., one] & good[..., other]
    first, second = offset[..., one, :], offset[..., other, :]
    product = np.where(both, (first * second).sum(axis=-1), 0.0)
    mean_square = np.where(both, (first**2 + second**2).sum(axis=-1) / 2, 0.0)
    return detector_sums.ScatterSums(
        n=n,
        square=k,
        hidden_n=_by_kind(good & (labels.occlusion != VISIBLE)),
        hidden_square=_by_kind(square * (labels.occlusion != VISIBLE)),
        later=np.stack([product for product, _ in later], axis=1),
        later_square=np.stack([square for _, square in later], axis=1),
        near=product.sum(axis=(1, 2, 3)),
        near_square=mean_square.sum(axis=(1, 2, 3)),
    )


def _jitters(labels: LabelledJoints) -> detector_sums.JitterSums:
    """Return the sums of jitters."""
    jitter = labels.taken["jitter"]
    away = np.where(jitter, np.hypot(labels.residual[..., 0], labels.residual[..., 1]), GOOD_BELOW)
    way = np.clip((away - GOOD_BELOW) / (MISS_FROM - GOOD_BELOW), 0.0, 1.0)
    return detector_sums.JitterSums(_by_kind(jitter), _by_kind(way))


def _later(offset: Floats, good: Bools, lag: int, labels: LabelledJoints) -> tuple[Floats, Floats]:
    """Return products of offsets ``lag`` frames apart and the mean of both squares, where both are good, (T,)."""
    product, square = np.zeros(len(good)), np.zeros(len(good))
    if lag < len(good):
        both = good[:-lag] & good[lag:] & _consecutive(labels, lag)[:, None, None, None]
        now, then = offset[:-lag], offset[lag:]
        product[:-lag] = ((now * then).sum(axis=-1) * both).sum(axis=(1, 2, 3))
        square[:-lag] = (((now**2 + then**2).sum(axis=-1) / 2) * both).sum(axis=(1, 2, 3))
    return product, square


def _consecutive(labels: LabelledJoints, lag: int) -> Bools:
    """Return which frames have no gap to the frame ``lag`` frames later, (T - lag,)."""
    return np.asarray(labels.time[lag:] - labels.time[:-lag] < (lag + 0.5) * labels.step)


def _dependence(labels: LabelledJoints) -> detector_sums.DependenceSums:
    """Return observed and expected pairs of joints taken by the same class, and their products over time.

    Pairs within limbs are of visible joints: whether a guess is a miss depends on the pose, which a limb has in common.
    """
    steps = lags(labels.step)
    frames, states = len(labels.occlusion), len(OCCLUSIONS) * len(KINDS)
    state = labels.occlusion * len(KINDS) + np.array(KIND_OF_JOINT)  # occlusion class and kind of joint
    visible = labels.occlusion == VISIBLE
    member = state[..., None] == np.arange(states)  # (T, V, P, 17, 27)
    limbs = np.array([limb == LIMB_OF_JOINT for limb in range(LIMB_OF_JOINT.max() + 1)])
    one, other = np.triu_indices(states)
    same = one == other
    views, gross_views, limb = (
        detector_sums.PairSums(np.zeros(frames), np.zeros((frames, len(correlation_grid())))) for _ in range(3)
    )
    excess, weight = np.zeros((2, frames, len(steps)))
    for key in CLASSES:
        risk, taken = labels.risk[key], labels.taken[key]
        at_risk = member & risk[..., None]
        n, k = at_risk.sum(axis=(0, 1, 2, 3)), (at_risk & taken[..., None]).sum(axis=(0, 1, 2, 3))
        chance = k / np.maximum(n, 1)
        curves = joint_probability(chance[one], chance[other])

        # Over views: the same joint of a person, so only states of one kind form pairs.
        by_joint = at_risk.sum(axis=1, dtype=np.float32).reshape(frames, -1, states)
        shown = (at_risk & visible[..., None]).astype(np.float32)
        by_limb = np.einsum("tvpjs,lj->tvpls", shown, limbs.astype(np.float32))
        for sums, count, whole in (
            (gross_views if key in GROSS else views, by_joint, taken.sum(axis=1, dtype=float).reshape(frames, -1)),
            (
                limb,
                by_limb.reshape(frames, -1, states),
                np.einsum("tvpj,lj->tvpl", (taken & visible).astype(float), limbs).reshape(frames, -1),
            ),
        ):
            # Pairs of states of the joints in one row, summed over the rows of a frame.
            met = (np.swapaxes(count, 1, 2) @ count)[:, one, other] - same * count.sum(axis=1)[:, one]
            met = met / (1 + same)
            sums.expected[:] += met @ curves
            sums.k[:] += (whole * (whole - 1) / 2).sum(axis=1)

        expected = np.where(risk, chance[state], 0.0)
        beyond = np.where(risk, taken - expected, 0.0)
        spread = np.sqrt(expected * (1 - expected))
        for index, lag in enumerate(steps):
            if lag >= frames:
                continue
            whole = _consecutive(labels, lag)
            excess[:-lag, index] += whole * (beyond[:-lag] * beyond[lag:]).sum(axis=(1, 2, 3))
            weight[:-lag, index] += whole * (spread[:-lag] * spread[lag:]).sum(axis=(1, 2, 3))
    return detector_sums.DependenceSums(views, gross_views, limb, excess, weight)


def _scores(labels: LabelledJoints) -> detector_sums.ScoreHistograms:
    """Return the histograms of scores."""
    scores, error = labels.association.scores, labels.error
    frames, bins = len(scores), len(LOGITS) - 1
    row = np.where(error == KeypointError.ABSENT, len(SCORED) - 1, error)
    known = np.isfinite(labels.target[..., 0])
    shown = (labels.association.detected & labels.known[:, None])[..., None] & (scores > 0)
    used = shown & labels.inside & ((error != KeypointError.ABSENT) | ~known)
    frame, *_, joint = np.nonzero(used)
    hidden = (labels.occlusion[used] != VISIBLE).astype(int)
    place = (frame, hidden, row[used], np.array(KIND_OF_JOINT)[joint], _bin(scores[used]))
    shape = (frames, 2, len(SCORED), len(KINDS), bins)
    whole = np.bincount(np.ravel_multi_index(place, shape), minlength=int(np.prod(shape))).reshape(shape)
    false = labels.association.false_scores
    flat = np.bincount(np.nonzero(false > 0)[0] * bins + _bin(false[false > 0]), minlength=frames * bins)
    outside = shown & ~labels.inside
    beyond = np.bincount(np.nonzero(outside)[0] * bins + _bin(scores[outside]), minlength=frames * bins)
    by_frame = (each.reshape(frames, bins).astype(float) for each in (flat, beyond))
    return detector_sums.ScoreHistograms(whole.astype(float), *by_frame)


def _bin(scores: Floats) -> NDArray[np.int64]:
    """Return the bins (...) of scores (...) in the histograms over LOGITS."""
    logit = np.log(np.clip(scores, 1e-9, 1 - 1e-9) / np.clip(1 - scores, 1e-9, 1))
    return np.clip(np.digitize(logit, LOGITS) - 1, 0, len(LOGITS) - 2)


def _missed_by_hidden_share(labels: LabelledJoints, expected: Bools, missed: Bools) -> detector_sums.Trials:
    """Return people expected and missed by the share of their limb joints that others or the border hide, (T, 5)."""
    hidden = ((labels.occlusion == OCCLUDED) | ~labels.inside)[..., LIMB_JOINTS].mean(axis=-1)
    nearest = np.round(4 * hidden).astype(int)[..., None] == np.arange(5)
    return detector_sums.Trials(
        *((nearest & which[..., None]).sum(axis=(1, 2)).astype(float) for which in (expected, missed))
    )


def _border(labels: LabelledJoints) -> tuple[detector_sums.Trials, detector_sums.Trials]:
    """Return limb joints outside of the images and those reported, by their distance from the border and by kind."""
    outside = (labels.association.detected & labels.known[:, None])[..., None] & ~labels.inside
    outside[..., : LIMB_JOINTS[0]] = False
    bins = np.digitize(labels.beyond, BORDER[1:-1])[..., None] == np.arange(len(BORDER) - 1)
    shown = labels.association.scores > 0
    reached = outside & ((PARENT < 0) | shown[..., PARENT])  # the others are lost with their parents
    border = (bins & which[..., None] for which in (reached, reached & shown))
    by_distance = (each.sum(axis=(1, 2, 3)).astype(float) for each in border)
    return detector_sums.Trials(*by_distance), detector_sums.Trials(_by_kind(outside), _by_kind(outside & shown))


def _people(labels: LabelledJoints) -> detector_sums.PeopleSums:
    """Return the sums of people missed, detected and duplicated."""
    expected, detected = labels.expected, labels.association.detected & labels.known[:, None]
    missed = expected & ~detected
    both = expected, missed
    many = [what.sum(axis=1, dtype=float) for what in both]
    duplicates = (labels.association.duplicates * labels.known[:, None]).sum(axis=(1, 2))
    return detector_sums.PeopleSums(
        all=detector_sums.Trials(*(what.sum(axis=(1, 2), dtype=float) for what in both)),
        hidden=_missed_by_hidden_share(labels, expected, missed),
        views=detector_sums.Trials(*(((each**2 - each) / 2).sum(axis=1) for each in many)),
        time=detector_sums.Trials(*(_again(labels, what) for what in both)),
        detected=detected.sum(axis=(1, 2), dtype=float),
        duplicates=duplicates.astype(float),
    )


def _again(labels: LabelledJoints, what: Bools) -> Floats:
    """Return how many of the people in the views (T, V, P) are the same a lag later, (T, L)."""
    steps = lags(labels.step)
    time = np.zeros((len(what), len(steps)))
    for index, lag in enumerate(steps):
        if lag < len(what):
            time[:-lag, index] = _consecutive(labels, lag) * (what[:-lag] & what[lag:]).sum(axis=(1, 2))
    return time


def _false_detections(labels: LabelledJoints) -> detector_sums.FalseSums:
    """Return the sums of false detections."""
    false, steps = labels.association.false.astype(float), lags(labels.step)
    products, pairs = np.zeros((*false.shape, len(steps) + 1)), np.zeros((len(false), len(steps) + 1))
    products[..., 0], pairs[:, 0] = false**2, 1
    for index, lag in enumerate(steps, start=1):
        if lag < len(false):
            whole = _consecutive(labels, lag)
            products[:-lag, :, index], pairs[:-lag, index] = whole[:, None] * false[:-lag] * false[lag:], whole
    return detector_sums.FalseSums(false, labels.association.fragments.sum(axis=1).astype(float), products, pairs)
