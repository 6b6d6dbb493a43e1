"""Detections of a whole sequence as one block of arrays: every step of the detector takes one and returns one."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from simharness.types.truth import KeypointError
from simharness.types.views import Views, Visibility


class Origin(IntEnum):
    """Source of a detection; with :attr:`DetectionBlock.number` it names the person or object that is detected."""

    PERSON = 0
    """A person; of a split person the upper half, of merged people the one who gives most joints."""
    DUPLICATE = 1
    """A second detection of a person."""
    LOWER_HALF = 2
    """The lower half of a split person."""
    PHANTOM = 3
    """A phantom. Its number is drawn with it and is the same in all views that show it."""
    DECOY = 4
    """A decoy, by its index among the lookalikes."""


@dataclass(frozen=True)
class DetectionBlock:
    """Detections in the pictures that V cameras take in T frames, in S slots of each picture.

    Values in a slot that holds no detection have no meaning.
    """

    present: Bools
    """Which slots hold a detection, (T, V, S)."""
    keypoints: Floats
    """Pixels, (T, V, S, J, 2); NaN where a joint is not reported."""
    scores: Floats
    """Scores of keypoints, 0 to 1, (T, V, S, J); 0 where a joint is not reported."""
    boxes: Floats
    """x, y, width, height in pixels, (T, V, S, 4)."""
    box_scores: Floats
    """0 to 1, (T, V, S)."""
    person: Integers
    """Index of the person that the detection shows, (T, V, S); -1 of a false positive."""
    origin: NDArray[np.int8]
    """:class:`Origin`, (T, V, S)."""
    number: Integers
    """Number among the detections of this origin, (T, V, S); unlike the slot, it does not depend on how many other
    detections there are."""
    error: NDArray[np.int8]
    """:class:`KeypointError`, (T, V, S, J)."""
    guessed: Bools
    """Which keypoints are guesses, (T, V, S, J)."""
    rivals: Floats
    """Position of a second peak in the heat map, pixels, (T, V, S, J, 2); NaN where there is none."""

    @classmethod
    def of_people(cls, views: Views) -> Self:
        """Return the detections of a perfect detector: person p in slot p, every joint in the image at its true place.

        Args:
            views: ground truth in the pictures.
        """
        seen = views.visibility != Visibility.OUTSIDE
        shape = seen.shape[:3]
        number = np.broadcast_to(np.arange(shape[2]), shape)
        return cls(
            present=seen.any(axis=-1),
            keypoints=np.where(seen[..., None], views.pixels, np.nan),
            scores=seen.astype(float),
            boxes=views.boxes,
            box_scores=np.ones(shape),
            person=number,
            origin=np.full(shape, Origin.PERSON, np.int8),
            number=number,
            error=np.where(seen, np.int8(KeypointError.GOOD), np.int8(KeypointError.ABSENT)),
            guessed=np.zeros(seen.shape, bool),
            rivals=np.full((*seen.shape, 2), np.nan),
        )

    @classmethod
    def empty(cls, frames: int, views: int, slots: int, joints: int = 17) -> Self:
        """Return slots without detections, with the origin, person and error class of phantoms."""
        shape = (frames, views, slots)
        return cls(
            present=np.zeros(shape, bool),
            keypoints=np.full((*shape, joints, 2), np.nan),
            scores=np.zeros((*shape, joints)),
            boxes=np.zeros((*shape, 4)),
            box_scores=np.zeros(shape),
            person=np.full(shape, -1),
            origin=np.full(shape, Origin.PHANTOM, np.int8),
            number=np.full(shape, -1),
            error=np.full((*shape, joints), KeypointError.MISS, np.int8),
            guessed=np.zeros((*shape, joints), bool),
            rivals=np.full((*shape, joints, 2), np.nan),
        )

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return one block with the slots of all parts, in their order; at least one part is needed."""
        filled = [part for part in parts if part.present.shape[2]] or parts[:1]
        if len(filled) == 1:
            return filled[0]
        fields: dict[str, Any] = {
            key: np.concatenate([getattr(part, key) for part in filled], axis=2) for key in cls.__dataclass_fields__
        }
        return cls(**fields)
