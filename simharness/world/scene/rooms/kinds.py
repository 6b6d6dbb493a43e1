"""Kinds of rooms: their finishes, furniture, windows, lamps and what hangs on their walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects import gym, home, office, park, shop, stage, ward
from simharness.world.scene.objects.furnishing import Furnishing

Draw = Callable[[Furnishing, np.random.Generator], None]
LampKind = Literal["panels", "tubes", "downlights", "pendants", "spots", "none"]


@dataclass(frozen=True)
class Furniture:
    """Furniture of one name: how it is drawn, and how many stand at 28 m of walls (a room of 7 by 7 m)."""

    name: str
    draw: Draw
    count: tuple[int, int]


@dataclass(frozen=True)
class RoomKind:
    """Kind of a room.

    Attributes:
        floors, walls: finishes from which one is drawn.
        furniture: furniture along the walls, in the order in which it finds its places.
        least: least size of the room, x, y, z, metres.
        windows: numbers of walls with windows, least and most.
        sill: height of the lower edge of the windows, metres.
        lamps: lamps in the ceiling.
        doors: whether there are a door and sockets.
        prints: what hangs on the walls: names of prints, with width and height of each, metres.
    """

    floors: tuple[str, ...]
    walls: tuple[str, ...]
    furniture: tuple[Furniture, ...] = ()
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
            furniture=(
                Furniture("workstation", office.workstation, (2, 4)),
                Furniture("cabinet", office.cabinet, (1, 3)),
                Furniture("bookcase", office.bookcase, (1, 2)),
                Furniture("printer", office.printer, (1, 1)),
                Furniture("water cooler", office.water_cooler, (1, 1)),
                Furniture("potted plant", office.potted_plant, (1, 3)),
            ),
            windows=(1, 2),
            sill=0.8,
            prints=(("whiteboard", 1.9, 1.0), ("clock", 0.30, 0.30), *_NOTICES, *_POSTERS),
        ),
        "living_room": RoomKind(
            floors=("parquet", "wood"),
            walls=("wallpaper", "tinted", "tinted", "stripes"),
            furniture=(
                Furniture("sofa", home.sofa, (1, 1)),
                Furniture("television", home.television, (1, 1)),
                Furniture("bookshelf", home.bookshelf, (1, 2)),
                Furniture("dining table", home.dining_table, (1, 1)),
                Furniture("armchair", home.armchair, (1, 1)),
                Furniture("sideboard", home.sideboard, (1, 2)),
                Furniture("potted plant", office.potted_plant, (1, 2)),
            ),
            windows=(1, 2),
            sill=0.75,
            lamps="pendants",
            prints=(("landscape0", 0.9, 0.6), ("landscape1", 0.75, 0.5), ("poster0", 0.5, 0.7), ("poster1", 0.5, 0.7)),
        ),
        "gym": RoomKind(
            floors=("sports_floor",),
            walls=("tinted", "brick", "panels"),
            furniture=(
                Furniture("wall bars", gym.wall_bars, (1, 2)),
                Furniture("vaulting box", gym.vaulting_box, (1, 1)),
                Furniture("gym bench", gym.bench, (1, 3)),
                Furniture("mats", gym.mats, (1, 1)),
                Furniture("ball trolley", gym.balls, (1, 1)),
                Furniture("dumbbells", gym.dumbbells, (1, 1)),
                Furniture("treadmill", gym.treadmill, (0, 2)),
                Furniture("punching bag", gym.punching_bag, (0, 1)),
            ),
            least=(4.0, 4.0, 2.6),
            windows=(1, 2),
            sill=1.5,
            lamps="tubes",
            prints=(("clock", 0.4, 0.4), ("poster0", 0.6, 0.83), ("poster2", 0.6, 0.83), *_NOTICES[:2]),
        ),
        "ward": RoomKind(
            floors=("linoleum",),
            walls=("tinted", "tiled"),
            furniture=(
                Furniture("bed", ward.bed, (1, 3)),
                Furniture("bedside cabinet", ward.bedside, (1, 3)),
                Furniture("monitor", ward.monitor, (1, 1)),
                Furniture("visitors' chairs", ward.visitors, (1, 1)),
                Furniture("wardrobe", ward.wardrobe, (1, 1)),
                Furniture("screen on wheels", ward.screen_on_wheels, (0, 1)),
            ),
            windows=(1, 2),
            prints=(("clock", 0.32, 0.32), ("landscape1", 0.8, 0.53), ("landscape0", 0.6, 0.4), *_NOTICES),
        ),
        "shop": RoomKind(
            floors=("tiles", "wood", "concrete"),
            walls=("plain", "tinted", "brick"),
            furniture=(
                Furniture("counter", shop.counter, (1, 1)),
                Furniture("goods", shop.goods, (3, 6)),
                Furniture("fridge", shop.fridge, (1, 1)),
                Furniture("clothes rail", shop.clothes, (1, 2)),
                Furniture("display table", shop.display, (1, 1)),
                Furniture("stock", shop.stock, (1, 2)),
            ),
            windows=(1, 1),
            sill=0.4,
            lamps="downlights",
            prints=(*((f"poster{k}", 0.8, 1.1) for k in range(3)), *_NOTICES[:2]),
        ),
        "stage": RoomKind(
            floors=("stage_boards",),
            walls=("curtain",),
            furniture=(
                Furniture("drums", stage.drums, (1, 1)),
                Furniture("loudspeaker", stage.loudspeaker, (2, 2)),
                Furniture("piano", stage.piano, (1, 1)),
                Furniture("amplifier", stage.amplifier, (1, 2)),
                Furniture("microphone", stage.microphone, (1, 2)),
                Furniture("flight cases", stage.cases, (1, 2)),
                Furniture("floodlight", stage.floodlight, (1, 2)),
            ),
            least=(4.0, 4.0, 2.6),
            windows=(0, 0),
            lamps="spots",
            doors=False,
        ),
        "outdoors": RoomKind(
            floors=("paving", "asphalt", "grass"),
            walls=("plain",),
            furniture=(
                Furniture("lamp post", park.lamp_post, (1, 2)),
                Furniture("park bench", park.park_bench, (1, 3)),
                Furniture("planter", park.planter, (1, 3)),
                Furniture("hedge", park.hedge, (1, 3)),
                Furniture("small tree", park.small_tree, (1, 2)),
                Furniture("litter bin", park.litter_bin, (1, 1)),
                Furniture("bicycle", park.bicycle, (1, 2)),
            ),
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
