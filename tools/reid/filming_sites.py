"""Filming sites of the re-ID data set: a room, its light, and cameras with different sensor responses.

Many groups are filmed at the same site, so walls and light do not identify people, as in a real installation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from mvpose.camera import Camera
from simharness.scenario.sections.cameras import Sensor
from simharness.scenario.sections.room import Room
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.lenses import intrinsics
from simharness.world.scene.rooms.lighting import room_lighting
from simharness.world.scene.rooms.room import make_room

SIZE = (512, 384)  # width and height of the pictures, pixels: people have a median height of about 150 pixels
SENSOR_SPREAD = Sensor(gain=0.10, white_balance=0.12, exposure=0.35)
"""Differences between cameras of one site: contrast 10 %, red and blue 12 %, exposure a third of a stop."""

_DISTANCE, _HEIGHT, _FOV = (2.6, 7.0), (0.7, 3.0), (42.0, 75.0)  # ranges of the cameras: metres, metres, degrees
_HALF = (4.0, 7.5)  # half the sides of rooms, metres
_OPEN = 0.3  # fraction of rooms without walls
_TINTED = 0.5  # fraction of rooms painted in a random colour
_WALL = 0.25  # distance from a camera to the walls, metres
_NOISE, _JPEG = (0.0, 6.0), (50, 95)


@dataclass(frozen=True)
class Site:
    """Filming site with V cameras.

    Attributes:
        seed: seed of the site and of its sensors.
        room: configuration of the room.
        meshes: floor and walls.
        lighting: light of the room.
        cameras: V cameras.
        sensors: sensors of the V cameras.
    """

    seed: int
    room: Room
    meshes: tuple[Mesh, ...]
    lighting: Lighting
    cameras: tuple[Camera, ...]
    sensors: tuple[Sensor, ...]


def make_site(seed: int, *, views: int, casts: tuple[float, float] = (1.0, 1.0)) -> Site:
    """Draw a filming site.

    Args:
        seed: seed of the site.
        views: number of cameras.
        casts: least and greatest factor on :data:`SENSOR_SPREAD`.
    """
    rng = stream(seed, "train", "site")
    x, y = rng.uniform(*_HALF, 2)
    is_open, is_tinted = rng.random(2) < (_OPEN, _TINTED)
    paint = rng.uniform(0.25, 1.0, (2, 3)).astype(np.float32)
    room = Room(size=(2 * x, 2 * y, 3.2), walls=not is_open, floor="any", wall="any", light="any")
    meshes = [_coarser(solid.mesh) for solid in make_room(room, seed)]
    if is_tinted:
        meshes = [replace(mesh, colors=mesh.colors * paint[min(m, 1)]) for m, mesh in enumerate(meshes)]
    strength = float(rng.uniform(*casts))
    return Site(
        seed=seed,
        room=room,
        meshes=tuple(meshes),
        lighting=_light(rng, room, seed),
        cameras=_cameras(rng, room, views),
        sensors=tuple(_sensor(stream(seed, "train", "sensor", view), strength) for view in range(views)),
    )


def _coarser(mesh: Mesh) -> Mesh:
    """Halve the resolution of a mesh's texture: invisible in small pictures, and four times as fast to make."""
    if mesh.texture is None:
        return mesh
    height, width = mesh.texture.shape[:2]
    small = cv2.resize(mesh.texture, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    return replace(mesh, texture=small.astype(np.uint8, copy=False))


def _light(rng: np.random.Generator, room: Room, seed: int) -> Lighting:
    """Draw the light of a room with random brightness."""
    light = room_lighting(room, seed)
    key, sky, fill = (np.exp(rng.normal(0.0, 0.15, 3)) * (light.key, light.sky, light.fill)).tolist()
    return replace(light, key=key, sky=sky, fill=fill)


def _cameras(rng: np.random.Generator, room: Room, views: int) -> tuple[Camera, ...]:
    """Draw cameras in independent directions around the centre, within the walls."""
    bearing = rng.uniform(-np.pi, np.pi, views)
    distance, height, fov = (rng.uniform(*span, views) for span in (_DISTANCE, _HEIGHT, _FOV))
    aim = np.column_stack([rng.normal(0.0, 0.25, (views, 2)), rng.uniform(0.6, 1.1, views)])
    half = np.array(room.size[:2]) / 2 - _WALL
    across = np.column_stack([np.cos(bearing), np.sin(bearing)])
    distance = np.minimum(distance, (half / np.maximum(np.abs(across), 1e-9)).min(axis=1))
    eye = np.column_stack([across * distance[:, None], height])
    return tuple(
        look_at(eye[v], aim[v], K=intrinsics(float(fov[v]), SIZE), size=SIZE, name=f"{v}") for v in range(views)
    )


def _sensor(rng: np.random.Generator, strength: float) -> Sensor:
    """Draw a sensor with random noise and JPEG quality and ``strength`` times :data:`SENSOR_SPREAD`."""
    return Sensor(
        gain=strength * SENSOR_SPREAD.gain,
        white_balance=strength * SENSOR_SPREAD.white_balance,
        exposure=strength * SENSOR_SPREAD.exposure,
        noise=float(rng.uniform(*_NOISE)),
        jpeg=int(rng.integers(_JPEG[0], _JPEG[1] + 1)),
    )
