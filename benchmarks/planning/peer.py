"""Rig that ``lab-camera-optimizer`` 1.2.1 (MIT) plans for a room, from its program run without a display.

It gets the same room, obstacles, volume, lens, number of cameras, and the same places: its cameras hang on the walls of
a room that is smaller by the clearance of ours. It needs the extra ``bench``, or ``--peer PROGRAM``.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from simharness.planning.candidates import Candidate, candidate
from simharness.planning.planned_room import Room

PROGRAM = "lab-camera-optimizer"

_HEIGHTS = 4  # heights that it may choose from, as it takes a list
_PERSON = 1.8  # metres
_ATTEMPT = re.compile(r"- Attempt +\d+: Score= *([\d.]+)")
_CAMERA = re.compile(
    r"A ?\d+ \[([LP])\]\[[SN]\] +\((-?[\d.]+)m, ?(-?[\d.]+)m\) h=([\d.]+)m +angle=(-?\d+)deg .*tilt=([\d.]+)deg"
)


def settings_of(room: Room, count: int) -> dict[str, Any]:
    """Return the settings of the program for a room; they are those of its own example where the room gives none."""
    keys, lens = room.keys, room.lenses[0]
    walls = keys.places.walls
    assert walls is not None
    clearance = walls.clearance
    low, high = walls.heights
    wide, tall = lens.fov
    corner = room.volume.bounds[0]
    return {
        "room": {"corners": _shrunk(room.space.outline, clearance).round(4).tolist(), "height": room.space.height},
        "obstacles": [
            {
                "type": "rect",
                "bounds": [
                    *(np.array(each.center) - np.array(each.size[:2]) / 2).tolist(),
                    *(np.array(each.center) + np.array(each.size[:2]) / 2).tolist(),
                ],
                "height": each.size[2],
                "label": each.name,
                "can_mount_camera": False,
            }
            for each in keys.obstacles
        ],
        "subject": {"height": _PERSON, "foot_z": 0.0},
        "camera_sets": [
            {
                "id": "cam_A",
                "name": "camera",
                "mounting": "wall",
                "optional": False,
                "fov_h_landscape": wide,
                "fov_v_landscape": tall,
                "fov_h_portrait": tall,
                "fov_v_portrait": wide,
                "max_range": 20.0,
                "min_range": 0.3,
                "height_options": np.linspace(low, high, _HEIGHTS).round(2).tolist(),
                "max_count": count,
                "min_spacing": keys.cameras.spacing,
            }
        ],
        "capture_zones": [
            {
                "id": "volume",
                "type": "polygon",
                "priority": 1.0,
                "grid_step": 0.25,
                "vertices": (room.volume.outline - corner).tolist(),
                "placement": {"x_offsets": [float(corner[0])], "y_offsets": [float(corner[1])]},
            }
        ],
        "optimization": {
            "target_coverage": 3,
            "bilateral_weight": 0.0,
            "vertical_coverage_threshold": 0.9,
            "restarts_per_combo": 10,
            "wall_step": 0.4,
            "angle_steps": 20,
            "distance_quality_factor": 0.01,
            "graph_mode": "best_per_combo",
            "algo": "greedy_1opt",
        },
    }


def _shrunk(outline: np.ndarray, clearance: float) -> np.ndarray:
    """Return a counter-clockwise polygon (n, 2) whose sides are moved inwards by ``clearance`` metres."""
    along = np.roll(outline, -1, axis=0) - outline
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    inward = np.column_stack([-along[:, 1], along[:, 0]])
    return outline + clearance * (inward + np.roll(inward, 1, axis=0))  # sides are perpendicular


def peer_rig(room: Room, count: int, *, program: str, folder: Path, timeout: float = 900.0) -> list[Candidate]:
    """Return the cameras that the program places.

    Args:
        room: a room whose sides are perpendicular, with places on walls alone.
        count: number of cameras.
        program: its path.
        folder: folder for its settings.
        timeout: seconds after which it is stopped.

    Raises:
        RuntimeError: it failed, or its output has no result.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{room.name}.yaml"
    path.write_text(yaml.safe_dump(settings_of(room, count)), encoding="utf-8")
    done = subprocess.run(
        [program, "--config", str(path), "--no-preview"],
        capture_output=True, text=True, timeout=timeout, check=False,
        env={"MPLBACKEND": "Agg", "PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    best = read_result(done.stdout)
    if done.returncode or not best:
        raise RuntimeError(f"{program} gave no result for {room.name}: {done.stderr[-300:]}")
    return [_camera(room, each) for each in best]


def read_result(output: str) -> list[tuple[str, float, float, float, float, float]]:
    """Return orientation, x, y, height, bearing and downward tilt (degrees) of the cameras of its best attempt."""
    best, score, current = [], -1.0, -1.0
    attempts: dict[float, list[tuple[str, float, float, float, float, float]]] = {}
    for line in output.splitlines():
        if found := _ATTEMPT.search(line):
            current = float(found[1])
            attempts[current] = []
        elif current >= 0 and (camera := _CAMERA.search(line)):
            turn, *numbers = camera.groups()
            x, y, z, bearing, tilt = map(float, numbers)
            attempts[current].append((turn, x, y, z, bearing, tilt))
    for each, cameras in attempts.items():
        if each > score:
            best, score = cameras, each
    return best


def _camera(room: Room, result: tuple[str, float, float, float, float, float]) -> Candidate:
    turn, x, y, z, bearing, tilt = result
    lens = next(k for k, each in enumerate(room.lenses) if each.turned == (turn == "P"))
    place = np.array([x, y, z])
    down, angle = np.radians(tilt), np.radians(bearing)
    aim = place + [np.cos(down) * np.cos(angle), np.cos(down) * np.sin(angle), -np.sin(down)]
    mount = int(np.argmin([np.linalg.norm(each.at(each.nearest(place)) - place) for each in room.mounts]))
    return candidate(mount, lens, place, aim)
