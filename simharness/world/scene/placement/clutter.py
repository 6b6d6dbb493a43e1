"""Clutter by kind and number: objects placed where they occlude people but do not obstruct their paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simharness.scenario.sections.room_section import ClutterSection, RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.fixtures import draw_partition, draw_pillar
from simharness.world.scene.objects.furniture import draw_chair, draw_table
from simharness.world.scene.objects.plants import draw_plant
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.objects.storage import draw_box, draw_rack, draw_shelf
from simharness.world.scene.placement.carts import place_cart
from simharness.world.scene.placement.coverage import cover
from simharness.world.scene.placement.free_space import (
    TRIES,
    FreeSpace,
    PlaceSampler,
    Site,
    near_origin,
    near_people,
    towards_walls,
)


@dataclass(frozen=True)
class ClutterKind:
    """Kind of clutter at rest.

    Attributes:
        name: name of one object.
        plural: key of the scenario.
        draw: function that draws one object for a room.
        sample_place: function that draws a place for it.
        fills: whether it may be added to reach ``clutter.coverage``.
    """

    name: str
    plural: str
    draw: Callable[[np.random.Generator, RoomSection], ObjectModel]
    sample_place: PlaceSampler
    fills: bool = True


# In the order of placement: large objects first, because they need more space.
CLUTTER_KINDS = (
    ClutterKind("pillar", "pillars", lambda rng, room: draw_pillar(rng, room.size[2]), near_people),
    ClutterKind("shelf", "shelves", lambda rng, room: draw_shelf(rng), towards_walls),
    ClutterKind("rack", "racks", lambda rng, room: draw_rack(rng), towards_walls, fills=False),
    ClutterKind("partition", "partitions", lambda rng, room: draw_partition(rng), towards_walls),
    ClutterKind("table", "tables", lambda rng, room: draw_table(rng), towards_walls, fills=False),
    ClutterKind("box", "boxes", lambda rng, room: draw_box(rng), near_people),
    ClutterKind("plant", "plants", lambda rng, room: draw_plant(rng), near_people),
    ClutterKind("chair", "chairs", lambda rng, room: draw_chair(rng), near_people, fills=False),
)


def place_clutter(seed: int, clutter: ClutterSection, space: FreeSpace) -> tuple[Solid, ...]:
    """Draw the clutter and find a place for each object.

    Each object is drawn and placed by a separate stream, so one more box moves none of the objects placed before it.
    Objects keep 0.5 m from cameras, and all objects at rest together fill at most 60 % of any picture. If people keep
    the middle of the room free (``people.around``), the first object stands there.

    Raises:
        ValueError: no place is found for an object, or ``clutter.coverage`` cannot be reached.
    """
    site = Site(space)
    for kind in CLUTTER_KINDS:
        for k in range(getattr(clutter, kind.plural)):
            site.add(_place(seed, kind, k, site))
    for k in range(clutter.carts):
        site.add(place_cart(seed, k, site))
    if clutter.coverage is not None:
        fillers = {kind.name: kind.draw for kind in CLUTTER_KINDS if kind.fills}
        cover(seed, clutter.coverage, fillers, site)
    return tuple(site.solids[len(space.taken) :])


def _place(seed: int, kind: ClutterKind, k: int, site: Site) -> Solid:
    model = kind.draw(stream(seed, "clutter", kind.name, k), site.space.room)
    rng = stream(seed, "clutter", kind.name, k, "place")
    name = f"{kind.name}{k}"
    first = site.space.around > 0 and not any(solid.kind == "clutter" for solid in site.solids)
    solid = site.find(rng, model, near_origin if first else kind.sample_place, kind="clutter", name=name)
    if solid is None:
        raise ValueError(
            f"clutter.{kind.plural}: found no place for {kind.name} {k} in {TRIES} tries, clear of {len(site.solids)} "
            "other objects, of the paths of people and of the cameras, and with 40 % of each picture free, in "
            f"room.size = {list(site.space.room.size)}: lower clutter.{kind.plural} or people.count, or enlarge "
            "room.size"
        )
    return solid
