"""Coverage of the floor by the pictures alone: how many cameras have a point, or a standing person, in the picture.

Geometry without people, obstacles or a detector: what :class:`~simharness.planning.fast_layer.FastLayer` begins with.
"""

import numpy as np
import shapely
from scipy.ndimage import find_objects, label

from mvpose import Rig
from mvpose.arrays import Bools, Floats, Integers
from simharness.types.floor import Volume

STANDING = (0.05, 1.75)
"""Heights of the soles and the crown of a standing person, metres."""

_STEP = 0.25  # metres between places where a volume is sought
_AHEAD = 4.0  # metres ahead of every camera to which it may reach
_LEAST_PIXELS = 60.0  # of a person in the picture: smaller ones are not found by common detectors
_BODY = 0.25  # metres: half the width of a person
_SMALLEST = 3.0  # m² that three cameras have to see
_LEAST = 1.0  # m² that two cameras have to see
_ENOUGH = 3  # cameras
_FLOOR = 3.0  # m² for each person: eight people in the dome of CMU Panoptic, 5.5 m across
_FEWEST, _MOST = 2, 4  # people of a rehearsal whose number nobody has said


def coverage(rig: Rig, places: Floats, heights: tuple[float, ...]) -> Integers:
    """Return the number of cameras that have a point over each place in the picture, by height.

    Args:
        rig: the cameras.
        places: places on the floor, (P, 2), metres.
        heights: heights over the floor, (H,), metres.

    Returns:
        Numbers of cameras, (H, P).
    """
    points = np.stack([np.column_stack([places, np.full(len(places), height)]) for height in heights])
    return np.sum([camera.inside(camera.project(points)) for camera in rig], axis=0)


def whole_people(rig: Rig, places: Floats) -> Bools:
    """Return which cameras have a person who stands at places (P, 2) whole in the picture, and large enough, (V, P)."""
    result = np.ones((len(rig), len(places)), bool)
    for v, camera in enumerate(rig):
        aside = np.array([-camera.R[2, 1], camera.R[2, 0]])
        aside /= max(float(np.linalg.norm(aside)), 1e-9)
        ends = []
        for height in STANDING:
            for side in (-_BODY, _BODY):
                pixels = camera.project(np.column_stack([places + side * aside, np.full(len(places), height)]))
                result[v] &= camera.inside(pixels)
                ends.append(pixels)
        with np.errstate(invalid="ignore"):
            result[v] &= np.linalg.norm(ends[2] - ends[0], axis=1) >= _LEAST_PIXELS
    return result


def covered_volume(rig: Rig) -> tuple[Volume, int]:
    """Return the volume over the largest connected part of the floor where enough cameras see a standing person whole.

    Enough are three: one of them may lose a person whom somebody hides. They are two for a rig of two cameras, and
    where three see less than 3 m².

    Returns:
        The volume, and the number of cameras that see every place of it but for the rounding of its outline.

    Raises:
        ValueError: two cameras nowhere see one person whole.
    """
    forward = np.stack([camera.R[2, :2] for camera in rig])
    corners = np.concatenate([rig.centers[:, :2], rig.centers[:, :2] + _AHEAD * forward])
    low, high = corners.min(axis=0), corners.max(axis=0)
    xs, ys = (np.arange(low[axis], high[axis] + _STEP, _STEP) for axis in (0, 1))
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
    count = whole_people(rig, grid.reshape(-1, 2)).sum(axis=0)
    for needed in range(min(_ENOUGH, len(rig)), 1, -1):
        cells = grid.reshape(-1, 2)[count >= needed]
        parts = shapely.union_all(shapely.box(*(cells - _STEP / 2).T, *(cells + _STEP / 2).T), grid_size=1e-6)
        largest = max(shapely.get_parts(parts), key=shapely.area, default=shapely.Polygon())
        if largest.area >= (_SMALLEST if needed > 2 else _LEAST):
            # Stairs of cells become sides; holes, in which a camera lacks somebody's feet, are left to the simulation.
            outline = shapely.Polygon(largest.exterior).simplify(_STEP)
            return Volume(shapely.get_coordinates(outline)[:-1]), needed
    raise ValueError(
        "nowhere on the floor do two cameras see one standing person whole: the cameras look past each other, or the "
        "floor of the calibration is not at z = 0; give --volume to rehearse anyway, or check the calibration"
    )


def usual_people(volume: Volume) -> int:
    """Return the number of people where none is given: one for each 3 m², as in published recordings, from 2 to 4."""
    return min(max(round(volume.area / _FLOOR), _FEWEST), _MOST)


def good_rectangle(places: Floats, good: Bools) -> tuple[Floats, Floats] | None:
    """Return the corners (2,), metres, of the largest upright rectangle of good cells of a square grid; None: none.

    Args:
        places: centres of the cells, (P, 2), metres.
        good: which are good, (P,).
    """
    if not good.any():
        return None
    spacing = grid_spacing(places)
    low = places.min(axis=0)
    cells = np.rint((places - low) / spacing).astype(int)
    mask = np.zeros(cells.max(axis=0) + 1, bool)
    mask[tuple(cells[good].T)] = True
    x, y = largest_rectangle(mask)
    return low + spacing * (np.array([x.start, y.start]) - 0.5), low + spacing * (np.array([x.stop, y.stop]) - 0.5)


def grid_spacing(places: Floats) -> float:
    """Return the distance of neighbouring places of a square grid, metres; 1 for a single place."""
    steps = [np.diff(np.unique(np.round(places[:, axis], 6))) for axis in (0, 1)]
    known = np.concatenate(steps)
    return float(known.min()) if len(known) else 1.0


def largest_rectangle(mask: Bools) -> tuple[slice, slice]:
    """Return rows and columns of the largest rectangle of true cells of a grid (rows, columns); empty without any."""
    best, area = (slice(0, 0), slice(0, 0)), 0
    for first in range(len(mask)):
        for stop in range(first + 1, len(mask) + 1):
            for (run,) in find_objects(label(mask[first:stop].all(axis=0))[0]):
                if (stop - first) * (run.stop - run.start) > area:
                    best, area = (slice(first, stop), run), (stop - first) * (run.stop - run.start)
    return best
