"""Compiled shading of scenes with light sources: private, on plain arrays, single-threaded.

The light on a surface is interpolated between its samples (:mod:`simharness.capture.rendering.light_samples`), and a
picture shows it times the linear albedo through a tone curve.
"""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.finish_kernels import finish
from simharness.capture.rendering.shading_kernels import STRIDE, gather

_ZERO, _UNIT = np.float32(0.0), np.float32(1.0)
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
    first_vertex: int,
    material: np.ndarray,
    figure: np.ndarray,
    lights: np.ndarray,
    pixel: np.ndarray,
    grain: np.ndarray,
    place: np.ndarray,
    around: float,
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
        first_vertex: first vertex of the faces to colour.
        material: see :func:`.finish_kernels.finish`, as all arguments up to ``around``; empty: all is matte.
        figure: mesh of these faces.
        lights: light around the meshes.
        pixel: size of a pixel at each mesh.
        grain: grain of the vertices.
        place: place in the pattern of the grain.
        around: period of the pattern of hair.
        curve: tone curve, see :func:`.tone.table`.
        brightest: light of its last entry.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    height, width = triangle.shape
    albedo, normal = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
    received, weights = np.empty((3, width), np.float32), np.empty((2, width), np.float32)
    index, edge, across = np.empty((3, width), np.int32), np.zeros((3, 3)), np.zeros((3, 3))
    steps, mixed = np.empty((2, STRIDE), np.int32), np.empty(STRIDE, np.uint64)
    gloss, work = np.zeros(width, np.float32), np.zeros((5, width), np.float32)
    top = np.float32(len(curve) - 1)
    scale = np.float32(top * top / brightest)
    for y in range(height):
        line = triangle[y]
        last = 0
        while last < width:
            first = last
            while first < width and line[first] < first_face:
                first += 1
            last = first
            while last < width and line[last] >= first_face:
                last += 1
            if first == last:
                continue
            gather(
                line, y, first, last, q, faces, colors, smooth, face_normals, vertex_normals, texture, uv, texels,
                pyramids, rays, edge, across, steps, mixed, albedo, normal, weights,
            )  # fmt: skip
            _received(line, first, last, weights, emission, light, corner_samples, divisions, first_face, received)
            if len(material):
                finish(
                    line, y, first, last, first_face, faces, first_vertex, rays, normal, weights, material, figure,
                    lights, pixel, grain, place, around, work, received, gloss,
                )  # fmt: skip
            for k in range(3):
                dyes, brought, indices = albedo[k], received[k], index[k]
                for x in range(first, last):
                    dye = dyes[x]
                    value = brought[x] * (dye * (dye * (dye * _CUBE + _SQUARE) + _PLAIN) + gloss[x])
                    indices[x] = np.int32(min(np.float32(math.sqrt(scale * max(value, _ZERO))), top) + np.float32(0.5))
            red, green, blue = index[0], index[1], index[2]
            for x in range(first, last):
                rgb[y, x, 0] = curve[np.uint32(red[x])]
                rgb[y, x, 1] = curve[np.uint32(green[x])]
                rgb[y, x, 2] = curve[np.uint32(blue[x])]


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _received(
    triangle: np.ndarray,
    first: int,
    last: int,
    weights: np.ndarray,
    emission: np.ndarray,
    light: np.ndarray,
    corner_samples: np.ndarray,
    divisions: np.ndarray,
    first_face: int,
    received: np.ndarray,
) -> None:
    """Write the light on the pixels ``first`` to before ``last`` of a row, (3, w); arguments as :func:`shade_lit`.

    ``weights`` are those of the second and third corner of the triangle, (2, w).
    """
    red, green, blue, second, third = received[0], received[1], received[2], weights[0], weights[1]
    end = first
    while end < last:
        start, label = end, triangle[end]
        end += 1
        f = np.uint32(label - first_face)
        glow_red, glow_green, glow_blue = emission[f, 0], emission[f, 1], emission[f, 2]
        n = divisions[f]
        i, j, k = corner_samples[f, 0], corner_samples[f, 1], corner_samples[f, 2]
        if n <= 1:
            a, b, c = np.uint32(i), np.uint32(j), np.uint32(k)
            red_a, green_a, blue_a = light[a, 0] + glow_red, light[a, 1] + glow_green, light[a, 2] + glow_blue
            red_b, green_b, blue_b = light[b, 0] - light[a, 0], light[b, 1] - light[a, 1], light[b, 2] - light[a, 2]
            red_c, green_c, blue_c = light[c, 0] - light[a, 0], light[c, 1] - light[a, 1], light[c, 2] - light[a, 2]
            end = start
            while end < last and triangle[end] == label:
                vb, vc = second[end], third[end]
                red[end] = red_a + vb * red_b + vc * red_c
                green[end] = green_a + vb * green_b + vc * green_c
                blue[end] = blue_a + vb * blue_b + vc * blue_c
                end += 1
            continue
        while end < last and triangle[end] == label:
            end += 1
        size = np.float32(n)
        for x in range(start, end):
            u, v = min(max(size * second[x], _ZERO), size), min(max(size * third[x], _ZERO), size)
            row = min(int(u), n - 1)
            column = min(int(v), n - 1 - row)
            u, v = u - np.float32(row), v - np.float32(column)
            here = i + row * (n + 1) - row * (row - 1) // 2 + column
            below = here + n + 1 - row  # the next row of the lattice
            one, two, three = here, below, here + 1
            va, vb, vc = _UNIT - u - v, u, v
            if va < 0 and row + column < n - 1:
                one, va, vb, vc = below + 1, -va, _UNIT - v, _UNIT - u
            red[x] = va * light[one, 0] + vb * light[two, 0] + vc * light[three, 0] + glow_red
            green[x] = va * light[one, 1] + vb * light[two, 1] + vc * light[three, 1] + glow_green
            blue[x] = va * light[one, 2] + vb * light[two, 2] + vc * light[three, 2] + glow_blue


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
