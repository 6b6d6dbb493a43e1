"""Clutter and decoys by kind and number: objects that occlude people or look like them, clear of their paths.

A cart oscillates on a line or circulates on an ellipse, always clear of people.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from simharness.scenario.sections.room_section import ClutterSection, DecoysSection, RoomSection
from simharness.types.random_streams import stream
from simharness.world.motion.motion import Trajectory, upright_poses
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.laboratory import draw_box, draw_mannequin, draw_shelf
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import draw_shipped, draw_variant, load_object
from simharness.world.scene.objects.solids import ObjectModel, Solid, yaw_of
from simharness.world.scene.placement.free_space import (
    BODY_HALF_WIDTH,
    LIMB,
    TRIES,
    FreeSpace,
    PlaceSampler,
    Site,
    inward_yaw,
    near_origin,
    near_people,
    towards_walls,
)
from simharness.world.scene.placement.occlusion_target import cover, lines_in
from simharness.world.scene.placement.sight_lines import SightLines
from simharness.world.scene.rooms.kinds import room_kinds
from simharness.world.scene.rooms.openings import Opening, room_walls

_SPEED = (0.35, 0.7)  # m/s: largest speed on the path
_LINE = (0.4, 2.5)  # metres from the middle of a line to its ends
_MIN_RADIUS = 0.7  # metres
_LINE_CHANCE = 0.6
_BEARING_SPREAD = 0.2  # radians: standard deviation of the bearing of a path about that of a wall
_PHASES = 24  # phases of one period at which clearance from objects is checked
_COARSE = 6  # every sixth time step shows most encounters with people
_ON_WALL_CHANCE = 0.7  # chance that a poster or mirror hangs at a wall, if there are walls
_LIMBS_REACH = 1.6  # metres: largest distance from a pelvis to a joint


@dataclass(frozen=True)
class ClutterKind:
    """Kind of clutter at rest."""

    name: str
    """Name of one object."""
    plural: str
    """Key of the scenario."""
    sample_place: PlaceSampler
    """Function that draws a place for it."""
    fills: bool = True
    """Whether it may be added to reach ``clutter.coverage``."""
    file: str = ""
    """Name of the shipped object that it is; its own by default."""
    stretch: float = 0.0
    """Largest change of its width and depth, and of its height, as a share."""

    def draw(self, rng: np.random.Generator, room: RoomSection) -> ObjectModel:
        """Draw one object for a room; a pillar reaches the ceiling."""
        if self.name in ("box", "shelf"):
            return draw_box(rng) if self.name == "box" else draw_shelf(rng)
        height = room.size[2] if self.name == "pillar" else None
        return draw_shipped(rng, self.file or self.name, self.stretch, height=height)


# In the order of placement: large objects first, because they need more space.
CLUTTER_KINDS = (
    ClutterKind("pillar", "pillars", near_people),
    ClutterKind("shelf", "shelves", towards_walls),
    ClutterKind("rack", "racks", towards_walls, fills=False, stretch=0.12),
    ClutterKind("partition", "partitions", towards_walls, stretch=0.05),
    ClutterKind("table", "tables", towards_walls, fills=False, file="laid_table", stretch=0.03),
    ClutterKind("box", "boxes", near_people),
    ClutterKind("plant", "plants", near_people, file="potted_plant", stretch=0.1),
    ClutterKind("chair", "chairs", near_people, fills=False, stretch=0.05),
)
_CART_STRETCH = 0.08
_DECOYS = {"posters": "poster", "mirrors": "mirror", "mannequins": "mannequin", "coat_stands": "coat stand"}
"""Names of decoys, in the order of placement, by key of the scenario."""


def place_clutter(seed: int, clutter: ClutterSection, space: FreeSpace) -> tuple[Solid, ...]:
    """Draw the clutter and find a place for each object, for those of files first.

    Each object is drawn and placed by a separate stream, so one more box moves none of the objects placed before it.
    Objects keep 0.5 m from cameras, and all objects at rest together fill at most 60 % of any picture. If people keep
    the middle of the room free (``people.around``), the first object stands there.

    Raises:
        ValueError: no place is found for an object, or ``clutter.coverage`` cannot be reached.
    """
    site = Site(space)
    for k, file in enumerate(clutter.objects):
        site.add(_place_file(seed, Path(file), k, site))
    for kind in CLUTTER_KINDS:
        for k in range(getattr(clutter, kind.plural)):
            site.add(_place(seed, kind, k, site))
    for k in range(clutter.carts):
        site.add(place_cart(seed, k, site))
    if clutter.coverage is not None:
        fillers = {kind.name: kind.draw for kind in CLUTTER_KINDS if kind.fills}
        cover(seed, clutter.coverage, fillers, site)
    return tuple(site.solids[len(space.taken) :])


def _place_file(seed: int, file: Path, k: int, site: Site) -> Solid:
    """Read the object of a file and find a place for it near people."""
    model = load_object(file).model()
    solid = _find(seed, "object", k, model, site, near_people, name=f"object{k} {file.stem}")
    size = " x ".join(f"{2 * half:.2f}" for half in model.extent.half)
    remedy = "scale the object if its lengths are not metres, name fewer objects, lower people.count"
    return _placed(solid, "clutter.objects", f"{file}, {size} m large,", site, remedy)


def _placed(solid: Solid | None, key: str, what: str, site: Site, remedy: str) -> Solid:
    """Return the solid if a place was found for it.

    Raises:
        ValueError: there is none; the message names the key of the scenario and what to change.
    """
    if solid is None:
        raise ValueError(
            f"{key}: found no place for {what} in {TRIES} tries, clear of {len(site.solids)} other objects, of the "
            "paths of people and of the cameras, and with 40 % of each picture free, in room.size = "
            f"{list(site.space.room.size)}: {remedy}, or enlarge room.size"
        )
    return solid


def _find(
    seed: int, kind: str, k: int, model: ObjectModel, site: Site, sample_place: PlaceSampler, *, name: str
) -> Solid | None:
    """Return object k of a kind at a drawn place; the first object stands where people keep the middle free."""
    rng = stream(seed, "clutter", kind, k, "place")
    first = site.space.around > 0 and not any(solid.kind == "clutter" for solid in site.solids)
    return site.find(rng, model, near_origin if first else sample_place, kind="clutter", name=name)


def _place(seed: int, kind: ClutterKind, k: int, site: Site) -> Solid:
    model = kind.draw(stream(seed, "clutter", kind.name, k), site.space.room)
    solid = _find(seed, kind.name, k, model, site, kind.sample_place, name=f"{kind.name}{k}")
    key = f"clutter.{kind.plural}"
    return _placed(solid, key, f"{kind.name} {k}", site, f"lower {key} or people.count")


def place_cart(seed: int, k: int, site: Site) -> Solid:
    """Draw cart k and a path for it.

    At all times for which people are planned it keeps the same distance from them as objects at rest, and is clear of
    objects, of the paths of other carts, of walls and of cameras.

    Raises:
        ValueError: no path is free.
    """
    cart = draw_shipped(stream(seed, "clutter", "cart", k), "cart", _CART_STRETCH)
    rng = stream(seed, "clutter", "cart", k, "way")
    space = site.space
    for _ in range(TRIES):
        path = _draw_path(rng, space)
        period = path.at(path.period * np.arange(_PHASES) / _PHASES)
        if not all(site.clear(cart.extent.moved(pose[:2], yaw_of(pose))) for pose in period):
            continue
        pose = path.at(space.time)
        if not (_meets_people(cart.extent, pose, space, _COARSE) or _meets_people(cart.extent, pose, space, 1)):
            return cart.along(Trajectory(space.time, pose), kind="clutter", name=f"cart{k}")
    raise ValueError(
        f"clutter.carts: found no free path for cart {k} in {TRIES} tries, clear of people, objects and cameras in "
        f"room.size = {list(space.room.size)}: lower clutter.carts, people.area or people.count, or enlarge room.size"
    )


@dataclass(frozen=True)
class _Path:
    """Harmonic path: an ellipse, whose second radius is 0 for a line."""

    middle: Floats
    """Centre, (2,), metres."""
    bearing: float
    """Bearing of the first radius, radians."""
    radii: Floats
    """Radii, (2,), metres."""
    period: float
    """Period in seconds; negative for clockwise."""
    phase: float
    """Phase at time 0, radians."""

    def at(self, time: Floats) -> Floats:
        """Return poses (n, 7) at times (n,); the cart keeps its orientation on a line and faces ahead on an ellipse."""
        angle = 2 * np.pi * time / self.period + self.phase
        c, s = np.cos(self.bearing), np.sin(self.bearing)
        turn = np.array([[c, s], [-s, c]])
        place = self.middle + np.column_stack([np.cos(angle), np.sin(angle)]) * self.radii @ turn
        ahead = np.column_stack([-np.sin(angle), np.cos(angle)]) * self.radii @ turn * np.sign(self.period)
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) if self.radii[1] else np.full(len(time), self.bearing)
        return upright_poses(place, yaw)


def _draw_path(rng: np.random.Generator, space: FreeSpace) -> _Path:
    on_a_line, speed, sense = rng.uniform() < _LINE_CHANCE, rng.uniform(*_SPEED), rng.choice([-1.0, 1.0])
    quarter, deviation, phase = rng.integers(4), rng.normal(0.0, _BEARING_SPREAD), rng.uniform(0, 2 * np.pi)
    share, reach = rng.uniform(-1, 1, 2), rng.uniform(0, 1, 2)
    bearing = float(quarter * np.pi / 2 + deviation)
    if on_a_line:
        radii = np.array([_LINE[0] + (_LINE[1] - _LINE[0]) * reach[0] ** 2, 0.0])
        middle = share * space.half
    else:
        radii = _MIN_RADIUS + np.maximum(space.half - _MIN_RADIUS, 0) * reach
        middle = share * np.maximum(space.half - radii, 0)
    return _Path(middle, bearing, radii, float(sense * 2 * np.pi * radii.max() / speed), phase)


def _meets_people(extent: Box, pose: Floats, space: FreeSpace, stride: int) -> bool:
    """Return whether a person comes too close to an object on its path, checked at every ``stride``-th time."""
    pose, pelvises = pose[::stride], space.pelvises[::stride]
    apart = np.linalg.norm(pelvises[..., :2] - pose[:, None, :2], axis=-1)
    n, p = np.nonzero(apart < np.hypot(*extent.half[:2]) + _LIMBS_REACH)
    if _least_distance(extent, pose[n], pelvises[n, p][:, None]) < BODY_HALF_WIDTH:
        return True
    return _least_distance(extent, pose[n], space.joints[::stride][n, p]) < LIMB


def _least_distance(extent: Box, pose: Floats, points: Floats) -> float:
    """Return the least horizontal distance between an object in poses (n, 7) and points (n, J, 3), metres."""
    yaw = np.arctan2(pose[:, 6], pose[:, 3]) * 2
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = np.moveaxis(points[..., :2] - pose[:, None, :2], -1, 0)
    local = np.stack([c * x + s * y, c * y - s * x, np.zeros_like(x)], axis=-1)
    return float(extent.distance_on_floor(local).min(initial=np.inf))


def place_decoys(seed: int, decoys: DecoysSection, space: FreeSpace) -> tuple[Solid, ...]:
    """Draw the decoys and find a place for each: on a wall, or near the paths of people.

    Each is drawn and placed by a separate stream, so one more moves none of those placed before it.

    Raises:
        ValueError: no place is found for a decoy.
    """
    site = Site(space)
    for plural, name in _DECOYS.items():
        for k in range(getattr(decoys, plural)):
            rng = stream(seed, "decoys", name, k)
            on_wall = rng.uniform() < _ON_WALL_CHANCE and space.room.walls and plural in ("posters", "mirrors")
            model = _decoy(rng, name, on_wall)
            place_rng = stream(seed, "decoys", name, k, "place")
            sample_place = _at_wall if on_wall else near_people
            solid = site.find(place_rng, model, sample_place, kind="decoy", name=f"{name}{k}", at_wall=on_wall)
            key = f"decoys.{plural}"
            site.add(_placed(solid, key, f"{name} {k}", site, f"lower {key} or people.count"))
    return tuple(site.solids[len(space.taken) :])


def _decoy(rng: np.random.Generator, name: str, on_wall: bool) -> ObjectModel:
    """Draw a decoy, as it hangs on a wall or as it stands."""
    if name == "mannequin":
        return draw_mannequin(rng)
    return draw_variant(rng, f"{'wall_' * on_wall}{name.replace(' ', '_')}").model()


def _at_wall(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """Draw a place along a wall and the yaw that faces into the room."""
    side, sense, along = rng.integers(2), rng.choice([-1.0, 1.0]), rng.uniform(-0.85, 0.85)
    unit = np.array([sense, along]) if side == 0 else np.array([along, sense])
    outward = np.array([sense, 0.0]) if side == 0 else np.array([0.0, sense])
    return unit * space.half, inward_yaw(outward)


_TRIES = 40  # places tried for one piece
_WALLS = 28.0  # metres of walls for which the numbers of a kind are given
_BEHIND = 0.02  # metres between a piece and its wall: room for the skirting board
_MOST_HIDDEN = 0.01  # share of the joints in the pictures that one piece may hide
_LINES = 3000  # lines of sight on which that is measured


def place_furniture(seed: int, space: FreeSpace, openings: Sequence[Opening]) -> tuple[Solid, ...]:
    """Choose the furniture of a room and find places along its walls, or along the edge of an open floor.

    Variant and place of every piece are drawn by streams of its own. It stands outside the square in which people stay
    (``people.area``), obstructs no person, keeps 0.5 m from cameras, leaves doors and windows free, and hides at most
    1 % of the joints in the pictures. A piece that finds no place is left out.

    Args:
        seed: seed of the scenario.
        space: free space, in a room with a drawn kind.
        openings: doors and windows.

    Raises:
        ValueError: the room has furniture, and no piece finds a place.
    """
    furniture = room_kinds()[space.room.kind].furniture
    if not furniture:
        return ()
    site, sheet, walls = Site(space), draw_sheet(seed), room_walls(space.room)
    lines = lines_in(space)
    step = max(1, len(lines) // _LINES)
    lines = SightLines(lines.starts[::step], lines.ends[::step], lines.time[::step])
    area = Box((0.0, 0.0, 1.0), (space.area, space.area, 1.0)) if space.pelvises.size else None

    def find(rng: np.random.Generator, model: ObjectModel, name: str) -> Solid | None:
        """Return a piece of furniture at the first valid place; None if there is none."""
        for along, wall_share in rng.uniform(size=(_TRIES, 2)):
            wall, (depth, width, _) = walls[int(wall_share * len(walls))], model.extent.half
            from_left = width + along * max(wall.length - 2 * width, 0.0)
            place, yaw = wall.at((from_left, depth + _BEHIND, 0.0))[:2], wall.yaw  # its back to the wall
            hull = model.hull(place, yaw)
            if (
                (area is not None and area.gap_on_floor(hull) <= 0.0)
                or not site.clear(hull, at_wall=True)
                or not all(opening.keeps_free(hull) for opening in openings)
                or site.space.obstructed(hull)
            ):
                continue
            solid = model.at(place, yaw, kind="furniture", name=name)
            if site.leaves_pictures_free(solid) and (not len(lines) or lines.cut_by(solid).mean() <= _MOST_HIDDEN):
                return solid
        return None

    share = sum(wall.length for wall in walls) / _WALLS
    placed: list[Solid] = []
    for name, (low, high) in furniture.items():
        number = int(stream(seed, "room", "furniture", name).integers(low, high + 1))
        for k in range(max(1, round(share * number))):
            key = ("room", "furniture", name, k)
            model = draw_variant(stream(seed, *key), name).model(sheet)
            solid = find(stream(seed, *key, "place"), model, f"{name}{k}")
            if solid is not None:
                site.add(solid)
                placed.append(solid)
    if not placed:
        raise ValueError(
            f'room.kind = "{space.room.kind}": no piece of its furniture finds a place between people.area = '
            f"{space.area:g} m and the walls of room.size = {list(space.room.size)}, clear of people and 0.5 m from "
            'cameras: enlarge room.size, lower people.area, or use room.kind = "laboratory"'
        )
    return tuple(placed)
