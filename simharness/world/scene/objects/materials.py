"""Sheet of materials and prints: one texture that all textured objects of a scene share, of pictures that ship.

A renderer prepares every texture once, so objects with many materials stay cheap if they share one picture. Materials
(wood, fabric, metal) are nearly white and are multiplied by the colours of the faces; prints (pictures on screens,
posters, papers, boards and packages) bring their colours with them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import seal
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.shapes import joined

Material = Literal["plain", "wood", "fabric", "metal", "leaves"]
_ONE = (*get_args(Material), "whiteboard", "clock")
_SEVERAL = {"landscape": 2, "poster": 3, "notice": 3, "screen": 3, "package": 8, "spines": 3}  # prints of a sheet
MATERIALS = Path(__file__).parents[3] / "assets" / "materials"
"""Folder of the pictures of materials and prints that simharness ships, some of each."""

RESOLUTION = 320  # pixels per metre of a material
_BORDER = 6  # pixels around each patch, so that mipmaps do not mix neighbours
_GOLDEN = (5**0.5 - 1) / 2
_WIDTH = 1024  # pixels: least width of the sheet
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # axes of a cross product
_KEPT = 8  # sheets, 4 MB each: studies and suites have few seeds


@dataclass(frozen=True)
class Patch:
    """Rectangle of the sheet: left, top, width and height in pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Sheet:
    """Sheet of materials and prints."""

    texture: NDArray[np.uint8]
    """Picture, sRGB, (h, w, 3) uint8."""
    patches: Mapping[str, Patch]
    """Place of each material and print."""

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
        one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = one[:, _NEXT] * other[:, _LAST] - one[:, _LAST] * other[:, _NEXT]  # np.cross takes five times as long
        main = np.abs(normal).argmax(axis=1)
        across = np.array([[b, c] if extent[b] >= extent[c] else [c, b] for b, c in ((1, 2), (0, 2), (0, 1))])[main]
        place = np.take_along_axis(corners - low, np.repeat(across[:, None], 3, axis=1), axis=2)
        patch = self.extent(material)
        scale = np.minimum(1.0, 0.98 * patch / np.maximum(extent[across], 1e-6))
        place = place * scale[:, None] / patch
        spare = 1.0 - place.reshape(-1, 2).max(axis=0)
        start = spare * [(number * _GOLDEN) % 1.0, (number * _GOLDEN**2) % 1.0]
        return self.uv(material, place + start)

    def joined(self, meshes: Sequence[Mesh]) -> Mesh:
        """Return one mesh of several that show this sheet."""
        uv = np.concatenate([mesh.uv for mesh in meshes if mesh.uv is not None])
        return replace(joined(*meshes), texture=self.texture, uv=uv)

    @classmethod
    def pack(cls, pictures: Mapping[str, Floats]) -> "Sheet":
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


@lru_cache(maxsize=_KEPT)
def draw_sheet(seed: int) -> Sheet:
    """Draw the sheet of a scene from the shipped pictures: one of each material, and different ones of each print."""
    names = {kind: [kind] for kind in _ONE}
    names |= {kind: [f"{kind}{k}" for k in range(count)] for kind, count in _SEVERAL.items()}
    pictures: dict[str, Floats] = {}
    for kind, each in names.items():
        files = drawn_pictures(MATERIALS, kind, stream(seed, "room", "sheet", kind), len(each))
        pictures |= {name: read_picture(file) / 255 for name, file in zip(each, files, strict=True)}
    return Sheet.pack(pictures)


def drawn_pictures(folder: Path, name: str, rng: np.random.Generator, count: int = 1) -> list[Path]:
    """Draw ``count`` different ones of the shipped pictures ``NAME.0.webp``, ``NAME.1.webp`` and so on of a folder."""
    files = sorted(folder.glob(f"{name}.*.webp"))
    return [files[k] for k in rng.permutation(len(files))[:count]]


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Return a shipped picture, sRGB, (h, w, 3)."""
    return np.asarray(cv2.imread(str(path)), np.uint8)[..., ::-1]
