"""[room], [clutter] and [decoys]: where it happens and what is in the way."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from simharness.scenario.sections.section import Count, Positive, Section, Share


class Room(Section):
    """The room: a floor and four walls around the origin. A look of "any" is drawn by the seed."""

    size: tuple[Positive, Positive, Positive] = Field((8.0, 8.0, 3.0), description="x, y, z in metres")
    walls: bool = Field(True, description="false: an open floor, and cameras may stand anywhere above it")
    floor: Literal["tiles", "wood", "carpet", "concrete", "any"] = "tiles"
    wall: Literal["plain", "panels", "brick", "stripes", "any"] = "plain"
    light: Literal["day", "warm", "side", "dim", "any"] = "day"


class Clutter(Section):
    """Things that stand in the way, how many of each kind."""

    boxes: Count = 0
    shelves: Count = 0
    racks: Count = Field(0, description="bare frames as high as a chest, that hide little")
    tables: Count = 0
    chairs: Count = 0
    pillars: Count = 0
    partitions: Count = 0
    plants: Count = 0
    carts: Count = Field(0, description="these move about")
    coverage: Share | None = Field(
        None,
        description="share of the joints in the pictures to be hidden by things, whoever else hides them too; more "
        "things are added to reach it",
    )


class Decoys(Section):
    """Things that a detector may take for people, how many of each kind."""

    posters: Count = 0
    mannequins: Count = 0
    coat_stands: Count = 0
    mirrors: Count = 0
