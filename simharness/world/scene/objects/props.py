"""Props: shapes of the objects that activities use."""

import numpy as np

from simharness.types.random_streams import stream
from simharness.world.motion.motion import Prop
from simharness.world.scene.objects.laboratory import BOX_COLORS, taped
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.objects.shapes import box_model
from simharness.world.scene.objects.solids import ObjectModel, Solid

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
