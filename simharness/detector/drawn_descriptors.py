"""Whose descriptor a detection has, from where it is seen and how well: what is drawn of the descriptor model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector.correlation import Chances
from simharness.detector.descriptor_model import DescriptorModel
from simharness.detector.detection_block import Origin
from simharness.detector.view_geometry import bearings, hidden_shares
from simharness.types.sequence import Sequence
from simharness.types.views import Views


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

    Everything is drawn by who or what is detected (its origin and number), never by its place among the others: so
    more people, phantoms or people found twice change no descriptor of the rest.

    Args:
        sequence: where everyone is.
        views: the same in the pictures.
        rig: the cameras.
        looks: how descriptors are drawn.
        chances: the draws.
        life: seconds in which the noise of one person's crops forgets.
    """

    def __init__(
        self, sequence: Sequence, views: Views, rig: Rig, looks: Looks, chances: Chances, *, life: float
    ) -> None:
        self._looks, self._chances, self._life = looks, chances, life
        self._source, self._decoys = views.source, views.lookalikes.names
        self._bearing, self._hidden = bearings(sequence.joints, rig), hidden_shares(views.visibility)

    def __call__(self, frame: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Descriptors of detections by frame, view, origin and number (:class:`Found`), (n,) each: (n, D)."""
        picture = self._source[frame, view]
        real = (origin != Origin.PHANTOM) & (origin != Origin.DECOY)
        bearing, hidden = np.zeros(len(frame)), np.zeros(len(frame))
        crop = picture[real], view[real], number[real]
        bearing[real], hidden[real] = self._bearing[crop], self._hidden[crop]
        noise = self._noise(picture, view, origin, number)
        alike = self._looks.alike or self._bearing.shape[2]
        return self._looks.model.draw(
            [self._who(Origin(kind), which) for kind, which in zip(origin.tolist(), number.tolist(), strict=True)],
            bearing=bearing,
            hidden=hidden,
            noise=noise[:, :-1],
            unease=noise[:, -1],
            look_alike=np.where(real & (number < alike), self._looks.look_alike, 0.0),
            seed=self._chances.seed,
        )

    def _noise(self, picture: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Standard normal numbers of each detection, (n, D + 1), those of one thing in one view wandering.

        All phantoms of a view go by one block, as there may be a new one in every frame: each begins at another of its
        columns.
        """
        size = self._looks.model.dimensions + 1
        column = np.where(origin == Origin.PHANTOM, number % size, 0)
        stem = np.where(origin == Origin.PHANTOM, 0, number)
        drawn = np.empty((len(picture), size))
        for v, kind, which in np.unique(np.column_stack([view, origin, stem]), axis=0).tolist():
            mine = np.flatnonzero((view == v) & (origin == kind) & (stem == which))
            key = (self._decoys[which],) if kind == Origin.DECOY else () if kind == Origin.PHANTOM else (which,)
            name = Origin(kind).name.lower()
            block = self._chances.wandering("descriptor", v, name, *key, shape=(size,), life=self._life)
            drawn[mine] = block[picture[mine, None], (np.arange(size) + column[mine, None]) % size]
        return drawn

    def _who(self, origin: Origin, number: int) -> tuple[str | int, ...]:
        """A key of whose look it is: a phantom has one of its own, which is the same in all views that show it."""
        if origin == Origin.PHANTOM:
            return "phantom", number
        if origin != Origin.DECOY:
            return "person", number
        name = self._decoys[number]
        _, mirrored, reflected = name.partition("/person")
        return ("person", int(reflected)) if mirrored else ("decoy", name)
