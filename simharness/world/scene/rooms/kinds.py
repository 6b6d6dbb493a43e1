"""Kinds of rooms: their finishes, windows, lamps, what hangs on their walls, and their furniture."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

from pydantic import TypeAdapter

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
        furniture: its pieces in the order in which they find their places along the walls, each with the least and
            largest number at 28 m of walls (a room of 7 by 7 m).
    """

    floors: tuple[str, ...]
    walls: tuple[str, ...]
    least: tuple[float, float, float] = (3.0, 3.0, 2.2)
    windows: tuple[int, int] = (1, 1)
    sill: float = 0.95
    lamps: LampKind = "panels"
    doors: bool = True
    prints: tuple[tuple[str, float, float], ...] = ()
    furniture: Mapping[str, tuple[int, int]] = field(default_factory=dict)


@lru_cache(maxsize=1)
def room_kinds() -> Mapping[str, RoomKind]:
    """Return the kinds of rooms by their names in the scenario, from ``rooms.toml`` of the shipped objects."""
    table = parse_toml((ASSETS / "rooms.toml").read_text(encoding="utf-8"))
    return MappingProxyType(TypeAdapter(dict[str, RoomKind]).validate_python(table))


def settled(room: RoomSection, seed: int) -> RoomSection:
    """Return the room with its kind, floor and wall drawn where the scenario leaves them to the seed.

    A kind of "any" is drawn among those with walls, or is "outdoors" without walls. Finishes of "usual" are drawn among
    those that the kind has, by streams of their own.
    """
    kinds = [name for name in room_kinds() if name != "outdoors"]
    drawn = kinds[stream(seed, "room", "kind").integers(len(kinds))]
    name = room.kind if room.kind != "any" else drawn if room.walls else "outdoors"
    kind = room_kinds()[name]
    floor = kind.floors[stream(seed, "room", "usual floor").integers(len(kind.floors))]
    wall = kind.walls[stream(seed, "room", "usual wall").integers(len(kind.walls))]
    drawn_finishes = {"floor": floor if room.floor == "usual" else room.floor}
    drawn_finishes |= {"wall": wall if room.wall == "usual" else room.wall}
    return room.model_copy(update={"kind": name} | drawn_finishes)


def check_size(room: RoomSection) -> None:
    """Check that a room is large enough for its kind.

    Raises:
        ValueError: the room is too small; the message gives the least size.
    """
    least = room_kinds()[room.kind].least
    if any(size < low for size, low in zip(room.size, least, strict=True)):
        raise ValueError(
            f'room.kind = "{room.kind}" needs a room of at least {least[0]:g} by {least[1]:g} m, {least[2]:g} m high, '
            f'got room.size = {list(room.size)}: enlarge room.size, or use room.kind = "laboratory", which fits any'
        )
