"""Keyed random draws that are correlated in time, across views and within limbs, with exact marginal distributions.

Whether an error occurs is drawn as a latent standard normal number and compared with the quantile of its probability.
So it occurs with exactly that probability, however much of the number views or joints share and however long it is
held. Changing a correlation or a mean life changes no other draw. Each error of joints has a separate stream
(:class:`ErrorDraws`), and all errors of a person have the same lives.

Bottom-up detectors join a joint to its person along the limb that leads to it: a wrist hangs on the elbow, the elbow on
the shoulder; an ankle on the knee, the knee on the hip. In every set of detections of OpenPose and RTPose looked at, no
joint is reported whose parent is not. The joints of the face are found independently of each other.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from mvpose.arrays import Bools, Floats
from mvpose.kernels import njit
from simharness.scenario.sections.detector_section import CorrelationSection
from simharness.types.random_streams import stream

Key = str | int

LIMB_OF_JOINT = np.repeat([0, 1, 2], [5, 6, 6])
"""Limb of each COCO-17 joint, (17,): 0 the face, 1 both arms, 2 both legs."""
_GROUPS = 3

GROSS = frozenset({"miss", "stray", "inversion", "swap", "guess"})
"""Errors that ``correlation.gross_views`` correlates over the views; of the others it is ``correlation.views``."""

PARENT = np.array([-1, -1, -1, -1, -1, -1, -1, 5, 6, 7, 8, -1, -1, 11, 12, 13, 14])
"""Parent of each COCO-17 joint in the tree of parts, (17,); -1 without a parent. Parents come before children."""

IN_TREE = np.arange(len(PARENT)) >= 5
"""Which COCO-17 joints belong to the tree, (17,): those of the limbs."""


@dataclass(frozen=True)
class KeyedDraws:
    """Random draws of one detector on one sequence, each block from the stream of its key."""

    seed: int
    """Seed of the scenario."""
    time: Floats
    """Times of the frames, (T,), seconds, evenly spaced."""
    views: int
    """V, number of cameras."""

    @cached_property
    def step(self) -> float:
        """Seconds between consecutive frames; infinite for a single frame."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1) if len(self.time) > 1 else np.inf

    def uniform(self, *key: Key, shape: tuple[int, ...] = ()) -> Floats:
        """Draw independent uniform numbers for every frame, ``(T, *shape)``."""
        return stream(self.seed, "detector", *key).random((len(self.time), *shape))

    def normal(self, *key: Key, shape: tuple[int, ...] = ()) -> Floats:
        """Draw independent standard normal numbers for every frame, ``(T, *shape)``."""
        return self._normal(len(self.time), key, shape)

    def held_frames(self, *key: Key, life: float) -> NDArray[np.int64] | None:
        """Return the frame whose draw is held in each frame, (T,); None where ``life`` is 0 and no draw is held.

        Args:
            key: name of the lives.
            life: mean of the exponential lives, seconds.
        """
        if life == 0:
            return None
        begins = self._begins(key, life, groups=1)[:, 0]
        return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))

    def states(self, *key: Key, life: float = 0.0, shared: float = 0.0) -> Floats:
        """Draw a latent state for every view, standard normal and constant during a life, (T, V).

        Args:
            key: name of the state and of the person or object.
            life: mean seconds until the state is drawn anew, in all views at once; 0: in every frame.
            shared: share of the variance that all views have in common.
        """
        return self._mixed(key, (), life=life, shared=shared, limb=0.0)

    def joint_states(
        self, *key: Key, lives: tuple[Key, ...] = (), life: float = 0.0, shared: float = 0.0, limb: float = 0.0
    ) -> Floats:
        """Draw latent states for each joint of a person, standard normal, (T, V, 17).

        Args:
            key: name of the state and of the person.
            lives: name of the lives: states with the same name are drawn anew at the same moments; default: ``key``.
            life: mean seconds until the joints of a limb are drawn anew, in all views at once.
            shared: share of the variance that all views have in common.
            limb: share of the variance that the joints of a limb (``LIMB_OF_JOINT``) have in common.
        """
        return self._mixed(key, (len(LIMB_OF_JOINT),), lives=lives, life=life, shared=shared, limb=limb)

    def autoregressive(self, *key: Key, shape: tuple[int, ...] = (), life: float = 0.0) -> Floats:
        """Draw first-order autoregressive standard normal numbers, ``(T, *shape)``: correlation exp(-lag / life).

        Args:
            key: name of the numbers.
            shape: shape of the numbers of one frame.
            life: correlation time, seconds; 0: independent frames.
        """
        draws = self.normal(*key, shape=shape)
        if life == 0.0 or len(draws) < 2:
            return draws
        kept = np.exp(-self.step / life)
        draws[1:] *= np.sqrt(1 - kept**2)
        _follow(draws.reshape(len(draws), -1), kept)
        return draws

    def _mixed(
        self,
        key: tuple[Key, ...],
        shape: tuple[int, ...],
        *,
        lives: tuple[Key, ...] = (),
        life: float,
        shared: float,
        limb: float,
    ) -> Floats:
        # Index of the life that each frame is in, for each limb: only as many numbers are drawn as there are lives.
        groups = _GROUPS if shape else 1
        which = self._begins(lives or key, life, groups=groups).cumsum(axis=0) - 1 if life > 0 else None
        count = len(self.time) if which is None else int(which[-1].max()) + 1
        drawn = np.zeros((count, self.views, *shape))
        if shared > 0:
            drawn += np.sqrt(shared) * self._limbs(count, (*key, "all"), shape, limb)[:, None]
        if shared < 1:
            for view in range(self.views):
                drawn[:, view] += np.sqrt(1 - shared) * self._limbs(count, (*key, "view", view), shape, limb)
        if which is None:
            return drawn
        if not shape:
            return drawn[which[:, 0]]
        return drawn[which[:, None, LIMB_OF_JOINT], np.arange(self.views)[:, None], np.arange(len(LIMB_OF_JOINT))]

    def _limbs(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...], limb: float) -> Floats:
        if limb == 0.0:
            return self._normal(count, key, shape)
        common = np.sqrt(limb) * self._normal(count, (*key, "limb"), (_GROUPS,))[:, LIMB_OF_JOINT]
        return common if limb == 1.0 else common + np.sqrt(1 - limb) * self._normal(count, key, shape)

    def _normal(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...]) -> Floats:
        return stream(self.seed, "detector", *key).standard_normal((count, *shape))

    def _begins(self, key: tuple[Key, ...], life: float, *, groups: int) -> NDArray[np.bool_]:
        """Return the frames in which a life begins, (T, groups)."""
        begins = self.uniform(*key, "life", shape=(groups,)) < -np.expm1(-self.step / life)
        begins[0] = True
        return begins


@njit(cache=True)
def _follow(draws: np.ndarray, kept: float) -> None:
    """Add to each row, (T, n), ``kept`` times the one before, in place."""
    for k in range(1, len(draws)):  # as scipy.signal.lfilter, whose import takes a third of a second
        for i in range(draws.shape[1]):
            draws[k, i] += kept * draws[k - 1, i]


def logistic(usual: ArrayLike, spread: ArrayLike) -> Floats:
    """Return scores (...) that differ from their usual values by ``spread`` on the logit scale.

    Where ``spread`` is 0, the result is the usual value itself, also where that is 0 or 1.
    """
    usual, spread = np.broadcast_arrays(np.asarray(usual, float), np.asarray(spread, float))
    odds = np.exp(np.clip(spread, -40, 40))
    return usual * odds / (usual * odds + (1 - usual))


@dataclass(frozen=True)
class ErrorDraws:
    """Draws of the errors of people's joints, (T, V, 17) for one person."""

    draws: KeyedDraws
    """Draws of the sequence."""
    correlation: CorrelationSection
    """Correlation in time, over the views and within limbs."""
    tree: bool
    """Whether joints are dropped along the tree of parts."""

    def occurs(self, what: str, person: int, share: Floats | float) -> Bools:
        """Draw which joints of a person an error takes with probability ``share``, (T, V, 17)."""
        share = np.minimum(share, 1.0)
        most = share.max(initial=0.0)
        if most == 0.0:
            return np.zeros((len(self.draws.time), self.draws.views, len(LIMB_OF_JOINT)), bool)
        views = self.correlation.gross_views if what in GROSS else self.correlation.views
        state = self._state(what, person, views=views, limb=self.correlation.limb)
        if self.tree and what == "drop":  # within limbs, drops depend on each other by the tree alone
            state = np.where(IN_TREE, self._state(what, person, views=views), state)
        occurs = state < ndtri(most)
        if share.ndim and share.min() < most:  # quantiles are expensive: only where needed
            where = np.nonzero(occurs)
            occurs[where] = state[where] < ndtri(np.broadcast_to(share, state.shape)[where])
        return occurs

    def normal(self, what: str, person: int) -> Floats:
        """Draw standard normal numbers that last as long as the errors, independent by joint and view, (T, V, 17)."""
        return self._state(what, person)

    def _state(self, what: str, person: int, *, views: float = 0.0, limb: float = 0.0) -> Floats:
        lives, life = ("lives", person), self.correlation.life
        return self.draws.joint_states(what, person, lives=lives, life=life, shared=views, limb=limb)


def with_parents(reported: Bools) -> Bools:
    """Return which of the reported joints (..., 17) remain when each needs its parent, (..., 17)."""
    result = reported.copy()
    for joint in np.flatnonzero(PARENT >= 0):
        result[..., joint] &= result[..., PARENT[joint]]
    return result
