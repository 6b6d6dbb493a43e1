"""Reader of room files (TOML); their keys are in :mod:`.room_keys`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mvpose.files.message_text import all_in_one_line, listed, one_line
from simharness.planning.planned_room import Room, make_room
from simharness.planning.room_keys import RoomKeys
from simharness.scenario.layers import Origins, merge, nested, set_origin
from simharness.scenario.shipped import shipped_folder
from simharness.scenario.toml_files import read_toml
from simharness.scenario.validation_messages import explain_all


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
