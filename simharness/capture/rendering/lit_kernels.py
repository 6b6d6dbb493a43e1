"""Compiled shading of scenes with light sources.

The light on a surface is interpolated between its samples (:mod:`simharness.capture.rendering.light_samples`), and a
picture shows it times the linear albedo through a tone curve.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.finish_kernels import FINISHING, GLOSS, FinishArrays, finish
from simharness.capture.rendering.surface_kernels import (
    BLUE,
    GREEN,
    PIXELS,
    RED,
    SECOND,
    THIRD,
    DrawnPixels,
    FaceArrays,
    gather,
    memory,
)
from simharness.capture.rendering.tone import BRIGHTEST

_ZERO, _UNIT = np.float32(0.0), np.float32(1.0)
_TO_SECOND, _TO_THIRD, _SHARES, _RECEIVED = (PIXELS * row for row in (3, 6, 9, 11))  # rows of light on pixels
# Linear value of sRGB s: s (s (s a + b) + c), within 0.2 % of white of IEC 61966-2-1.
_CUBE, _SQUARE, _PLAIN = np.float32(0.305306011), np.float32(0.682171111), np.float32(0.012522878)


class FaceLight(NamedTuple):
    """Light that some faces of a scene get and give.

    Attributes:
        emission: radiance of the faces, times which the albedo is shown, (m, 3).
        exposure: factor on it, (3,) float32.
        light: irradiance at the light samples, (n, 3) float32.
        corner_samples: samples of the faces, (m, 3); see :class:`.light_samples.LightSamples`.
        divisions: divisions of the faces, (m,).
    """

    emission: NDArray[np.float32]
    exposure: NDArray[np.float32]
    light: NDArray[np.float32]
    corner_samples: NDArray[np.int32]
    divisions: NDArray[np.int32]


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def shade_lit(
    spans: np.ndarray,
    drawn: DrawnPixels,
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
        spans: spans of pixels that may show them, see :func:`.vertex_kernels.covering_spans`.
        drawn: what the pixels show.
        faces: all faces.
        rays: matrix that turns pixels into rays, (3, 3).
        light: light of the faces to colour.
        first: first face to colour, all that follow are coloured, and first vertex of these faces.
        finishes: finishes of these faces.
        curve: tone curve, see :func:`.tone.table`.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    triangle, first_face = drawn.triangle, first[0]
    surfaces = memory()
    narrow = surfaces[0]
    received, index = np.zeros(_RECEIVED, np.float32), np.zeros(3 * PIXELS, np.uint32)
    work = np.zeros(FINISHING, np.float32)
    most = PIXELS + triangle.shape[1]
    labels, columns, lines = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
    top = np.float32(len(curve) - 1)
    scale, count = np.float32(top * top / BRIGHTEST), 0
    for span in range(len(spans)):
        begin, y = count, spans[span, 0]
        for x in range(spans[span, 1], spans[span, 2]):
            columns[np.uint32(count)] = x
            count += triangle[y, x] >= first_face
        for n in range(begin, count):
            labels[n], lines[n] = triangle[y, columns[n]], y
        done = 0
        while done + PIXELS <= count or (span == len(spans) - 1 and done < count):
            size = min(count - done, PIXELS)
            chunk = slice(done, done + size)
            pixels = labels[chunk], columns[chunk], lines[chunk]
            gather(pixels, drawn.corners, faces, surfaces)
            _receive(labels[chunk], narrow, light, first_face, received)
            if len(finishes.material):
                finish(pixels, first, faces.faces, rays, narrow, finishes, work, received)
            for row in range(0, 3 * PIXELS, PIXELS):
                for n in range(PIXELS):
                    dye = narrow[RED + row + n]
                    value = received[row + n] * (dye * (dye * (dye * _CUBE + _SQUARE) + _PLAIN) + work[GLOSS + n])
                    step = min(np.float32(math.sqrt(scale * max(value, _ZERO))), top)
                    index[row + n] = np.uint32(np.int32(step + np.float32(0.5)))
            for n in range(size):
                row, column = lines[done + n], columns[done + n]
                rgb[row, column, 0] = curve[index[RED + n]]
                rgb[row, column, 1] = curve[index[GREEN + n]]
                rgb[row, column, 2] = curve[index[BLUE + n]]
            done += size
        for n in range(count - done):
            labels[n], columns[n], lines[n] = labels[done + n], columns[done + n], lines[done + n]
        count -= done


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
