"""Heat maps: the output of a pose network for every joint, before it is reduced to one keypoint.

A map covers the crop of one detection on a grid: the centre of cell (row, column) is the image pixel
``origin + stride * (column, row)``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Bools, Floats
from mvpose.checks import Sealed, as_array, as_points
from mvpose.kernels import njit

_HIGHEST = 2.0  # peaks of networks trained towards 1 exceed it, but not by a factor of 2
_LEAST_SHARE = 0.05  # lower limit of neighbour over peak, because the logarithm of 0 is not finite


@dataclass(frozen=True)
class Heatmaps(Sealed):
    """Heat maps of m detections, one for each of J joints.

    Raises:
        ValueError: a wrong shape, a value that is negative, not finite or far above 1, an origin that is not finite,
            or a stride that is not positive.
    """

    values: NDArray[np.float32]
    """Likelihood of the joint in each cell, (m, J, h, w), float32, from 0 to about 1 at a confident peak."""
    origin: Floats
    """Pixel of the centre of cell (0, 0), x and y, (m, 2)."""
    stride: Floats
    """Pixels between neighbouring cells, in x and y, (m, 2)."""

    def __post_init__(self) -> None:
        values = as_array(self.values, ("m", "J", "h", "w"), "heat map values", np.float32)
        origin = as_array(self.origin, (len(values), 2), "heat map origin")
        stride = as_array(self.stride, (len(values), 2), "heat map stride")
        if not min(values.shape[2:]):
            raise ValueError(f"heat map values must have at least one cell (m, J, h, w), got {values.shape}")
        low, high = values.min(initial=0.0), values.max(initial=0.0)
        if not (low >= 0 and high <= _HIGHEST):
            raise ValueError(
                f"heat map values must lie between 0 and a peak of about 1, got {low:.3g} to {high:.3g}; "
                "clip values that are negative or not finite, and divide by the height of a confident peak"
            )
        if not np.isfinite(origin).all():
            raise ValueError(f"heat map origin must be finite pixels, got {_first_bad(origin, np.isfinite(origin))}")
        if not ((stride > 0) & np.isfinite(stride)).all():
            bad = _first_bad(stride, (stride > 0) & np.isfinite(stride))
            raise ValueError(f"heat map stride must be positive pixels per cell, got {bad}")
        for key, value in (("values", values), ("origin", origin), ("stride", stride)):
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(self.values)

    def sample(self, pixels: ArrayLike) -> Floats:
        """Return heights at image pixels, by bilinear interpolation between cells.

        A map is 0 outside its crop, and falls to 0 over one cell at the border.

        Args:
            pixels: points for every map, (m, J, ..., 2); the height at NaN is 0.

        Returns:
            Heights, (m, J, ...).

        Raises:
            ValueError: a wrong shape.
        """
        pixels = as_points(pixels, 2, "pixels")
        maps = self.values.shape[:2]
        if pixels.ndim < 3 or pixels.shape[:2] != maps:
            raise ValueError(f"pixels must be ({maps[0]}, {maps[1]}, ..., 2), points for every map, got {pixels.shape}")
        flat = np.ascontiguousarray(pixels).reshape(*maps, -1, 2)
        return _sample(self.values, self.origin, self.stride, flat).reshape(pixels.shape[:-1])

    def modes(self, most: int) -> tuple[Floats, Floats]:
        """Return the local maxima of every map at sub-cell accuracy, strongest first.

        A maximum is a cell, or a plateau of equal cells, whose 3 x 3 neighbours are all lower. Parabolas through the
        logarithms of the cell and its neighbours in x and y give position and height; this is exact for an
        axis-aligned Gaussian with a standard deviation of 0.6 cells or more. At the border of the map, where a
        neighbour is unknown, the position is that of the cell. Cells of height 0 are not maxima.

        Args:
            most: greatest number of maxima per map, at least 1.

        Returns:
            Image pixels, (m, J, most, 2), and heights, (m, J, most); NaN and 0 where a map has fewer maxima.

        Raises:
            ValueError: ``most`` is below 1.
        """
        if most < 1:
            raise ValueError(f"most must be at least 1 mode per map, got {most}")
        return _modes(self.values, self.origin, self.stride, int(most))


def _first_bad(values: Floats, good: Bools) -> str:
    index = int(np.flatnonzero(~good.all(axis=1))[0])
    return f"{values[index].tolist()} of detection {index}"


@njit(cache=True)
def height(values, detection, joint, column, row):
    """Return the bilinear interpolation of one map at a position in cells; cells outside are 0. For the kernels."""
    rows, columns = values.shape[2], values.shape[3]
    if not (-1.0 < column < columns and -1.0 < row < rows):
        return 0.0
    left, top = int(np.floor(column)), int(np.floor(row))
    right_share, bottom_share = column - left, row - top
    total = 0.0
    for below in range(2):
        for beside in range(2):
            r, c = top + below, left + beside
            if 0 <= r < rows and 0 <= c < columns:
                share_y = bottom_share if below else 1.0 - bottom_share
                share_x = right_share if beside else 1.0 - right_share
                total += share_x * share_y * values[detection, joint, r, c]
    return total


@njit(cache=True)
def _sample(values, origin, stride, pixels):
    result = np.zeros(pixels.shape[:3])
    for d in range(pixels.shape[0]):
        for j in range(pixels.shape[1]):
            for k in range(pixels.shape[2]):
                column = (pixels[d, j, k, 0] - origin[d, 0]) / stride[d, 0]
                row = (pixels[d, j, k, 1] - origin[d, 1]) / stride[d, 1]
                result[d, j, k] = height(values, d, j, column, row)
    return result


@njit(cache=True)
def _modes(values, origin, stride, most):
    m, joints, rows, columns = values.shape
    pixels, heights = np.full((m, joints, most, 2), np.nan), np.zeros((m, joints, most))
    cells = np.empty(rows * columns, np.int64)  # cells of a plateau
    seen = np.zeros((rows, columns), np.int64)  # last map in which this plateau cell was visited
    for d in range(m):
        for j in range(joints):
            stamp = d * joints + j + 1
            for r in range(rows):
                for c in range(columns):
                    value = values[d, j, r, c]
                    # Nearly every cell is rejected here: it is empty, or on a slope.
                    if value <= 0.0 or (c + 1 < columns and values[d, j, r, c + 1] > value):
                        continue
                    if (c > 0 and values[d, j, r, c - 1] > value) or (r > 0 and values[d, j, r - 1, c] > value):
                        continue
                    if seen[r, c] == stamp:
                        continue
                    size = _summit(values, d, j, r, c, seen, stamp, cells)
                    if size == 0:
                        continue
                    x, y, top = 0.0, 0.0, 0.0
                    for k in range(size):
                        x, y, top = _vertex(values, d, j, cells[k], size, x, y, top)
                    slot = most  # insert among the strongest
                    while slot > 0 and top > heights[d, j, slot - 1]:
                        slot -= 1
                        if slot + 1 < most:
                            heights[d, j, slot + 1] = heights[d, j, slot]
                            pixels[d, j, slot + 1, 0] = pixels[d, j, slot, 0]
                            pixels[d, j, slot + 1, 1] = pixels[d, j, slot, 1]
                    if slot < most:
                        heights[d, j, slot] = top
                        pixels[d, j, slot, 0] = origin[d, 0] + stride[d, 0] * x
                        pixels[d, j, slot, 1] = origin[d, 1] + stride[d, 1] * y
    return pixels, heights


@njit(cache=True)
def _summit(values, d, j, row, column, seen, stamp, cells):
    """Write the plateau of a cell to ``cells`` and return its size, or 0 if a neighbour of the plateau is higher."""
    rows, columns = seen.shape
    level = values[d, j, row, column]
    size, summit = 1, True
    cells[0] = row * columns + column
    k = 0
    while k < size:
        row, column = cells[k] // columns, cells[k] % columns
        k += 1
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                value = values[d, j, r, c]
                if value > level:
                    if size == 1:
                        return 0
                    summit = False
                elif value == level and seen[r, c] != stamp and not (k == 1 and r == row and c == column):
                    if size == 1:
                        seen[row, column] = stamp
                    seen[r, c] = stamp
                    cells[size] = r * columns + c
                    size += 1
    return size if summit else 0


@njit(cache=True)
def _vertex(values, d, j, cell, size, x, y, top):
    """Add a cell to the mean position of the ``size`` cells of a maximum, and update their greatest height.

    On each axis, a parabola through the logarithms of the cell and its two neighbours gives the offset of the maximum
    from the cell and its height.
    """
    rows, columns = values.shape[2], values.shape[3]
    row, column = cell // columns, cell % columns
    peak, rise = values[d, j, row, column], 0.0
    for axis in range(2):
        right, down = 1 - axis, axis
        offset = 0.0
        if down <= row < rows - down and right <= column < columns - right:
            low = np.log(max(values[d, j, row - down, column - right] / peak, _LEAST_SHARE))
            high = np.log(max(values[d, j, row + down, column + right] / peak, _LEAST_SHARE))
            if low + high < 0.0:  # otherwise the cell lies inside a plateau
                offset = 0.5 * (low - high) / (low + high)
                rise += 0.25 * (high - low) * offset
        if axis == 0:
            x += (column + offset) / size
        else:
            y += (row + offset) / size
    return x, y, max(top, peak * np.exp(rise))
