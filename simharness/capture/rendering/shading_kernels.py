"""Compiled shading of pixels, in the two light models of :class:`simharness.types.lighting.Lighting`.

Pixels that are new are shaded ``PIXELS`` at a time. First
:func:`~simharness.capture.rendering.surface_kernels.gather` writes what their surfaces are like (albedo, normal) to
memory. Then the light on them is computed from it, by loops with the same rule for every pixel, which the compiler
vectorises.

- :func:`shade` has a distant key light with shadow maps, an even sky and a fill light, in closed form. It needs the
  faces alone, so any meshes can be shaded at once: bodies without a room, scenes without lamps. OpenGL computes the
  same, which verifies the rasteriser (:mod:`simharness.capture.rendering.gl`).
- :func:`shade_lit` shows the light of lamps, windows, sun and sky, times the linear albedo, through a tone curve. The
  light is computed once for the still meshes of a room, before their first picture, and interpolated
  between its samples (:mod:`simharness.capture.rendering.light_samples`).

Kernels of this package may not reorder sums, contract products or approximate quotients (``fastmath`` names what they
may do): a loop runs in vectors where its arrays are apart in memory, else not, and both must round alike.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.finish_kernels import FINISHING, GLOSS, FinishArrays, finish
from simharness.capture.rendering.shadow_maps import ShadowMap, darken
from simharness.capture.rendering.surface_kernels import (
    BLUE,
    GREEN,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    PIXELS,
    RED,
    SECOND,
    THIRD,
    DrawnPixels,
    FaceArrays,
    PixelRays,
    gather,
    memory,
)
from simharness.capture.rendering.tone import BRIGHTEST

LEAST_COSINE = 0.25
_BRIGHTEST = 4.0
_ZERO, _UNIT = np.float32(0.0), np.float32(1.0)
_TO_SECOND, _TO_THIRD, _SHARES, _RECEIVED = (PIXELS * row for row in (3, 6, 9, 11))  # rows of light on pixels
# Linear value of sRGB s: s (s (s a + b) + c), within 0.2 % of white of IEC 61966-2-1.
_CUBE, _SQUARE, _PLAIN = np.float32(0.305306011), np.float32(0.682171111), np.float32(0.012522878)


class DistantLight(NamedTuple):
    """Lighting in closed form as the kernels take it."""

    direction: NDArray[np.float64]
    """Unit direction to the key light, (3,)."""
    strengths: NDArray[np.float64]
    """Strengths of key, sky and fill light, (3,)."""
    gains: NDArray[np.float64]
    """255 times the factor of the light colour on the albedo, sRGB, (3,)."""
    projection: NDArray[np.float64]
    """Projection into the shadow maps, (3, 4)."""
    bias: float
    """Least lead in inverse depth of what shades a surface that faces the light."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def shade(
    pixels: tuple[np.ndarray, ...],
    drawn: DrawnPixels,
    faces: FaceArrays,
    view: PixelRays,
    light: DistantLight,
    maps: tuple[ShadowMap, ShadowMap],
    rgb: np.ndarray,
) -> None:
    """Colour pixels in place, by the rule of :class:`simharness.types.lighting.Lighting` in closed form.

    Args:
        pixels: the pixels to colour, see :meth:`.surface_kernels.DrawnPixels.shown`.
        drawn: what all pixels show.
        faces: all faces.
        view: rays of the pixels.
        light: the lighting.
        maps: shadow maps of still meshes, and of the others.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    labels, columns, lines = pixels
    center, rays = view
    light_P, gains = light.projection, light.gains
    # Shadow map position of a pixel times its inverse depth: away * inverse depth + seen @ (x, y, 1), homogeneous.
    seen, away = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        away[i] = light_P[i, 0] * center[0] + light_P[i, 1] * center[1] + light_P[i, 2] * center[2] + light_P[i, 3]
        for j in range(3):
            for k in range(3):
                seen[i, j] += light_P[i, k] * rays[k, j]
    surfaces = memory()
    narrow = surfaces[0]
    # For every pixel: light with and without the key light; position in the shadow map and inverse depth there.
    key_light, other_light = np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    map_x, map_y, near = np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    lit = key_light, other_light, map_x, map_y, near
    gain_red, gain_green, gain_blue = np.float32(gains[0]), np.float32(gains[1]), np.float32(gains[2])
    depths = np.empty(PIXELS, np.float32)
    for done in range(0, len(labels), PIXELS):
        chunk = slice(done, min(done + PIXELS, len(labels)))
        some = labels[chunk], columns[chunk], lines[chunk]
        size = len(some[0])
        for n in range(size):
            depths[n] = drawn.inverse_depth[lines[done + n], columns[done + n]]
        gather(some, drawn.corners, faces, surfaces)
        _light(some, depths[:size], narrow, rays, light, (seen, away), lit)
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


class FaceLight(NamedTuple):
    """Light that some faces of a scene get and give."""

    emission: NDArray[np.float32]
    """Radiance of the faces, times which the albedo is shown, (m, 3)."""
    exposure: NDArray[np.float32]
    """Factor on it, (3,) float32."""
    light: NDArray[np.float32]
    """Irradiance at the light samples, (n, 3) float32."""
    corner_samples: NDArray[np.int32]
    """Samples of the faces, (m, 3); see :class:`.light_samples.LightSamples`."""
    divisions: NDArray[np.int32]
    """Divisions of the faces, (m,)."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def shade_lit(
    pixels: tuple[np.ndarray, ...],
    corners: np.ndarray,
    faces: FaceArrays,
    rays: np.ndarray,
    light: FaceLight,
    first: tuple[int, int],
    finishes: FinishArrays,
    curve: np.ndarray,
    rgb: np.ndarray,
) -> None:
    """Colour the pixels that show some faces, in place.

    Args:
        pixels: the pixels that show them, see :meth:`.surface_kernels.DrawnPixels.shown`.
        corners: homogeneous pixel coordinates of all vertices, (n, 3).
        faces: all faces.
        rays: matrix that turns pixels into rays, (3, 3).
        light: light of the faces to colour.
        first: first face to colour, all that follow are coloured, and first vertex of these faces.
        finishes: finishes of these faces.
        curve: tone curve, see :func:`.tone.table`.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    labels, columns, lines = pixels
    surfaces = memory()
    narrow = surfaces[0]
    received, index = np.zeros(_RECEIVED, np.float32), np.zeros(3 * PIXELS, np.uint32)
    work = np.zeros(FINISHING, np.float32)
    top = np.float32(len(curve) - 1)
    scale = np.float32(top * top / BRIGHTEST)
    for done in range(0, len(labels), PIXELS):
        chunk = slice(done, min(done + PIXELS, len(labels)))
        some = labels[chunk], columns[chunk], lines[chunk]
        gather(some, corners, faces, surfaces)
        _receive(labels[chunk], narrow, light, first[0], received)
        if len(finishes.material):
            finish(some, first, faces.faces, rays, narrow, finishes, work, received)
        for row in range(0, 3 * PIXELS, PIXELS):
            for n in range(PIXELS):
                dye = narrow[RED + row + n]
                value = received[row + n] * (dye * (dye * (dye * _CUBE + _SQUARE) + _PLAIN) + work[GLOSS + n])
                step = min(np.float32(math.sqrt(scale * max(value, _ZERO))), top)
                index[row + n] = np.uint32(np.int32(step + np.float32(0.5)))
        for n in range(len(some[0])):
            row, column = lines[done + n], columns[done + n]
            rgb[row, column, 0] = curve[index[RED + n]]
            rgb[row, column, 1] = curve[index[GREEN + n]]
            rgb[row, column, 2] = curve[index[BLUE + n]]


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _receive(labels: np.ndarray, narrow: np.ndarray, faces: FaceLight, first_face: int, received: np.ndarray) -> None:
    """Write the light on pixels to the first three rows of ``received``; ``faces`` as in :func:`shade_lit`.

    ``labels`` are the visible faces, (n,), and ``narrow`` has the weights of their corners, see
    :func:`.surface_kernels.gather`. The light is interpolated between three samples: those of the corners, or of a
    small triangle of the lattice of samples.
    """
    emission, exposure, light, corner_samples, divisions = faces
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
            received[row] = one + emission[f, color] * exposure[color]
            received[_TO_SECOND + row], received[_TO_THIRD + row] = light[b, color] - one, light[c, color] - one
    for row in range(0, 3 * PIXELS, PIXELS):
        for n in range(PIXELS):
            second, third = received[_SHARES + n], received[_SHARES + PIXELS + n]
            to_second, to_third = received[_TO_SECOND + row + n], received[_TO_THIRD + row + n]
            received[row + n] = received[row + n] + second * to_second + third * to_third


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
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
