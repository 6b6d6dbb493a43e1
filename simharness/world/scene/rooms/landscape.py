"""Landscape outdoors: what lies around an open floor, as meshes, and the panorama behind it.

The surroundings, ground up to the horizon of the panorama and trees, are for pictures alone and hide nothing: the
ground is below all that people and cameras do, and everything else stands outside a circle around the floor and all
cameras, so that no line from a camera to a person leaves the circle.

The panorama is a picture of the sky with its clouds, and of hills, woods, houses and trees on the horizon, as seen from
two metres above the ground; its land is far enough away to look the same from all cameras.
"""

from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import Panorama, Vector
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box, carried
from simharness.world.scene.objects.materials import draw_sheet, drawn_pictures, read_picture
from simharness.world.scene.objects.object_files import draw_variant
from simharness.world.scene.objects.shapes import outline, ring_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.tiled_textures import FINISHES

WHITE = 2.5
"""Radiance that white in the picture stands for."""
LOWEST = float(np.radians(-40.0))
"""Elevation of the lower edge, radians."""
PANORAMAS = Path(__file__).parents[3] / "assets" / "panoramas"
"""Folder of the pictures of panoramas that simharness ships, some of each weather, all with the sun towards +x."""


@lru_cache(maxsize=2)
def panorama(seed: int, weather: str, bearing: float, shown: Vector = (1.0, 1.0, 1.0)) -> Panorama:
    """Return the panorama of a scenario; it is read when a picture first shows it, and the last ones are kept.

    Args:
        seed: seed of the scenario.
        weather: name of the weather.
        bearing: bearing of the sun from +x, radians.
        shown: factor of its radiance.
    """
    r, g, b = shown
    return Panorama(partial(read_panorama, seed, weather, bearing), (WHITE * r, WHITE * g, WHITE * b), LOWEST)


def read_panorama(seed: int, weather: str, bearing: float) -> NDArray[np.uint8]:
    """Return a shipped picture of a weather, with the sun in its bearing: see :func:`panorama`."""
    (file,) = drawn_pictures(PANORAMAS, weather, stream(seed, "room", "landscape"))
    picture = read_picture(file)
    return np.roll(picture, round(bearing / (2 * np.pi) * picture.shape[1]), axis=1)


AROUND = 4.0
"""Metres of ground around an open floor, before the meadow begins."""
_FAR = 60.0  # metres from the middle: least radius of the meadow
_BEYOND_CAMERAS = 40.0  # metres of meadow behind the farthest camera, at least
_CLEAR = 3.0  # metres between the circle around floor and cameras, and trees and shrubs with their crowns
_RINGS, _PER_SIDE = 22, 22  # cells of the meadow outwards, and along each side
_PATCH = 30.0  # metres: side of the texture of the meadow
_TREES, _SHRUBS = (9, 16), (8, 14)
_TREE_SCALE, _SHRUB_SCALE = (0.75, 1.5), (0.6, 1.3)  # of trees of 6 m and shrubs of about 1 m


def make_surroundings(room: RoomSection, seed: int, rig: Rig) -> tuple[Solid, ...]:
    """Return the surroundings of an open floor outdoors, for pictures alone.

    Args:
        room: room of the kind "outdoors".
        seed: seed of the scenario.
        rig: true cameras.
    """
    half = np.array(room.size[:2]) / 2 + AROUND
    cameras = float(np.hypot(*rig.centers[:, :2].T).max(initial=0.0))
    meadow = _meadow(stream(seed, "room", "meadow"), half, max(_FAR, cameras + _BEYOND_CAMERAS))
    plants = _plants(seed, max(float(np.hypot(*half)), cameras) + _CLEAR)
    return tuple(
        Solid("room", name, mesh, (), Box.around(mesh.vertices))
        for name, mesh in (("meadow", meadow), ("far plants", plants))
    )


def _meadow(rng: np.random.Generator, half: Floats, radius: float) -> Mesh:
    """Return a ring of ground between a rectangle and a circle."""
    inner = outline(half, _PER_SIDE)
    outer = radius * inner / np.linalg.norm(inner, axis=1, keepdims=True)
    steps = (np.arange(_RINGS + 1) / _RINGS)[:, None, None] ** 1.8
    rings = inner + steps * (outer - inner)
    mesh = ring_mesh(rings, np.ones((_RINGS * len(inner), 3)))
    uv = (rings.reshape(-1, 3)[:, :2] / _PATCH)[mesh.faces].astype(np.float32)
    return replace(mesh, smooth=True, texture=read_picture(drawn_pictures(FINISHES, "meadow", rng)[0]), uv=uv)


def _plants(seed: int, clear: float) -> Mesh:
    """Return trees and shrubs outside a circle around the origin."""
    sheet, rng = draw_sheet(seed), stream(seed, "room", "far plants")
    trees, shrubs = (int(rng.integers(low, high + 1)) for low, high in (_TREES, _SHRUBS))
    plants = [(stream(seed, "room", "far tree", k), "far_tree", _TREE_SCALE, 24.0, 3.0) for k in range(trees)]
    plants += [(stream(seed, "room", "far shrub", k), "far_shrub", _SHRUB_SCALE, 18.0, 1.5) for k in range(shrubs)]
    meshes = []
    for rng, name, scales, reach, crown in plants:
        mesh = draw_variant(rng, name).mesh(sheet)
        scale, far, turn, yaw = rng.uniform(*scales), rng.uniform() ** 1.3 * reach, *rng.uniform(0, 2 * np.pi, 2)
        away = clear + scale * crown + far
        place = (away * np.cos(turn), away * np.sin(turn))
        meshes.append(mesh.moved(carried(scale * mesh.vertices, place, yaw)))
    return sheet.joined(meshes)
