"""Whose descriptor a detection has, from where it is seen and how well: what is drawn of the descriptor model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.detector.correlation import Chances
from simharness.detector.descriptors import DescriptorModel
from simharness.detector.viewing import bearings, hidden_shares
from simharness.rendering.views import Views
from simharness.scene.sequence import Sequence

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Looks:
    """How descriptors are drawn.

    Attributes:
        model: what they are made of.
        look_alike: how alike people are dressed, the first ``alike`` of them; 0: all.
    """

    model: DescriptorModel
    look_alike: float
    alike: int = 0


class Describer:
    """Draws the descriptors of detections: a detection shows a person, a decoy, somebody in a mirror, or nobody.

    Args:
        sequence: where everyone is.
        views: the same in the pictures.
        rig: the cameras.
        looks: how descriptors are drawn.
        chances: the draws.
        first_decoy: slot of the first decoy; those before are of people and phantoms.
        life: seconds in which the noise of one person's crops forgets.
    """

    def __init__(
        self,
        sequence: Sequence,
        views: Views,
        rig: Rig,
        looks: Looks,
        chances: Chances,
        *,
        first_decoy: int,
        life: float,
    ) -> None:
        self._looks, self._chances, self._first_decoy, self._life = looks, chances, first_decoy, life
        self._source, self._decoys = views.source, views.lookalikes.names
        self._bearing, self._hidden = bearings(sequence.joints, rig), hidden_shares(views.visibility)

    def __call__(self, frame: Ints, view: Ints, slot: Ints, person: Ints) -> NDArray[np.float64]:
        """Descriptors of detections by frame, view, slot and person, (n,) each: (n, D)."""
        picture, real = self._source[frame, view], person >= 0
        size = self._looks.model.dimensions
        drawn = np.empty((len(frame), size + 1))
        for v, s in np.unique(np.column_stack([view, slot]), axis=0).tolist():
            mine = (view == v) & (slot == s)
            wandering = self._chances.wandering("descriptor", v, s, shape=(size + 1,), life=self._life)
            drawn[mine] = wandering[picture[mine]]
        alike = self._looks.alike or self._bearing.shape[2]
        return self._looks.model.draw(
            [self._who(*each) for each in zip(view.tolist(), slot.tolist(), person.tolist(), strict=True)],
            bearing=np.where(real, self._bearing[picture, view, person], 0.0),
            hidden=np.where(real, self._hidden[picture, view, person], 0.0),
            noise=drawn[:, :size],
            unease=drawn[:, size],
            look_alike=np.where(real & (person < alike), self._looks.look_alike, 0.0),
            seed=self._chances.seed,
        )

    def _who(self, view: int, slot: int, person: int) -> tuple[str | int, ...]:
        """A key of whose look it is."""
        if person >= 0:
            return "person", person
        if slot < self._first_decoy:
            return "phantom", view, slot
        name = self._decoys[slot - self._first_decoy]
        _, mirrored, reflected = name.partition("/person")
        return ("person", int(reflected)) if mirrored else ("decoy", name)
