"""Finishes of floors and walls: seamless textures of pictures that ship, some of each.

A texture shows a patch of given size in metres; its rows run downwards, on a wall from the top to the floor.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import seal
from simharness.world.scene.objects.materials import drawn_pictures, read_picture

FLOOR_RESOLUTION = 192  # pixels per metre
WALL_RESOLUTION = 160
FINISHES = Path(__file__).parents[3] / "assets" / "finishes"
"""Folder of the pictures of finishes that simharness ships, some of each."""


@dataclass(frozen=True)
class TiledTexture:
    """Finish of a floor or wall: a texture (h, w, 3) uint8, sRGB, of a patch with width and height ``size``, metres."""

    texture: NDArray[np.uint8]
    size: tuple[float, float]


FLOORS = (
    *("tiles", "wood", "carpet", "concrete"),
    *("carpet_tiles", "linoleum", "parquet", "sports_floor", "stage_boards", "paving", "asphalt", "grass"),
)
"""Names of floors; those of any room come first."""
WALLS = ("plain", "panels", "brick", "stripes", "tinted", "wallpaper", "tiled", "curtain")
"""Names of walls; those of any room come first."""


def finish(name: str, rng: np.random.Generator, height: float | None = None) -> TiledTexture:
    """Return a finish of floors or walls, one of its shipped pictures.

    The picture of a wall is cut off at ``height`` metres above the floor, or mirrored above its upper edge.
    """
    picture = np.asarray(read_picture(drawn_pictures(FINISHES, name, rng)[0]), float) / 255
    if height is None:
        return tiled_texture(picture, FLOOR_RESOLUTION)
    rows = max(round(height * WALL_RESOLUTION), 1)
    picture = np.pad(picture, ((max(rows - len(picture), 0), 0), (0, 0), (0, 0)), mode="symmetric")
    return tiled_texture(picture[-rows:], WALL_RESOLUTION)


def tiled_texture(picture: Floats, resolution: int) -> TiledTexture:
    """Return the texture of a picture (h, w, 3) with values from 0 to 1."""
    texture = np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    seal(texture)  # the walls of a room share it
    return TiledTexture(texture, (texture.shape[1] / resolution, texture.shape[0] / resolution))
