"""What each frame adds to the sums that all figures are made of, so that figures of resamples cost one product."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from simharness.detector.conditions import OCCLUDED, SELF_OCCLUDED, VISIBLE
from simharness.detector.draws import LIMB_OF_JOINT
from simharness.reality.detector_fit.joint_labels import CLASSES, Judged
from simharness.reality.detector_fit.sample import LIMBS
from simharness.reality.detector_fit.tetrachoric import grid, together
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS, Keypoints
from simharness.types.truth import MISS_FROM, KeypointError

Sums = dict[str, Floats]

REACH = 1.15 * float(Keypoints().reach)
"""Units from which a miss has strayed: beyond those to which misses go by definition, and the error of a unit, 15 %."""

LOGITS = np.linspace(-5.0, 5.0, 101)
"""Edges of the histograms of scores, on the logit scale."""

SCORED = ("good", "jitter", "miss", "inversion", "swap", "unknown")
"""The classes that have histograms of scores: those of KeypointError, and those of joints whose truth is unknown."""

SIGHTS = (VISIBLE, SELF_OCCLUDED, OCCLUDED)

TERCILES = ("small", "medium", "large")

_OF_KIND = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
_LONGEST = 1.0  # seconds, longest lag: beyond it, people differ more than moments do
_LAGS = 8
_CELLS = 12  # each way, of the grid on a person's box


def lags(step: float) -> NDArray[np.int64]:
    """The lags of autocorrelations, (L,) frames: 1 to what is a second, closer together at first."""
    return np.unique(np.geomspace(1, max(1.0, round(_LONGEST / step)), _LAGS).round().astype(np.int64))


def count(judged: Judged) -> Sums:
    """The sums of each frame, by name; every array begins with T."""
    sums = {
        **_shares(judged),
        **_sizes(judged),
        **_misses(judged),
        **_scatter(judged),
        **_together(judged),
        **_scores(judged),
        **_people(judged),
    }
    sums["bias.A"], sums["bias.b"] = judged.normal
    return sums


def _by_kind(values: NDArray) -> Floats:
    """Sums (T, 9) of what joints have, (T, V, P, 17)."""
    return values.sum(axis=(1, 2), dtype=float) @ _OF_KIND


def _by_sight(values: Bools, judged: Judged) -> Floats:
    """The same by how the joints are seen, (T, 3, 9)."""
    return np.stack([_by_kind(values & (judged.seen == sight)) for sight in SIGHTS], axis=1)


def _shares(judged: Judged) -> Sums:
    """How many joints each class could have taken (``n.``) and took (``k.``), by how they are seen, (T, 3, 9).

    Of inversions and swaps those are taken off that misses make by chance.
    """
    n = {key: _by_sight(judged.risk[key], judged) for key in CLASSES}
    k = {key: _by_sight(judged.taken[key], judged) for key in CLASSES}
    for key, chance in judged.chance.items():
        opposite_hits = _by_sight(chance, judged)
        k[key] -= opposite_hits
        n["miss"] += opposite_hits
        k["miss"] += opposite_hits
    return {f"n.{key}": n[key] for key in CLASSES} | {f"k.{key}": k[key] for key in CLASSES}


def _sizes(judged: Judged) -> Sums:
    """Limb joints reported and not good, by how large the person is, (T, 3)."""
    size = np.sqrt(judged.boxes[..., 2] * judged.boxes[..., 3])
    present = judged.association.found
    third = (
        np.digitize(size, np.quantile(size[present], [1 / 3, 2 / 3])) if present.any() else np.zeros(size.shape, int)
    )
    reported, wrong = judged.risk["swap"] | judged.risk["miss"] | judged.risk["jitter"], _wrong(judged)
    result: dict[str, list[Floats]] = {"size.n": [], "size.k": [], "size.drop.n": [], "size.drop.k": []}
    for index in range(len(TERCILES)):
        mine = (third == index)[..., None]
        for key, what in (
            ("size.n", reported),
            ("size.k", wrong),
            ("size.drop.n", judged.risk["drop"]),
            ("size.drop.k", judged.taken["drop"]),
        ):
            result[key].append((what & mine)[..., LIMBS].sum(axis=(1, 2, 3)))
    return {key: np.stack(each, axis=1).astype(float) for key, each in result.items()}


def _wrong(judged: Judged) -> Bools:
    return judged.taken["swap"] | judged.taken["inversion"] | judged.taken["miss"] | judged.taken["jitter"]


def _misses(judged: Judged) -> Sums:
    """Misses, those beyond REACH, and how much of the boxes is beyond 2.35 and beyond REACH, (T,)."""
    miss = judged.taken["miss"]
    far = np.where(miss, np.hypot(judged.residual[..., 0], judged.residual[..., 1]), 0.0)
    frame, view, person, _ = np.nonzero(miss)
    box, target, unit = judged.boxes[frame, view, person], judged.target[miss], judged.unit[miss]
    at = (np.arange(_CELLS) + 0.5) / _CELLS
    x, y = box[:, :1] + at * box[:, 2:3], box[:, 1:2] + at * box[:, 3:]
    away = np.hypot((x - target[:, :1])[:, :, None], (y - target[:, 1:])[:, None]) / unit[:, None, None]
    result = {"miss.n": miss.sum(axis=(1, 2, 3)), "miss.beyond": (far >= REACH).sum(axis=(1, 2, 3))}
    for key, limit in (("miss.box", MISS_FROM), ("miss.box_beyond", REACH)):
        result[key] = np.bincount(frame, (away >= limit).mean(axis=(1, 2)), len(miss))
    return {key: each.astype(float) for key, each in result.items()}


def _scatter(judged: Judged) -> Sums:
    """Of good keypoints: squares by kind, products with later ones, and products of two views in space."""
    good = judged.risk["jitter"] & (judged.error == KeypointError.GOOD)
    square = np.where(good, (judged.residual**2).sum(axis=-1), 0.0)
    n, k = _by_kind(good), _by_kind(square)
    with np.errstate(invalid="ignore", divide="ignore"):
        usual = np.sqrt(k.sum(axis=0) / n.sum(axis=0) / 2)[list(KIND_OF_JOINT)]
        offset = np.where(good[..., None], judged.residual / usual[:, None], 0.0)
    steps = lags(judged.step)
    later = [_later(offset, good, lag) for lag in steps]
    axes = np.where(np.isfinite(judged.axes), judged.axes, 0.0)
    across, space = np.zeros(n.shape), np.zeros(n.shape)
    for v, w in _pairs(good.shape[1]):
        shared = np.einsum("tpac,tpbc->tpab", axes[:, v], axes[:, w])
        both = good[:, v] & good[:, w]
        product = np.einsum("tpja,tpjb,tpab->tpj", offset[:, v], offset[:, w], shared)
        across += (product * both).sum(axis=1) @ _OF_KIND
        space += (both * (shared**2).sum(axis=(-1, -2))[..., None]).sum(axis=1) @ _OF_KIND
    return {
        "scatter.n": n,
        "scatter.square": k,
        "scatter.later": np.stack([product for product, _ in later], axis=1),
        "scatter.later_square": np.stack([square for _, square in later], axis=1),
        "scatter.across": across,
        "scatter.space": space,
    }


def _later(offset: Floats, good: Bools, lag: int) -> tuple[Floats, Floats]:
    """Products of offsets with those ``lag`` frames later, and the mean of both squares, where both are good, (T,)."""
    product, square = np.zeros(len(good)), np.zeros(len(good))
    if lag < len(good):
        both = good[:-lag] & good[lag:]
        now, then = offset[:-lag], offset[lag:]
        product[:-lag] = ((now * then).sum(axis=-1) * both).sum(axis=(1, 2, 3))
        square[:-lag] = (((now**2 + then**2).sum(axis=-1) / 2) * both).sum(axis=(1, 2, 3))
    return product, square


def _together(judged: Judged) -> Sums:
    """How many joints each class took in pairs, and how many it would have, (T, ...).

    ``views.k``, ``limb.k`` (T,): pairs of which it took both, over views and within limbs; ``views.expected``,
    ``limb.expected`` (T, G): for each correlation of :func:`dependence.grid`. ``time.excess``, ``time.weight`` (T, L):
    products of what was taken beyond its chance and what is taken after a lag, and what they would be were it all
    remembered. The chances are those of the joint's kind and of how it is seen.
    """
    steps = lags(judged.step)
    frames, states = len(judged.seen), len(SIGHTS) * len(KINDS)
    state = judged.seen * len(KINDS) + np.array(KIND_OF_JOINT)  # how a joint is seen, and its kind
    member = state[..., None] == np.arange(states)  # (T, V, P, 17, 27)
    limbs = np.array([limb == LIMB_OF_JOINT for limb in range(LIMB_OF_JOINT.max() + 1)])
    one, other = np.triu_indices(states)
    same = one == other
    result = {"views.k": np.zeros(frames), "limb.k": np.zeros(frames)}
    result |= {key: np.zeros((frames, len(grid()))) for key in ("views.expected", "limb.expected")}
    result |= {key: np.zeros((frames, len(steps))) for key in ("time.excess", "time.weight")}
    for key in CLASSES:
        risk, taken = judged.risk[key], judged.taken[key]
        at_risk = member & risk[..., None]
        n, k = at_risk.sum(axis=(0, 1, 2, 3)), (at_risk & taken[..., None]).sum(axis=(0, 1, 2, 3))
        chance = k / np.maximum(n, 1)
        curves = together(chance[one], chance[other])

        def pairs(count: Floats) -> Floats:
            """Pairs of states (..., 378) among things of which so many have each state, (..., 27)."""
            return count[..., one] * (count[..., other] - same) / (1 + same)

        # Over views: the same joint of a person, so only states of one kind meet.
        by_joint = at_risk.sum(axis=1, dtype=np.float32).reshape(frames, -1, states)
        by_limb = np.einsum("tvpjs,lj->tvpls", at_risk.astype(np.float32), limbs.astype(np.float32))
        for name, count, whole in (
            ("views", by_joint, taken.sum(axis=1, dtype=float).reshape(frames, -1)),
            (
                "limb",
                by_limb.reshape(frames, -1, states),
                np.einsum("tvpj,lj->tvpl", taken.astype(float), limbs).reshape(frames, -1),
            ),
        ):
            # A frame at a time: all pairs of all frames would be a gigabyte.
            met = np.stack([pairs(each).sum(axis=0) for each in count])
            result[f"{name}.expected"] += met @ curves
            result[f"{name}.k"] += (whole * (whole - 1) / 2).sum(axis=1)

        expected = np.where(risk, chance[state], 0.0)
        beyond = np.where(risk, taken - expected, 0.0)
        spread = np.sqrt(expected * (1 - expected))
        for index, lag in enumerate(steps):
            result["time.excess"][:-lag, index] += (beyond[:-lag] * beyond[lag:]).sum(axis=(1, 2, 3))
            result["time.weight"][:-lag, index] += (spread[:-lag] * spread[lag:]).sum(axis=(1, 2, 3))
    return result


def _scores(judged: Judged) -> Sums:
    """Histograms of scores on the logit scale by class and kind, (T, 2, 6, 9, B): of visible joints and of others.

    And those of false detections, (T, B).
    """
    scores, error = judged.association.scores, judged.error
    frames, bins = len(scores), len(LOGITS) - 1
    row = np.where(error == KeypointError.ABSENT, len(SCORED) - 1, error)
    known = np.isfinite(judged.target[..., 0])
    used = judged.association.found[..., None] & (scores > 0) & ((error != KeypointError.ABSENT) | ~known)
    frame, *_, joint = np.nonzero(used)
    hidden = (judged.seen[used] != VISIBLE).astype(int)
    place = (frame, hidden, row[used], np.array(KIND_OF_JOINT)[joint], _bin(scores[used]))
    shape = (frames, 2, len(SCORED), len(KINDS), bins)
    whole = np.bincount(np.ravel_multi_index(place, shape), minlength=int(np.prod(shape))).reshape(shape)
    false = judged.association.false_scores
    flat = np.bincount(np.nonzero(false > 0)[0] * bins + _bin(false[false > 0]), minlength=frames * bins)
    return {"scores": whole.astype(float), "scores.false": flat.reshape(frames, bins).astype(float)}


def _bin(scores: Floats) -> NDArray[np.int64]:
    logit = np.log(np.clip(scores, 1e-9, 1 - 1e-9) / np.clip(1 - scores, 1e-9, 1))
    return np.clip(np.digitize(logit, LOGITS) - 1, 0, len(LOGITS) - 2)


def _people(judged: Judged) -> Sums:
    """Whom the detector misses, finds twice, and makes up."""
    wanted, found = judged.wanted, judged.association.found
    missed = wanted & ~found
    false = judged.association.false.astype(float)
    fragments = judged.association.fragments.sum(axis=1)
    steps = lags(judged.step)
    result = {
        "people.n": wanted.sum(axis=(1, 2)),
        "people.k": missed.sum(axis=(1, 2)),
        "people.found": found.sum(axis=(1, 2)),
        "people.repeated": judged.association.repeated.sum(axis=(1, 2)),
        "false.n": false,
        "fragments.n": fragments,
    }
    for name, what in (("n", wanted), ("k", missed)):
        many = what.sum(axis=1, dtype=float)
        result[f"people.views.{name}"] = ((many**2 - many) / 2).sum(axis=1)
        time = np.zeros((len(what), len(steps)))
        for index, lag in enumerate(steps):
            time[:-lag, index] = (what[:-lag] & what[lag:]).sum(axis=(1, 2))
        result[f"people.time.{name}"] = time
    products, pairs = np.zeros((*false.shape, len(steps) + 1)), np.zeros((len(false), len(steps) + 1))
    products[..., 0], pairs[:, 0] = false**2, 1
    for index, lag in enumerate(steps, start=1):
        products[:-lag, :, index], pairs[:-lag, index] = false[:-lag] * false[lag:], 1
    result["false.products"], result["false.pairs"] = products, pairs
    return {key: np.asarray(each, float) for key, each in result.items()}


def _pairs(count: int) -> Iterator[tuple[int, int]]:
    for v in range(count):
        for w in range(v + 1, count):
            yield v, w
