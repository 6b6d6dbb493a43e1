"""Random rooms: box or L-shaped, with pillars, cupboards and partitions around and in a volume."""

from __future__ import annotations

from typing import Any

import numpy as np

from simharness.planning.planned_room import Room
from simharness.planning.room_file import make_room
from simharness.planning.room_keys import RoomKeys
from simharness.types.floor import Floor, Volume
from simharness.types.random_streams import stream

LENS_SIZES = ((1280, 960), (1280, 800), (1920, 1080))
_KINDS = {"pillar": (0.4, 0.4), "cupboard": (1.2, 0.5), "partition": (1.6, 0.1)}  # metres on the floor
_TRIES = 200


def draw_room(seed: int) -> Room:
    """Return a random room; its number of cameras, 4 to 8, is in its keys."""
    rng = stream(seed, "benchmark", "room")
    size = rng.uniform([6.0, 5.5], [11.0, 9.0]).round(1)
    height = round(float(rng.uniform(2.6, 3.4)), 1)
    outline = Volume.box(size[0], size[1]).outline
    if rng.random() < 0.3:  # an L: one corner is cut away
        x, y = (size / 2).tolist()
        cut = rng.uniform(0.2, 0.35, 2) * size
        outline = np.array([[-x, -y], [x, -y], [x, y - cut[1]], [x - cut[0], y - cut[1]], [x - cut[0], y], [-x, y]])
    volume_size, center = _volume(rng, outline, size)
    lens: dict[str, Any] = {
        "name": "camera",
        "size": LENS_SIZES[rng.integers(len(LENS_SIZES))],
        "fov": round(float(rng.uniform(42.0, 62.0))),
        "turned": True,
    }
    keys = {
        "name": f"room{seed}",
        "room": {"outline": [tuple(corner) for corner in outline.tolist()], "height": height},
        "volume": {"size": volume_size, "center": center},
        "places": {"walls": {"heights": (1.0, min(2.8, round(height - 0.2, 1)))}},
        "obstacles": _obstacles(rng, outline, np.array(volume_size), np.array(center), height),
        "lenses": [lens],
        "cameras": {"count": int(rng.integers(4, 9)), "from_people": 0.0},
        "people": {"count": int(rng.integers(4, 9))},
        "detector": "typical",
        "objective": {"kind": "mean"},
    }
    return make_room(RoomKeys.model_validate(keys))


def _volume(
    rng: np.random.Generator, outline: np.ndarray, size: np.ndarray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return size and centre of a volume at least 0.5 m from the walls."""
    for _ in range(_TRIES):
        extent = rng.uniform(0.65, 0.88, 2) * size
        center = rng.uniform(-0.5, 0.5, 2) * (size - extent - 1.0)
        grown = Volume.box(extent[0] + 1.0, extent[1] + 1.0, center=(center[0], center[1])).outline
        sides = np.linspace(grown, np.roll(grown, -1, axis=0), 9).reshape(-1, 2)
        if (extent >= 2.8).all() and Floor(1.0001 * outline).contains(sides).all():
            break
    else:
        extent = np.array([2.6, 2.6])  # in the corner from which nothing is cut
        center = outline.min(axis=0) + 0.5 + extent / 2
    x, y = extent.round(2).tolist()
    u, v = center.round(2).tolist()
    return (x, y), (u, v)


def _obstacles(
    rng: np.random.Generator, outline: np.ndarray, volume: np.ndarray, center: np.ndarray, height: float
) -> list[dict[str, Any]]:
    """Return two to five boxes between the volume and the walls, apart from each other."""
    found: list[dict[str, Any]] = []
    wanted = int(rng.integers(2, 6))
    low, high = outline.min(axis=0), outline.max(axis=0)
    for _ in range(_TRIES):
        if len(found) == wanted:
            break
        kind = list(_KINDS)[rng.integers(len(_KINDS))]
        extent = np.array(_KINDS[kind])[:: 1 if rng.random() < 0.5 else -1]
        place = rng.uniform(low + extent / 2, high - extent / 2)
        corners = Volume.box(extent[0], extent[1], center=(place[0], place[1])).outline
        clear = (np.abs(place - center) - volume / 2 - extent / 2).max() > 0.05
        apart = all(
            (np.abs(place - each["center"]) - extent / 2 - np.array(each["size"][:2]) / 2).max() > 0.3 for each in found
        )
        if clear and apart and Floor(outline).contains(corners).all():
            top = height if kind == "pillar" else round(float(rng.uniform(1.5, 2.1)), 1)
            u, v = place.round(2).tolist()
            found.append({"name": kind, "center": (u, v), "size": (float(extent[0]), float(extent[1]), top)})
    return found
