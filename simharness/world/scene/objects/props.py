"""Props: shapes of the objects that activities use."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from simharness.types.random_streams import stream
from simharness.world.motion.performance import Prop
from simharness.world.scene.objects.assembly import Assembly
from simharness.world.scene.objects.furniture import chair, table
from simharness.world.scene.objects.shapes import lathe
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.objects.storage import BOX_COLORS, taped

Size = tuple[float, float, float]

_STILL = 1e-9  # metres and quaternion units: smaller changes are no motion
_GLASS = np.array([[0.24, 0.46, 0.36], [0.30, 0.42, 0.62], [0.62, 0.30, 0.26]])
_LABEL = np.array([0.93, 0.92, 0.86])
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


_SHAPES: MappingProxyType[str, Callable[[Size, int], ObjectModel]] = MappingProxyType(
    {
        "chair": lambda size, tint: chair(size, tint=tint),
        "table": lambda size, tint: table(size, tint=tint),
        "box": _box,
        "step": _step,
        "bottle": _bottle,
    }
)
