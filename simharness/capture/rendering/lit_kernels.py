"""Compiled shading of scenes with light sources: private, on plain arrays, single-threaded.

The light on a surface is interpolated between its samples (:mod:`simharness.capture.rendering.light_samples`), and a
picture shows it times the linear albedo through a tone curve.
"""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.surface_kernels import BLUE, GREEN, PIXELS, RED, SECOND, THIRD, gather, memory

_ZERO, _UNIT = np.float32(0.0), np.float32(1.0)
_TO_SECOND, _TO_THIRD, _SHARES, _RECEIVED = (PIXELS * row for row in (3, 6, 9, 11))  # rows of light on pixels
_FLOOR = np.float32(0.02)  # metres: what is lower is the floor
# Linear value of sRGB s: s (s (s a + b) + c), within 0.2 % of white of IEC 61966-2-1.
_CUBE, _SQUARE, _PLAIN = np.float32(0.305306011), np.float32(0.682171111), np.float32(0.012522878)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def shade_lit(
    triangle: np.ndarray,
    q: np.ndarray,
    faces: np.ndarray,
    colors: np.ndarray,
    smooth: np.ndarray,
    face_normals: np.ndarray,
    vertex_normals: np.ndarray,
    texture: np.ndarray,
    uv: np.ndarray,
    texels: np.ndarray,
    pyramids: np.ndarray,
    rays: np.ndarray,
    emission: np.ndarray,
    light: np.ndarray,
    corner_samples: np.ndarray,
    divisions: np.ndarray,
    first_face: int,
    curve: np.ndarray,
    brightest: float,
    rgb: np.ndarray,
) -> None:
    """Colour the pixels that show faces from ``first_face`` on, in place.

    Args:
        triangle: see :func:`.shading_kernels.shade`, as all arguments up to ``rays``.
        q: homogeneous pixel coordinates of the vertices.
        faces: vertex indices.
        colors: sRGB albedo.
        smooth: whether to interpolate vertex normals.
        face_normals: unit normals of the faces.
        vertex_normals: unit normals of the vertices.
        texture: index of each face's texture.
        uv: texture coordinates of the corners.
        texels: texels of all textures.
        pyramids: levels of all textures.
        rays: rays of the pixels.
        emission: radiance of the faces from ``first_face`` on, times which the albedo is shown, (m, 3).
        light: irradiance at the light samples, (n, 3) float32.
        corner_samples: samples of the faces from ``first_face`` on, (m, 3); see :class:`.light_samples.LightSamples`.
        divisions: divisions of these faces, (m,).
        first_face: first face to colour.
        curve: tone curve, see :func:`.tone.table`.
        brightest: light of its last entry.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    height, width = triangle.shape
    narrow, wide, whole, level = memory()
    received, index = np.zeros(_RECEIVED, np.float32), np.zeros(3 * PIXELS, np.uint32)
    most = PIXELS + width
    labels, columns, lines = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
    top = np.float32(len(curve) - 1)
    scale, count = np.float32(top * top / brightest), 0
    for y in range(height + 1):
        if y < height:
            begin = count
            for x in range(width):
                columns[np.uint32(count)] = x
                count += triangle[y, x] >= first_face
            for n in range(begin, count):
                labels[n], lines[n] = triangle[y, columns[n]], y
        done = 0
        while done + PIXELS <= count or (y == height and done < count):
            size = min(count - done, PIXELS)
            chunk = slice(done, done + size)
            gather(
                labels[chunk], columns[chunk], lines[chunk], q, faces, colors, smooth, face_normals, vertex_normals,
                texture, uv, texels, pyramids, narrow, wide, whole, level,
            )  # fmt: skip
            _receive(labels[chunk], narrow, emission, light, corner_samples, divisions, first_face, received)
            for n in range(3 * PIXELS):
                dye = narrow[RED + n]
                value = received[n] * (dye * (dye * (dye * _CUBE + _SQUARE) + _PLAIN))
                step = min(np.float32(math.sqrt(scale * max(value, _ZERO))), top)
                index[n] = np.uint32(np.int32(step + np.float32(0.5)))
            for n in range(size):
                row, column = lines[done + n], columns[done + n]
                rgb[row, column, 0] = curve[index[RED + n]]
                rgb[row, column, 1] = curve[index[GREEN + n]]
                rgb[row, column, 2] = curve[index[BLUE + n]]
            done += size
        for n in range(count - done):
            labels[n], columns[n], lines[n] = labels[done + n], columns[done + n], lines[done + n]
        count -= done


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _receive(
    labels: np.ndarray,
    narrow: np.ndarray,
    emission: np.ndarray,
    light: np.ndarray,
    corner_samples: np.ndarray,
    divisions: np.ndarray,
    first_face: int,
    received: np.ndarray,
) -> None:
    """Write the light on pixels to the first three rows of ``received``; arguments as :func:`shade_lit`.

    ``labels`` are the visible faces, (n,), and ``narrow`` has the weights of their corners, see
    :func:`.surface_kernels.gather`. The light is interpolated between three samples: those of the corners, or of a
    small triangle of the lattice of samples.
    """
    for n in range(len(labels)):
        f = np.uint32(labels[n] - first_face)
        i, j, k, divided = corner_samples[f, 0], corner_samples[f, 1], corner_samples[f, 2], divisions[f]
        second, third = narrow[SECOND + n], narrow[THIRD + n]
        if divided > 1:
            i, j, k, second, third = _on_lattice(i, divided, second, third)
        a, b, c = np.uint32(i), np.uint32(j), np.uint32(k)
        received[_SHARES + n], received[_SHARES + PIXELS + n] = second, third
        for color in range(3):
            one, row = light[a, color], color * PIXELS + n
            received[row] = one + emission[f, color]
            received[_TO_SECOND + row], received[_TO_THIRD + row] = light[b, color] - one, light[c, color] - one
    for row in range(0, 3 * PIXELS, PIXELS):
        for n in range(PIXELS):
            second, third = received[_SHARES + n], received[_SHARES + PIXELS + n]
            to_second, to_third = received[_TO_SECOND + row + n], received[_TO_THIRD + row + n]
            received[row + n] = received[row + n] + second * to_second + third * to_third


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _on_lattice(
    first: int, divisions: int, second: np.float32, third: np.float32
) -> tuple[int, int, int, np.float32, np.float32]:
    """Return the three samples around a place, and the weights of the second and the third.

    Args:
        first: first sample of the lattice of a face, see :class:`.light_samples.LightSamples`.
        divisions: its divisions.
        second: weight of the second corner of the face.
        third: weight of the third corner.
    """
    size = np.float32(divisions)
    u, v = min(max(size * second, _ZERO), size), min(max(size * third, _ZERO), size)
    row = min(int(u), divisions - 1)
    column = min(int(v), divisions - 1 - row)
    u, v = u - np.float32(row), v - np.float32(column)
    here = first + row * (divisions + 1) - row * (row - 1) // 2 + column
    below = here + divisions + 1 - row  # the next row of the lattice
    if _UNIT - u - v < 0 and row + column < divisions - 1:
        return below + 1, below, here + 1, _UNIT - v, _UNIT - u
    return here, below, here + 1, u, v


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def dim(
    triangle: np.ndarray,
    inverse_depth: np.ndarray,
    first_face: int,
    place: np.ndarray,
    center: np.ndarray,
    rays: np.ndarray,
    origin: np.ndarray,
    cell: float,
    fine: np.ndarray,
    coarse: np.ndarray,
    heights: np.ndarray,
    touched: np.ndarray,
    dimming: np.ndarray,
    rgb: np.ndarray,
) -> None:
    """Darken the pixels of still meshes that moving ones shade, in place.

    Args:
        triangle: visible face or -1, (h, w) int32.
        inverse_depth: inverse depth, 1/m, (h, w) float32.
        first_face: first face of the moving meshes.
        place: block of the map that each pixel of a still mesh lies over, see :func:`blocks_below`.
        center: camera centre in the world, (3,).
        rays: see :func:`.shading_kernels.shade`.
        origin: x and y of the corner of the map, (2,).
        cell: size of a cell of ``fine``; a cell of ``coarse`` is twice as large.
        fine: share of the light that is left on the floor, (rows, columns) float32.
        coarse: the same at several heights, (heights, rows / 2, columns / 2) float32.
        heights: these heights, (heights,) float32.
        touched: blocks in which anything is dark, the last is always False, (blocks + 1,).
        dimming: see :func:`.tone.dimming`.
        rgb: picture to change, (h, w, 3) uint8.
    """
    height, width = triangle.shape
    steps = np.float32(len(dimming) - 1)
    per_cell, levels = np.float32(1.0 / cell), len(heights)
    place_x, place_y, place_z = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    from_x, from_y = np.float32(center[0] - origin[0]), np.float32(center[1] - origin[1])
    from_z, half = np.float32(center[2]), np.float32(0.5)
    for y in range(height):
        places, faces, depths = place[y], triangle[y], inverse_depth[y]
        ray_x, ray_y = np.float32(rays[0, 1] * y + rays[0, 2]), np.float32(rays[1, 1] * y + rays[1, 2])
        ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
        end = 0
        while end < width:
            start = end
            while start < width and not touched[places[start]]:
                start += 1
            end = start
            while end < width and touched[places[end]]:
                end += 1
            for x in range(start, end):
                far, column = _UNIT / depths[x], np.float32(x)
                place_x[x] = (from_x + far * (rise_x * column + ray_x)) * per_cell
                place_y[x] = (from_y + far * (rise_y * column + ray_y)) * per_cell
                place_z[x] = from_z + far * (rise_z * column + ray_z)
            for x in range(start, end):
                if faces[x] >= first_face:
                    continue
                u, v, z = place_x[x], place_y[x], place_z[x]
                if z < _FLOOR:
                    left = _between(fine, u - half, v - half)
                else:
                    level = 0
                    while level < levels - 2 and z > heights[level + 1]:
                        level += 1
                    share = (z - heights[level]) / (heights[level + 1] - heights[level])
                    share = min(max(share, _ZERO), _UNIT)
                    u, v = half * u - half, half * v - half
                    left = _between(coarse[level], u, v)
                    left += share * (_between(coarse[level + 1], u, v) - left)
                row = np.int32(left * steps + half)
                if row < len(dimming) - 1:
                    for k in range(3):
                        rgb[y, x, k] = dimming[row, rgb[y, x, k]]


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _between(grid: np.ndarray, u: np.float32, v: np.float32) -> np.float32:
    """Return the value of a grid at column u and row v, by bilinear interpolation."""
    u, v = min(max(u, _ZERO), np.float32(grid.shape[1] - 1.001)), min(max(v, _ZERO), np.float32(grid.shape[0] - 1.001))
    i, j = np.uint32(u), np.uint32(v)
    u, v = u - np.float32(i), v - np.float32(j)
    below = j + np.uint32(1)
    one, two = grid[j, i], grid[below, i]
    one += u * (grid[j, i + np.uint32(1)] - one)
    two += u * (grid[below, i + np.uint32(1)] - two)
    return one + v * (two - one)


@njit(cache=True, error_model="numpy")
def blocks_below(
    triangle: np.ndarray,
    inverse_depth: np.ndarray,
    center: np.ndarray,
    rays: np.ndarray,
    origin: np.ndarray,
    block: float,
    rows: int,
    columns: int,
    highest: float,
) -> np.ndarray:
    """Return the block of a map of the floor that each pixel lies over, (h, w) uint16; the last index for none.

    Args:
        triangle: visible face or -1, (h, w) int32.
        inverse_depth: inverse depth, 1/m, (h, w) float32.
        center: camera centre in the world, (3,).
        rays: see :func:`.shading_kernels.shade`.
        origin: x and y of the corner of the map, (2,).
        block: side of a block, metres.
        rows: number of blocks along y.
        columns: number of blocks along x.
        highest: height above which nothing is shaded, metres.
    """
    height, width = triangle.shape
    place = np.full((height, width), rows * columns, np.uint16)
    for y in range(height):
        for x in range(width):
            if triangle[y, x] < 0:
                continue
            far = 1.0 / inverse_depth[y, x]
            u = (center[0] + far * (rays[0, 0] * x + rays[0, 1] * y + rays[0, 2]) - origin[0]) / block
            v = (center[1] + far * (rays[1, 0] * x + rays[1, 1] * y + rays[1, 2]) - origin[1]) / block
            if center[2] + far * (rays[2, 0] * x + rays[2, 1] * y + rays[2, 2]) > highest:
                continue
            # The walls lie on the border of the map.
            i, j = (
                math.floor(u - 1e-3 if u > 0.5 * columns else u + 1e-3),
                math.floor(v - 1e-3 if v > 0.5 * rows else v + 1e-3),
            )
            if 0 <= i < columns and 0 <= j < rows:
                place[y, x] = j * columns + i
    return place
