"""[room], [clutter] and [decoys]: the room and the objects in it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from simharness.scenario.sections.section import Count, Elements, Length, Section, Share


class Room(Section):
    """The room: a floor and four walls around the origin. A look of "any" is drawn from the seed."""

    size: Annotated[tuple[Length, Length, Length], Elements(("x", "y", "z"))] = Field(
        (8.0, 8.0, 3.0), description="x, y, z in metres"
    )
    walls: bool = Field(True, description="false: an open floor, and cameras may stand anywhere above it")
    floor: Literal["tiles", "wood", "carpet", "concrete", "any"] = Field("tiles", description="look of the floor")
    wall: Literal["plain", "panels", "brick", "stripes", "any"] = Field("plain", description="look of the walls")
    light: Literal["day", "warm", "side", "dim", "any"] = Field("day", description="lighting")


class Clutter(Section):
    """Objects that stand in the way: number of each kind."""

    boxes: Count = 0
    shelves: Count = 0
    racks: Count = Field(0, description="open frames of chest height, which hide little")
    tables: Count = 0
    chairs: Count = 0
    pillars: Count = 0
    partitions: Count = 0
    plants: Count = 0
    carts: Count = Field(0, description="carts that move about")
    coverage: Share | None = Field(
        None,
        description="share of the joints in the pictures that clutter hides, including joints that people hide as "
        "well; objects are added until it is reached",
    )


class Decoys(Section):
    """Objects that a detector may take for people: number of each kind."""

    posters: Count = 0
    mannequins: Count = 0
    coat_stands: Count = 0
    mirrors: Count = 0
