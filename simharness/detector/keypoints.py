"""Positions of keypoints and their errors.

Every joint in the picture has at most one error: not reported (drop), at the same joint of a neighbour (swap), at its
left-right counterpart (inversion), far off (miss), slightly off (jitter); otherwise it is good. Each error has a
separate stream. They are drawn in that order, each among the joints that the errors before it left: raising one
parameter takes more joints and changes no other joint. A joint hidden by another person or an object may be guessed
from the pose of the rest.

Classes and distances: Ronchi & Perona, "Benchmarking and error diagnosis in multi-instance pose estimation", ICCV 2017.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.bias import pixel_offsets
from simharness.detector.conditions import OCCLUDED, OUTSIDE, SELF_OCCLUDED, VISIBLE, Conditions
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import KeyedDraws
from simharness.detector.error_classes import MIRROR, PAIRED
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.view_geometry import image_axes
from simharness.scenario.sections.detector import Bias, Correlation, Keypoints
from simharness.types.sequence import Sequence
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError
from simharness.types.views import Views

_SMALL = 64.0  # pixels, sqrt(area) of a person below which `small` raises the rates of errors
_HARDEST = 4.0  # largest factor by which small size raises them

_PARENT = np.array([parent if parent >= 0 else COCO17.mirror[joint] for joint, parent in enumerate(COCO17.parents)])
# A guessed joint keeps its parent in the skeleton; the bone gets a wrong direction (radians) and length (logarithm).
_GUESS_TURN, _GUESS_LENGTH = np.deg2rad(35.0), 0.25


@dataclass(frozen=True)
class Keypoints2D:
    """Keypoints of everyone in every picture.

    Attributes:
        pixels: positions, (T, V, P, J, 2); NaN where not reported.
        error: :class:`KeypointError`, (T, V, P, J): an inversion or a swap where one was drawn and led away from the
            joint, else by the distance.
        guessed: which keypoints are guesses of hidden joints, (T, V, P, J).
        rivals: positions of second peaks, (T, V, P, J, 2); NaN where there is none.
    """

    pixels: Floats
    error: NDArray[np.int8]
    guessed: Bools
    rivals: Floats


@step("keypoints", stage=StepStage.KEYPOINTS, sections=("keypoints", "bias", "correlation"))
def set_keypoints(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Move every person's keypoints to where the detector finds them."""
    config, rig = context.config, context.rig
    offset = None if config.bias == Bias() else pixel_offsets(context.sequence.joints, config.bias, rig)
    found = find_keypoints(
        context.views,
        context.conditions,
        context.sequence,
        rig,
        config.keypoints,
        config.correlation,
        context.draws,
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
    config: Keypoints,
    correlation: Correlation,
    draws: KeyedDraws,
    *,
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
        offset: offset of the detector's joints from the anatomical ones, (T, V, P, J, 2) pixels; None: no offset.
    """
    target = views.pixels if offset is None else views.pixels + offset
    axes = image_axes(sequence.joints.mean(axis=2), rig)
    errors = _KeypointErrors(target, views.boxes, conditions, axes, config, correlation, draws)
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
        axes: Floats,
        config: Keypoints,
        correlation: Correlation,
        draws: KeyedDraws,
    ) -> None:
        self._target, self._boxes, self._conditions, self._axes = target, boxes, conditions, axes
        self._config, self._correlation, self._draws = config, correlation, draws
        self._every = np.arange(len(COCO17))
        drop = (config.drop.visible, config.drop.self_occluded, config.drop.occluded)
        self._drop = np.array([shares.by_joint() for shares in drop])
        self._scatter = np.array(config.scatter.by_joint())
        self._jitter = np.array(config.jitter.by_joint())
        some = config.miss_some or config.miss
        self._miss = np.array([shares.by_joint() for shares in (config.miss, some, config.miss_few or some)])
        self._inversion = np.where(PAIRED, config.inversion.by_joint(), 0.0)
        self._swap = np.array([shares.by_joint() for shares in (config.swap, config.swap_crowded or config.swap)])

    def find(self, person: int) -> tuple[Floats, NDArray[np.int8], Bools, Floats]:
        """Return pixels (T, V, J, 2), errors, guesses (T, V, J each) and rivals (T, V, J, 2) of one person."""
        config, conditions = self._config, self._conditions
        true, unit, occlusion = (
            self._target[:, :, person],
            conditions.unit[:, :, person],
            conditions.occlusion[:, :, person],
        )
        scatter = unit[..., None] * self._offsets(person)
        found = true + scatter

        harder = self._harder(person)
        jitter = self._occurs("jitter", person, config.quality * self._jitter * harder)
        some = np.digitize(-conditions.valid[:, :, person], [-10, -5])  # more than 10 valid joints, 6 to 10, fewer
        miss = self._occurs("miss", person, config.quality * self._miss[some] * harder)
        off = jitter | miss
        if off.any():
            direction, far = self._places(person, off)
            reach = np.where(
                miss[off],
                MISS_FROM + (config.reach - MISS_FROM) * far,
                GOOD_BELOW + (MISS_FROM - GOOD_BELOW) * far,
            )
            found[off] = true[off] + (unit[off] * reach)[:, None] * direction
            stray = miss & self._occurs("stray", person, config.stray)
            if stray.any():
                found[stray] = self._anywhere(person)[stray]

        guessed = (occlusion == OCCLUDED) & self._occurs("guess", person, config.hallucinate)
        if guessed.any():
            found[guessed] = self._guesses(person)[guessed]
        inverted = self._occurs("inversion", person, config.quality * self._inversion)
        other = true[:, :, MIRROR]
        inverted &= np.isfinite(other[..., 0])
        swapped, neighbour = self._swaps(person)
        place = np.where(swapped[..., None], neighbour, other)
        moved = swapped | inverted
        if moved.any():
            found = np.where(moved[..., None], place + scatter, found)
        error = self._labels(found, person, inverted, swapped)
        guessed &= ~moved
        outside = occlusion == OUTSIDE
        gone = outside | self._occurs("drop", person, self._drop[np.where(outside, VISIBLE, occlusion), self._every])
        error[gone] = KeypointError.ABSENT
        found = np.where(gone[..., None], np.nan, found)
        return found, error, guessed & ~gone, self._rivals(true + scatter, other + scatter, error, occlusion)

    def _occurs(self, what: str, person: int, share: Floats | float) -> Bools:
        """Draw which joints (T, V, J) an error takes with probability ``share``."""
        share = np.minimum(share, 1.0)
        most = share.max(initial=0.0)
        if most == 0.0:
            return np.zeros(self._conditions.occlusion[:, :, person].shape, bool)
        state = self._state(what, person, shared=True)
        occurs = state < ndtri(most)
        if share.ndim and share.min() < most:  # quantiles are expensive: only where needed
            where = np.nonzero(occurs)
            occurs[where] = state[where] < ndtri(np.broadcast_to(share, state.shape)[where])
        return occurs

    def _state(self, what: str, person: int, *, shared: bool) -> Floats:
        correlation = self._correlation
        return self._draws.joint_states(
            what,
            person,
            lives=("lives", person),
            life=correlation.life,
            shared=correlation.views if shared else 0.0,
            limb=correlation.limb if shared else 0.0,
        )

    def _harder(self, person: int) -> Floats:
        """Return the factors of the rates of jitter and miss, (T, V, J)."""
        config, conditions = self._config, self._conditions
        by_occlusion = np.ones(4)
        by_occlusion[[SELF_OCCLUDED, OCCLUDED]] = config.self_occluded, config.occluded
        harder = by_occlusion[conditions.occlusion[:, :, person]]
        size = np.sqrt(np.maximum(conditions.area[:, :, person], 1.0))
        small = np.clip((_SMALL / size) ** config.small, 1.0, _HARDEST) if config.small else np.ones(size.shape)
        return harder * np.where(conditions.cut[:, :, person], config.truncated * small, small)[..., None]

    def _offsets(self, person: int) -> Floats:
        """Return the scatter of good keypoints, (T, V, J, 2) units: Gaussian, truncated where the class good ends."""
        correlation, draws = self._correlation, self._draws
        frames, views, joints = self._conditions.occlusion[:, :, person].shape
        if not self._scatter.any():
            return np.zeros((frames, views, joints, 2))
        normal = np.zeros((frames, views, joints, 2))
        if correlation.scatter_views < 1:
            for view in range(views):
                separate = draws.autoregressive(
                    "scatter", person, "view", view, shape=(joints, 2), life=correlation.scatter_life
                )
                normal[:, view] = np.sqrt(1 - correlation.scatter_views) * separate
        if correlation.scatter_views > 0:
            space = draws.autoregressive("scatter", person, "all", shape=(joints, 3), life=correlation.scatter_life)
            axes = np.swapaxes(self._axes[:, :, person], -1, -2)
            normal += np.sqrt(correlation.scatter_views) * (space[:, None] @ axes)
        # The radius keeps its rank when its distribution is truncated: radius² / 2 is exponential.
        square = (normal**2).sum(axis=-1)
        sigma = np.maximum(self._scatter, 1e-9)
        whole = -np.expm1(-0.5 * (GOOD_BELOW / sigma) ** 2)
        radius = sigma * np.sqrt(-2 * np.log1p(np.expm1(-0.5 * square) * whole))
        return normal * np.divide(radius, np.sqrt(square), out=np.zeros_like(square), where=square > 0)[..., None]

    def _places(self, person: int, off: Bools) -> tuple[Floats, Floats]:
        """Return directions (n, 2) and relative distances (n,), 0 to 1, of the n joints that are ``off``."""
        turn = 2 * np.pi * ndtr(self._state("direction", person, shared=False)[off])
        return np.stack([np.cos(turn), np.sin(turn)], axis=-1), ndtr(self._state("distance", person, shared=False)[off])

    def _anywhere(self, person: int) -> Floats:
        """Return random places on the person's box, (T, V, J, 2)."""
        box = self._boxes[:, :, person, None]
        across, down = (ndtr(self._state(what, person, shared=False)) for what in ("across", "down"))
        return box[..., :2] + np.stack([across, down], axis=-1) * box[..., 2:]

    def _guesses(self, person: int) -> Floats:
        """Return guesses of the joints from their parents in the skeleton, (T, V, J, 2)."""
        true = self._target[:, :, person]
        bone = true - true[:, :, _PARENT]
        turn = _GUESS_TURN * self._state("guess turn", person, shared=False)
        longer = np.exp(_GUESS_LENGTH * self._state("guess length", person, shared=False))
        cos, sin = longer * np.cos(turn), longer * np.sin(turn)
        turned = [cos * bone[..., 0] - sin * bone[..., 1], sin * bone[..., 0] + cos * bone[..., 1]]
        return true[:, :, _PARENT] + np.stack(turned, axis=-1)

    def _swaps(self, person: int) -> tuple[Bools, Floats]:
        """Return which joints (T, V, J) are swapped, and the joints of the neighbour, (T, V, J, 2)."""
        conditions = self._conditions
        neighbour = conditions.neighbour[:, :, person]
        frame, view = np.indices(neighbour.shape)
        of_neighbour = self._target[frame, view, neighbour]
        shown = conditions.occlusion[frame, view, neighbour] != OUTSIDE
        crowded = conditions.crowded[:, :, person].astype(int)
        share = self._config.quality * self._swap[crowded]
        possible = shown & (neighbour >= 0)[..., None]
        return possible & self._occurs("swap", person, np.where(possible, share, 0.0)), of_neighbour

    def _labels(self, found: Floats, person: int, inverted: Bools, swapped: Bools) -> NDArray[np.int8]:
        """Return the error classes: by distance, with the drawn inversions and swaps among the misses."""
        unit = np.maximum(self._conditions.unit[:, :, person], 1e-9)
        away = found - self._target[:, :, person]
        with np.errstate(invalid="ignore"):
            distance = np.hypot(away[..., 0], away[..., 1]) / unit
            far = distance >= MISS_FROM
            error = np.where(far, KeypointError.MISS, KeypointError.JITTER)
            error = np.where(distance < GOOD_BELOW - 1e-9, KeypointError.GOOD, error)
        error = np.where(inverted & far, KeypointError.INVERSION, error)
        return np.where(swapped & far, KeypointError.SWAP, error).astype(np.int8)

    @staticmethod
    def _rivals(true: Floats, other: Floats, error: NDArray[np.int8], occlusion: NDArray[np.int8]) -> Floats:
        """Return second peaks (T, V, J, 2): the true place of a displaced joint, the counterpart of a hidden joint.

        Args:
            true: true places with the scatter of good keypoints, because a peak is not more exact, (T, V, J, 2).
            other: places of their left-right counterparts, with the same scatter, (T, V, J, 2).
            error: error classes, (T, V, J).
            occlusion: occlusion classes of the joints, (T, V, J).
        """
        elsewhere = (error == KeypointError.INVERSION) | (error == KeypointError.SWAP) | (error == KeypointError.MISS)
        unsure = ~elsewhere & (error != KeypointError.ABSENT) & (occlusion != VISIBLE) & PAIRED
        return np.where(elsewhere[..., None], true, np.where(unsure[..., None], other, np.nan))
