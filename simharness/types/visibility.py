"""How a camera sees a joint."""

from __future__ import annotations

from enum import IntEnum


class Visibility(IntEnum):
    """How a camera sees a joint."""

    VISIBLE = 0
    SELF_OCCLUDED = 1
    OCCLUDED_BY_PERSON = 2
    OCCLUDED_BY_CLUTTER = 3
    OUTSIDE = 4
