"""Compiled surfaces of pixels: what they are like (albedo, normal), before any light.

Pixels are taken from the whole picture, ``PIXELS`` at a time: most triangles of a body are about as large as a pixel,
so a loop over the pixels of one triangle, or of one row of a limb, would be too short for vectors. For each pixel the
corners of its triangle are copied to rows of memory; nearly all else is arithmetic over these rows.

Over a triangle the weights of its corners are ``edge . d`` up to a common factor, in the notation of
:mod:`simharness.capture.rendering.raster_kernels`. So attributes of the corners (normals, texture coordinates) and all
quantities that are linear in space are linear in ``d = (x, y, 1)`` and in inverse depth.

Memory has one dimension and rows of ``PIXELS`` numbers: the compiler knows that rows are apart, and all loops have the
same length. Of fewer pixels the others are those of an earlier call; nothing is indexed by them.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit

PIXELS = 64
"""Pixels shaded together."""
RED, GREEN, BLUE, NORMAL_X, NORMAL_Y, NORMAL_Z, SECOND, THIRD = (PIXELS * row for row in range(8))
"""Begin of the rows that :func:`gather` writes into ``narrow``: albedo, sRGB, 0 to 1; unit normal on the side of the
camera; weights of the second and the third corner of the triangle."""

_NORMALS, _DYE, _TEXTURED, _UV, _NARROW = (PIXELS * row for row in (8, 17, 20, 21, 27))  # float32
_CORNERS, _COLUMN, _ROW, _ACROSS, _DOWN, _WIDE = (PIXELS * row for row in (0, 9, 10, 11, 12, 13))  # float64
_STEPS_X, _STEPS_Y, _BASE, _LINE, _MIXED, _WHOLE = (PIXELS * row for row in range(6))  # uint64
_KEPT, _UNTIL, _NEXT, _LAST_ROW, _LEVEL = range(5)  # of the memory of texture levels

_STRIDE = 32  # pixels along a row that share one texture level
_SHIFT = np.uint64(6)
_STEPS = 1 << 6  # interpolation steps between two texels
_SHARE = 1.0 / (255.0 * _STEPS * _STEPS)
_UNIT, _TINY = np.float32(1.0), np.float32(1e-30)
_ONE, _HALF_STEPS, _STEP_MASK, _ALL_STEPS = (
    np.uint64(1),
    np.uint64(_STEPS // 2),
    np.uint64(_STEPS - 1),
    np.uint64(_STEPS),
)
_LANE = np.uint64(20)  # bits: 255 x 64 x 64 fits
_TWO_LANES = np.uint64(40)
_MASK = np.uint64((1 << 20) - 1)


class FaceArrays(NamedTuple):
    """Faces of a scene as the shading kernels take them: k faces with n vertices."""

    faces: NDArray[np.uint32]
    """Vertex indices, (k, 3) uint32."""
    colors: NDArray[np.float32]
    """SRGB albedo, (k, 3) float32."""
    smooth: NDArray[np.bool_]
    """Whether to interpolate vertex normals, (k,) bool."""
    face_normals: NDArray[np.float32]
    """Unit normals of the faces, (k, 3) float32."""
    vertex_normals: NDArray[np.float32]
    """Unit normals of the vertices, (n, 3) float32."""
    texture: NDArray[np.int16]
    """Index of each face's texture, -1 for none, (k,) int16."""
    uv: NDArray[np.float32]
    """Texture coordinates of the corners, (k, 3, 2) float32; ignored if no face has a texture."""
    texels: NDArray[np.uint64]
    """Texels of all textures at all mipmap levels, (m,) uint64, see :func:`packed`."""
    pyramids: NDArray[np.int64]
    """First texel, height and width of every level of every texture, (textures, levels, 3); each level has a border of
    one texel, copied from the opposite side."""


class DrawnPixels(NamedTuple):
    """What pixels show."""

    triangle: NDArray[np.int32]
    """Visible face or -1, (h, w) int32."""
    inverse_depth: NDArray[np.float32]
    """Inverse depth, 1/m, (h, w) float32; 0 without a face."""
    corners: NDArray[np.float64]
    """Homogeneous pixel coordinates of the vertices, (n, 3)."""

    def shown(self, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int32], ...]:
        """Return visible face, column and row of chosen (h, w) pixels, (n,) int32 each, row by row."""
        place = np.flatnonzero(chosen)
        rows, columns = np.divmod(place.astype(np.int32), np.int32(chosen.shape[1]))
        return self.triangle.ravel()[place], columns, rows


class PixelRays(NamedTuple):
    """Rays of a camera: ``center + depth * to_rays @ (x, y, 1)`` is the point at a pixel."""

    center: NDArray[np.float64]
    """Camera centre in the world, (3,)."""
    to_rays: NDArray[np.float64]
    """Matrix, (3, 3)."""


@njit(cache=True)
def memory() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return memory of :func:`gather`: rows of float32, float64, uint64, and the texture level of the last pixel."""
    return np.zeros(_NARROW, np.float32), np.zeros(_WIDE), np.zeros(_WHOLE, np.uint64), np.full(5, -1)


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def gather(
    pixels: tuple[np.ndarray, ...], corners: np.ndarray, faces: FaceArrays, rows: tuple[np.ndarray, ...]
) -> None:
    """Write what the surfaces at some pixels are like, to the rows from ``RED`` to ``THIRD`` of the first memory.

    Args:
        pixels: visible faces, (n,) int32, n at most ``PIXELS``, none is -1; columns and rows, (n,) int32 each, in the
            order of the picture.
        corners: homogeneous pixel coordinates of the vertices, (n, 3).
        faces: all faces.
        rows: see :func:`memory`.
    """
    labels, texels = pixels[0], faces.texels
    narrow, wide, whole, _ = rows
    _load(pixels, corners, faces, rows)
    _weigh(narrow, wide, whole)
    for n in range(len(labels)):
        i, j = whole[_STEPS_X + n], whole[_STEPS_Y + n]
        one = whole[_BASE + n] + (j >> _SHIFT) * whole[_LINE + n] + (i >> _SHIFT)
        two = one + whole[_LINE + n]
        weight_x, weight_y = i & _STEP_MASK, j & _STEP_MASK
        rest_x, rest_y = _ALL_STEPS - weight_x, _ALL_STEPS - weight_y
        mix = rest_y * (rest_x * texels[one] + weight_x * texels[one + _ONE])
        whole[_MIXED + n] = mix + weight_y * (rest_x * texels[two] + weight_x * texels[two + _ONE])
    for n in range(PIXELS):
        mix, textured = whole[_MIXED + n], narrow[_TEXTURED + n] > 0
        red, green = np.float32(np.int32(mix & _MASK)), np.float32(np.int32((mix >> _LANE) & _MASK))
        blue = np.float32(np.int32(mix >> _TWO_LANES))
        narrow[RED + n] = narrow[_DYE + n] * (red if textured else _UNIT)
        narrow[GREEN + n] = narrow[_DYE + PIXELS + n] * (green if textured else _UNIT)
        narrow[BLUE + n] = narrow[_DYE + 2 * PIXELS + n] * (blue if textured else _UNIT)


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _load(
    pixels: tuple[np.ndarray, ...], corners: np.ndarray, surfaces: FaceArrays, memory: tuple[np.ndarray, ...]
) -> None:
    """Copy the corners of the triangles at pixels to memory; arguments as :func:`gather`."""
    labels, columns, rows = pixels
    narrow, wide, whole, level = memory
    faces, colors, smooth, face_normals, vertex_normals, texture, uv, _, pyramids = surfaces
    for n in range(len(labels)):
        t = np.uint32(labels[n])
        textured, x, y = texture[t], columns[n], rows[n]
        wide[_COLUMN + n], wide[_ROW + n] = x, y
        for k in range(3):
            at, first = faces[t, k], 3 * k * PIXELS + n
            for i in range(3):
                wide[_CORNERS + first + i * PIXELS] = corners[at, i]
            if smooth[t]:
                for i in range(3):
                    narrow[_NORMALS + first + i * PIXELS] = vertex_normals[at, i]
            else:
                for i in range(3):
                    narrow[_NORMALS + first + i * PIXELS] = face_normals[t, i]
        if x != level[_NEXT] or y != level[_LAST_ROW]:  # begin of a span of pixels
            level[_KEPT] = -1
        level[_NEXT], level[_LAST_ROW] = x + 1, y
        if textured < 0:
            narrow[_TEXTURED + n] = 0.0
            for k in range(3):
                narrow[_DYE + k * PIXELS + n] = colors[t, k]
            continue
        narrow[_TEXTURED + n] = 1.0
        for k in range(3):
            narrow[_DYE + k * PIXELS + n] = np.float32(_SHARE * colors[t, k])
            narrow[_UV + 2 * k * PIXELS + n] = uv[t, k, 0]
            narrow[_UV + (2 * k + 1) * PIXELS + n] = uv[t, k, 1]
        if textured != level[_KEPT] or x >= level[_UNTIL]:
            level[_KEPT], level[_UNTIL] = textured, x + _STRIDE
            level[_LEVEL] = _level(n, narrow, wide, pyramids[textured])
        at_level = level[_LEVEL]
        whole[_BASE + n] = np.uint64(pyramids[textured, at_level, 0])
        height, width = pyramids[textured, at_level, 1], pyramids[textured, at_level, 2]
        whole[_LINE + n] = np.uint64(width + 2)  # each level has a border of one texel
        wide[_ACROSS + n], wide[_DOWN + n] = np.float64(_STEPS * width), np.float64(_STEPS * height)


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _level(n: int, narrow: np.ndarray, wide: np.ndarray, pyramid: np.ndarray) -> int:
    """Return the mipmap level whose texels are about as large as a pixel; arguments as :func:`gather`."""
    x, y = wide[_COLUMN + n], wide[_ROW + n]
    one = two = three = 0.0  # linear functions over the picture: u and v times the third, at the pixel
    one_x = two_x = three_x = one_y = two_y = three_y = 0.0  # and their slopes
    for k in range(3):
        b, c = _CORNERS + (k + 1) % 3 * 3 * PIXELS + n, _CORNERS + (k + 2) % 3 * 3 * PIXELS + n
        bx, by, bz = wide[b], wide[b + PIXELS], wide[b + 2 * PIXELS]
        cx, cy, cz = wide[c], wide[c + PIXELS], wide[c + 2 * PIXELS]
        ex, ey, ez = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        u, v = np.float64(narrow[_UV + 2 * k * PIXELS + n]), np.float64(narrow[_UV + (2 * k + 1) * PIXELS + n])
        e = ex * x + (ey * y + ez)
        one, two, three = one + u * e, two + v * e, three + e
        one_x, two_x, three_x = one_x + u * ex, two_x + v * ex, three_x + ex
        one_y, two_y, three_y = one_y + u * ey, two_y + v * ey, three_y + ey
    scale = 1.0 / three
    at_u, at_v, rows, columns = one * scale, two * scale, pyramid[0, 1], pyramid[0, 2]
    ux, vx = (one_x - at_u * three_x) * scale * columns, (two_x - at_v * three_x) * scale * rows
    uy, vy = (one_y - at_u * three_y) * scale * columns, (two_y - at_v * three_y) * scale * rows
    area = 0.5 * (ux * ux + vx * vx) + 0.5 * (uy * uy + vy * vy)
    level = 0
    while area > 2.0 and level < len(pyramid) - 1:
        area *= 0.25
        level += 1
    return level


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _weigh(narrow: np.ndarray, wide: np.ndarray, whole: np.ndarray) -> None:
    """Compute weights of the corners, normals and places in the textures; arguments as :func:`gather`."""
    for n in range(PIXELS):  # vectorised by the compiler
        ax, ay, az = wide[n], wide[PIXELS + n], wide[2 * PIXELS + n]
        bx, by, bz = wide[3 * PIXELS + n], wide[4 * PIXELS + n], wide[5 * PIXELS + n]
        cx, cy, cz = wide[6 * PIXELS + n], wide[7 * PIXELS + n], wide[8 * PIXELS + n]
        x, y = wide[_COLUMN + n], wide[_ROW + n]
        # Negative where the triangle faces the camera: these weights turn normals to its side.
        wa = -((by * cz - bz * cy) * x + ((bz * cx - bx * cz) * y + (bx * cy - by * cx)))
        wb = -((cy * az - cz * ay) * x + ((cz * ax - cx * az) * y + (cx * ay - cy * ax)))
        wc = -((ay * bz - az * by) * x + ((az * bx - ax * bz) * y + (ax * by - ay * bx)))
        wide[n], wide[PIXELS + n], wide[2 * PIXELS + n] = wa, wb, wc
        wide[3 * PIXELS + n] = 1.0 / (wa + wb + wc)
    for n in range(PIXELS):
        wa, wb, wc, scale = wide[n], wide[PIXELS + n], wide[2 * PIXELS + n], wide[3 * PIXELS + n]
        narrow[SECOND + n], narrow[THIRD + n] = np.float32(wb * scale), np.float32(wc * scale)
        a, b, c = _NORMALS + n, _NORMALS + 3 * PIXELS + n, _NORMALS + 6 * PIXELS + n
        x = np.float32(wa * narrow[a] + wb * narrow[b] + wc * narrow[c])
        y = np.float32(wa * narrow[a + PIXELS] + wb * narrow[b + PIXELS] + wc * narrow[c + PIXELS])
        z = np.float32(wa * narrow[a + 2 * PIXELS] + wb * narrow[b + 2 * PIXELS] + wc * narrow[c + 2 * PIXELS])
        length = _UNIT / max(np.float32(math.sqrt(x * x + y * y + z * z)), _TINY)
        narrow[NORMAL_X + n], narrow[NORMAL_Y + n], narrow[NORMAL_Z + n] = x * length, y * length, z * length
    for n in range(PIXELS):
        wa, wb, wc, scale = wide[n], wide[PIXELS + n], wide[2 * PIXELS + n], wide[3 * PIXELS + n]
        a, b, c = _UV + n, _UV + 2 * PIXELS + n, _UV + 4 * PIXELS + n
        u = (wa * narrow[a] + wb * narrow[b] + wc * narrow[c]) * scale
        v = (wa * narrow[a + PIXELS] + wb * narrow[b + PIXELS] + wc * narrow[c + PIXELS]) * scale
        # In steps between texel centres.
        whole[_STEPS_X + n] = np.uint64(np.int64((u - np.floor(u)) * wide[_ACROSS + n])) + _HALF_STEPS
        whole[_STEPS_Y + n] = np.uint64(np.int64((v - np.floor(v)) * wide[_DOWN + n])) + _HALF_STEPS


def packed(picture: np.ndarray) -> np.ndarray:
    """Pack texels (m, 3) uint8 into (m,) uint64: colours 20 bits apart, so that one product weights all three."""
    texels = picture[:, 2].astype(np.uint64)
    for channel in (1, 0):
        texels <<= _LANE
        texels |= picture[:, channel]
    return np.asarray(texels)
