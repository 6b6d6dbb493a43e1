"""Filming sites of the re-ID data set: a room, its light, and cameras with different sensor responses.

Many groups are filmed at the same site, so walls and light do not identify people, as in a real installation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mvpose.camera import Camera
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.projection import intrinsics
from simharness.world.scene.objects.geoms import Box
from tools.reid.site_rooms import draw_room, furnish
from tools.reid.site_sensors import draw_profile, draw_sensor

SIZE = (512, 384)  # width and height of the pictures, pixels: people have a median height of about 150 pixels

_DISTANCE, _HEIGHT, _FOV = (2.6, 7.0), (0.7, 3.0), (42.0, 75.0)  # ranges of the cameras: metres, metres, degrees
_WALL, _CEILING = 0.25, 0.15  # distances from a camera to walls and ceiling, metres


@dataclass(frozen=True)
class Site:
    """Filming site with V cameras.

    Attributes:
        seed: seed of the site and of its sensors.
        room: configuration of the room.
        meshes: meshes of the room and its furniture.
        furniture: bounding boxes of the furniture.
        lighting: light of the room.
        cameras: V cameras.
        profile: sensor profile around which the sensors are drawn.
        sensors: sensors of the V cameras.
    """

    seed: int
    room: RoomSection
    meshes: tuple[Mesh, ...]
    furniture: tuple[Box, ...]
    lighting: Lighting
    cameras: tuple[Camera, ...]
    profile: str
    sensors: tuple[SensorSection, ...]


@lru_cache(maxsize=2)  # renderers keep the light of the same meshes
def make_site(seed: int, *, views: int, casts: tuple[float, float] = (1.0, 1.0)) -> Site:
    """Draw a filming site; the last ones are kept.

    Args:
        seed: seed of the site.
        views: number of cameras, at least two.
        casts: least and greatest factor on :data:`tools.reid.site_sensors.SENSOR_SPREAD`.
    """
    rng = stream(seed, "train", "site")
    room = draw_room(rng)
    strength, profile = float(rng.uniform(*casts)), draw_profile(rng)
    cameras = _cameras(rng, room, views)
    furnished = furnish(rng, room, seed, cameras)
    return Site(
        seed=seed,
        room=furnished.room,
        meshes=furnished.meshes,
        furniture=furnished.furniture,
        lighting=furnished.lighting,
        cameras=cameras,
        profile=profile,
        sensors=tuple(draw_sensor(stream(seed, "train", "sensor", view), profile, strength) for view in range(views)),
    )


def _cameras(rng: np.random.Generator, room: RoomSection, views: int) -> tuple[Camera, ...]:
    """Draw cameras in independent directions around the centre, within the walls and below the ceiling."""
    bearing = rng.uniform(-np.pi, np.pi, views)
    distance, height, fov = (rng.uniform(*span, views) for span in (_DISTANCE, _HEIGHT, _FOV))
    aim = np.column_stack([rng.normal(0.0, 0.25, (views, 2)), rng.uniform(0.6, 1.1, views)])
    half = np.array(room.size[:2]) / 2 - _WALL
    across = np.column_stack([np.cos(bearing), np.sin(bearing)])
    distance = np.minimum(distance, (half / np.maximum(np.abs(across), 1e-9)).min(axis=1))
    eye = np.column_stack([across * distance[:, None], np.minimum(height, room.size[2] - _CEILING)])
    return tuple(
        look_at(eye[v], aim[v], K=intrinsics(float(fov[v]), SIZE), size=SIZE, name=f"{v}") for v in range(views)
    )
