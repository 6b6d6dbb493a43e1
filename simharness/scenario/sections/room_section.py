"""[room], [clutter] and [decoys]: the room and the objects in it."""

from typing import Annotated, Literal, Self

from pydantic import field_validator, model_validator

from simharness.scenario.sections.section import Count, Elements, Length, Section, Share, key


class RoomSection(Section):
    """The room: a floor and four walls around the origin. A kind or look of "any" is drawn from the seed."""

    size: Annotated[tuple[Length, Length, Length], Elements(("x", "y", "z"))] = key(
        (8.0, 8.0, 3.0), "x, y, z in metres"
    )
    walls: bool = key(True, "false: an open floor, and cameras may stand anywhere above it")
    kind: Literal["laboratory", "office", "living_room", "gym", "ward", "shop", "stage", "outdoors", "any"] = key(
        "laboratory",
        "kind of the room: its furniture along the walls, windows, lamps, finishes and what hangs on the "
        "walls; a laboratory has no furniture; outdoors has no walls",
    )
    floor: Literal[
        "usual",
        "tiles",
        "wood",
        "carpet",
        "concrete",
        "carpet_tiles",
        "linoleum",
        "parquet",
        "sports_floor",
        "stage_boards",
        "paving",
        "asphalt",
        "grass",
        "any",
    ] = key("usual", "look of the floor; usual: one that rooms of this kind have, in a laboratory tiles")
    wall: Literal["usual", "plain", "panels", "brick", "stripes", "tinted", "wallpaper", "tiled", "curtain", "any"] = (
        key("usual", "look of the walls; usual: one that rooms of this kind have, in a laboratory plain")
    )
    light: Literal["day", "warm", "side", "dim", "any"] = key("day", "lighting")

    @model_validator(mode="after")
    def _open_air(self) -> Self:
        """Leave out the walls outdoors."""
        if self.kind == "outdoors" and self.walls:
            if "walls" in self.model_fields_set:
                raise ValueError('room.kind = "outdoors" has no walls: remove room.walls = true')
            object.__setattr__(self, "walls", False)
        return self


class ClutterSection(Section):
    """Objects that stand in the way: number of each kind."""

    boxes: Count = 0
    shelves: Count = 0
    racks: Count = key(0, "open frames of chest height, which hide little")
    tables: Count = 0
    chairs: Count = 0
    pillars: Count = 0
    partitions: Count = 0
    plants: Count = 0
    carts: Count = key(0, "carts that move about")
    objects: tuple[str, ...] = key(
        (),
        "files of further objects, each placed once: MJCF (.xml), or OBJ (.obj) with its MTL, z up and front towards "
        "+x, or glTF (.glb, .gltf); in metres; paths relative to the scenario file",
        max_length=50,
    )
    coverage: Share | None = key(
        None,
        "share of the joints in the pictures that clutter hides, including joints that people hide as "
        "well; objects are added until it is reached",
    )

    @field_validator("objects")
    @classmethod
    def _objects(cls, objects: tuple[str, ...]) -> tuple[str, ...]:
        for file in objects:
            if not file.lower().endswith((".xml", ".obj", ".glb", ".gltf")):
                raise ValueError(
                    f"{file!r} is no file of an object: expected a name that ends in .xml (MJCF), .obj (OBJ), .glb or "
                    ".gltf (glTF)"
                )
        return objects


class DecoysSection(Section):
    """Objects that a detector may take for people: number of each kind."""

    posters: Count = 0
    mannequins: Count = 0
    coat_stands: Count = 0
    mirrors: Count = 0
