"""Positions of keypoints, their errors and their scores.

Every joint in the picture has at most one error: not reported (drop), guessed, at the same joint of a neighbour (swap),
at its left-right counterpart (inversion), far off (miss), slightly off (jitter); otherwise it is good. Each error has a
separate stream. They are drawn in that order, each among the joints that the errors before it left: raising one
parameter takes more joints and changes no other joint. After drop, a joint may be guessed from the joints that are
neither dropped nor guessed (:mod:`simharness.detector.reported`); only guesses depend on which joints these are.

Classes and distances: Ronchi & Perona, "Benchmarking and error diagnosis in multi-instance pose estimation", ICCV 2017.

Scores of keypoints follow the drawn errors, but misses may be overconfident and good keypoints unsure.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import ErrorDraws, KeyedDraws, logistic
from simharness.detector.error_classes import MIRROR, PAIRED, jitter_distance
from simharness.detector.reported import ReportedJoints, guess_places, last_pixels, pixels_per_metre
from simharness.detector.scatter import Scatter
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import (
    OCCLUDED,
    OUTSIDE,
    SELF_OCCLUDED,
    VISIBLE,
    Conditions,
    bearings,
    distance_factors,
    image_axes,
    inversion_factors,
    pixel_offsets,
)
from simharness.scenario.sections.detector_section import (
    BiasSection,
    CorrelationSection,
    KeypointsSection,
    ScoresSection,
)
from simharness.types.sequence import Sequence
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError
from simharness.types.views import Views

_SMALL = 64.0  # pixels, sqrt(area) of a person below which `small` raises the rates of errors
_HARDEST = 4.0  # largest factor by which small size raises them


@dataclass(frozen=True)
class Keypoints2D:
    """Keypoints of everyone in every picture."""

    pixels: Floats
    """Positions, (T, V, P, J, 2); NaN where not reported."""
    error: NDArray[np.int8]
    """:class:`KeypointError`, (T, V, P, J): an inversion or a swap where one was drawn and led away from the joint,
    else by the distance."""
    guessed: Bools
    """Which keypoints are guesses, (T, V, P, J)."""
    rivals: Floats
    """Positions of second peaks, (T, V, P, J, 2); NaN where there is none."""


@step("keypoints", stage=StepStage.KEYPOINTS, sections=("keypoints", "bias", "correlation"))
def set_keypoints(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Move every person's keypoints to where the detector finds them."""
    config, rig = context.config, context.rig
    offset = None if config.bias == BiasSection() else pixel_offsets(context.sequence.joints, config.bias, rig)
    found = find_keypoints(
        context.views,
        context.conditions,
        context.sequence,
        rig,
        config.keypoints,
        config.correlation,
        context.draws,
        kind=config.kind,
        offset=offset,
    )
    return replace(
        block,
        present=np.any(found.error != KeypointError.ABSENT, axis=-1),
        keypoints=found.pixels,
        error=found.error,
        guessed=found.guessed,
        rivals=found.rivals,
    )


def find_keypoints(
    views: Views,
    conditions: Conditions,
    sequence: Sequence,
    rig: Rig,
    config: KeypointsSection,
    correlation: CorrelationSection,
    draws: KeyedDraws,
    *,
    kind: str = "top-down",
    offset: Floats | None = None,
) -> Keypoints2D:
    """Return the keypoints of everyone as the detector finds them.

    Args:
        views: ground truth in the pictures.
        conditions: viewing conditions.
        sequence: ground truth in space, for the directions from which cameras see people.
        rig: true rig.
        config: rates of the errors.
        correlation: correlation of the errors in time, across views and within limbs.
        draws: draws of the sequence.
        kind: "bottom-up" (no joint without its parent in the tree of parts) or "top-down".
        offset: offset of the detector's joints from the anatomical ones, (T, V, P, J, 2) pixels; None: no offset.
    """
    target = views.pixels if offset is None else views.pixels + offset
    errors = _KeypointErrors(target, views.boxes, conditions, sequence.joints, rig, config, correlation, draws, kind)
    parts = [errors.find(person) for person in range(target.shape[2])]
    if not parts:
        empty = target.copy()
        return Keypoints2D(empty, np.zeros(target.shape[:4], np.int8), np.zeros(target.shape[:4], bool), empty)
    return Keypoints2D(*(np.stack(each, axis=2) for each in zip(*parts, strict=True)))


class _KeypointErrors:
    """Draws the keypoints of one person after the other; tables of parameters by joint are made once."""

    def __init__(
        self,
        target: Floats,
        boxes: Floats,
        conditions: Conditions,
        joints: Floats,
        rig: Rig,
        config: KeypointsSection,
        correlation: CorrelationSection,
        draws: KeyedDraws,
        kind: str,
    ) -> None:
        self._target, self._boxes, self._conditions = target, boxes, conditions
        self._joints, self._rig, self._axes = joints, rig, image_axes(joints.mean(axis=2), rig)
        self._config = config
        self._errors = ErrorDraws(draws, correlation, kind == "bottom-up")
        self._reported = ReportedJoints(target, conditions, joints, rig, config, self._errors)
        self._scatter = Scatter(config, correlation, draws)
        self._jitter = np.array(config.jitter.by_joint())
        self._jitter_mean = np.array(config.jitter_mean.by_joint())
        self._miss_mean = np.array(config.miss_mean.by_joint())
        self._by_occlusion = np.ones((4, len(self._jitter)))
        self._by_occlusion[SELF_OCCLUDED] = config.self_occluded.by_joint()
        self._by_occlusion[OCCLUDED] = config.occluded.by_joint()
        self._stray = np.array(config.stray.by_joint())
        some = config.miss_some or config.miss
        self._miss = np.array([shares.by_joint() for shares in (config.miss, some, config.miss_few or some)])
        self._inversion = np.where(PAIRED, config.inversion.by_joint(), 0.0)
        self._inversion_factor = inversion_factors(joints, rig, config.inversion_bearing)
        self._swap = np.array([shares.by_joint() for shares in (config.swap, config.swap_crowded or config.swap)])

    def find(self, person: int) -> tuple[Floats, NDArray[np.int8], Bools, Floats]:
        """Return pixels (T, V, J, 2), errors, guesses (T, V, J each) and rivals (T, V, J, 2) of one person."""
        config, conditions = self._config, self._conditions
        true, unit, occlusion = (
            self._target[:, :, person],
            conditions.unit[:, :, person],
            conditions.occlusion[:, :, person],
        )
        scatter = unit[..., None] * self._scatter.of_person(person, occlusion, self._axes[:, :, person])
        found = true + scatter
        reported = self._reported.of_person(person)
        guessed = reported.guessed

        harder = self._harder(person)
        jitter = self._errors.occurs("jitter", person, config.quality * self._jitter * harder)
        some = np.digitize(-conditions.valid[:, :, person], [-10, -5])  # more than 10 valid joints, 6 to 10, fewer
        miss = self._errors.occurs("miss", person, config.quality * self._miss[some] * harder)
        off = jitter | miss
        if off.any():
            direction, far = self._places(person, off)
            jitter_mean, miss_mean = (means[np.nonzero(off)[-1]] for means in (self._jitter_mean, self._miss_mean))
            of_miss = jitter_distance(far, miss_mean, nearest=MISS_FROM, farthest=config.reach)
            reach = np.where(miss[off], of_miss, jitter_distance(far, jitter_mean))
            found[off] = true[off] + (unit[off] * reach)[:, None] * direction
            stray = miss & self._errors.occurs("stray", person, self._stray)
            if stray.any():
                found[stray] = self._anywhere(person)[stray]

        share = config.quality * self._inversion_factor[:, :, person, None] * self._inversion
        share = share * np.where(occlusion == OCCLUDED, 1.0, config.inversion_uncovered)
        other = true[:, :, MIRROR]
        if config.inversion_reach:
            share = share * distance_factors(true, other, self._boxes[:, :, person, 3], config.inversion_reach)
        inverted = self._errors.occurs("inversion", person, share)
        inverted &= np.isfinite(other[..., 0])
        swapped, neighbour = self._swaps(person)
        place = np.where(swapped[..., None], neighbour, other)
        moved = swapped | inverted
        if moved.any():
            found = np.where(moved[..., None], place + scatter, found)
        if guessed.any():
            found[guessed] = self._guesses(person, reported.joints & ~guessed)[guessed]
        if reported.at_border.any():
            found = np.where(reported.at_border[..., None], np.clip(found, 0.0, last_pixels(self._rig)), found)
        error = self._labels(found, person, inverted & ~guessed, swapped & ~guessed)
        error[~reported.joints] = KeypointError.ABSENT
        found = np.where(reported.joints[..., None], found, np.nan)
        return found, error, guessed, self._rivals(true + scatter, other + scatter, error, guessed, occlusion)

    def _harder(self, person: int) -> Floats:
        """Return the factors of the rates of jitter and miss, (T, V, J)."""
        config, conditions = self._config, self._conditions
        harder = self._by_occlusion[conditions.occlusion[:, :, person], np.arange(self._by_occlusion.shape[1])]
        size = np.sqrt(np.maximum(conditions.area[:, :, person], 1.0))
        small = np.clip((_SMALL / size) ** config.small, 1.0, _HARDEST) if config.small else np.ones(size.shape)
        return harder * np.where(conditions.cut[:, :, person], config.truncated * small, small)[..., None]

    def _places(self, person: int, off: Bools) -> tuple[Floats, Floats]:
        """Return directions (n, 2) and relative distances (n,), 0 to 1, of the n joints that are ``off``."""
        turn = 2 * np.pi * ndtr(self._errors.normal("direction", person)[off])
        return np.stack([np.cos(turn), np.sin(turn)], axis=-1), ndtr(self._errors.normal("distance", person)[off])

    def _anywhere(self, person: int) -> Floats:
        """Return random places on the person's box, (T, V, J, 2)."""
        box = self._boxes[:, :, person, None]
        across, down = (ndtr(self._errors.normal(what, person)) for what in ("across", "down"))
        return box[..., :2] + np.stack([across, down], axis=-1) * box[..., 2:]

    def _guesses(self, person: int, localised: Bools) -> Floats:
        """Return guesses of the joints that are not localised, inside the images, (T, V, J, 2)."""
        joints, shape = self._joints[:, person], localised.shape
        box = self._boxes[:, :, person]
        places = guess_places(
            self._target[:, :, person].reshape(-1, *shape[2:], 2),
            localised.reshape(-1, *shape[2:]),
            bearings=bearings(joints[:, None], self._rig)[:, :, 0].ravel(),
            scale=pixels_per_metre(joints, self._rig, localised).ravel(),
            center=(box[..., :2] + box[..., 2:] / 2).reshape(-1, 2),
        ).reshape(*shape, 2)
        deviation = np.array(self._config.guess.scatter.by_joint()) * self._conditions.unit[:, :, person]
        if deviation.any():
            away = [self._errors.normal(what, person) for what in ("guess right", "guess down")]
            places += deviation[..., None] * np.stack(away, axis=-1)
        return np.clip(places, 0.0, last_pixels(self._rig))

    def _swaps(self, person: int) -> tuple[Bools, Floats]:
        """Return which joints (T, V, J) are swapped, and the joints of the neighbour, (T, V, J, 2)."""
        conditions = self._conditions
        neighbour = conditions.neighbour[:, :, person]
        frame, view = np.indices(neighbour.shape)
        of_neighbour = self._target[frame, view, neighbour]
        shown = conditions.occlusion[frame, view, neighbour] != OUTSIDE
        crowded = conditions.crowded[:, :, person].astype(int)
        covered = conditions.occlusion[:, :, person] == OCCLUDED
        share = self._config.quality * self._swap[crowded] * np.where(covered, 1.0, self._config.swap_uncovered)
        possible = shown & (neighbour >= 0)[..., None]
        if self._config.swap_reach and share.any():
            height = self._boxes[:, :, person, 3]
            target = self._target[:, :, person]
            share = share * distance_factors(target, of_neighbour, height, self._config.swap_reach)
        return possible & self._errors.occurs("swap", person, np.where(possible, share, 0.0)), of_neighbour

    def _labels(self, found: Floats, person: int, inverted: Bools, swapped: Bools) -> NDArray[np.int8]:
        """Return the error classes: by distance, with the drawn inversions and swaps among the misses."""
        unit = np.maximum(self._conditions.unit[:, :, person], 1e-9)
        away = found - self._target[:, :, person]
        with np.errstate(invalid="ignore"):
            distance = np.hypot(away[..., 0], away[..., 1]) / unit
            far = ~(distance < MISS_FROM)  # true of joints behind the camera, whose place is unknown
            error = np.where(far, KeypointError.MISS, KeypointError.JITTER)
            error = np.where(distance < GOOD_BELOW - 1e-9, KeypointError.GOOD, error)
        error = np.where(inverted & far, KeypointError.INVERSION, error)
        return np.where(swapped & far, KeypointError.SWAP, error).astype(np.int8)

    @staticmethod
    def _rivals(
        true: Floats, other: Floats, error: NDArray[np.int8], guessed: Bools, occlusion: NDArray[np.int8]
    ) -> Floats:
        """Return second peaks (T, V, J, 2): the true place of a displaced joint, the counterpart of a hidden joint.

        The detector does not know the true place of a joint that it guesses.

        Args:
            true: true places with the scatter of good keypoints, because a peak is not more exact, (T, V, J, 2).
            other: places of their left-right counterparts, with the same scatter, (T, V, J, 2).
            error: error classes, (T, V, J).
            guessed: which joints are guessed, (T, V, J).
            occlusion: occlusion classes of the joints, (T, V, J).
        """
        elsewhere = (error == KeypointError.INVERSION) | (error == KeypointError.SWAP) | (error == KeypointError.MISS)
        elsewhere &= ~guessed
        unsure = ~elsewhere & (error != KeypointError.ABSENT) & (occlusion != VISIBLE) & PAIRED
        return np.where(elsewhere[..., None], true, np.where(unsure[..., None], other, np.nan))


MIN_SCORE = 0.02
"""Lowest score of a joint that is reported."""


@step("scores", stage=StepStage.SCORES, sections=("scores", "correlation"))
def set_scores(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Give every keypoint its score; a person without a scored keypoint is not detected."""
    scores = score_keypoints(
        block.error, block.guessed, context.conditions, context.config.scores, context.config.correlation, context.draws
    )
    return replace(block, present=np.any(scores > 0, axis=-1), scores=scores)


def score_keypoints(
    error: NDArray[np.int8],
    guessed: Bools,
    conditions: Conditions,
    config: ScoresSection,
    correlation: CorrelationSection,
    draws: KeyedDraws,
) -> Floats:
    """Return the scores of everyone's keypoints, (T, V, P, J); 0 where not reported.

    Args:
        error: :class:`KeypointError` of each keypoint, (T, V, P, J).
        guessed: which keypoints are guesses, (T, V, P, J).
        conditions: viewing conditions.
        config: usual scores and their spread.
        correlation: correlation of the draws in time.
        draws: draws of the sequence.
    """
    usual, hidden = np.zeros(len(KeypointError)), np.ones(len(KeypointError))
    for kind in KeypointError:
        usual[kind] = getattr(config, kind.name.lower(), 0.0)
        hidden[kind] = getattr(config.hidden, kind.name.lower(), 1.0)
    scored_as, unsure = error.copy(), guessed.copy()
    _, views, people, joints = error.shape
    doubtful = (error == KeypointError.MISS) | guessed
    for share, purpose, candidates, other in (
        (config.overconfident, "overconfident", doubtful, KeypointError.GOOD),
        (config.underconfident, "underconfident", (error == KeypointError.GOOD) & ~guessed, KeypointError.MISS),
    ):
        if share > 0:
            for person in range(people):
                state = draws.joint_states(purpose, person, lives=("lives", person), life=correlation.life)
                taken = candidates[:, :, person] & (state < ndtri(share))
                scored_as[:, :, person][taken] = other
                unsure[:, :, person][taken] = False
    factor = np.where((conditions.occlusion == VISIBLE) | guessed, 1.0, hidden[scored_as])
    score = usual[scored_as] * factor * np.array(config.joint.by_joint())
    of_guess = np.where(conditions.occlusion == OUTSIDE, config.outside, 1.0) * np.array(config.guess.by_joint())
    score = np.where(unsure, of_guess, score)
    score = np.minimum(score, 1.0)
    if config.deviation > 0:
        for person in range(people):
            for view in range(views):
                spread = draws.autoregressive("score", person, view, shape=(joints,), life=correlation.scatter_life)
                score[:, view, person] = logistic(score[:, view, person], config.deviation * spread)
    return np.where(error == KeypointError.ABSENT, 0.0, np.maximum(score, MIN_SCORE))
