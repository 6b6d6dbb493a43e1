"""Ground truth in the pictures: pixels, visibility and boxes of all people in all views."""

from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import set_arrays

_OVER_TIME = ("pixels", "visibility", "boxes", "area_visible", "source")


class Visibility(IntEnum):
    """Visibility of a joint in one camera."""

    VISIBLE = 0
    SELF_OCCLUDED = 1
    OCCLUDED_BY_PERSON = 2
    OCCLUDED_BY_CLUTTER = 3
    OUTSIDE = 4


@dataclass(frozen=True)
class LookalikeViews:
    """Lookalikes in the pictures (:mod:`simharness.world.scene.lookalikes`); their number D may be 0."""

    names: tuple[str, ...] = ()
    """Names of the lookalikes, (D,)."""
    pixels: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 0, 17, 2)))
    """Pixels of their joints, (T, V, D, J, 2); NaN behind the camera."""
    visible: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0, 0, 17), bool))
    """Whether each joint is visible: inside the picture and not occluded, (T, V, D, J)."""

    def __post_init__(self) -> None:
        count = len(self.names)
        set_arrays(self, "lookalike ", pixels=("T", "V", count, "J", 2), visible=(("T", "V", count, "J"), np.bool_))

    @classmethod
    def nothing(cls, frames: int, views: int, names: tuple[str, ...] = (), joints: int = 17) -> Self:
        """Return views in which no lookalike is visible."""
        shape = (frames, views, len(names), joints)
        return cls(names, np.full((*shape, 2), np.nan), np.zeros(shape, bool))


@dataclass(frozen=True)
class Views:
    """Ground truth in the pictures that V cameras deliver in T frames.

    A picture that never arrives has NaN pixels, visibility OUTSIDE and boxes of zeros, and so has a person who is
    absent while the picture is taken.
    """

    pixels: NDArray[np.float64]
    """Pixel of each joint, (T, V, P, J, 2); NaN behind the camera."""
    visibility: NDArray[np.int8]
    """:class:`simharness.types.views.Visibility`, (T, V, P, J) int8."""
    boxes: NDArray[np.float64]
    """x, y, width, height in pixels of the part of each silhouette inside the image, occlusion ignored, (T, V, P, 4);
    zeros if no part is inside."""
    area_visible: NDArray[np.int64]
    """Number of pixels that show each person, (T, V, P)."""
    source: NDArray[np.int64]
    """Frame in which the delivered picture was taken, (T, V): the frame itself, an earlier one if the camera froze, -1
    if nothing arrived. Counted from the first frame of the sequence."""
    previews: Mapping[int, tuple[NDArray[np.uint8], ...]] = field(default_factory=dict)
    """Reduced colour pictures of some frames by frame number, one (h, w, 3) uint8 for each view."""
    lookalikes: LookalikeViews = field(default_factory=LookalikeViews)
    """The same of the lookalikes in the scene; none by default."""

    def __post_init__(self) -> None:
        set_arrays(
            self,
            pixels=("T", "V", "P", "J", 2),
            visibility=(("T", "V", "P", "J"), np.int8),
            boxes=("T", "V", "P", 4),
            area_visible=(("T", "V", "P"), np.int64),
            source=(("T", "V"), np.int64),
        )
        shape = self.visibility.shape
        if not self.lookalikes.names:
            object.__setattr__(self, "lookalikes", LookalikeViews.nothing(shape[0], shape[1], joints=shape[3]))
        if self.lookalikes.pixels.shape[:2] != shape[:2]:
            raise ValueError(
                f"lookalikes must have {shape[0]} frames and {shape[1]} views as the people have, "
                f"got {self.lookalikes.pixels.shape[:2]}"
            )

    def __len__(self) -> int:
        return len(self.pixels)

    def held(self, every: int, frames: int) -> Self:
        """Return the views of as many frames, of which these are every n-th; the others show the picture before."""
        rows = np.arange(frames) // every
        alike = self.lookalikes
        return replace(
            self,
            **{key: getattr(self, key)[rows] for key in _OVER_TIME},
            lookalikes=LookalikeViews(alike.names, alike.pixels[rows], alike.visible[rows]),
        )

    @classmethod
    def concatenate(cls, parts: Many[Self]) -> Self:
        """Join the views of consecutive frames.

        Raises:
            ValueError: no parts, or parts with different views, people, joints or lookalikes.
        """
        shapes = {part.pixels.shape[1:] for part in parts}
        if len(shapes) != 1:
            raise ValueError(
                f"parts to join must have the same views, people and joints, got {sorted(shapes) or 'none'}"
            )
        names = {part.lookalikes.names for part in parts}
        if len(names) != 1:
            raise ValueError(f"parts to join must have the same lookalikes, got {sorted(names)}")
        return cls(
            **{key: np.concatenate([getattr(part, key) for part in parts]) for key in _OVER_TIME},
            previews={frame: pictures for part in parts for frame, pictures in part.previews.items()},
            lookalikes=LookalikeViews(
                parts[0].lookalikes.names,
                np.concatenate([part.lookalikes.pixels for part in parts]),
                np.concatenate([part.lookalikes.visible for part in parts]),
            ),
        )
