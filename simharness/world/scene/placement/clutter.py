"""Clutter by kind and amount: things drawn, and put where they hide people from cameras but are in nobody's way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simharness.scenario.sections.room import Clutter, Room
from simharness.types.random_streams import stream
from simharness.world.scene.objects.fixtures import draw_partition, draw_pillar
from simharness.world.scene.objects.furniture import draw_chair, draw_table
from simharness.world.scene.objects.plants import draw_plant
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.objects.storage import draw_box, draw_rack, draw_shelf
from simharness.world.scene.placement.carts import place_cart
from simharness.world.scene.placement.coverage import cover
from simharness.world.scene.placement.free_space import TRIES, FreeSpace, Site, Where, about, beside, middle


@dataclass(frozen=True)
class ClutterKind:
    """One kind of clutter that stands still.

    Attributes:
        name: of one; ``plural``: the key of the scenario.
        draw: draws one for a room.
        where: draws a place for it.
        fills: whether it may be added to reach ``clutter.coverage``.
    """

    name: str
    plural: str
    draw: Callable[[np.random.Generator, Room], ObjectModel]
    where: Where
    fills: bool = True


# In the order in which they find their places: the large ones first, for they find one less easily.
CLUTTER_KINDS = (
    ClutterKind("pillar", "pillars", lambda rng, room: draw_pillar(rng, room.size[2]), about),
    ClutterKind("shelf", "shelves", lambda rng, room: draw_shelf(rng), beside),
    ClutterKind("rack", "racks", lambda rng, room: draw_rack(rng), beside, fills=False),
    ClutterKind("partition", "partitions", lambda rng, room: draw_partition(rng), beside),
    ClutterKind("table", "tables", lambda rng, room: draw_table(rng), beside, fills=False),
    ClutterKind("box", "boxes", lambda rng, room: draw_box(rng), about),
    ClutterKind("plant", "plants", lambda rng, room: draw_plant(rng), about),
    ClutterKind("chair", "chairs", lambda rng, room: draw_chair(rng), about, fills=False),
)


def place_clutter(seed: int, clutter: Clutter, space: FreeSpace) -> tuple[Solid, ...]:
    """Draw the clutter and find a place for each thing.

    Each thing is drawn and placed by a stream of its own: one more box moves nothing that stood before it. Nothing
    comes within 0.5 m of a lens, and all things at rest fill at most 60 % of any one picture. Where people keep the
    middle free (``people.around``), the first thing stands there.

    Raises:
        ValueError: a thing finds no place, or ``clutter.coverage`` cannot be reached.
    """
    site = Site(space)
    for species in CLUTTER_KINDS:
        for k in range(getattr(clutter, species.plural)):
            site.add(_place(seed, species, k, site))
    for k in range(clutter.carts):
        site.add(place_cart(seed, k, site))
    if clutter.coverage is not None:
        fillers = {species.name: species.draw for species in CLUTTER_KINDS if species.fills}
        cover(seed, clutter.coverage, fillers, site)
    return tuple(site.solids[len(space.taken) :])


def _place(seed: int, species: ClutterKind, k: int, site: Site) -> Solid:
    thing = species.draw(stream(seed, "clutter", species.name, k), site.space.room)
    rng = stream(seed, "clutter", species.name, k, "place")
    name = f"{species.name}{k}"
    first = site.space.around > 0 and not any(solid.kind == "clutter" for solid in site.solids)
    solid = site.find(rng, thing, middle if first else species.where, kind="clutter", name=name)
    if solid is None:
        raise ValueError(
            f"clutter.{species.plural}: {species.name} {k} finds no place in {TRIES} tries beside {len(site.solids)} "
            "other things, the people's paths and the cameras, of whose pictures 40 % stay clear, in room.size = "
            f"{list(site.space.room.size)}; lower clutter.{species.plural} or people.count, or enlarge room.size"
        )
    return solid
