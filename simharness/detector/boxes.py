"""Errors of boxes: people missed, two people merged, one person split, people detected twice, noise of boxes.

The errors are drawn in the order missed, merged, split, duplicated, each among the people that the errors before it
left. Each has separate streams, so raising one parameter changes no other draw. Errors last ``life`` seconds on
average, which is also the correlation time of the noise of boxes and of their scores.
"""

from dataclasses import fields, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.draws import LIMB_OF_JOINT, Key, KeyedDraws, logistic
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import BOX_SHARE, hidden_shares, overlaps
from simharness.scenario.sections.detector_section import BoxesSection
from simharness.types.truth import KeypointError
from simharness.types.views import Views, Visibility

UPPER_BODY = LIMB_OF_JOINT < 2
"""Joints of the upper half of a split person, (17,): face and arms. The others are the lower half."""

DUPLICATE_SCATTER = 0.2
"""Deviation of a duplicate's keypoints from the first ones in x and in y, in units of OKS sigma x sqrt(area). It is so
small that error classes change only rarely, near their borders, and the labels are kept."""

DUPLICATE_SCORE = 0.8
"""Factor of the scores of a duplicate."""

_HIDDEN_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
_INWARD = 0.45  # most that a side may move, as a share of the box's size, so that no box turns inside out
_JOINTS = np.arange(len(COCO17))


@step("people", stage=StepStage.PEOPLE, sections=("boxes",))
def detect_people(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Detect people in boxes, with the errors of boxes."""
    return apply_box_errors(block, context.views, context.rig, context.config.boxes, context.draws)


def apply_box_errors(
    people: DetectionBlock, views: Views, rig: Rig, config: BoxesSection, draws: KeyedDraws
) -> DetectionBlock:
    """Return the detections of people in boxes.

    Args:
        people: everyone's keypoints, person p in slot p, ``present`` where any is reported; its boxes are ignored.
        views: ground truth in the pictures.
        rig: cameras, for the sizes of their images.
        config: rates and noise of the errors.
        draws: draws of the sequence.

    Returns:
        The P slots: merged people in the slot of the person who gives most joints, of split people the upper half.
        Where anyone is split or duplicated, P more slots: the lower half, or the person again.
    """
    errors = _BoxErrors(views, rig, config, draws)
    visible = views.visibility == Visibility.VISIBLE
    found = people.present & (visible.sum(axis=-1) >= config.least_visible)
    found &= ~errors.occurs("missed", errors.missed_shares(), shared=config.missed_views)
    merged = errors.merged(found)
    left = found.copy()
    for pair, merge_here in merged.items():
        left[..., pair] &= ~merge_here[..., None]
    split = left & errors.occurs("split", config.split)
    duplicated = left & ~split & errors.occurs("duplicates", config.duplicates)

    rounds = 2 if (split | duplicated).any() else 1  # how many times P slots
    blocks = {field.name: np.concatenate([getattr(people, field.name)] * rounds, axis=2) for field in fields(people)}
    blocks["present"] = np.concatenate([found, split | duplicated][:rounds], axis=2)
    second = np.where(split, Origin.LOWER_HALF, Origin.DUPLICATE).astype(np.int8)
    blocks["origin"] = np.concatenate([people.origin, second][:rounds], axis=2)
    boxes, share = (np.concatenate([each] * rounds, axis=2) for each in (views.boxes, visible.mean(axis=-1)))
    result = DetectionBlock(**blocks)
    t, v, p = np.nonzero(split)
    for half, slot in (UPPER_BODY, p), (~UPPER_BODY, p + found.shape[2]):
        _keep_joints(result, half, (t, v, slot))
        boxes[t, v, slot] = _box_of_part(views.boxes[t, v, p], views.pixels[t, v, p], half)
        share[t, v, slot] = (visible[t, v, p] & half).mean(axis=-1)
    result = replace(result, boxes=errors.jittered(boxes), box_scores=errors.scored(share))
    for pair, merge_here in merged.items():
        _merge(result, pair, merge_here, errors.limbs(pair)[merge_here])
    if duplicated.any():
        errors.perturb(result, duplicated)
    return replace(result, present=result.present & (result.scores > 0).any(axis=-1))


class _BoxErrors:
    """Draws of the errors of boxes, and everything that depends on these draws only."""

    def __init__(self, views: Views, rig: Rig, config: BoxesSection, draws: KeyedDraws) -> None:
        self._views, self._config, self._draws = views, config, draws
        self._shape = views.boxes.shape[:3]
        self._image = np.array([camera.size for camera in rig], float).reshape(-1, 1, 2)

    def missed_shares(self) -> Floats | float:
        """Return the probability that a person is missed, (T, V, P), or one for all."""
        config = self._config
        if not any(config.missed_hidden):
            return config.missed
        hidden = hidden_shares(self._views.visibility)
        return 1 - (1 - config.missed) * (1 - np.interp(hidden, _HIDDEN_SHARES, config.missed_hidden))

    def occurs(self, what: str, share: Floats | float, *, shared: float = 0.0) -> Bools:
        """Draw which people an error of probability ``share`` takes in which pictures, (T, V, P)."""
        result = np.zeros(self._shape, bool)
        share = np.broadcast_to(share, self._shape)
        if (share > 0).any():
            for person in range(self._shape[2]):
                result[..., person] = self._state(what, person, shared=shared) < ndtri(share[..., person])
        return result

    def merged(self, found: Bools) -> dict[tuple[int, int], Bools]:
        """Return which pairs of people merge in which pictures, (T, V) by pair.

        A person who could merge with two others merges with the one of the lower draw, at any rate: a higher rate only
        adds mergers.
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
        states = np.stack([self._state("merged", *pair) for pair in pairs], axis=-1)
        one, other = np.array(pairs).T
        possible = (near[..., one, other] & (states < ndtri(share))).reshape(-1, len(pairs))
        free, picture = found.reshape(-1, self._shape[2]).copy(), np.arange(len(possible))
        merged = np.zeros_like(possible)
        # In every picture the pairs are taken in rising order of their draws.
        for pair in states.reshape(possible.shape).argsort(axis=-1).T:
            a, b = one[pair], other[pair]
            merge_here = possible[picture, pair] & free[picture, a] & free[picture, b]
            free[picture[merge_here], a[merge_here]] = free[picture[merge_here], b[merge_here]] = False
            merged[picture, pair] = merge_here
        by_pair = np.moveaxis(merged.reshape(states.shape), -1, 0)
        return {pair: merge_here for pair, merge_here in zip(pairs, by_pair, strict=True) if merge_here.any()}

    def limbs(self, pair: tuple[int, int]) -> Bools:
        """Draw which joints of a merged pair are the first person's, (T, V, J): face, arms and legs as a whole."""
        life = self._config.life
        return self._draws.joint_states("boxes", "limbs", *pair, life=life, limb=1.0) < 0

    def jittered(self, boxes: Floats) -> Floats:
        """Return boxes (T, V, S, 4) with noise on every side, within the image."""
        if self._config.jitter == 0:
            return boxes
        low, size = boxes[..., :2], boxes[..., 2:]
        noise = np.clip(self._config.jitter * self._noise("sides", boxes.shape[2:]), -_INWARD, _INWARD)
        corner = np.clip(low - noise[..., :2] * size, -0.5, self._image - 0.5)
        opposite = np.clip(low + size + noise[..., 2:] * size, -0.5, self._image - 0.5)
        return np.concatenate([corner, opposite - corner], axis=-1)

    def scored(self, share: Floats) -> Floats:
        """Return the scores of boxes, (T, V, S), that show a share (T, V, S) of the joints of a whole person."""
        deviation = self._config.deviation
        noise = deviation * self._noise("score", share.shape[2:]) if deviation else 0.0
        return logistic(self._config.score * share, noise)

    def perturb(self, people: DetectionBlock, duplicated: Bools) -> None:
        """Add noise to the duplicates of people (T, V, P), in the later P slots, in place."""
        t, v, p = np.nonzero(duplicated)
        slot = (t, v, p + self._shape[2])
        size = self._views.boxes[duplicated][:, 2:]
        unit = np.sqrt(BOX_SHARE * size.prod(axis=-1))[:, None] * np.asarray(COCO17.sigmas)
        before = people.keypoints[slot]
        noise = self._noise("again", (self._shape[2], len(COCO17), 2))[duplicated]
        after = before + DUPLICATE_SCATTER * unit[..., None] * noise
        inside = ((after >= -0.5) & (after < self._image[v] - 0.5)).all(axis=-1, keepdims=True)
        people.keypoints[slot] = np.where(inside, after, before)
        people.scores[slot] *= DUPLICATE_SCORE
        people.box_scores[slot] *= DUPLICATE_SCORE

    def _state(self, *key: Key, shared: float = 0.0) -> Floats:
        return self._draws.states("boxes", *key, life=self._config.life, shared=shared)

    def _noise(self, what: str, shape: tuple[int, ...]) -> Floats:
        """Draw standard normal numbers (T, V, S, ...) for the S slots of every view; ``shape`` is (S, ...)."""
        people = self._shape[2]
        result = np.empty((*self._shape[:2], *shape))
        for view in range(self._shape[1]):
            for slot in range(shape[0]):
                key = ("boxes", what, "again" if slot >= people else "first", view, slot % people)
                result[:, view, slot] = self._draws.autoregressive(*key, shape=shape[1:], life=self._config.life)
        return result


def _keep_joints(people: DetectionBlock, part: Bools, slots: tuple[NDArray[np.int64], ...]) -> None:
    """Keep only some of the joints (J,) of the people in some slots, in place."""
    gone = (*(index[:, None] for index in slots), np.flatnonzero(~part))
    people.keypoints[gone] = people.rivals[gone] = np.nan
    people.scores[gone] = 0.0
    people.guessed[gone] = False
    people.error[gone] = KeypointError.ABSENT


def _box_of_part(boxes: Floats, pixels: Floats, part: Bools) -> Floats:
    """Return boxes (n, 4) of some of the joints, with the same margins as the whole boxes have around all joints.

    Args:
        boxes: boxes of whole people, (n, 4).
        pixels: positions of their joints, (n, J, 2); NaN behind the camera.
        part: which joints, (J,).
    """
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    pixels = np.clip(pixels, low[:, None], high[:, None])
    within, whole = pixels[:, part], pixels
    inset = np.nan_to_num(np.fmin.reduce(within, axis=1) - np.fmin.reduce(whole, axis=1))
    outset = np.nan_to_num(np.fmax.reduce(whole, axis=1) - np.fmax.reduce(within, axis=1))
    return np.concatenate([low + inset, np.maximum(boxes[:, 2:] - inset - outset, 0.0)], axis=1)


def _merge(people: DetectionBlock, pair: tuple[int, int], merge_here: Bools, firsts: Bools) -> None:
    """Merge two people into one detection, in place, in the slot of the person who gives most joints.

    Joints of the other person are swaps; the position of a joint that is not taken is its rival.

    Args:
        people: people in separate boxes.
        pair: indices of the two people.
        merge_here: in which pictures they merge, (T, V), n of them.
        firsts: which joints are those of the first person, (n, J).
    """
    t, v = np.nonzero(merge_here)
    row = np.arange(len(t))
    keypoints, scores, error, guessed = (
        getattr(people, key)[t, v][:, list(pair)] for key in ("keypoints", "scores", "error", "guessed")
    )
    source = np.where(firsts, 0, 1)
    reported = scores[row[:, None], source, _JOINTS] > 0
    owner = np.where((reported & firsts).sum(axis=1) >= (reported & ~firsts).sum(axis=1), 0, 1)
    slot, other = np.array(pair)[owner], np.array(pair)[1 - owner]

    swapped = reported & (source != owner[:, None])
    people.keypoints[t, v, slot] = keypoints[row[:, None], source, _JOINTS]
    people.rivals[t, v, slot] = np.where(reported[..., None], keypoints[row[:, None], 1 - source, _JOINTS], np.nan)
    people.scores[t, v, slot] = scores[row[:, None], source, _JOINTS]
    people.error[t, v, slot] = np.where(swapped, KeypointError.SWAP, error[row[:, None], source, _JOINTS])
    people.guessed[t, v, slot] = guessed[row[:, None], source, _JOINTS]
    boxes, box_scores = people.boxes[t, v][:, list(pair)], people.box_scores[t, v][:, list(pair)]
    low, high = boxes[..., :2].min(axis=1), (boxes[..., :2] + boxes[..., 2:]).max(axis=1)
    people.boxes[t, v, slot] = np.concatenate([low, high - low], axis=1)
    people.box_scores[t, v, slot] = box_scores.max(axis=1)
    people.present[t, v, other] = False
