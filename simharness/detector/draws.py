"""Keyed random draws that are correlated in time, across views and within limbs, with exact marginal distributions.

Whether an error occurs is drawn as a latent standard normal number and compared with the quantile of its probability.
So it occurs with exactly that probability, however much of the number views or joints share and however long it is
held. Changing a correlation or a mean life changes no other draw.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.kernels import njit
from simharness.types.random_streams import stream

Key = str | int

LIMB_OF_JOINT = np.repeat([0, 1, 2], [5, 6, 6])
"""Limb of each COCO-17 joint, (17,): 0 the face, 1 both arms, 2 both legs."""
_GROUPS = 3


@dataclass(frozen=True)
class KeyedDraws:
    """Random draws of one detector on one sequence, each block from the stream of its key.

    Attributes:
        seed: seed of the scenario.
        time: times of the frames, (T,), seconds, evenly spaced.
        views: V, number of cameras.
    """

    seed: int
    time: Floats
    views: int

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
