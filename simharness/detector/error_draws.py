"""Draws of which joints an error takes: each error has a separate stream, and all have the same lives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from mvpose.arrays import Bools, Floats
from simharness.detector.draws import LIMB_OF_JOINT, KeyedDraws
from simharness.detector.part_tree import IN_TREE
from simharness.scenario.sections.detector_section import CorrelationSection

GROSS = frozenset({"miss", "stray", "inversion", "swap", "guess"})
"""Errors that ``correlation.gross_views`` correlates over the views; of the others it is ``correlation.views``."""


@dataclass(frozen=True)
class ErrorDraws:
    """Draws of the errors of people's joints, (T, V, 17) for one person.

    Attributes:
        draws: draws of the sequence.
        correlation: correlation in time, over the views and within limbs.
        tree: whether joints are dropped along the tree of parts.
    """

    draws: KeyedDraws
    correlation: CorrelationSection
    tree: bool

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
