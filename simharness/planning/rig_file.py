"""Rig files: a rig to rehearse is read from any calibration, rig file or name; a planned rig is written.

A rig file has the keys of the section ``[cameras]`` of a scenario, which takes it with ``rig = "planned.toml"``.
"""

import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mvpose import Rig
from mvpose.camera import Camera
from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line
from mvpose.formats.calibration.pose2sim import write_calibration
from simharness.planning.planned_room import Room
from simharness.scenario.layers import RIGS
from simharness.scenario.presets import file_of, read_preset
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.toml_files import read_toml, toml
from simharness.world.rigs.layouts import build_rig, look_at

CALIBRATION = "planned_cameras.toml"
"""File of the calibration beside a rig file whose cameras have different lenses."""

_SAME = 1e-6


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


def write_rig(rig: Rig, room: Room, path: Path, *, comments: Sequence[str] = ()) -> None:
    """Write a rig file that scenarios and ``simharness rehearse`` read.

    Cameras of one lens are written as positions and aims; of different lenses as a calibration beside the file, in
    the format of Pose2Sim.

    Args:
        rig: the cameras, which are upright.
        room: the room that they were planned for.
        path: the TOML file.
        comments: lines at its top.
    """
    head = [f"# {each}" for each in (f"Planned rig of {room.name}.", *comments)]
    first = rig[0]
    if all(_same_lens(first, each) for each in rig) and all(_upright(each) for each in rig):
        keys = {
            "layout": "free",
            "positions": [np.round(each.center, 4).tolist() for each in rig],
            "aims": [np.round(each.center + 3.0 * each.R[2], 4).tolist() for each in rig],
            "fov": float(np.degrees(2 * np.arctan(first.size[0] / (2 * first.K[0, 0])))),
            "size": list(first.size),
            "distortion": first.distortion.tolist(),
        }
    else:
        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder, CALIBRATION)
            write_calibration(written, rig)
            write_atomic(path.parent / CALIBRATION, read_bytes(written, what="the calibration"))
        keys = {"layout": "file", "file": CALIBRATION}
    lines = head + [f"{key} = {toml(value)}" for key, value in keys.items()]
    write_atomic(path, ("\n".join(lines) + "\n").encode())


def _cameras(path: str, size: tuple[int, int] | None) -> CamerasSection:
    sized = {} if size is None else {"size": list(size)}
    if not os.path.exists(path) and not Path(path).suffix:
        settings = read_preset(RIGS, file_of(RIGS, path, [Path()]))
    elif path.endswith(".toml") and read_toml(Path(path)).keys() <= {*CamerasSection.model_fields, RIGS.key}:
        settings = read_preset(RIGS, Path(path))
    else:
        settings = {"layout": "file", "file": path} | sized
    try:
        return CamerasSection.model_validate_json(json.dumps(settings, default=str))
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {error}")) from None


def _same_lens(one: Camera, other: Camera) -> bool:
    return (
        one.size == other.size
        and bool(np.abs(one.K - other.K).max() < _SAME)
        and bool(np.abs(one.distortion - other.distortion).max() < _SAME)
        and abs(one.K[0, 0] - one.K[1, 1]) < _SAME
    )


def _upright(camera: Camera) -> bool:
    """Return whether a camera is as :func:`look_at` makes it, with its axis in the middle of the picture."""
    same = look_at(camera.center, camera.center + camera.R[2], K=camera.K, size=camera.size)
    middle = (np.array(camera.size) - 1) / 2
    return bool(np.abs(same.R - camera.R).max() < _SAME and np.abs(camera.K[:2, 2] - middle).max() < _SAME)
