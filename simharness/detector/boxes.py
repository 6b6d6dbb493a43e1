"""Whom the detector finds, and in which boxes: people missed, two in one box, one in two, people found twice.

What goes wrong is drawn in this order, each among the people whom those before left: missed, merged, split, found
twice. Each has streams of its own, so a dial turned up changes no other draw. All of it lasts ``life`` seconds on
average; the noise of boxes and of their scores forgets in that time.
"""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.conditions import BOX_SHARE, overlaps
from simharness.detector.correlation import LIMBS, Chances, Key, logistic
from simharness.detector.detection_block import Found, Origin
from simharness.scenario.sections.detector import Boxes
from simharness.types.truth import KeypointError
from simharness.types.views import Views
from simharness.types.visibility import Visibility

UPPER = LIMBS < 2
"""The joints of the upper half of somebody who is found in two, (17,): face and arms. The others are the lower half."""

AGAIN = 0.2
"""From a keypoint to the same found again: deviation in x and in y, in units of OKS sigma x sqrt(area). So little that
its error is still of the same class, up to rare ones at the border of theirs, and labels are kept."""

PALER = 0.8
"""What multiplies the scores of somebody who is found again."""

_INWARD = 0.45  # of a box's size that a side may move: none turns inside out
_JOINTS = np.arange(len(COCO17))


def in_boxes(people: Found, views: Views, rig: Rig, config: Boxes, chances: Chances) -> Found:
    """Find people in boxes.

    Args:
        people: everyone's keypoints, person p in slot p, ``there`` where any is reported. Their boxes do not count yet.
        views: the truth in the pictures.
        rig: the cameras, for the sizes of their images.
        config: what goes wrong how often.
        chances: the draws.

    Returns:
        The P slots: merged people in that of the one who gives most joints, of split ones the upper half. Where anybody
        is split or found twice, P more: the lower half, or the person again.
    """
    finder = _Finder(views, rig, config, chances)
    visible = views.visibility == Visibility.VISIBLE
    found = people.there & (visible.sum(axis=-1) >= config.least_visible)
    found &= ~finder.happens("missed", config.missed, shared=config.missed_views)
    merged = finder.merged(found)
    left = found.copy()
    for pair, together in merged.items():
        left[..., pair] &= ~together[..., None]
    split = left & finder.happens("split", config.split)
    twice = left & ~split & finder.happens("duplicates", config.duplicates)

    rounds = 2 if (split | twice).any() else 1  # of the P slots
    blocks = {field.name: np.concatenate([getattr(people, field.name)] * rounds, axis=2) for field in fields(Found)}
    blocks["there"] = np.concatenate([found, split | twice][:rounds], axis=2)
    second = np.where(split, Origin.LOWER, Origin.AGAIN).astype(np.int8)
    blocks["origin"] = np.concatenate([people.origin, second][:rounds], axis=2)
    boxes, share = (np.concatenate([each] * rounds, axis=2) for each in (views.boxes, visible.mean(axis=-1)))
    result = Found(**blocks)
    t, v, p = np.nonzero(split)
    for half, slot in (UPPER, p), (~UPPER, p + found.shape[2]):
        _leave(result, half, (t, v, slot))
        boxes[t, v, slot] = _of_part(views.boxes[t, v, p], views.pixels[t, v, p], half)
        share[t, v, slot] = (visible[t, v, p] & half).mean(axis=-1)
    result = replace(result, boxes=finder.jittered(boxes), box_scores=finder.scored(share))
    for pair, together in merged.items():
        _merge(result, pair, together, finder.limbs(pair)[together])
    if twice.any():
        finder.perturb(result, twice)
    return replace(result, there=result.there & (result.scores > 0).any(axis=-1))


class _Finder:
    """The draws about boxes, and what depends on them alone."""

    def __init__(self, views: Views, rig: Rig, config: Boxes, chances: Chances) -> None:
        self._views, self._config, self._chances = views, config, chances
        self._shape = views.boxes.shape[:3]
        self._image = np.array([camera.size for camera in rig], float).reshape(-1, 1, 2)

    def happens(self, what: str, share: float, *, shared: float = 0.0) -> Bools:
        """To whom it happens in which picture, (T, V, P)."""
        result = np.zeros(self._shape, bool)
        if share > 0:
            for person in range(self._shape[2]):
                result[..., person] = self._state(what, person, shared=shared) < ndtri(share)
        return result

    def merged(self, found: Bools) -> dict[tuple[int, int], Bools]:
        """Which pairs become one in which pictures, (T, V).

        Somebody who could merge with two does so with the one of the lower draw, whatever the dial: more only adds.
        """
        share = self._config.merged
        if share == 0:
            return {}
        near = overlaps(self._views.boxes) > self._config.merged_overlap
        pairs = [
            (a, b)
            for a, b in combinations(range(self._shape[2]), 2)
            if (near[..., a, b] & found[..., a] & found[..., b]).any()
        ]
        if not pairs:
            return {}
        draws = np.stack([self._state("merged", *pair) for pair in pairs], axis=-1)
        one, other = np.array(pairs).T
        willing = (near[..., one, other] & (draws < ndtri(share))).reshape(-1, len(pairs))
        free, picture = found.reshape(-1, self._shape[2]).copy(), np.arange(len(willing))
        merged = np.zeros_like(willing)
        for pair in draws.reshape(willing.shape).argsort(axis=-1).T:  # of each picture the pair of the next higher draw
            a, b = one[pair], other[pair]
            together = willing[picture, pair] & free[picture, a] & free[picture, b]
            free[picture[together], a[together]] = free[picture[together], b[together]] = False
            merged[picture, pair] = together
        by_pair = np.moveaxis(merged.reshape(draws.shape), -1, 0)
        return {pair: together for pair, together in zip(pairs, by_pair, strict=True) if together.any()}

    def limbs(self, pair: tuple[int, int]) -> Bools:
        """Which joints of a merged pair are the first one's, (T, V, J): the face, the arms, the legs as a whole."""
        life = self._config.life
        return self._chances.joint_states("boxes", "limbs", *pair, life=life, limb=1.0) < 0

    def jittered(self, boxes: Floats) -> Floats:
        """Boxes (T, V, S, 4) with noise on every side, within the image."""
        if self._config.jitter == 0:
            return boxes
        low, size = boxes[..., :2], boxes[..., 2:]
        noise = np.clip(self._config.jitter * self._noise("sides", boxes.shape[2:]), -_INWARD, _INWARD)
        corner = np.clip(low - noise[..., :2] * size, -0.5, self._image - 0.5)
        opposite = np.clip(low + size + noise[..., 2:] * size, -0.5, self._image - 0.5)
        return np.concatenate([corner, opposite - corner], axis=-1)

    def scored(self, share: Floats) -> Floats:
        """Scores of boxes (T, V, S) that show some share of the joints of a whole person."""
        deviation = self._config.deviation
        noise = deviation * self._noise("score", share.shape[2:]) if deviation else 0.0
        return logistic(self._config.score * share, noise)

    def perturb(self, people: Found, twice: Bools) -> None:
        """Make those who are found again (T, V, P), in the later P slots, differ from the first time, in place."""
        t, v, p = np.nonzero(twice)
        slot = (t, v, p + self._shape[2])
        size = self._views.boxes[twice][:, 2:]
        unit = np.sqrt(BOX_SHARE * size.prod(axis=-1))[:, None] * np.asarray(COCO17.sigmas)
        before = people.keypoints[slot]
        noise = self._noise("again", (self._shape[2], len(COCO17), 2))[twice]
        after = before + AGAIN * unit[..., None] * noise
        inside = ((after >= -0.5) & (after < self._image[v] - 0.5)).all(axis=-1, keepdims=True)
        people.keypoints[slot] = np.where(inside, after, before)
        people.scores[slot] *= PALER
        people.box_scores[slot] *= PALER

    def _state(self, *key: Key, shared: float = 0.0) -> Floats:
        return self._chances.states("boxes", *key, life=self._config.life, shared=shared)

    def _noise(self, what: str, shape: tuple[int, ...]) -> Floats:
        """Standard normal numbers (T, V, S, ...) for the S slots of every view, the first of ``shape`` (S, ...)."""
        people = self._shape[2]
        result = np.empty((*self._shape[:2], *shape))
        for view in range(self._shape[1]):
            for slot in range(shape[0]):
                key = ("boxes", what, "again" if slot >= people else "first", view, slot % people)
                result[:, view, slot] = self._chances.wandering(*key, shape=shape[1:], life=self._config.life)
        return result


def _leave(people: Found, part: Bools, slots: tuple[NDArray[np.int64], ...]) -> None:
    """Leave only some of the joints (J,) to the people in some slots, in place."""
    gone = (*(index[:, None] for index in slots), np.flatnonzero(~part))
    people.keypoints[gone] = people.rivals[gone] = np.nan
    people.scores[gone] = 0.0
    people.error[gone] = KeypointError.ABSENT


def _of_part(boxes: Floats, pixels: Floats, part: Bools) -> Floats:
    """Boxes (n, 4) of some of the joints: on each side as far beyond them as the whole box is beyond all joints.

    Args:
        boxes: of the whole person, (n, 4).
        pixels: of the joints, (n, J, 2); NaN behind the camera.
        part: which joints, (J,).
    """
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    pixels = np.clip(pixels, low[:, None], high[:, None])
    within, whole = pixels[:, part], pixels
    inset = np.nan_to_num(np.fmin.reduce(within, axis=1) - np.fmin.reduce(whole, axis=1))
    outset = np.nan_to_num(np.fmax.reduce(whole, axis=1) - np.fmax.reduce(within, axis=1))
    return np.concatenate([low + inset, np.maximum(boxes[:, 2:] - inset - outset, 0.0)], axis=1)


def _merge(people: Found, pair: tuple[int, int], together: Bools, firsts: Bools) -> None:
    """Make one detection of two people, in place, in the slot of the one who gives most joints.

    What the other one gives is a swap; where both compete for a joint, the one not taken is the rival.

    Args:
        people: in boxes of their own.
        pair: who.
        together: in which pictures, (T, V), n of them.
        firsts: which joints are those of the first of the pair, (n, J).
    """
    t, v = np.nonzero(together)
    row = np.arange(len(t))
    keypoints, scores, error = (getattr(people, key)[t, v][:, list(pair)] for key in ("keypoints", "scores", "error"))
    source = np.where(firsts, 0, 1)
    reported = scores[row[:, None], source, _JOINTS] > 0
    owner = np.where((reported & firsts).sum(axis=1) >= (reported & ~firsts).sum(axis=1), 0, 1)
    slot, other = np.array(pair)[owner], np.array(pair)[1 - owner]

    swapped = reported & (source != owner[:, None])
    people.keypoints[t, v, slot] = keypoints[row[:, None], source, _JOINTS]
    people.rivals[t, v, slot] = np.where(reported[..., None], keypoints[row[:, None], 1 - source, _JOINTS], np.nan)
    people.scores[t, v, slot] = scores[row[:, None], source, _JOINTS]
    people.error[t, v, slot] = np.where(swapped, KeypointError.SWAP, error[row[:, None], source, _JOINTS])
    boxes, sureness = people.boxes[t, v][:, list(pair)], people.box_scores[t, v][:, list(pair)]
    low, high = boxes[..., :2].min(axis=1), (boxes[..., :2] + boxes[..., 2:]).max(axis=1)
    people.boxes[t, v, slot] = np.concatenate([low, high - low], axis=1)
    people.box_scores[t, v, slot] = sureness.max(axis=1)
    people.there[t, v, other] = False
