"""Rig to rehearse: a calibration of any format, a rig file of scenarios, or the name of a shipped rig."""

from __future__ import annotations

import json
import os
from pathlib import Path

from mvpose import Rig
from mvpose.files.message_text import one_line
from simharness.scenario.presets import RIGS, file_of, read_preset
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.toml_files import read_toml
from simharness.world.rigs.layouts import build_rig


def read_rig(
    path: str | Path, *, size: tuple[int, int] | None = None, room: tuple[float, float, float] | None = None
) -> Rig:
    """Read a rig of two or more cameras.

    Args:
        path: a calibration file or folder of any format that mvpose reads; a TOML file with the keys of the section
            ``[cameras]`` of a scenario; or the name of a shipped rig ("ring5").
        size: width and height of the pictures, pixels, for calibrations that do not state them.
        room: size x, y, z of the room, metres, for cameras in its corners.

    Raises:
        ValueError: no such file or rig, a file that cannot be read, or fewer than two cameras.
    """
    cameras = _cameras(str(path), size)
    try:
        return build_rig(cameras, room=room)
    except ValueError as error:
        message = str(error).replace("add cameras.size = [width, height], pixels", "give --size WIDTHxHEIGHT, pixels")
        raise ValueError(message if str(path) in message else f"{path}: {message}") from None


def _cameras(path: str, size: tuple[int, int] | None) -> CamerasSection:
    sized = {} if size is None else {"size": list(size)}
    if not os.path.exists(path) and not Path(path).suffix:
        settings = read_preset(RIGS, file_of(RIGS, path, [Path()]))
    elif path.endswith(".toml") and _is_rig_file(Path(path)):
        settings = read_preset(RIGS, Path(path))
    else:
        settings = {"layout": "file", "file": path} | sized
    try:
        return CamerasSection.model_validate_json(json.dumps(settings, default=str))
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {error}")) from None


def _is_rig_file(path: Path) -> bool:
    """Return whether a TOML file has the keys of a section of cameras; else it is a calibration."""
    return read_toml(path).keys() <= {*CamerasSection.model_fields, RIGS.key}
