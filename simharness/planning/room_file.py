"""Reader of room files (TOML): keys (:mod:`.room_keys`) to a checked room."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.files.message_text import all_in_one_line, listed, one_line, prefixed
from simharness.planning.planned_room import LEAST_AREA, LensChoice, Room, make_mounts
from simharness.planning.room_keys import LensKeys, ObstacleKeys, Outline, RoomKeys
from simharness.scenario.layers import Origins, merge, nested, set_origin
from simharness.scenario.presets import read_profile
from simharness.scenario.shipped import shipped_folder
from simharness.scenario.toml_files import read_toml
from simharness.scenario.validation_messages import explain_all
from simharness.types.floor import Volume, simple_outline
from simharness.world.rigs.projection import check_lens, intrinsics
from simharness.world.scene.objects.geoms import Box

_DEFAULT_MARGIN = 0.5  # metres from the walls to a volume that the file does not give
_DEFAULT_FOV = 75.0  # degrees
_AT_WALL = 0.3  # metres: largest distance of a door from the walls


def find_room(path: str | Path) -> Path:
    """Return the file of a room: a TOML file, or a shipped room by its name.

    Raises:
        ValueError: no such room.
    """
    given = Path(path)
    shipped = shipped_folder() / "rooms"
    if given.suffix == ".toml" or given.is_file():
        return given
    names = sorted(file.stem for file in shipped.glob("*.toml"))
    if str(path) in names:
        return shipped / f"{path}.toml"
    raise ValueError(f"{path}: no such room; expected a TOML file, or the name of a shipped room: {listed(names)}")


def read_room(path: str | Path, *, changes: Mapping[tuple[str, ...], Any] | None = None) -> Room:
    """Read a room file.

    Args:
        path: TOML file, or name of a shipped room.
        changes: values that replace those of the file, by key: ``{("people", "count"): 6}``.

    Raises:
        ValueError: the file does not exist or is not TOML, a key does not exist or has a wrong value, or the room is
            impossible; the message names the file and the key.
    """
    file = find_room(path)
    settings = read_toml(file)
    origins: Origins = {}
    for key, value in (changes or {}).items():
        settings = merge(settings, nested(key, value))
        set_origin(origins, key, f"--{key[-1] if key[-1] != 'count' else key[0]}")
    try:
        keys = RoomKeys.model_validate_json(json.dumps(settings, default=str), strict=True)
    except ValidationError as error:
        lines = explain_all(error, origins, str(file), root=RoomKeys)
        raise ValueError(all_in_one_line(list(dict.fromkeys(lines)))) from None
    try:
        return make_room(keys, name=keys.name or file.stem, file=str(file), folder=file.parent)
    except ValueError as error:
        raise ValueError(one_line(f"{file}: {error}")) from None


def make_room(keys: RoomKeys, *, name: str = "", file: str = "", folder: Path | None = None) -> Room:
    """Return the room of checked keys.

    Args:
        keys: keys of a room file.
        name: name of the room.
        file: file for messages.
        folder: folder in which a detector profile is looked for first.

    Raises:
        ValueError: an impossible room; the message names the key.
    """
    space = _space(keys)
    lenses = tuple(_lens(each, k) for k, each in enumerate(keys.lenses))
    turned = tuple(_turned(lens) for lens, key in zip(lenses, keys.lenses, strict=True) if key.turned)
    room = Room(
        name=name or keys.name or "room",
        keys=keys,
        space=space,
        volume=_people_volume(keys, space),
        mounts=make_mounts(keys.places, space),
        obstacles=tuple(_box(each) for each in keys.obstacles),
        doors=_doors(keys, space),
        lenses=lenses + turned,
        fixed=(),
        detector=read_profile(keys.detector, folder=folder),
        file=file,
    )
    return replace(room, fixed=tuple(_fixed(room, k) for k in range(len(keys.fixed))))


def _space(keys: RoomKeys) -> Volume:
    shape = keys.room
    if shape.size is not None and shape.outline:
        raise ValueError("room.size and room.outline are both given: keep one of them")
    if shape.size is None and not shape.outline:
        raise ValueError("room.size is missing: give room.size = [x, y, z], or room.outline and room.height")
    if shape.size is not None:
        x, y, height = shape.size
        return Volume.box(x, y, height=height)
    return _volume(shape.outline, shape.height, "room.outline")


def _volume(outline: Outline, height: float, key: str) -> Volume:
    return Volume(simple_outline(outline, what=key, smallest=LEAST_AREA), height)


def _people_volume(keys: RoomKeys, space: Volume) -> Volume:
    given = keys.volume
    if given.size is not None and given.outline:
        raise ValueError("volume.size and volume.outline are both given: keep one of them")
    if given.height > space.height:
        raise ValueError(
            f"volume.height = {given.height:g} m is above the ceiling at {space.height:g} m: use a lower volume"
        )
    if given.size is not None:
        volume = Volume.box(*given.size, height=given.height, center=given.center)
    elif given.outline:
        volume = _volume(given.outline, given.height, "volume.outline")
    else:
        x, y = (space.size - 2 * _DEFAULT_MARGIN).tolist()
        if not space.convex or len(space.outline) != 4 or min(x, y) <= 0:
            raise ValueError("volume is missing: give volume.size and volume.center, or volume.outline")
        middle_x, middle_y = space.middle.tolist()
        volume = Volume.box(x, y, height=given.height, center=(middle_x, middle_y))
    if (outside := space.beyond(volume)) is not None:
        raise ValueError(
            f"volume reaches beyond the walls of the room at ({outside[0]:g}, {outside[1]:g}): use a smaller "
            "volume.size, another volume.center, or another volume.outline"
        )
    return volume


def _box(keys: ObstacleKeys) -> Box:
    x, y, z = keys.size
    return Box((*keys.center, keys.base + z / 2), (x / 2, y / 2, z / 2), float(np.radians(keys.yaw)))


def _lens(keys: LensKeys, index: int) -> LensChoice:
    key = f"lenses[{index}]"
    if keys.fov is not None and keys.focal is not None:
        raise ValueError(f"{key}.fov and {key}.focal are both given: keep one of them")
    if (keys.focal is None) != (keys.sensor is None):
        missing, given = ("focal", "sensor") if keys.focal is None else ("sensor", "focal")
        raise ValueError(f"{key}.{missing} is missing: {key}.{given} needs it; both are in millimetres")
    if keys.focal is not None and keys.sensor is not None:
        fov = float(np.degrees(2 * np.arctan(keys.sensor / (2 * keys.focal))))
    else:
        fov = keys.fov or _DEFAULT_FOV
    lens = LensChoice(keys.name, intrinsics(fov, keys.size), keys.size, np.array(keys.distortion), keys.cost)
    check_lens(lens.camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), name=keys.name))
    return lens


def _turned(lens: LensChoice) -> LensChoice:
    """Return the lens of the camera turned by 90 degrees, whose pictures are turned back."""
    width, height = lens.size
    K = np.array([[lens.K[0, 0], 0.0, (height - 1) / 2], [0.0, lens.K[1, 1], (width - 1) / 2], [0.0, 0.0, 1.0]])
    k1, k2, p1, p2, k3 = lens.distortion
    return replace(lens, K=K, size=(height, width), distortion=np.array([k1, k2, -p2, p1, k3]), turned=True)


def _doors(keys: RoomKeys, space: Volume) -> Floats:
    doors = np.array([[each.start, each.end] for each in keys.doors], float).reshape(-1, 2, 2)
    for k, ends in enumerate(doors):
        away = float(space.distance_to_sides(ends).max())
        if away > _AT_WALL:
            raise ValueError(
                f"doors[{k}] is {away:.2f} m away from the walls: a door is within a wall, give its two sides"
            )
    return doors


def _fixed(room: Room, index: int) -> Camera:
    given = room.keys.fixed[index]
    key, names = f"fixed[{index}]", [lens.name for lens in room.lenses]
    if given.lens and given.lens not in names:
        raise ValueError(f"{key}.lens = {given.lens!r}: no such lens; expected one of {listed(names)}")
    lens = names.index(given.lens) if given.lens else 0
    place = np.array(given.position)
    where = f"{key} at ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m"
    if not room.space.contains(place[:2]) or not 0.0 < place[2] <= room.space.height:
        raise ValueError(f"{where} is inside a wall or outside the room: give a position within the room")
    for k, box in enumerate(room.obstacles):
        if box.distance(place) == 0.0:
            raise ValueError(f"{where} is inside obstacles[{k}] {room.keys.obstacles[k].name}: move one of them")
    name = given.name or f"fixed{index}"
    with prefixed(f"{key}.aim"):
        return room.lenses[lens].camera(place, given.aim, name=name)
