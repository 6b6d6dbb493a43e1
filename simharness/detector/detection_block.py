"""What a detector finds in all pictures, as blocks: each part of the detector makes one, or changes one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from simharness.types.truth import KeypointError


class Origin(IntEnum):
    """What a detection comes from: with a number (:attr:`Found.number`) it names who or what is detected."""

    PERSON = 0
    """A person by number, or of one found in two the upper half, or of two in one who gives most."""
    AGAIN = 1
    """The same person once more."""
    LOWER = 2
    """The lower half of a person who is found in two."""
    PHANTOM = 3
    """A phantom: its number is drawn with it, and it has the same in all views that show it."""
    DECOY = 4
    """A decoy by number among the lookalikes."""


@dataclass(frozen=True)
class Found:
    """Detections in the pictures that V cameras take in T frames: S slots a picture, of which some are filled.

    What stands in a slot that is not filled means nothing.

    Attributes:
        there: which slots are filled, (T, V, S).
        keypoints: pixels, (T, V, S, J, 2); NaN where a joint is not reported.
        scores: of keypoints, 0 to 1, (T, V, S, J); 0 where a joint is not reported.
        boxes: x, y, width, height in pixels, (T, V, S, 4).
        box_scores: 0 to 1, (T, V, S).
        person: whom it shows, (T, V, S); -1 for nobody.
        origin: :class:`Origin`, (T, V, S).
        number: which one of its origin, (T, V, S): the same however many others there are, unlike its slot.
        error: :class:`KeypointError`, (T, V, S, J).
        rivals: where a second peak competes in the heat map, pixels, (T, V, S, J, 2), NaN where none does.
    """

    there: NDArray[np.bool_]
    keypoints: Floats
    scores: Floats
    boxes: Floats
    box_scores: Floats
    person: Integers
    origin: NDArray[np.int8]
    number: Integers
    error: NDArray[np.int8]
    rivals: Floats

    @classmethod
    def nothing(cls, frames: int, views: int, slots: int, joints: int = 17) -> Self:
        """Empty slots, of phantoms."""
        shape = (frames, views, slots)
        return cls(
            there=np.zeros(shape, bool),
            keypoints=np.full((*shape, joints, 2), np.nan),
            scores=np.zeros((*shape, joints)),
            boxes=np.zeros((*shape, 4)),
            box_scores=np.zeros(shape),
            person=np.full(shape, -1),
            origin=np.full(shape, Origin.PHANTOM, np.int8),
            number=np.full(shape, -1),
            error=np.full((*shape, joints), KeypointError.MISS, np.int8),
            rivals=np.full((*shape, joints, 2), np.nan),
        )

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All of several in one, their slots one after the other."""
        if len(parts) == 1:
            return parts[0]
        fields: dict[str, Any] = {
            key: np.concatenate([getattr(part, key) for part in parts], axis=2) for key in cls.__dataclass_fields__
        }
        return cls(**fields)
