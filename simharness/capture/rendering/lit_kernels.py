"""Compiled shading of scenes with light sources: private, on plain arrays, single-threaded.

The light on a surface is interpolated between its samples (:mod:`simharness.capture.rendering.light_samples`), and a
picture shows it times the linear albedo through a tone curve.
"""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.shading_kernels import STRIDE, gather

_ZERO = np.float32(0.0)
# Linear value of sRGB s: s (s (s a + b) + c), within 0.2 % of white of IEC 61966-2-1.
_CUBE, _SQUARE, _PLAIN = np.float32(0.305306011), np.float32(0.682171111), np.float32(0.012522878)


@njit(cache=True, error_model="numpy", fastmath=True)
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
    albedo, normal = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
    received = np.empty((3, width), np.float32)
    edge, across = np.zeros((3, 3)), np.zeros((3, 3))
    steps, mixed = np.empty((2, STRIDE), np.int32), np.empty(STRIDE, np.uint64)
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
                pyramids, rays, edge, across, steps, mixed, albedo, normal,
            )  # fmt: skip
            _received(line, y, first, last, q, faces, emission, light, corner_samples, divisions, first_face, received)
            for k in range(3):
                dyes, lights = albedo[k], received[k]
                for x in range(first, last):
                    dye = dyes[x]
                    value = lights[x] * (dye * (dye * (dye * _CUBE + _SQUARE) + _PLAIN))
                    dyes[x] = min(np.float32(math.sqrt(scale * max(value, _ZERO))), top)
            for x in range(first, last):
                for k in range(3):
                    rgb[y, x, k] = curve[np.int32(albedo[k, x] + np.float32(0.5))]


@njit(cache=True, error_model="numpy", fastmath=True)
def _received(
    triangle: np.ndarray,
    y: int,
    first: int,
    last: int,
    q: np.ndarray,
    faces: np.ndarray,
    emission: np.ndarray,
    light: np.ndarray,
    corner_samples: np.ndarray,
    divisions: np.ndarray,
    first_face: int,
    received: np.ndarray,
) -> None:
    """Write the light on the pixels ``first`` to before ``last`` of a row, (3, w); arguments as :func:`shade_lit`."""
    red, green, blue = received[0], received[1], received[2]
    end = first
    while end < last:
        start, label = end, triangle[end]
        end += 1
        while end < last and triangle[end] == label:
            end += 1
        f = label - first_face
        a, b, c = faces[label, 0], faces[label, 1], faces[label, 2]
        ax, ay, az, bx, by, bz = q[a, 0], q[a, 1], q[a, 2], q[b, 0], q[b, 1], q[b, 2]
        cx, cy, cz = q[c, 0], q[c, 1], q[c, 2]
        # Weights of the corners, up to a common factor, at the first pixel and their change along the row.
        turn_a, turn_b, turn_c = by * cz - bz * cy, cy * az - cz * ay, ay * bz - az * by
        wa = turn_a * start + (bz * cx - bx * cz) * y + (bx * cy - by * cx)
        wb = turn_b * start + (cz * ax - cx * az) * y + (cx * ay - cy * ax)
        wc = turn_c * start + (az * bx - ax * bz) * y + (ax * by - ay * bx)
        total, turn = wa + wb + wc, turn_a + turn_b + turn_c
        glow_red, glow_green, glow_blue = emission[f, 0], emission[f, 1], emission[f, 2]
        n = divisions[f]
        i, j, k = corner_samples[f, 0], corner_samples[f, 1], corner_samples[f, 2]
        if n <= 1:
            for x in range(start, end):
                scale = 1.0 / total
                va, vb, vc = np.float32(wa * scale), np.float32(wb * scale), np.float32(wc * scale)
                red[x] = va * light[i, 0] + vb * light[j, 0] + vc * light[k, 0] + glow_red
                green[x] = va * light[i, 1] + vb * light[j, 1] + vc * light[k, 1] + glow_green
                blue[x] = va * light[i, 2] + vb * light[j, 2] + vc * light[k, 2] + glow_blue
                wa, wb, wc, total = wa + turn_a, wb + turn_b, wc + turn_c, total + turn
            continue
        for x in range(start, end):
            scale = n / total
            u, v = min(max(wb * scale, 0.0), 1.0 * n), min(max(wc * scale, 0.0), 1.0 * n)
            row = min(int(u), n - 1)
            column = min(int(v), n - 1 - row)
            u, v = np.float32(u - row), np.float32(v - column)
            here = i + row * (n + 1) - row * (row - 1) // 2 + column
            below = here + n + 1 - row  # the next row of the lattice
            one, two, three = here, below, here + 1
            va, vb, vc = np.float32(1.0) - u - v, u, v
            if va < 0 and row + column < n - 1:
                one, va, vb, vc = below + 1, -va, np.float32(1.0) - v, np.float32(1.0) - u
            red[x] = va * light[one, 0] + vb * light[two, 0] + vc * light[three, 0] + glow_red
            green[x] = va * light[one, 1] + vb * light[two, 1] + vc * light[three, 1] + glow_green
            blue[x] = va * light[one, 2] + vb * light[two, 2] + vc * light[three, 2] + glow_blue
            wb, wc, total = wb + turn_b, wc + turn_c, total + turn


@njit(cache=True, error_model="numpy", fastmath=True)
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
        fine: share of the light that is left on the floor, see :class:`.lit_scene.ShadowLayers`, (rows, columns).
        coarse: the same at several heights, (heights, rows / 2, columns / 2).
        heights: these heights, (heights,).
        touched: blocks in which anything is dark, the last is always False, (blocks + 1,).
        dimming: see :func:`.tone.dimming`.
        rgb: picture to change, (h, w, 3) uint8.
    """
    height, width = triangle.shape
    steps = np.float64(len(dimming) - 1)
    per_cell, levels = 1.0 / cell, len(heights)
    x0, y0 = origin[0], origin[1]
    for y in range(height):
        ray_x, ray_y = rays[0, 1] * y + rays[0, 2], rays[1, 1] * y + rays[1, 2]
        ray_z = rays[2, 1] * y + rays[2, 2]
        for x in range(width):
            if not touched[place[y, x]] or triangle[y, x] >= first_face or triangle[y, x] < 0:
                continue
            far = 1.0 / inverse_depth[y, x]
            pz = center[2] + far * (rays[2, 0] * x + ray_z)
            u = (center[0] + far * (rays[0, 0] * x + ray_x) - x0) * per_cell
            v = (center[1] + far * (rays[1, 0] * x + ray_y) - y0) * per_cell
            if pz < 0.02:
                left = _between(fine, u - 0.5, v - 0.5) * _between(coarse[0], 0.5 * u - 0.5, 0.5 * v - 0.5)
            else:
                level = 0
                while level < levels - 2 and pz > heights[level + 1]:
                    level += 1
                share = min(max((pz - heights[level]) / (heights[level + 1] - heights[level]), 0.0), 1.0)
                u, v = 0.5 * u - 0.5, 0.5 * v - 0.5
                left = (1.0 - share) * _between(coarse[level], u, v) + share * _between(coarse[level + 1], u, v)
            row = int(left * steps + 0.5)
            for k in range(3):
                rgb[y, x, k] = dimming[row, rgb[y, x, k]]


@njit(cache=True, error_model="numpy", fastmath=True)
def _between(grid: np.ndarray, u: float, v: float) -> float:
    """Return the value of a grid at column u and row v, by bilinear interpolation."""
    u, v = min(max(u, 0.0), grid.shape[1] - 1.001), min(max(v, 0.0), grid.shape[0] - 1.001)
    i, j = int(u), int(v)
    u, v = u - i, v - j
    upper = (1.0 - u) * grid[j, i] + u * grid[j, i + 1]
    return (1.0 - v) * upper + v * ((1.0 - u) * grid[j + 1, i] + u * grid[j + 1, i + 1])


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
