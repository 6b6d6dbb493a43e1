"""Models of decoys: objects that a detector may take for people: posters, mannequins, coat stands, mirrors.

Each except the mirror has the joints that a detector would find on it (``Solid.figure``); a mirror has its glass
(``Solid.mirror``) and shows the people in front of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.scene.objects.artwork import draw_person
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.laboratory import WOOD
from simharness.world.scene.objects.shapes import Assembly, box_mesh, joined, lathe, loft, shifted
from simharness.world.scene.objects.solids import ObjectModel

_POSTER_RESOLUTION = 320  # pixels per metre
_ALUMINIUM = np.array([0.74, 0.75, 0.77])
_FRAMES = np.array([[0.20, 0.20, 0.22], [0.85, 0.84, 0.81], [0.62, 0.47, 0.33], [0.40, 0.30, 0.24]])
_GLASS = np.array([0.78, 0.84, 0.85])
_SHOP_COLORS = np.array([[0.90, 0.88, 0.85], [0.80, 0.69, 0.58], [0.30, 0.31, 0.33], [0.74, 0.75, 0.77]])
_CLOTHS = np.array([[0.29, 0.31, 0.36], [0.62, 0.50, 0.36], [0.34, 0.40, 0.32], [0.46, 0.26, 0.26], [0.24, 0.32, 0.44]])
_ARM_OUT = 0.2  # angle of the upper arms of a mannequin from the vertical, radians
# Profile of a coat on a stand: height, half width, half depth; metres.
_COAT = np.array(
    [
        *((0.48, 0.265, 0.165), (0.70, 0.250, 0.155), (0.95, 0.225, 0.140), (1.15, 0.215, 0.130)),
        *((1.32, 0.222, 0.120), (1.43, 0.215, 0.095), (1.485, 0.150, 0.070), (1.50, 0.055, 0.050)),
    ]
)
_FOLDS = 7


def draw_poster(rng: np.random.Generator, on_wall: bool) -> ObjectModel:
    """Draw a poster of a person, almost life-size: framed on a wall, or on a free-standing banner."""
    width, height = rng.uniform(0.72, 0.85), rng.uniform(1.75, 1.95)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    size = (round(width * _POSTER_RESOLUTION), round(height * _POSTER_RESOLUTION))
    texture, joints = draw_person(rng, size, tall=0.82)
    low = 0.12 if on_wall else 0.09
    sheet = Box((0.018, 0.0, low + height / 2), (0.006, width / 2, height / 2))
    if on_wall:
        rims, colors = _rim(sheet, 0.028), [frame] * 4
    else:
        rims = [
            Box((0.0, 0.0, 0.045), (0.10, width / 2 + 0.01, 0.045)),
            Box((0.0, 0.0, low + height / 2), (0.012, 0.012, height / 2)),
        ]
        colors = [_ALUMINIUM, 0.85 * _ALUMINIUM]
    boxes = [sheet, *rims]
    mesh = box_mesh(boxes, np.array([np.ones(3), *colors]))
    front = 0.024
    figure = np.column_stack([np.full(17, front), (joints[:, 0] - 0.5) * width, low + (1 - joints[:, 1]) * height])
    return ObjectModel(_printed(mesh, texture), tuple(boxes), figure=figure)


def _printed(mesh: Mesh, texture: NDArray[np.uint8]) -> Mesh:
    """Return the mesh with a picture on the front of its first box; other faces keep their colours."""
    # A white column beside the picture, which leaves colours unchanged, serves as texture of all other faces.
    wide = np.concatenate([texture, np.full((len(texture), 4, 3), 255, np.uint8)], axis=1)
    uv = np.full((len(mesh.faces), 3, 2), 0.5)
    uv[..., 0] = 1 - 2 / wide.shape[1]
    front = slice(2, 4)  # the two triangles of the side +x
    corners = mesh.vertices[mesh.faces[front]]
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    share = (corners - low)[..., 1:] / (high - low)[1:]
    uv[front, :, 0] = share[..., 0] * (texture.shape[1] / wide.shape[1])
    uv[front, :, 1] = 1 - share[..., 1]
    return replace(mesh, texture=wide, uv=uv.astype(np.float32))


def _rim(sheet: Box, width: float) -> list[Box]:
    """Return four bars around a sheet perpendicular to x, slightly thicker than the sheet."""
    (x, y, z), (depth, wide, tall) = sheet.center, sheet.half
    bars = []
    for side in (-1.0, 1.0):
        bars.append(Box((x, y + side * (wide + width / 2), z), (depth + 0.012, width / 2, tall + width)))
        bars.append(Box((x, y, z + side * (tall + width / 2)), (depth + 0.012, wide, width / 2)))
    return bars


def draw_mirror(rng: np.random.Generator, on_wall: bool) -> ObjectModel:
    """Draw a framed mirror as tall as a person: on a wall, or on two feet."""
    width, height = rng.uniform(0.65, 1.0), rng.uniform(1.55, 1.8)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    low, rim = 0.14, 0.05
    sheet = Box((0.020, 0.0, low + height / 2), (0.006, width / 2, height / 2))
    bars = _rim(sheet, rim)
    assembly = Assembly().boxes([sheet], [_GLASS]).boxes(bars, [frame] * 4)
    if not on_wall:
        for side in (-1.0, 1.0):
            y = side * (width / 2 + rim / 2)
            assembly.box((0.02, y, 0.02), (0.46, 0.05, 0.04), frame)
            assembly.box((0.02, y, 0.065), (0.05, 0.05, 0.05), frame)
    return assembly.model(mirror=Mirror((0.026, 0.0, low + height / 2), (1.0, 0.0, 0.0), (width / 2, height / 2)))


def draw_mannequin(rng: np.random.Generator, on_wall: bool = False) -> ObjectModel:
    """Draw a shop mannequin: an unclothed body of one colour on a round base."""
    body = make_body(
        Shape(
            gender=float(rng.choice([0.05, 0.95])),
            muscle=0.35,
            weight=float(rng.uniform(0.2, 0.5)),
            height=float(rng.uniform(0.35, 0.45)),
            proportions=0.0,
        )
    )
    color, twist, bend = _SHOP_COLORS[rng.integers(len(_SHOP_COLORS))], rng.uniform(-0.2, 0.2), rng.uniform(0.1, 0.6, 2)
    turns = {"Spine": np.array([0.0, 0.0, twist])}
    for side, flexed in zip(("Left", "Right"), bend, strict=True):
        arm, forearm = (body.heads[body.index(side + bone)] for bone in ("Arm", "ForeArm"))
        out, down = np.abs((forearm - arm)[1:])
        sense = -1.0 if side == "Left" else 1.0
        turns[side + "Arm"] = np.array([sense * (np.arctan2(out, down) - _ARM_OUT), 0.0, 0.0])
        hinge = np.cross(forearm - arm, [1.0, 0.0, 0.0])
        turns[side + "ForeArm"] = flexed * hinge / np.linalg.norm(hinge)
    bones = _posed(body, turns)
    skin = body.skin(bones)
    base = 0.025
    offset = np.array([0.0, 0.0, base - float(skin[:, 2].min())])
    offset[:2] = -skin[skin[:, 2] < skin[:, 2].min() + 0.05, :2].mean(axis=0)
    statue = Mesh(
        vertices=(skin + offset).astype(np.float32),
        faces=body.faces,
        colors=np.tile(color.astype(np.float32), (len(body.faces), 1)),
        smooth=True,
    )
    assembly = Assembly().mesh(statue).bar((0, 0, 0), (0, 0, base), 0.27, 0.6 * _ALUMINIUM, sides=28)
    return assembly.model(figure=body.joints(bones) + offset)


def _posed(body: Body, turns: Mapping[str, Floats]) -> Floats:
    """Return bone transforms (B, 3, 4) of the rest pose with bones rotated about their heads by rotation vectors."""
    transforms = np.empty((len(body.bones), 3, 4))
    for bone, (name, parent) in enumerate(zip(body.bones, body.parents, strict=True)):
        rest = np.eye(3, 4) if parent < 0 else transforms[parent]
        turn = Rotation.from_rotvec(turns.get(name, np.zeros(3))).as_matrix()
        head = body.heads[bone]
        transforms[bone, :, :3] = rest[:, :3] @ turn
        transforms[bone, :, 3] = rest[:, :3] @ (head - turn @ head) + rest[:, 3]
    return transforms


def draw_coat_stand(rng: np.random.Generator, on_wall: bool = False) -> ObjectModel:
    """Draw a coat stand as tall as a person: a pole on a round foot with a coat and a hat."""
    tall, wide = rng.uniform(0.94, 1.10), rng.uniform(0.92, 1.08)
    cloth, wood = _CLOTHS[rng.integers(len(_CLOTHS))], WOOD[rng.integers(len(WOOD))]
    felt, phase = 0.75 * _CLOTHS[rng.integers(len(_CLOTHS))], rng.uniform(0, 2 * np.pi, 2)
    assembly = Assembly().bar((0, 0, 0), (0, 0, 0.03), 0.20, 0.9 * wood, sides=24)
    assembly.bar((0, 0, 0.03), (0, 0, 1.72 * tall), 0.02, wood)
    shape = _COAT * [tall, wide, wide]
    assembly.mesh(joined(_coat(shape, cloth, phase[0]), *(_sleeve(shape, side, cloth) for side in (-1.0, 1.0))))
    crown = 1.60 * tall
    brim = [(0.0, 0.0), (0.165, 0.0), (0.170, 0.012), (0.098, 0.022)]
    hat = np.array([*brim, (0.095, 0.06), (0.092, 0.105), (0.078, 0.130), (0.04, 0.128), (0.0, 0.118)])
    bands = np.array([felt, felt, felt, 0.4 * felt, felt, felt, felt, felt])
    assembly.mesh(shifted(lathe(hat, bands, sides=20, squash=1.1), (0, 0, crown)))
    return assembly.model(figure=_coat_figure(shape, crown, tall))


def _coat(shape: Floats, cloth: Floats, phase: float) -> Mesh:
    """Return the body of a coat, closed below, with folds that deepen downwards."""
    sides = 36
    turn = 2 * np.pi * np.arange(sides) / sides
    depth = np.linspace(1, 0, len(shape))[:, None] ** 1.5
    fold = 1 + 0.055 * depth * np.sin(_FOLDS * turn + phase)
    rounded = np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** 0.8, np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** 0.8
    rings = np.stack(
        [shape[:, 2:] * fold * rounded[1], shape[:, 1:2] * fold * rounded[0], np.tile(shape[:, :1], (1, sides))], axis=2
    )
    hem, collar = rings[:1] * [0.0, 0.0, 1.0], rings[-1:] * [0.0, 0.0, 1.0]
    colors = np.tile(cloth, (len(rings) + 1, sides, 1))
    colors[1:-1, 0] *= 0.72  # edge of the front flap
    return loft(np.concatenate([hem, rings, collar]), colors, edges=(1,))


def _sleeve(shape: Floats, side: float, cloth: Floats) -> Mesh:
    """Return an empty sleeve that hangs from a shoulder."""
    top, wide = shape[5, 0], shape[5, 1]
    path = np.array(
        [[0.0, 0.80, 0.01], [0.0, 0.98, -0.04], [0.01, 1.13, -0.20], [0.02, 1.20, -0.42], [0.02, 1.22, -0.60]]
    )
    centers = path * [1.0, side * wide, 1.0] + [0.0, 0.0, top]
    radii = np.array([[0.045, 0.03], [0.075, 0.055], [0.070, 0.055], [0.062, 0.050], [0.060, 0.048]])
    turn = 2 * np.pi * np.arange(14) / 14
    rings = (
        np.stack([radii[:, :1] * np.cos(turn), radii[:, 1:] * np.sin(turn), np.zeros((len(radii), 14))], axis=2)
        + centers[:, None]
    )
    ends = centers[[0]][:, None].repeat(14, axis=1), centers[[-1]][:, None].repeat(14, axis=1)
    return loft(np.concatenate([ends[1], rings[::-1], ends[0]]), 0.93 * cloth, edges=(1,))


def _coat_figure(shape: Floats, crown: float, tall: float) -> Floats:
    """Return the COCO-17 joints of the apparent person, (17, 3)."""
    shoulder, wide = shape[5, 0], 0.8 * shape[5, 1]
    face = [
        (0.09, 0.0, -0.05),
        *((0.08, side * 0.032, -0.02) for side in (1, -1)),
        *((0.0, side * 0.075, -0.03) for side in (1, -1)),
    ]
    head = [(x, y, crown + z) for x, y, z in face]
    rows = [
        (0.0, wide, shoulder),
        (0.02, 1.25 * wide, shoulder - 0.28 * tall),
        (0.03, 1.35 * wide, shoulder - 0.55 * tall),
        (0.0, 0.55 * wide, 0.90 * tall),
        (0.02, 0.50 * wide, 0.50 * tall),
        (0.0, 0.45 * wide, 0.08 * tall),
    ]
    return np.array([*head, *((x, s * y, z) for x, y, z in rows for s in (1, -1))])


DECOY_MODELS: MappingProxyType[str, tuple[str, Callable[[np.random.Generator, bool], ObjectModel]]] = MappingProxyType(
    {
        "posters": ("poster", draw_poster),
        "mirrors": ("mirror", draw_mirror),
        "mannequins": ("mannequin", draw_mannequin),
        "coat_stands": ("coat stand", draw_coat_stand),
    }
)
"""Name of one decoy and its drawing function, which is given whether it hangs on a wall; by key of the scenario."""
