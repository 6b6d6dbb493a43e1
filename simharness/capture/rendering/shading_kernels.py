"""Compiled shading pass of the rasteriser: private, on plain arrays, single-threaded.

Pixels that are new are listed row by row, and shaded ``PIXELS`` at a time. First
:func:`~simharness.capture.rendering.surface_kernels.gather` writes what their surfaces are like (albedo, normal) to
memory. Then the light on them is computed from it, by loops with the same rule for every pixel, which the compiler
vectorises.

Kernels of this package may not reorder sums, contract products or approximate quotients (``fastmath`` names what they
may do): a loop runs in vectors where its arrays are apart in memory, else not, and both must round alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.shadow_maps import ShadowMap, darken
from simharness.capture.rendering.surface_kernels import (
    BLUE,
    GREEN,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    PIXELS,
    RED,
    DrawnPixels,
    FaceArrays,
    PixelRays,
    gather,
    memory,
)

LEAST_COSINE = 0.25
_BRIGHTEST = 4.0
_ZERO, _UNIT = np.float32(0.0), np.float32(1.0)


class DistantLight(NamedTuple):
    """Lighting in closed form as the kernels take it.

    Attributes:
        direction: unit direction to the key light, (3,).
        strengths: strengths of key, sky and fill light, (3,).
        gains: 255 times the factor of the light colour on the albedo, sRGB, (3,).
        P: projection into the shadow maps, (3, 4).
        bias: least lead in inverse depth of what shades a surface that faces the light.
    """

    direction: NDArray[np.float64]
    strengths: NDArray[np.float64]
    gains: NDArray[np.float64]
    P: NDArray[np.float64]
    bias: float


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def shade(
    drawn: DrawnPixels,
    faces: FaceArrays,
    view: PixelRays,
    light: DistantLight,
    maps: tuple[ShadowMap, ShadowMap],
    places: tuple[np.ndarray, np.ndarray],
    first_face: int,
    rgb: np.ndarray,
) -> None:
    """Colour pixels in place, by the rule of :class:`simharness.types.lighting.Lighting` in closed form.

    Args:
        drawn: what the pixels show.
        faces: all faces.
        view: rays of the pixels.
        light: the lighting.
        maps: shadow maps of still meshes, and of the others.
        places: place in the shadow maps of what each pixel shows of still meshes, and its inverse depth from the light,
            see :func:`.shadow_maps.shadow_places`.
        first_face: first face of the meshes that are not still. Only pixels that show them are coloured, and those of
            still meshes on which their shadows may fall.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    triangle, inverse_depth, corners = drawn
    center, rays = view
    light_P, gains, (shadow_place, shadow_depth) = light.P, light.gains, places
    height, width = triangle.shape
    # Shadow map position of a pixel times its inverse depth: away * inverse depth + seen @ (x, y, 1), homogeneous.
    seen, away = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        away[i] = light_P[i, 0] * center[0] + light_P[i, 1] * center[1] + light_P[i, 2] * center[2] + light_P[i, 3]
        for j in range(3):
            for k in range(3):
                seen[i, j] += light_P[i, k] * rays[k, j]
    shaded_from = np.append(maps[1].blocks.ravel(), np.float32(0.0))
    surfaces = memory()
    narrow = surfaces[0]
    # For every pixel: light with and without the key light; position in the shadow map and inverse depth there.
    key_light, other_light = np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    map_x, map_y, near = np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    lit = key_light, other_light, map_x, map_y, near
    gain_red, gain_green, gain_blue = np.float32(gains[0]), np.float32(gains[1]), np.float32(gains[2])
    most = PIXELS + width
    labels, columns, lines = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
    depths, count = np.empty(most, np.float32), 0
    for y in range(height + 1):
        if y < height:
            begin = count
            for x in range(width):
                columns[np.uint32(count)] = x
                count += (triangle[y, x] >= first_face) | (shaded_from[shadow_place[y, x]] > shadow_depth[y, x])
            for n in range(begin, count):
                labels[n], lines[n], depths[n] = triangle[y, columns[n]], y, inverse_depth[y, columns[n]]
        done = 0
        while done + PIXELS <= count or (y == height and done < count):
            size = min(count - done, PIXELS)
            chunk = slice(done, done + size)
            pixels = labels[chunk], columns[chunk], lines[chunk]
            gather(pixels, corners, faces, surfaces)
            _light(pixels, depths[chunk], narrow, rays, light, (seen, away), lit)
            darken(key_light[:size], map_x[:size], map_y[:size], near[:size], maps[0], maps[1])
            for n in range(PIXELS):
                bright = np.float32(math.sqrt(min(other_light[n] + key_light[n], np.float32(_BRIGHTEST))))
                for k, gain in ((RED, gain_red), (GREEN, gain_green), (BLUE, gain_blue)):
                    narrow[k + n] = min(bright * (gain * narrow[k + n]) + np.float32(0.5), np.float32(255.0))
            for n in range(size):
                y_n, x_n = lines[done + n], columns[done + n]
                rgb[y_n, x_n, 0] = np.uint8(narrow[RED + n])
                rgb[y_n, x_n, 1] = np.uint8(narrow[GREEN + n])
                rgb[y_n, x_n, 2] = np.uint8(narrow[BLUE + n])
            done += size
        for n in range(count - done):
            labels[n], columns[n], lines[n] = labels[done + n], columns[done + n], lines[done + n]
            depths[n] = depths[done + n]
        count -= done


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _light(
    pixels: tuple[np.ndarray, ...],
    inverse_depth: np.ndarray,
    narrow: np.ndarray,
    rays: np.ndarray,
    light: DistantLight,
    to_map: tuple[np.ndarray, np.ndarray],
    lit: tuple[np.ndarray, ...],
) -> None:
    """Compute the light on pixels, without shadows, and their place in the shadow maps.

    Args:
        pixels: see :func:`.surface_kernels.gather`.
        inverse_depth: inverse depth of the pixels, (n,).
        narrow: surfaces of the pixels, see :func:`.surface_kernels.gather`.
        rays: matrix that turns pixels into rays, (3, 3).
        light: the lighting.
        to_map: matrix ``seen``, (3, 3), and vector ``away``, (3,), such that ``away * inverse depth + seen @ (x, y,
            1)`` is the place in the shadow map.
        lit: written, (``PIXELS``,) each: key light; sky and fill light; column and row in the shadow maps; inverse
            depth from the light less the bias.
    """
    columns, rows = pixels[1], pixels[2]
    key_light, other_light, map_x, map_y, near = lit
    seen, away = to_map
    direction, strengths = light.direction, light.strengths
    key, fill = np.float32(strengths[0]), np.float32(strengths[2])
    sky_all, sky_up = np.float32(0.65 * strengths[1]), np.float32(0.35 * strengths[1])
    light_x, light_y, light_z = np.float32(direction[0]), np.float32(direction[1]), np.float32(direction[2])
    slope_bias, least_cosine = np.float32(light.bias), np.float32(LEAST_COSINE)
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    seen_x, seen_y, seen_w = np.float32(seen[0, 0]), np.float32(seen[1, 0]), np.float32(seen[2, 0])
    away_x, away_y, away_w = np.float32(away[0]), np.float32(away[1]), np.float32(away[2])
    for n in range(len(columns)):
        place, y, w = np.float32(columns[n]), np.float64(rows[n]), inverse_depth[n]
        ray_x = np.float32(rays[0, 1] * y + rays[0, 2])
        ray_y = np.float32(rays[1, 1] * y + rays[1, 2])
        ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
        nx, ny, nz = narrow[NORMAL_X + n], narrow[NORMAL_Y + n], narrow[NORMAL_Z + n]
        cosine = nx * light_x + ny * light_y + nz * light_z
        # The ray to the pixel is slightly longer than 1; the error is negligible.
        glance = nx * (rise_x * place + ray_x) + ny * (rise_y * place + ray_y) + nz * (rise_z * place + ray_z)
        key_light[n] = key * max(cosine, _ZERO)
        other_light[n] = sky_up * nz + sky_all + fill * min(max(-glance, _ZERO), _UNIT)
        from_x = np.float32(seen[0, 1] * y + seen[0, 2])
        from_y = np.float32(seen[1, 1] * y + seen[1, 2])
        from_w = np.float32(seen[2, 1] * y + seen[2, 2])
        scale = _UNIT / (away_w * w + (seen_w * place + from_w))
        map_x[n] = (away_x * w + (seen_x * place + from_x)) * scale - _UNIT
        map_y[n] = (away_y * w + (seen_y * place + from_y)) * scale - _UNIT
        near[n] = w * scale + slope_bias / max(cosine, least_cosine)
