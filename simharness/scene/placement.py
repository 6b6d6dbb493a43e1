"""Where clutter stands: where it hides people from cameras, but never in anyone's way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simharness.random import stream
from simharness.scene.clutter import Thing, draw_box, draw_shelf
from simharness.scene.solids import Box, Solid

Floats = NDArray[np.float64]

BODY_HALF_WIDTH = 0.42  # metres: what a trunk with its arms needs to pass by
_LIMB = 0.15  # metres around every joint: an outstretched arm does not go through a shelf
_LENS = 0.5  # metres kept free around each camera
_GAP = 0.08  # metres between things, and to the walls
_BESIDE = (0.6, 1.4)  # metres from a person to a box beside
_TRIES = 2000


@dataclass(frozen=True)
class FreeSpace:
    """What clutter must stay clear of.

    Attributes:
        room: x, y, z of the room, metres.
        area: half the side of the square that people stay in, metres.
        pelvises: where pelvises ever are, (n, 3) metres.
        joints: where joints ever are, (m, 3) metres.
        lenses: optical centres, (V, 3) metres.
    """

    room: tuple[float, float, float]
    area: float
    pelvises: Floats
    joints: Floats
    lenses: Floats

    def holds(self, hull: Box, others: list[Solid]) -> bool:
        """Whether a thing with this hull can stand there beside the others."""
        inside = np.abs(hull.corners[:, :2]).max(axis=0) <= np.array(self.room[:2]) / 2 - _GAP
        return bool(
            inside.all()
            and hull.corners[:, 2].max() <= self.room[2]
            and hull.distance_on_floor(self.pelvises).min(initial=np.inf) >= BODY_HALF_WIDTH
            and hull.distance_on_floor(self.joints).min(initial=np.inf) >= _LIMB
            and hull.distance(self.lenses).min(initial=np.inf) >= _LENS
            and all(hull.gap_on_floor(other.hull) >= _GAP for other in others)
        )


def place_clutter(seed: int, *, boxes: int, shelves: int, space: FreeSpace) -> tuple[Solid, ...]:
    """Draw the clutter and find a place for each thing, shelves first, for they find one less easily.

    Each thing is drawn and placed by a stream of its own: one more box moves nothing that stood before it.

    Raises:
        ValueError: a thing finds no place.
    """
    placed: list[Solid] = []
    for k in range(shelves):
        placed.append(_place(seed, "shelf", k, draw_shelf, _beside, space, placed))
    for k in range(boxes):
        placed.append(_place(seed, "box", k, draw_box, _about, space, placed))
    return tuple(placed)


_Where = Callable[[np.random.Generator, Thing, FreeSpace], tuple[Floats, float]]


def _place(
    seed: int,
    kind: str,
    k: int,
    draw: Callable[[np.random.Generator], Thing],
    where: _Where,
    space: FreeSpace,
    placed: list[Solid],
) -> Solid:
    thing = draw(stream(seed, "clutter", kind, k))
    rng = stream(seed, "clutter", kind, k, "place")
    for _ in range(_TRIES):
        place, yaw = where(rng, thing, space)
        if space.holds(thing.hull(place, yaw), placed):
            return thing.at(place, yaw, name=f"{kind}{k}")
    plural = "shelves" if kind == "shelf" else "boxes"
    raise ValueError(
        f"clutter.{plural}: {kind} {k} finds no place in {_TRIES} tries beside {len(placed)} other things, the "
        f"people's paths and the cameras in room.size = {list(space.room)}; lower clutter.{plural} or people.count, "
        "or enlarge room.size"
    )


def _about(rng: np.random.Generator, thing: Thing, space: FreeSpace) -> tuple[Floats, float]:
    """Close to where someone stands or walks, on any side, at any angle: it hides legs from the cameras beyond."""
    share, distance = rng.uniform(), rng.uniform(*_BESIDE)
    bearing, yaw = rng.uniform(0.0, 2 * np.pi, 2)
    if len(space.pelvises):
        someone = space.pelvises[int(share * len(space.pelvises)), :2]
        place = someone + distance * np.array([np.cos(bearing), np.sin(bearing)])
    else:
        place = _ring(rng, share * np.minimum(space.area, np.array(space.room[:2]) / 2))
    return place, float(yaw)


def _beside(rng: np.random.Generator, thing: Thing, space: FreeSpace) -> tuple[Floats, float]:
    """From within the people's area out to the wall, rather near than far, its back outwards."""
    half = np.array(space.room[:2]) / 2
    edge = np.minimum(0.6 * space.area, half)
    place = _ring(rng, edge + rng.uniform() ** 2 * np.maximum(half - 0.25 - edge, 0.0))
    outward = place / half
    side = int(np.abs(outward).argmax())
    yaw = (np.pi if outward[0] > 0 else 0.0) if side == 0 else (-np.pi / 2 if outward[1] > 0 else np.pi / 2)
    return place, float(yaw)


def _ring(rng: np.random.Generator, reach: Floats) -> Floats:
    """A point on the outline of the rectangle of half sides ``reach`` (2,)."""
    side, sense, along = rng.integers(2), rng.choice([-1.0, 1.0]), rng.uniform(-1.0, 1.0)
    unit = np.array([sense, along]) if side == 0 else np.array([along, sense])
    return unit * reach
