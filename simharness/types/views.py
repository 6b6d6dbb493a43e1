"""What the cameras saw of everyone: the truth in the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


class Visibility(IntEnum):
    """Visibility of a joint in one camera."""

    VISIBLE = 0
    SELF_OCCLUDED = 1
    OCCLUDED_BY_PERSON = 2
    OCCLUDED_BY_CLUTTER = 3
    OUTSIDE = 4


@dataclass(frozen=True)
class LookalikeViews:
    """Objects in the same pictures that look like people (:mod:`simharness.world.scene.lookalikes`); D may be 0.

    Attributes:
        names: what each is, (D,).
        pixels: where its joints are, (T, V, D, J, 2); NaN behind the camera.
        visible: which of them are seen, (T, V, D, J): in the picture, and nothing nearer in the way.
    """

    names: tuple[str, ...] = ()
    pixels: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 0, 17, 2)))
    visible: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0, 0, 17), bool))

    def __post_init__(self) -> None:
        pixels = as_array(self.pixels, ("T", "V", len(self.names), "J", 2), "lookalike pixels")
        object.__setattr__(self, "pixels", pixels)
        visible = as_array(self.visible, pixels.shape[:4], "lookalike visible", np.bool_)
        object.__setattr__(self, "visible", visible)

    @classmethod
    def nothing(cls, frames: int, views: int, names: tuple[str, ...] = (), joints: int = 17) -> Self:
        """Pictures in which nothing of them is seen."""
        shape = (frames, views, len(names), joints)
        return cls(names, np.full((*shape, 2), np.nan), np.zeros(shape, bool))


@dataclass(frozen=True)
class Views:
    """The truth in the pictures that V cameras deliver in T frames.

    A picture that never arrives shows nothing: NaN pixels, everyone OUTSIDE, boxes of zeros.

    Attributes:
        pixels: where each joint is in the picture, (T, V, P, J, 2); NaN behind the camera.
        visibility: :class:`simharness.types.views.Visibility`, (T, V, P, J) int8.
        boxes: x, y, width, height in pixels of the part of each person's silhouette that falls on the image,
            whatever stands in front, (T, V, P, 4); zeros where none does.
        area_visible: pixels in which each person is seen, (T, V, P).
        source: the frame whose picture this is, (T, V): the frame itself, an earlier one where the camera froze, -1
            where nothing arrived. Counted from the sequence's first frame.
        previews: reduced colour pictures of some frames, by frame, one (h, w, 3) uint8 of each view.
        lookalikes: the same of what a detector may take for people; nothing by default.
    """

    pixels: NDArray[np.float64]
    visibility: NDArray[np.int8]
    boxes: NDArray[np.float64]
    area_visible: NDArray[np.int64]
    source: NDArray[np.int64]
    previews: Mapping[int, tuple[NDArray[np.uint8], ...]] = field(default_factory=dict)
    lookalikes: LookalikeViews = field(default_factory=LookalikeViews)

    def __post_init__(self) -> None:
        pixels = as_array(self.pixels, ("T", "V", "P", "J", 2), "pixels")
        shape = pixels.shape[:4]
        for key, value in (
            ("pixels", pixels),
            ("visibility", as_array(self.visibility, shape, "visibility", np.int8)),
            ("boxes", as_array(self.boxes, (*shape[:3], 4), "boxes")),
            ("area_visible", as_array(self.area_visible, shape[:3], "area_visible", np.int64)),
            ("source", as_array(self.source, shape[:2], "source", np.int64)),
        ):
            object.__setattr__(self, key, value)
        if not self.lookalikes.names:
            object.__setattr__(self, "lookalikes", LookalikeViews.nothing(shape[0], shape[1], joints=shape[3]))
        if self.lookalikes.pixels.shape[:2] != shape[:2]:
            raise ValueError(
                f"lookalikes must be of {shape[0]} frames and {shape[1]} views as the people are, "
                f"got {self.lookalikes.pixels.shape[:2]}"
            )

    def __len__(self) -> int:
        return len(self.pixels)

    @classmethod
    def concatenate(cls, parts: Many[Self]) -> Self:
        """Join films of consecutive frames.

        Raises:
            ValueError: no parts, or parts of different views, people, joints or lookalikes.
        """
        shapes = {part.pixels.shape[1:] for part in parts}
        if len(shapes) != 1:
            raise ValueError(f"films to join must share views, people and joints, got {sorted(shapes) or 'none'}")
        names = {part.lookalikes.names for part in parts}
        if len(names) != 1:
            raise ValueError(f"films to join must share their lookalikes, got {sorted(names)}")
        keys = ("pixels", "visibility", "boxes", "area_visible", "source")
        return cls(
            **{key: np.concatenate([getattr(part, key) for part in parts]) for key in keys},
            previews={frame: pictures for part in parts for frame, pictures in part.previews.items()},
            lookalikes=LookalikeViews(
                parts[0].lookalikes.names,
                np.concatenate([part.lookalikes.pixels for part in parts]),
                np.concatenate([part.lookalikes.visible for part in parts]),
            ),
        )
