"""What lies around an open floor outdoors: ground up to the horizon of the panorama, and trees.

It is for pictures alone and hides nothing: the ground is below all that people and cameras do, and everything else
stands outside a circle around the floor and all cameras, so that no line from a camera to a person leaves the circle.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mvpose.arrays import Floats
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.light_sources import Vector
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box, carried
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.objects.shapes import joined, quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.noise import smooth_noise

if TYPE_CHECKING:
    from mvpose.camera import Rig

AROUND = 4.0
"""Metres of ground around an open floor, before the meadow begins."""
MEADOW: Vector = (0.34, 0.41, 0.20)
"""Mean albedo of the meadow, sRGB."""
_FAR = 60.0  # metres from the middle: least radius of the meadow
_BEYOND_CAMERAS = 40.0  # metres of meadow behind the farthest camera, at least
_CLEAR = 3.0  # metres between the circle around floor and cameras, and trees and shrubs with their crowns
_RINGS, _PER_SIDE = 22, 22  # cells of the meadow outwards, and along each side
_PATCH, _PIXELS = 30.0, 512  # metres and pixels of the texture of the meadow
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
    share = np.arange(_PER_SIDE)[:, None] / _PER_SIDE
    corners = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]) * half
    inner = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    outer = radius * inner / np.linalg.norm(inner, axis=1, keepdims=True)
    steps = (np.arange(_RINGS + 1) / _RINGS)[:, None, None] ** 1.8
    rings = inner + steps * (outer - inner)
    sides = len(inner)
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    rows = [
        np.column_stack([n * sides + k, (n + 1) * sides + k, (n + 1) * sides + after, n * sides + after])
        for n in range(_RINGS)
    ]
    flat = rings.reshape(-1, 2)
    quads = np.concatenate(rows)
    mesh = quad_mesh(np.pad(flat, ((0, 0), (0, 1))), quads, np.ones((len(quads), 3)))
    return replace(mesh, smooth=True, texture=_lawn(rng), uv=(flat / _PATCH)[mesh.faces].astype(np.float32))


def _lawn(rng: np.random.Generator) -> np.ndarray:
    """Draw a meadow from afar: patches of several greens, (h, w, 3) uint8, sRGB, with the mean ``MEADOW``."""
    shape = (_PIXELS, _PIXELS)
    patches = sum(smooth_noise(rng, shape, 128 >> k) / (k + 1.0) for k in range(5)) + 0.4 * rng.uniform(-1, 1, shape)
    shade = 1 + 0.09 * np.asarray(patches)[..., None]
    dry = 0.03 * smooth_noise(rng, shape, 96)[..., None] * np.array([1.0, 0.35, 0.2])
    picture = shade * MEADOW + dry
    picture *= np.array(MEADOW) / picture.mean(axis=(0, 1))
    return np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)


def _plants(seed: int, clear: float) -> Mesh:
    """Return trees and shrubs outside a circle around the origin."""
    sheet, rng = draw_sheet(seed), stream(seed, "room", "far plants")
    trees, shrubs = (int(rng.integers(low, high + 1)) for low, high in (_TREES, _SHRUBS))
    plants = [(stream(seed, "room", "far tree", k), "far_tree", _TREE_SCALE, 24.0, 3.0) for k in range(trees)]
    plants += [(stream(seed, "room", "far shrub", k), "far_shrub", _SHRUB_SCALE, 18.0, 1.5) for k in range(shrubs)]
    meshes = []
    for rng, name, scales, reach, crown in plants:
        files = variants(name)
        mesh = load_shipped(files[rng.integers(len(files))]).mesh(sheet)
        scale, far, turn, yaw = rng.uniform(*scales), rng.uniform() ** 1.3 * reach, *rng.uniform(0, 2 * np.pi, 2)
        away = clear + scale * crown + far
        place = (away * np.cos(turn), away * np.sin(turn))
        meshes.append(mesh.moved(carried(scale * mesh.vertices, place, yaw)))
    uv = np.concatenate([mesh.uv for mesh in meshes if mesh.uv is not None])
    return replace(joined(*meshes), texture=sheet.texture, uv=uv)
