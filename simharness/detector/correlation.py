"""Random draws that last in time and that views have in common, each with an exact marginal distribution.

Whether something goes wrong is drawn as a standard normal number and compared with the quantile of its chance: so it
goes wrong exactly as often as asked, however much of the number is shared, however long it stays. Turning sharing or
life up or down changes no other draw.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from mvpose.arrays import Floats
from simharness.types.random_streams import stream

Key = str | int

LIMBS = np.repeat([0, 1, 2], [5, 6, 6])
"""The limbs of COCO-17, (17,): the face, both arms, both legs."""
_GROUPS = 3


@dataclass(frozen=True)
class Chances:
    """The draws of one detector about one sequence.

    Attributes:
        seed: of the scenario.
        time: of the frames, (T,), seconds, evenly spaced.
        views: V, how many cameras.
    """

    seed: int
    time: Floats
    views: int

    @cached_property
    def step(self) -> float:
        """Seconds from one frame to the next; infinite where there is but one."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1) if len(self.time) > 1 else np.inf

    def uniform(self, *key: Key, shape: tuple[int, ...] = ()) -> Floats:
        """Uniform draws of every frame by itself, (T, ...)."""
        return stream(self.seed, "detector", *key).random((len(self.time), *shape))

    def normal(self, *key: Key, shape: tuple[int, ...] = ()) -> Floats:
        """Standard normal draws of every frame by itself, (T, ...)."""
        return self._normal(len(self.time), key, shape)

    def lasting(self, *key: Key, life: float) -> NDArray[np.int64] | None:
        """The frame whose draw holds in each frame, (T,): lives are exponential with mean ``life`` seconds.

        None where life is 0: every frame has its own.
        """
        if life == 0:
            return None
        anew = self._anew(key, life, groups=1)[:, 0]
        return np.maximum.accumulate(np.where(anew, np.arange(len(anew)), 0))

    def states(self, *key: Key, life: float = 0.0, shared: float = 0.0) -> Floats:
        """A lasting state of one thing as every view takes it: standard normal, (T, V).

        Args:
            key: names the state and the thing.
            life: mean seconds until it is drawn anew, in all views; 0: in every frame.
            shared: share of its variance that all views have in common.
        """
        return self._mixed(key, (), life=life, shared=shared, limb=0.0)

    def joint_states(
        self, *key: Key, lives: tuple[Key, ...] = (), life: float = 0.0, shared: float = 0.0, limb: float = 0.0
    ) -> Floats:
        """The same for each joint of a person, (T, V, 17).

        Args:
            key: names the state and the person.
            lives: names the lives; states with the same are drawn anew at the same moments. Its own where not given.
            life: mean seconds until the joints of a limb are drawn anew, in all views.
            shared: share of the variance that all views have in common.
            limb: share of the variance that the joints of a limb (``LIMBS``) have in common.
        """
        return self._mixed(key, (len(LIMBS),), lives=lives, life=life, shared=shared, limb=limb)

    def wandering(self, *key: Key, shape: tuple[int, ...] = (), life: float = 0.0) -> Floats:
        """Standard normal numbers that forget, (T, ...): their autocorrelation falls by e in ``life`` seconds."""
        draws = self.normal(*key, shape=shape)
        if life == 0.0 or len(draws) < 2:
            return draws
        kept = np.exp(-self.step / life)
        draws[1:] *= np.sqrt(1 - kept**2)
        return np.asarray(lfilter([1.0], [1.0, -kept], draws, axis=0))

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
        # Which life each frame is in, of each limb: only as much is drawn as there are lives.
        groups = _GROUPS if shape else 1
        which = self._anew(lives or key, life, groups=groups).cumsum(axis=0) - 1 if life > 0 else None
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
        return drawn[which[:, None, LIMBS], np.arange(self.views)[:, None], np.arange(len(LIMBS))]

    def _limbs(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...], limb: float) -> Floats:
        if limb == 0.0:
            return self._normal(count, key, shape)
        together = np.sqrt(limb) * self._normal(count, (*key, "limb"), (_GROUPS,))[:, LIMBS]
        return together if limb == 1.0 else together + np.sqrt(1 - limb) * self._normal(count, key, shape)

    def _normal(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...]) -> Floats:
        return stream(self.seed, "detector", *key).standard_normal((count, *shape))

    def _anew(self, key: tuple[Key, ...], life: float, *, groups: int) -> NDArray[np.bool_]:
        """In which frames a life begins, (T, groups)."""
        anew = self.uniform(*key, "life", shape=(groups,)) < -np.expm1(-self.step / life)
        anew[0] = True
        return anew


def logistic(usual: ArrayLike, spread: ArrayLike) -> Floats:
    """Scores (...) about their usual values: ``spread`` is how far off they are on the logit scale.

    Where nothing spreads, the usual value itself, 0 and 1 among them.
    """
    usual, spread = np.broadcast_arrays(np.asarray(usual, float), np.asarray(spread, float))
    odds = np.exp(np.clip(spread, -40, 40))
    return usual * odds / (usual * odds + (1 - usual))
