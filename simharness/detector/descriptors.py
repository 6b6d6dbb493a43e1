"""Descriptors of detections without pictures: sampled from the descriptor model by identity, bearing and occlusion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector.descriptor_model import DescriptorModel
from simharness.detector.detection_block import Origin
from simharness.detector.draws import KeyedDraws
from simharness.detector.view_geometry import bearings, hidden_shares
from simharness.types.sequence import Sequence
from simharness.types.views import Views

# Keys of random streams: another word would be another draw.
_STREAM_KEYS: Mapping[Origin, str] = {
    Origin.PERSON: "person",
    Origin.DUPLICATE: "again",
    Origin.LOWER_HALF: "lower",
    Origin.PHANTOM: "phantom",
    Origin.DECOY: "decoy",
}


@dataclass(frozen=True)
class DescriptorSettings:
    """Settings for drawing descriptors.

    Attributes:
        model: model of the descriptors of a re-ID network.
        look_alike: how alike people are dressed, 0 to 1, for the first ``alike`` people.
        alike: number of people who are dressed alike; 0: all.
    """

    model: DescriptorModel
    look_alike: float
    alike: int = 0


class DescriptorSampler:
    """Draws the descriptors of detections of people, decoys, mirror images and phantoms.

    All draws go by what is detected (origin and number), never by the position among other detections: more people,
    phantoms or duplicates change no descriptor of the other detections.

    Args:
        sequence: ground truth in space.
        views: ground truth in the pictures.
        rig: true rig.
        settings: how descriptors are drawn.
        draws: draws of the sequence.
        life: correlation time of the noise of one person's crops, seconds.
    """

    def __init__(
        self,
        sequence: Sequence,
        views: Views,
        rig: Rig,
        settings: DescriptorSettings,
        draws: KeyedDraws,
        *,
        life: float,
    ) -> None:
        self._settings, self._draws, self._life = settings, draws, life
        self._source, self._decoys = views.source, views.lookalikes.names
        self._bearing, self._hidden = bearings(sequence.joints, rig), hidden_shares(views.visibility)

    def __call__(self, frame: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Draw the descriptors (n, D) of detections by frame, view, origin and number, (n,) each.

        Origin and number are those of :class:`DetectionBlock`.
        """
        picture = self._source[frame, view]
        real = (origin != Origin.PHANTOM) & (origin != Origin.DECOY)
        bearing, hidden = np.zeros(len(frame)), np.zeros(len(frame))
        crop = picture[real], view[real], number[real]
        bearing[real], hidden[real] = self._bearing[crop], self._hidden[crop]
        noise = self._noise(picture, view, origin, number)
        alike = self._settings.alike or self._bearing.shape[2]
        return self._settings.model.draw(
            [self._identity(Origin(kind), which) for kind, which in zip(origin.tolist(), number.tolist(), strict=True)],
            bearing=bearing,
            hidden=hidden,
            noise=noise[:, :-1],
            noise_level=noise[:, -1],
            look_alike=np.where(real & (number < alike), self._settings.look_alike, 0.0),
            seed=self._draws.seed,
        )

    def _noise(self, picture: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Return standard normal numbers for each detection, (n, D + 1), autoregressive for one object in one view.

        All phantoms of a view share one block, because there may be a new phantom in every frame: each begins at
        another column of the block.
        """
        size = self._settings.model.dimensions + 1
        column = np.where(origin == Origin.PHANTOM, number % size, 0)
        stem = np.where(origin == Origin.PHANTOM, 0, number)
        drawn = np.empty((len(picture), size))
        for v, kind, which in np.unique(np.column_stack([view, origin, stem]), axis=0).tolist():
            rows = np.flatnonzero((view == v) & (origin == kind) & (stem == which))
            key = (self._decoys[which],) if kind == Origin.DECOY else () if kind == Origin.PHANTOM else (which,)
            name = _STREAM_KEYS[Origin(kind)]
            block = self._draws.autoregressive("descriptor", v, name, *key, shape=(size,), life=self._life)
            drawn[rows] = block[picture[rows, None], (np.arange(size) + column[rows, None]) % size]
        return drawn

    def _identity(self, origin: Origin, number: int) -> tuple[str | int, ...]:
        """Return the key of the identity that a detection shows; a phantom has the same identity in all views."""
        if origin == Origin.PHANTOM:
            return "phantom", number
        if origin != Origin.DECOY:
            return "person", number
        name = self._decoys[number]
        _, mirrored, reflected = name.partition("/person")
        return ("person", int(reflected)) if mirrored else ("decoy", name)
