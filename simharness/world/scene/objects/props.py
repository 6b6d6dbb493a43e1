"""Props: shapes of the objects that activities use."""

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from simharness.types.random_streams import stream
from simharness.world.motion.motion import Prop
from simharness.world.scene.objects.laboratory import BOX_COLORS, chair, table, taped
from simharness.world.scene.objects.shapes import Assembly, lathe
from simharness.world.scene.objects.solids import ObjectModel, Solid

Size = tuple[float, float, float]

_STILL = 1e-9  # metres and quaternion units: smaller changes are no motion
_GLASS = np.array([[0.24, 0.46, 0.36], [0.30, 0.42, 0.62], [0.62, 0.30, 0.26]])
_LABEL = np.array([0.93, 0.92, 0.86])
_BOARD, _FOLDS = 0.03, 14  # metres: thickness of the walls of a booth; folds of a curtain
_POST = 0.07  # metres: width of the frame of a door
_CORRIDOR = np.array([0.09, 0.09, 0.10])
_CAP = np.array([0.85, 0.85, 0.84])


def make_prop(prop: Prop, name: str) -> Solid:
    """Return the solid of a prop; its colours are drawn by its name.

    Returns:
        A solid of kind "prop": at rest if its trajectory is constant and upright, else moving.
    """
    tint = int(stream(0, "prop", name).integers(1000))
    model = _SHAPES[prop.kind](prop.size, tint)
    start = prop.trajectory.pose[0]
    x, y, z, w, i, j, k = start.tolist()
    if np.ptp(prop.trajectory.pose, axis=0).max() < _STILL and max(abs(z), abs(i), abs(j)) < _STILL:
        return model.at((x, y), float(2 * np.arctan2(k, w)), kind="prop", name=name)
    return model.along(prop.trajectory, kind="prop", name=name)


def _box(size: Size, tint: int) -> ObjectModel:
    boxes, painted = taped(np.array(size), BOX_COLORS[tint % len(BOX_COLORS)], base=0.0, yaw=0.0)
    return Assembly().boxes(boxes, painted).model()


def _step(size: Size, tint: int) -> ObjectModel:
    """Return an exercise step: a dark tread on a coloured block."""
    depth, width, height = size
    color = np.array([[0.25, 0.42, 0.58], [0.62, 0.36, 0.28], [0.42, 0.44, 0.47]])[tint % 3]
    tread = min(0.02, height / 4)
    return (
        Assembly()
        .box((0, 0, (height - tread) / 2), (0.94 * depth, 0.96 * width, height - tread), color)
        .box((0, 0, height - tread / 2), (depth, width, tread), (0.22, 0.23, 0.25))
        .model()
    )


def _bottle(size: Size, tint: int) -> ObjectModel:
    radius, height = min(size[0], size[1]) / 2, size[2]
    shape = [(0, 0), (0.92, 0), (1, 0.03), (1, 0.22), (1, 0.52), (1, 0.62), (0.40, 0.80), (0.36, 0.90), (0.44, 0.90)]
    profile = np.array([*shape, (0.44, 1.0), (0, 1.0)]) * [radius, height]
    glass = _GLASS[tint % len(_GLASS)]
    colors = np.array([glass, glass, glass, _LABEL, glass, glass, glass, _CAP, _CAP, _CAP])
    return Assembly().mesh(lathe(profile, colors, sides=14)).model()


def _booth(size: Size, tint: int) -> ObjectModel:
    """Return a closed booth: walls on both sides, a roof, and curtains in folds at both ends of its x axis."""
    depth, width, height = size
    side = np.array([[0.78, 0.76, 0.72], [0.66, 0.70, 0.74], [0.74, 0.70, 0.62]])[tint % 3]
    curtain = np.array([[0.46, 0.16, 0.18], [0.16, 0.26, 0.42], [0.20, 0.36, 0.26]])[tint % 3]
    made = Assembly()
    for end in (-1, 1):
        made.box((0, end * (width / 2 - _BOARD / 2), height / 2), (depth, _BOARD, height), side)
    made.box((0, 0, height - _BOARD / 2), (depth, width - 2 * _BOARD, _BOARD), 0.8 * side)
    inner = width - 2 * _BOARD
    fold = inner / _FOLDS
    for end in (-1, 1):
        for k in range(_FOLDS):
            y = (k + 0.5) * fold - inner / 2
            shade = curtain * (1.0 if k % 2 else 0.75)
            back = 0.012 * (k % 2)
            made.box((end * (depth / 2 - 0.03 - back), y, (height - _BOARD) / 2), (0.02, fold, height - _BOARD), shade)
    return made.model()


def _door(size: Size, tint: int) -> ObjectModel:
    """Return an open doorway to a dark corridor: an unlit panel in a frame, thin enough to lie on a wall."""
    depth, width, height = size
    frame = np.array([[0.86, 0.84, 0.80], [0.62, 0.50, 0.38], [0.50, 0.52, 0.55]])[tint % 3]
    made = Assembly().box((0, 0, (height - _POST) / 2), (depth / 2, width - 2 * _POST, height - _POST), _CORRIDOR)
    for y in (-1, 1):
        made.box((0, y * (width - _POST) / 2, height / 2), (depth, _POST, height), frame)
    return made.box((0, 0, height - _POST / 2), (depth, width - 2 * _POST, _POST), frame).model()


_SHAPES: MappingProxyType[str, Callable[[Size, int], ObjectModel]] = MappingProxyType(
    {
        "chair": lambda size, tint: chair(size, tint=tint),
        "table": lambda size, tint: table(size, tint=tint),
        "box": _box,
        "step": _step,
        "bottle": _bottle,
        "booth": _booth,
        "door": _door,
    }
)
