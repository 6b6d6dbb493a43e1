"""Boxes and bookshelves of laboratory scenes, drawn with sizes, contents and colours of their own.

Props: shapes of the objects that activities use.

Mannequins of shops: decoys whose joints a detector would find (``Solid.figure``).
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.motion import Prop
from simharness.world.scene.objects.geoms import Box, Surface
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.objects.shapes import TOP, bar_mesh, box_model, joined
from simharness.world.scene.objects.solids import ObjectModel, Solid

_BASE = np.array([0.44, 0.45, 0.46])
_SHOP_COLORS = np.array([[0.90, 0.88, 0.85], [0.80, 0.69, 0.58], [0.30, 0.31, 0.33], [0.74, 0.75, 0.77]])
_ARM_OUT = 0.2  # angle of the upper arms of a mannequin from the vertical, radians


def draw_mannequin(rng: np.random.Generator) -> ObjectModel:
    """Draw a shop mannequin: an unclothed body of one colour on a round base."""
    gender, weight, height = rng.choice([0.05, 0.95]), rng.uniform(0.2, 0.5), rng.uniform(0.35, 0.45)
    body = make_body(Shape(gender, muscle=0.35, weight=weight, height=height, proportions=0.0))
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
    statue = Mesh(skin + offset, body.faces, np.tile(color, (len(body.faces), 1)), smooth=True)
    foot = bar_mesh((0.0, 0.0, 0.0), (0.0, 0.0, base), 0.27, _BASE, sides=28)
    geoms = tuple(Surface(mesh.vertices.astype(float), mesh.faces) for mesh in (statue, foot))
    return ObjectModel(joined(statue, foot), geoms, body.joints(bones) + offset)


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


_STILL = 1e-9  # metres and quaternion units: smaller changes are no motion


def make_prop(prop: Prop, name: str) -> Solid:
    """Return the solid of a prop; its colours are drawn by its name.

    Returns:
        A solid of kind "prop": at rest if its trajectory is constant and upright, else moving.
    """
    model = _model(prop, int(stream(0, "prop", name).integers(1000)))
    start = prop.trajectory.pose[0]
    x, y, z, w, i, j, k = start.tolist()
    if np.ptp(prop.trajectory.pose, axis=0).max() < _STILL and max(abs(z), abs(i), abs(j)) < _STILL:
        return model.at((x, y), float(2 * np.arctan2(k, w)), kind="prop", name=name)
    return model.along(prop.trajectory, kind="prop", name=name)


def _model(prop: Prop, tint: int) -> ObjectModel:
    """Return the shipped object for a kind of prop, scaled to its size; the tape of a box keeps its width."""
    if prop.kind == "box":
        return box_model(*taped(np.array(prop.size), BOX_COLORS[tint % len(BOX_COLORS)], base=0.0, yaw=0.0))
    files = variants(prop.kind)
    file = load_shipped(files[tint % len(files)])
    return file.model(scale=np.array(prop.size) / file.size)


_BOX_SIDE = (0.40, 0.75)  # metres
_BOX_HEIGHT = (0.40, 1.10)
_STACKED = 0.35  # chance of a smaller box on top of a low one
_STACK_HEIGHT = (0.25, 0.45)
BOX_COLORS = np.array([
    [0.76, 0.60, 0.42], [0.70, 0.52, 0.35], [0.36, 0.50, 0.55],
    [0.80, 0.66, 0.38], [0.66, 0.42, 0.34], [0.50, 0.56, 0.46],
])  # fmt: skip
_TAPE = 0.06  # metres: width
_SHELF_WIDTH, _SHELF_HEIGHT, _SHELF_DEPTH = (0.9, 1.2), (1.7, 1.9), (0.28, 0.36)
_BOARD = 0.025
WOOD = np.array([[0.62, 0.47, 0.33], [0.80, 0.72, 0.60], [0.40, 0.30, 0.24], [0.86, 0.85, 0.82]])
BOOK_COLORS = np.array([
    [0.55, 0.22, 0.20], [0.20, 0.32, 0.46], [0.25, 0.42, 0.32],
    [0.78, 0.62, 0.30], [0.82, 0.79, 0.72], [0.36, 0.26, 0.40],
])  # fmt: skip


def draw_box(rng: np.random.Generator) -> ObjectModel:
    """Draw a box of 0.4 to 1.1 m with a strip of tape, sometimes with a smaller box on top."""
    size = np.array([rng.uniform(*_BOX_SIDE), rng.uniform(*_BOX_SIDE), rng.uniform(*_BOX_HEIGHT)])
    upper = np.array([*(size[:2] * rng.uniform(0.55, 0.85, 2)), rng.uniform(*_STACK_HEIGHT)])
    turn = rng.uniform(-0.4, 0.4)
    stacked = rng.uniform() < _STACKED and size[2] + upper[2] < _BOX_HEIGHT[1]
    colors = BOX_COLORS[rng.integers(len(BOX_COLORS), size=2)]
    boxes, sides = taped(size, colors[0], base=0.0, yaw=0.0)
    if stacked:
        upper_boxes, upper_sides = taped(upper, colors[1], base=size[2], yaw=turn)
        boxes, sides = boxes + upper_boxes, sides + upper_sides
    return box_model(boxes, sides)


def taped(size: Floats, color: Floats, *, base: float, yaw: float) -> tuple[list[Box], list[Floats]]:
    """Return a box as three slices side by side, the middle one with a paler top as packing tape, and their colours."""
    c, s = np.cos(yaw), np.sin(yaw)
    edges = np.array([-size[1] / 2, -_TAPE / 2, _TAPE / 2, size[1] / 2])
    boxes, painted = [], []
    for k, (low, high) in enumerate(pairwise(edges)):
        across = float(low + high) / 2
        center = (float(-s * across), float(c * across), float(base + size[2] / 2))
        boxes.append(Box(center, (float(size[0] / 2), float(high - low) / 2, float(size[2] / 2)), yaw))
        sides = np.tile(color, (6, 1))
        if k == 1:
            sides[TOP] = 0.45 * color + 0.55 * np.array([0.93, 0.89, 0.80])
        painted.append(sides)
    return boxes, painted


def draw_shelf(rng: np.random.Generator) -> ObjectModel:
    """Draw an open bookshelf about 1.8 m tall: two sides, boards, books and cartons."""
    width, height, depth = rng.uniform(*_SHELF_WIDTH), rng.uniform(*_SHELF_HEIGHT), rng.uniform(*_SHELF_DEPTH)
    boards = int(rng.integers(5, 7))
    wood = WOOD[rng.integers(len(WOOD))]
    inner = width - 2 * _BOARD
    parts: list[tuple[Box, Floats]] = []
    for side in (-1.0, 1.0):
        place = (0.0, side * (width - _BOARD) / 2, height / 2)
        parts.append((Box(place, (depth / 2, _BOARD / 2, height / 2)), wood))
    levels = np.linspace(0.08, height - _BOARD / 2, boards)
    for z in levels:
        parts.append((Box((0.0, 0.0, float(z)), (depth / 2, inner / 2, _BOARD / 2)), 0.94 * wood))
    for z, above in pairwise(levels):
        parts += _contents(rng, z + _BOARD / 2, above - z - _BOARD, inner, depth)
    boxes, colors = zip(*parts, strict=True)
    return box_model(boxes, np.array(colors))


def _contents(
    rng: np.random.Generator, floor: float, room: float, inner: float, depth: float
) -> list[tuple[Box, Floats]]:
    """Draw the contents of one board: a row of books from one end, and by chance a carton at the other end."""
    parts: list[tuple[Box, Floats]] = []
    end = rng.choice([-1.0, 1.0])
    filled = inner * rng.uniform(0.25, 0.7)
    at = 0.0
    while at < filled:
        thick, tall, deep = rng.uniform(0.02, 0.05), room * rng.uniform(0.55, 0.9), depth * rng.uniform(0.55, 0.85)
        y = end * (inner / 2 - at - thick / 2)
        color = BOOK_COLORS[rng.integers(len(BOOK_COLORS))] * rng.uniform(0.85, 1.1)
        parts.append((Box((0.0, float(y), float(floor + tall / 2)), (deep / 2, thick / 2, tall / 2)), color))
        at += thick
    free = inner - at
    if free > 0.25 and rng.uniform() < 0.6:
        wide, tall, deep = min(0.3, 0.8 * free), room * rng.uniform(0.4, 0.75), 0.75 * depth
        y = -end * (inner / 2 - wide / 2 - rng.uniform(0.0, free - wide) * 0.5)
        color = BOX_COLORS[rng.integers(len(BOX_COLORS))]
        parts.append((Box((0.0, float(y), float(floor + tall / 2)), (deep / 2, wide / 2, tall / 2)), color))
    return parts
