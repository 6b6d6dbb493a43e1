"""Objects of laboratory scenes, drawn with sizes and colours of their own.

Boxes, bookshelves and racks; pillars, partitions and carts; chairs and tables, which are props as well.
"""

from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import TOP, Assembly, hexahedron, lathe, shifted
from simharness.world.scene.objects.solids import ObjectModel

_BOX_SIDE = (0.40, 0.75)  # metres
_BOX_HEIGHT = (0.40, 1.10)
_STACKED = 0.35  # chance of a smaller box on top of a low one
_STACK_HEIGHT = (0.25, 0.45)
BOX_COLORS = np.array(
    [
        [0.76, 0.60, 0.42],
        [0.70, 0.52, 0.35],
        [0.36, 0.50, 0.55],
        [0.80, 0.66, 0.38],
        [0.66, 0.42, 0.34],
        [0.50, 0.56, 0.46],
    ]
)
_TAPE = 0.06  # metres: width
_SHELF_WIDTH, _SHELF_HEIGHT, _SHELF_DEPTH = (0.9, 1.2), (1.7, 1.9), (0.28, 0.36)
_BOARD = 0.025
_RACK_WIDTH, _RACK_HEIGHT, _RACK_DEPTH = (0.6, 0.8), (1.0, 1.3), (0.30, 0.38)
_POST, _SHEET = 0.03, 0.015
_RACK_COLORS = np.array([[0.72, 0.73, 0.75], [0.25, 0.26, 0.28], [0.88, 0.88, 0.86]])
WOOD = np.array([[0.62, 0.47, 0.33], [0.80, 0.72, 0.60], [0.40, 0.30, 0.24], [0.86, 0.85, 0.82]])
BOOK_COLORS = np.array(
    [
        [0.55, 0.22, 0.20],
        [0.20, 0.32, 0.46],
        [0.25, 0.42, 0.32],
        [0.78, 0.62, 0.30],
        [0.82, 0.79, 0.72],
        [0.36, 0.26, 0.40],
    ]
)
_STONE = np.array([[0.80, 0.79, 0.76], [0.70, 0.69, 0.67], [0.86, 0.84, 0.79], [0.62, 0.63, 0.66]])
_PANELS = np.array([[0.36, 0.52, 0.55], [0.55, 0.57, 0.60], [0.72, 0.55, 0.32], [0.44, 0.40, 0.52], [0.48, 0.56, 0.42]])
_FRAME = np.array([0.82, 0.83, 0.84])
_STEEL = np.array([0.66, 0.68, 0.71])
_RUBBER = np.array([0.16, 0.16, 0.17])
_WHEEL = 0.06  # metres: radius
_TOP = 0.03  # metres: thickness of a table's top
_SEAT = 0.045
_BACK = 0.40  # metres: height of the back of a chair over its seat
_LEAN = 0.07  # metres: distance by which the back leans backwards at its top
_METAL = np.array([0.30, 0.31, 0.33])
_FABRIC = np.array([[0.20, 0.38, 0.44], [0.62, 0.27, 0.22], [0.80, 0.60, 0.24], [0.35, 0.37, 0.40], [0.36, 0.46, 0.33]])
_PORCELAIN = np.array([0.93, 0.92, 0.90])


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
    return Assembly().boxes(boxes, sides).model()


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
    return Assembly().boxes(boxes, np.array(colors)).model()


def draw_rack(rng: np.random.Generator) -> ObjectModel:
    """Draw an empty rack of thin posts and boards, 1.0 to 1.3 m high: an obstacle that occludes little."""
    width, height, depth = rng.uniform(*_RACK_WIDTH), rng.uniform(*_RACK_HEIGHT), rng.uniform(*_RACK_DEPTH)
    levels = np.linspace(0.12, height - 0.06, int(rng.integers(3, 5)))
    metal = _RACK_COLORS[rng.integers(len(_RACK_COLORS))]
    posts = [
        Box((x * (depth - _POST) / 2, y * (width - _POST) / 2, height / 2), (_POST / 2, _POST / 2, height / 2))
        for x in (-1.0, 1.0)
        for y in (-1.0, 1.0)
    ]
    boards = [Box((0.0, 0.0, float(z)), (depth / 2, width / 2, _SHEET / 2)) for z in levels]
    boxes = posts + boards
    return Assembly().boxes(boxes, np.array([metal] * len(posts) + [0.9 * metal] * len(boards))).model()


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


def draw_pillar(rng: np.random.Generator, height: float) -> ObjectModel:
    """Draw a round or square pillar from the floor to ``height`` metres, with a base and a capital."""
    is_round, width = rng.uniform() < 0.5, rng.uniform(0.30, 0.45)
    stone = _STONE[rng.integers(len(_STONE))]
    base = min(0.12, height / 4)
    ends = [(0.0, base, 1.22), (base, height - base, 1.0), (height - base, height, 1.18)]
    assembly = Assembly()
    for low, high, wider in ends:
        color = stone if wider == 1.0 else 0.88 * stone
        if is_round:
            assembly.bar((0, 0, low), (0, 0, high), wider * width / 2, color, sides=28)
        else:
            assembly.box((0, 0, (low + high) / 2), (wider * width, wider * width, high - low), color)
    return assembly.model()


def draw_partition(rng: np.random.Generator) -> ObjectModel:
    """Draw a free-standing partition 1.5 to 1.9 m tall: one panel, or two or three in a zigzag."""
    panels = int(rng.integers(1, 4))
    width, height = rng.uniform(0.75, 1.0), rng.uniform(1.5, 1.9)
    fold, sense = rng.uniform(0.35, 0.7), rng.choice([-1.0, 1.0])
    fabric = _PANELS[rng.integers(len(_PANELS))]
    if panels == 1:
        width, fold = 1.5 * width, 0.0
    yaws = [sense * fold * (-1.0) ** k for k in range(panels)]
    along = [np.array([-np.sin(yaw), np.cos(yaw)]) for yaw in yaws]
    ends = np.cumsum([np.zeros(2), *(width * way for way in along)], axis=0)
    ends -= (ends.min(axis=0) + ends.max(axis=0)) / 2
    assembly = Assembly()
    for yaw, start, end in zip(yaws, ends, ends[1:], strict=False):
        _panel(assembly, (start + end) / 2, yaw, (width, height), fabric)
    return assembly.model()


def _panel(assembly: Assembly, middle: Floats, yaw: float, size: tuple[float, float], fabric: Floats) -> None:
    """Add one panel perpendicular to its x axis: cloth in a frame on two feet."""
    (width, height), post, under = size, 0.03, 0.09
    parts = [
        (Box((0.0, 0.0, (height + under) / 2), (0.014, width / 2 - post, (height - under) / 2 - post)), fabric),
        (Box((0.0, 0.0, height - post / 2), (0.018, width / 2 - post, post / 2)), _FRAME),
        (Box((0.0, 0.0, under + post / 2), (0.018, width / 2 - post, post / 2)), _FRAME),
    ]
    for side in (-1.0, 1.0):
        y = side * (width - post) / 2
        parts.append((Box((0.0, y, (height + 0.03) / 2), (0.018, post / 2, (height - 0.03) / 2)), _FRAME))
        parts.append((Box((0.0, y, 0.015), (0.17, post / 2, 0.015)), 0.7 * _FRAME))
    for box, color in parts:
        assembly.boxes([box.moved(middle, yaw)], [color])


def draw_cart(rng: np.random.Generator) -> ObjectModel:
    """Draw a service cart that moves along its x axis: two trays between four posts on wheels, with cartons."""
    length, width, height = rng.uniform(0.75, 0.95), rng.uniform(0.45, 0.55), rng.uniform(0.82, 0.95)
    sizes, places = rng.uniform([0.22, 0.2, 0.15], [0.34, 0.32, 0.3], (3, 3)), rng.uniform(-1, 1, (3, 2))
    colors, turns = BOX_COLORS[rng.integers(len(BOX_COLORS), size=3)], rng.uniform(-0.25, 0.25, 3)
    assembly, x, y = Assembly(), length / 2 - 0.02, width / 2 - 0.02
    trays = (0.17, height - 0.12)
    for z in trays:
        assembly.box((0, 0, z), (length, width, 0.02), _STEEL)
        for side in (-1.0, 1.0):
            assembly.box((side * (length / 2 - 0.008), 0, z + 0.035), (0.016, width, 0.05), 0.92 * _STEEL)
            assembly.box((0, side * (width / 2 - 0.008), z + 0.035), (length - 0.032, 0.016, 0.05), 0.92 * _STEEL)
    for side in (-1.0, 1.0):
        for end in (-1.0, 1.0):
            assembly.bar((end * x, side * y, 2 * _WHEEL), (end * x, side * y, height), 0.014, 0.8 * _STEEL)
            wheel = (end * x, side * y - 0.018, _WHEEL), (end * x, side * y + 0.018, _WHEEL)
            assembly.bar(*wheel, _WHEEL, _RUBBER, sides=16)
    for end in (-1.0, 1.0):
        assembly.bar((end * x, -y, height), (end * x, y, height), 0.016, 0.35 * _STEEL)
    for k, (size, place) in enumerate(zip(sizes, places, strict=True)):
        z = trays[0 if k == 0 else 1] + 0.01
        slot = (0.0 if k == 0 else (-1.0) ** k * length / 4) + 0.05 * place[0]
        boxes, painted = taped(size, colors[k], base=z, yaw=turns[k])
        assembly.boxes([box.moved((slot, 0.04 * place[1]), 0.0) for box in boxes], painted)
    return assembly.model()


def draw_table(rng: np.random.Generator) -> ObjectModel:
    """Draw a table of usual height, rectangular or round, with a few objects on it."""
    depth, width, height = rng.uniform(0.70, 0.85), rng.uniform(1.1, 1.5), rng.uniform(0.71, 0.76)
    is_round = rng.uniform() < 0.35
    wood = WOOD[rng.integers(len(WOOD))]
    diameter = rng.uniform(0.85, 1.05)
    if is_round:
        assembly = _round_table(diameter, height, wood)
        reach = np.array([0.55, 0.55]) * diameter / 2
    else:
        assembly = _table((depth, width, height), wood)
        reach = 0.7 * np.array([depth, width]) / 2
    return _with_tabletop_objects(rng, assembly, height, reach).model()


def table(size: tuple[float, float, float], *, tint: int = 0) -> ObjectModel:
    """Return a plain table of depth x, width y and height z, metres."""
    return _table(size, WOOD[tint % len(WOOD)]).model()


def _table(size: tuple[float, float, float], wood: Floats) -> Assembly:
    depth, width, height = size
    leg = 0.055
    assembly = Assembly().box((0, 0, height - _TOP / 2), (depth, width, _TOP), wood)
    x, y = depth / 2 - leg, width / 2 - leg
    under = height - _TOP
    for side in (-1.0, 1.0):
        assembly.box((side * x, 0, under - 0.035), (0.02, 2 * y, 0.07), 0.88 * wood)
        assembly.box((0, side * y, under - 0.035), (2 * x, 0.02, 0.07), 0.88 * wood)
        for other in (-1.0, 1.0):
            assembly.box((side * x, other * y, under / 2), (leg, leg, under), 0.92 * wood)
    return assembly


def _round_table(diameter: float, height: float, wood: Floats) -> Assembly:
    return (
        Assembly()
        .bar((0, 0, height - _TOP), (0, 0, height), diameter / 2, wood, sides=32)
        .bar((0, 0, 0.03), (0, 0, height - _TOP), 0.045, _METAL, sides=14)
        .bar((0, 0, 0), (0, 0, 0.03), 0.26, _METAL, sides=24)
    )


def _with_tabletop_objects(rng: np.random.Generator, assembly: Assembly, height: float, reach: Floats) -> Assembly:
    """Add books, a mug and a laptop, each by chance and in a separate corner."""
    chance, offset, turn = rng.uniform(size=3), rng.uniform(-0.3, 0.3, (3, 2)), rng.uniform(-0.5, 0.5, 3)
    thick, tint = rng.uniform(0.018, 0.04, 3), rng.integers(len(BOOK_COLORS), size=4)
    corners = np.array([[-0.5, -0.75], [0.4, 0.8], [0.0, 0.05]]) + 0.3 * offset
    places = corners * reach
    if chance[0] < 0.8:
        z = height
        for k in range(3):
            x, y = places[0] + 0.01 * offset[k]
            size = (0.21 - 0.015 * k, 0.155 - 0.01 * k, thick[k])
            assembly.box((x, y, z + thick[k] / 2), size, BOOK_COLORS[tint[k]], yaw=turn[k])
            z += thick[k]
    if chance[1] < 0.7:
        profile = [(0.0, 0.0), (0.036, 0.0), (0.041, 0.095), (0.036, 0.095), (0.034, 0.02), (0.0, 0.02)]
        assembly.mesh(shifted(lathe(profile, _PORCELAIN, sides=12), (*places[1], height)))
    if chance[2] < 0.6:
        x, y = places[2]
        assembly.box((x, y, height + 0.009), (0.23, 0.33, 0.018), 2.2 * _METAL, yaw=turn[2])
        c, s = np.cos(turn[2]), np.sin(turn[2])
        assembly.box((x - 0.12 * c, y - 0.12 * s, height + 0.12), (0.012, 0.33, 0.22), 0.6 * _METAL, yaw=turn[2])
    return assembly


def draw_chair(rng: np.random.Generator) -> ObjectModel:
    """Draw a chair with an upholstered or a wooden seat."""
    size = (rng.uniform(0.42, 0.48), rng.uniform(0.42, 0.48), rng.uniform(0.43, 0.47))
    return chair(size, tint=int(rng.integers(len(_FABRIC) + len(WOOD))))


def chair(size: tuple[float, float, float], *, tint: int = 0) -> ObjectModel:
    """Return a chair of depth x and width y with its seat at z, metres; it faces +x, its back at -x leans backwards."""
    depth, width, height = size
    colors = np.concatenate([_FABRIC, WOOD])
    color = colors[tint % len(colors)]
    frame = _METAL if tint % len(colors) < len(_FABRIC) else 0.88 * color
    x, y, leg = depth / 2 - 0.025, width / 2 - 0.025, 0.016
    assembly = Assembly().box((0, 0, height - _SEAT / 2), (depth, width, _SEAT), color)
    foot = height + _BACK
    for side in (-1.0, 1.0):
        assembly.bar((x, side * y, 0), (x, side * y, height - _SEAT), leg, frame)
        assembly.bar((-x, side * y, 0), (-x, side * y, height - _SEAT), leg, frame)
        assembly.bar((-x - 0.01, side * y, height - _SEAT), (-x - _LEAN, side * y, foot), leg, frame)
    slats = [(0.16, 0.40)] if tint % len(colors) < len(_FABRIC) else [(0.14, 0.21), (0.25, 0.31), (0.35, 0.40)]
    for low, high in slats:
        assembly.mesh(_slat(-x - 0.01, width - 0.05, height, (low, high), color))
    return assembly.model()


def _slat(x: float, width: float, seat: float, span: tuple[float, float], color: Floats) -> Mesh:
    """Return a board across the leaning back of a chair, between two heights over the seat."""
    corners = np.array(
        [
            [x + side * 0.013 - (_LEAN - 0.01) * (up + _SEAT) / (_BACK + _SEAT), y, seat + up]
            for side in (-1.0, 1.0)
            for y in (-width / 2, width / 2)
            for up in span
        ]
    )
    return hexahedron(corners, color)
