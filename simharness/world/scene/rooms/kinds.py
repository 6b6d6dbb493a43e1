"""Kinds of rooms: their finishes, windows, lamps, what hangs on their walls, and their furniture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

from mvpose.files.input_files import parse_toml
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.object_files import ASSETS

LampKind = Literal["panels", "tubes", "downlights", "pendants", "spots", "none"]


@dataclass(frozen=True)
class RoomKind:
    """Kind of a room.

    Attributes:
        floors, walls: finishes from which one is drawn.
        least: least size of the room, x, y, z, metres.
        windows: numbers of walls with windows, least and most.
        sill: height of the lower edge of the windows, metres.
        lamps: lamps in the ceiling.
        doors: whether there are a door and sockets.
        prints: what hangs on the walls: names of prints, with width and height of each, metres.
    """

    floors: tuple[str, ...]
    walls: tuple[str, ...]
    least: tuple[float, float, float] = (3.0, 3.0, 2.2)
    windows: tuple[int, int] = (1, 1)
    sill: float = 0.95
    lamps: LampKind = "panels"
    doors: bool = True
    prints: tuple[tuple[str, float, float], ...] = ()


_NOTICES = tuple((f"notice{k}", 0.30, 0.42) for k in range(3))
_POSTERS = tuple((f"poster{k}", 0.55, 0.76) for k in range(3))

ROOM_KINDS: Mapping[str, RoomKind] = MappingProxyType(
    {
        "laboratory": RoomKind(
            floors=("tiles",),
            walls=("plain",),
            least=(0.0, 0.0, 0.0),
            prints=(("whiteboard", 2.0, 1.05), ("clock", 0.32, 0.32), *_NOTICES, *_POSTERS[:1]),
        ),
        "office": RoomKind(
            floors=("carpet", "linoleum", "carpet_tiles"),
            walls=("plain", "tinted"),
            windows=(1, 2),
            sill=0.8,
            prints=(("whiteboard", 1.9, 1.0), ("clock", 0.30, 0.30), *_NOTICES, *_POSTERS),
        ),
        "living_room": RoomKind(
            floors=("parquet", "wood"),
            walls=("wallpaper", "tinted", "tinted", "stripes"),
            windows=(1, 2),
            sill=0.75,
            lamps="pendants",
            prints=(("landscape0", 0.9, 0.6), ("landscape1", 0.75, 0.5), ("poster0", 0.5, 0.7), ("poster1", 0.5, 0.7)),
        ),
        "gym": RoomKind(
            floors=("sports_floor",),
            walls=("tinted", "brick", "panels"),
            least=(4.0, 4.0, 2.6),
            windows=(1, 2),
            sill=1.5,
            lamps="tubes",
            prints=(("clock", 0.4, 0.4), ("poster0", 0.6, 0.83), ("poster2", 0.6, 0.83), *_NOTICES[:2]),
        ),
        "ward": RoomKind(
            floors=("linoleum",),
            walls=("tinted", "tiled"),
            windows=(1, 2),
            prints=(("clock", 0.32, 0.32), ("landscape1", 0.8, 0.53), ("landscape0", 0.6, 0.4), *_NOTICES),
        ),
        "shop": RoomKind(
            floors=("tiles", "wood", "concrete"),
            walls=("plain", "tinted", "brick"),
            windows=(1, 1),
            sill=0.4,
            lamps="downlights",
            prints=(*((f"poster{k}", 0.8, 1.1) for k in range(3)), *_NOTICES[:2]),
        ),
        "stage": RoomKind(
            floors=("stage_boards",),
            walls=("curtain",),
            least=(4.0, 4.0, 2.6),
            windows=(0, 0),
            lamps="spots",
            doors=False,
        ),
        "outdoors": RoomKind(
            floors=("paving", "asphalt", "grass"),
            walls=("plain",),
            windows=(0, 0),
            lamps="none",
            doors=False,
        ),
    }
)
"""Kinds of rooms by their names in the scenario."""


def settled(room: RoomSection, seed: int) -> RoomSection:
    """Return the room with its kind, floor and wall drawn where the scenario leaves them to the seed.

    A kind of "any" is drawn among those with walls, or is "outdoors" without walls. Finishes of "usual" are drawn among
    those that the kind has, by streams of their own.
    """
    kinds = [name for name in ROOM_KINDS if name != "outdoors"]
    drawn = kinds[stream(seed, "room", "kind").integers(len(kinds))]
    name = room.kind if room.kind != "any" else drawn if room.walls else "outdoors"
    kind = ROOM_KINDS[name]
    floor = kind.floors[stream(seed, "room", "usual floor").integers(len(kind.floors))]
    wall = kind.walls[stream(seed, "room", "usual wall").integers(len(kind.walls))]
    return room.model_copy(
        update={
            "kind": name,
            "floor": floor if room.floor == "usual" else room.floor,
            "wall": wall if room.wall == "usual" else room.wall,
        }
    )


def check_size(room: RoomSection) -> None:
    """Check that a room is large enough for its kind.

    Raises:
        ValueError: the room is too small; the message gives the least size.
    """
    least = ROOM_KINDS[room.kind].least
    if any(size < low for size, low in zip(room.size, least, strict=True)):
        raise ValueError(
            f'room.kind = "{room.kind}" needs a room of at least {least[0]:g} by {least[1]:g} m, {least[2]:g} m high, '
            f'got room.size = {list(room.size)}: enlarge room.size, or use room.kind = "laboratory", which fits any'
        )


@lru_cache(maxsize=1)
def furniture_of_rooms() -> Mapping[str, Mapping[str, tuple[int, int]]]:
    """Return the furniture by the kind of its room, from ``rooms.toml`` of the shipped objects.

    The pieces are in the order in which they find their places along the walls, each with the least and largest number
    at 28 m of walls (a room of 7 by 7 m). A laboratory has no furniture.
    """
    table = parse_toml((ASSETS / "rooms.toml").read_text(encoding="utf-8"))
    return MappingProxyType(
        {kind: {name: (low, high) for name, (low, high) in each.items()} for kind, each in table.items()}
    )
