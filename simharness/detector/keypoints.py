"""Where the keypoints of everyone are found, and what is wrong with them.

Every joint that is in the picture has at most one error: not reported (drop), found at the same joint of a neighbour
(swap), at its left-right counterpart (inversion), far off (miss), somewhat off (jitter); otherwise it is good. Each is
drawn from a stream of its own, in that order, each among the joints that those before left: so a dial turned up takes
joints and changes no other. A joint that somebody or something hides may be guessed from the pose of the rest.

Classes and distances: Ronchi & Perona, "Benchmarking and error diagnosis in multi-instance pose estimation", ICCV 2017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.classes import MIRROR, PAIRED
from simharness.detector.conditions import HIDDEN, OUTSIDE, OWN, VISIBLE, Conditions
from simharness.detector.correlation import Chances
from simharness.detector.view_geometry import image_axes
from simharness.scenario.sections.detector import Correlation, Keypoints
from simharness.types.sequence import Sequence
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError
from simharness.types.views import Views

_SMALL = 64.0  # pixels, sqrt(area) of a person from which on `small` makes it harder
_HARDEST = 4.0  # times as many errors that smallness makes at most

_PARENT = np.array([parent if parent >= 0 else COCO17.mirror[joint] for joint, parent in enumerate(COCO17.parents)])
# A guessed joint hangs from its neighbour in the skeleton: right bone, wrong way. Degrees and logarithm of length.
_GUESS_TURN, _GUESS_LENGTH = np.deg2rad(35.0), 0.25


@dataclass(frozen=True)
class Keypoints2D:
    """The keypoints of everyone in every picture.

    Attributes:
        pixels: (T, V, P, J, 2); NaN where not reported.
        error: :class:`KeypointError`, (T, V, P, J): an inversion or a swap where one was drawn and led away from the
            joint, else by the distance.
        guessed: which were guessed, (T, V, P, J).
        rivals: where a second peak competes, (T, V, P, J, 2); NaN where none does.
    """

    pixels: Floats
    error: NDArray[np.int8]
    guessed: Bools
    rivals: Floats


def find_keypoints(
    views: Views,
    conditions: Conditions,
    sequence: Sequence,
    rig: Rig,
    config: Keypoints,
    correlation: Correlation,
    chances: Chances,
    *,
    shift: Floats | None = None,
) -> Keypoints2D:
    """Find the keypoints of everyone.

    Args:
        views: the truth in the pictures.
        conditions: what makes it hard.
        sequence: where everyone is, which says from where a camera sees them.
        rig: the cameras.
        config: how often which error.
        correlation: what errors have to do with each other.
        chances: the draws.
        shift: of the detector's joints from anatomy's, (T, V, P, J, 2) pixels.
    """
    target = views.pixels if shift is None else views.pixels + shift
    axes = image_axes(sequence.joints.mean(axis=2), rig)
    finder = _Finder(target, views.boxes, conditions, axes, config, correlation, chances)
    parts = [finder.find(person) for person in range(target.shape[2])]
    if not parts:
        empty = target.copy()
        return Keypoints2D(empty, np.zeros(target.shape[:4], np.int8), np.zeros(target.shape[:4], bool), empty)
    return Keypoints2D(*(np.stack(each, axis=2) for each in zip(*parts, strict=True)))


class _Finder:
    """Finds one person after the other; what of the settings is a table is looked up once."""

    def __init__(
        self,
        target: Floats,
        boxes: Floats,
        conditions: Conditions,
        axes: Floats,
        config: Keypoints,
        correlation: Correlation,
        chances: Chances,
    ) -> None:
        self._target, self._boxes, self._conditions, self._axes = target, boxes, conditions, axes
        self._config, self._correlation, self._chances = config, correlation, chances
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
        """Pixels (T, V, J, 2), errors, which are guessed (T, V, J), and rivals of one person."""
        config, conditions = self._config, self._conditions
        true, unit, seen = self._target[:, :, person], conditions.unit[:, :, person], conditions.seen[:, :, person]
        scatter = unit[..., None] * self._offsets(person)
        found = true + scatter

        harder = self._harder(person)
        jitter = self._happens("jitter", person, config.quality * self._jitter * harder)
        some = np.digitize(-conditions.valid[:, :, person], [-10, -5])  # more than 10 valid joints, 6 to 10, fewer
        miss = self._happens("miss", person, config.quality * self._miss[some] * harder)
        off = jitter | miss
        if off.any():
            direction, far = self._places(person, off)
            reach = np.where(
                miss[off],
                MISS_FROM + (config.reach - MISS_FROM) * far,
                GOOD_BELOW + (MISS_FROM - GOOD_BELOW) * far,
            )
            found[off] = true[off] + (unit[off] * reach)[:, None] * direction
            stray = miss & self._happens("stray", person, config.stray)
            if stray.any():
                found[stray] = self._anywhere(person)[stray]

        guessed = (seen == HIDDEN) & self._happens("guess", person, config.hallucinate)
        if guessed.any():
            found[guessed] = self._guesses(person)[guessed]
        inverted = self._happens("inversion", person, config.quality * self._inversion)
        other = true[:, :, MIRROR]
        inverted &= np.isfinite(other[..., 0])
        swapped, neighbour = self._swaps(person)
        place = np.where(swapped[..., None], neighbour, other)
        moved = swapped | inverted
        if moved.any():
            found = np.where(moved[..., None], place + scatter, found)
        error = self._labels(found, person, inverted, swapped)
        guessed &= ~moved
        outside = seen == OUTSIDE
        gone = outside | self._happens("drop", person, self._drop[np.where(outside, VISIBLE, seen), self._every])
        error[gone] = KeypointError.ABSENT
        found = np.where(gone[..., None], np.nan, found)
        return found, error, guessed & ~gone, self._rivals(true + scatter, other + scatter, error, seen)

    def _happens(self, what: str, person: int, share: Floats | float) -> Bools:
        """Which joints (T, V, J) an error takes, of which ``share`` is the chance."""
        share = np.minimum(share, 1.0)
        most = share.max(initial=0.0)
        if most == 0.0:
            return np.zeros(self._conditions.seen[:, :, person].shape, bool)
        state = self._state(what, person, shared=True)
        happens = state < ndtri(most)
        if share.ndim and share.min() < most:  # quantiles are dear: only where it matters
            where = np.nonzero(happens)
            happens[where] = state[where] < ndtri(np.broadcast_to(share, state.shape)[where])
        return happens

    def _state(self, what: str, person: int, *, shared: bool) -> Floats:
        tie = self._correlation
        return self._chances.joint_states(
            what,
            person,
            lives=("lives", person),
            life=tie.life,
            shared=tie.views if shared else 0.0,
            limb=tie.limb if shared else 0.0,
        )

    def _harder(self, person: int) -> Floats:
        """What multiplies the shares of jitter and miss, (T, V, J)."""
        config, conditions = self._config, self._conditions
        by_seen = np.ones(4)
        by_seen[[OWN, HIDDEN]] = config.self_occluded, config.occluded
        harder = by_seen[conditions.seen[:, :, person]]
        size = np.sqrt(np.maximum(conditions.area[:, :, person], 1.0))
        small = np.clip((_SMALL / size) ** config.small, 1.0, _HARDEST) if config.small else np.ones(size.shape)
        return harder * np.where(conditions.cut[:, :, person], config.truncated * small, small)[..., None]

    def _offsets(self, person: int) -> Floats:
        """Scatter of good keypoints, (T, V, J, 2) units: Gaussian, cut off where they would not be good any more."""
        tie, chances = self._correlation, self._chances
        frames, views, joints = self._conditions.seen[:, :, person].shape
        if not self._scatter.any():
            return np.zeros((frames, views, joints, 2))
        normal = np.zeros((frames, views, joints, 2))
        if tie.scatter_views < 1:
            for view in range(views):
                own = chances.wandering("scatter", person, "view", view, shape=(joints, 2), life=tie.scatter_life)
                normal[:, view] = np.sqrt(1 - tie.scatter_views) * own
        if tie.scatter_views > 0:
            space = chances.wandering("scatter", person, "all", shape=(joints, 3), life=tie.scatter_life)
            axes = np.swapaxes(self._axes[:, :, person], -1, -2)
            normal += np.sqrt(tie.scatter_views) * (space[:, None] @ axes)
        # The radius keeps its rank when its distribution is cut: radius² / 2 is exponential.
        square = (normal**2).sum(axis=-1)
        sigma = np.maximum(self._scatter, 1e-9)
        whole = -np.expm1(-0.5 * (GOOD_BELOW / sigma) ** 2)
        radius = sigma * np.sqrt(-2 * np.log1p(np.expm1(-0.5 * square) * whole))
        return normal * np.divide(radius, np.sqrt(square), out=np.zeros_like(square), where=square > 0)[..., None]

    def _places(self, person: int, off: Bools) -> tuple[Floats, Floats]:
        """Where n joints go that are ``off``: directions (n, 2), and how far between least and most, (n,) 0 to 1."""
        turn = 2 * np.pi * ndtr(self._state("direction", person, shared=False)[off])
        return np.stack([np.cos(turn), np.sin(turn)], axis=-1), ndtr(self._state("distance", person, shared=False)[off])

    def _anywhere(self, person: int) -> Floats:
        """Places on the person's box, (T, V, J, 2)."""
        box = self._boxes[:, :, person, None]
        across, down = (ndtr(self._state(what, person, shared=False)) for what in ("across", "down"))
        return box[..., :2] + np.stack([across, down], axis=-1) * box[..., 2:]

    def _guesses(self, person: int) -> Floats:
        """Where one would guess the joints, from those that they hang on, (T, V, J, 2)."""
        true = self._target[:, :, person]
        bone = true - true[:, :, _PARENT]
        turn = _GUESS_TURN * self._state("guess turn", person, shared=False)
        longer = np.exp(_GUESS_LENGTH * self._state("guess length", person, shared=False))
        cos, sin = longer * np.cos(turn), longer * np.sin(turn)
        turned = [cos * bone[..., 0] - sin * bone[..., 1], sin * bone[..., 0] + cos * bone[..., 1]]
        return true[:, :, _PARENT] + np.stack(turned, axis=-1)

    def _swaps(self, person: int) -> tuple[Bools, Floats]:
        """Which joints (T, V, J) go to somebody else's, and where those are, (T, V, J, 2)."""
        conditions = self._conditions
        neighbour = conditions.neighbour[:, :, person]
        frame, view = np.indices(neighbour.shape)
        theirs = self._target[frame, view, neighbour]
        shown = conditions.seen[frame, view, neighbour] != OUTSIDE
        crowded = conditions.crowded[:, :, person].astype(int)
        share = self._config.quality * self._swap[crowded]
        possible = shown & (neighbour >= 0)[..., None]
        return possible & self._happens("swap", person, np.where(possible, share, 0.0)), theirs

    def _labels(self, found: Floats, person: int, inverted: Bools, swapped: Bools) -> NDArray[np.int8]:
        """The classes: by distance, but what is far off may be an inversion or a swap."""
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
    def _rivals(true: Floats, other: Floats, error: NDArray[np.int8], seen: NDArray[np.int8]) -> Floats:
        """Second peaks (T, V, J, 2): the true place of what is found elsewhere, the counterpart of what is not seen.

        Args:
            true: the joints' own places, as far off as a good keypoint would be: a peak is no better, (T, V, J, 2).
            other: those of their left-right counterparts, likewise.
            error: what is wrong with the keypoints, (T, V, J).
            seen: how the joints are seen, (T, V, J).
        """
        elsewhere = (error == KeypointError.INVERSION) | (error == KeypointError.SWAP) | (error == KeypointError.MISS)
        unsure = ~elsewhere & (error != KeypointError.ABSENT) & (seen != VISIBLE) & PAIRED
        return np.where(elsewhere[..., None], true, np.where(unsure[..., None], other, np.nan))
