"""Sheet of materials and prints: one texture that all textured objects of a scene share.

A renderer prepares every texture once, so objects with many materials stay cheap if they share one picture. Materials
(wood, fabric, metal) are nearly white and are multiplied by the colours of the faces; prints (screens, posters, papers)
bring their colours with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import seal
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.prints import PRINTS
from simharness.world.scene.rooms.noise import smooth_noise

Material = Literal["plain", "wood", "fabric", "metal", "leaves"]

RESOLUTION = 320  # pixels per metre of a material
_BORDER = 6  # pixels around each patch, so that mipmaps do not mix neighbours
_GOLDEN = (5**0.5 - 1) / 2
_WIDTH = 1024  # pixels: least width of the sheet


@dataclass(frozen=True)
class Patch:
    """Rectangle of the sheet: left, top, width and height in pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Sheet:
    """Sheet of materials and prints.

    Attributes:
        texture: picture, sRGB, (h, w, 3) uint8.
        patches: place of each material and print.
    """

    texture: NDArray[np.uint8]
    patches: Mapping[str, Patch]

    def uv(self, name: str, points: Floats) -> NDArray[np.float32]:
        """Return texture coordinates of points (..., 2) of a patch, 0 to 1 to the right and down."""
        patch, (height, width) = self.patches[name], self.texture.shape[:2]
        place = np.array([patch.left, patch.top]) + np.asarray(points) * [patch.width, patch.height]
        return np.asarray(place / [width, height], np.float32)

    def extent(self, name: str) -> Floats:
        """Return width and height of a material, (2,), metres."""
        patch = self.patches[name]
        return np.array([patch.width, patch.height]) / RESOLUTION

    def projected(self, mesh: Mesh, material: str, number: int) -> NDArray[np.float32]:
        """Return the texture coordinates of a material on a mesh, (k, 3, 2).

        The material is projected along the main axes of the mesh, with the grain along its longest extent.

        Args:
            mesh: the mesh.
            material: name of the material.
            number: number of the mesh among those of an object, which decides where on the material it begins.
        """
        corners = mesh.vertices[mesh.faces].astype(float)
        low = mesh.vertices.min(axis=0)
        extent = mesh.vertices.max(axis=0) - low
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        main = np.abs(normal).argmax(axis=1)
        across = np.array([[b, c] if extent[b] >= extent[c] else [c, b] for b, c in ((1, 2), (0, 2), (0, 1))])[main]
        place = np.take_along_axis(corners - low, np.repeat(across[:, None], 3, axis=1), axis=2)
        patch = self.extent(material)
        scale = np.minimum(1.0, 0.98 * patch / np.maximum(extent[across], 1e-6))
        place = place * scale[:, None] / patch
        spare = 1.0 - place.reshape(-1, 2).max(axis=0)
        start = spare * [(number * _GOLDEN) % 1.0, (number * _GOLDEN**2) % 1.0]
        return self.uv(material, place + start)

    @classmethod
    def pack(cls, pictures: Mapping[str, Floats]) -> Sheet:
        """Return the sheet of pictures (h, w, 3) with values from 0 to 1.

        They are packed on shelves, the highest ones first, each with a border that repeats its edge.
        """
        wide = max(_WIDTH, *(picture.shape[1] + 2 * _BORDER for picture in pictures.values()))
        patches: dict[str, Patch] = {}
        left = top = shelf = 0
        for name in sorted(pictures, key=lambda n: (-len(pictures[n]), n)):
            height, width = pictures[name].shape[:2]
            if left + width + 2 * _BORDER > wide:
                left, top, shelf = 0, top + shelf, 0
            patches[name] = Patch(left + _BORDER, top + _BORDER, width, height)
            left, shelf = left + width + 2 * _BORDER, max(shelf, height + 2 * _BORDER)
        texture = np.full((top + shelf, wide, 3), 255, np.uint8)
        for name, patch in patches.items():
            bordered = np.pad(pictures[name], ((_BORDER,) * 2, (_BORDER,) * 2, (0, 0)), mode="edge")
            rows = slice(patch.top - _BORDER, patch.top + patch.height + _BORDER)
            columns = slice(patch.left - _BORDER, patch.left + patch.width + _BORDER)
            texture[rows, columns] = np.round(255 * np.clip(bordered, 0, 1))
        seal(texture)  # all meshes share it: renderers pack it once
        return cls(texture, MappingProxyType(patches))


@lru_cache(maxsize=2)
def draw_sheet(seed: int) -> Sheet:
    """Draw the sheet of a scene; every patch is drawn by its own stream, so one more changes no other."""
    pictures = {name: draw(stream(seed, "room", "sheet", name)) for name, draw in {**_MATERIALS, **PRINTS}.items()}
    return Sheet.pack(pictures)


def _plain(rng: np.random.Generator) -> Floats:
    shape = (128, 128)
    return _grey(0.985 + 0.008 * smooth_noise(rng, shape, 16) + 0.004 * rng.uniform(-1, 1, shape))


def _wood(rng: np.random.Generator) -> Floats:
    """Draw planed wood: long grain, cathedral figure of the growth rings, pores."""
    shape = (250, 620)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    bend = 16 * smooth_noise(rng, shape, 310, across=125) + 5 * smooth_noise(rng, shape, 155, across=60)
    rings = np.sin((y + bend + 0.006 * (x - 300)) / 5.5)
    grain = smooth_noise(rng, shape, 124, across=2)
    pores = np.minimum(smooth_noise(rng, shape, 40, across=1), -0.35) + 0.35
    shade = 0.93 + 0.035 * rings + 0.035 * grain + 0.10 * pores
    warm = np.array([1.0, 0.985, 0.96])
    return _grey(shade) ** (1 + 1.2 * (1 - warm))


def _fabric(rng: np.random.Generator) -> Floats:
    """Draw woven cloth: over and under, with threads of uneven shade."""
    side = 256
    i, j = np.mgrid[:side, :side]
    weave = np.where((i // 2 + j // 2) % 2 == 0, 1.0, 0.93)
    threads = 1 + 0.03 * rng.uniform(-1, 1, (side // 2, 1)).repeat(2, axis=0) + 0.03 * rng.uniform(-1, 1, (1, side))
    return _grey(0.96 * weave * threads * (1 + 0.03 * smooth_noise(rng, (side, side), 64)))


def _metal(rng: np.random.Generator) -> Floats:
    shape = (160, 320)
    brushed = smooth_noise(rng, shape, 80, across=1)
    return _grey(0.96 + 0.02 * brushed + 0.015 * smooth_noise(rng, shape, 80))


def _leaves(rng: np.random.Generator) -> Floats:
    """Draw foliage: small leaves of different shade with dark gaps."""
    side = 256
    picture = np.full((side, side, 3), 0.30)
    for depth in range(3):
        for x, y, turn, shade in zip(
            *rng.uniform(0, side, (2, 420)), rng.uniform(0, 180, 420), rng.uniform(0.5, 1.0, 420), strict=True
        ):
            tone = shade * (0.66 + 0.17 * depth)
            cv2.ellipse(picture, ((x, y), (9.0, 4.5), turn), (tone, tone, 0.92 * tone), -1)
    return np.asarray(picture)


def _grey(shade: Floats) -> Floats:
    return np.repeat(np.asarray(shade)[..., None], 3, axis=2)


_MATERIALS = MappingProxyType({"plain": _plain, "wood": _wood, "fabric": _fabric, "metal": _metal, "leaves": _leaves})
