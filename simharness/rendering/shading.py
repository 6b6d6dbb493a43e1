"""The compiled shading pass of the rasteriser: private, on plain arrays, single-threaded.

A row of the picture at a time. What is the same rule for every pixel (its place in the map of shadows, its colour out
of light and albedo) is a loop over the row that the compiler turns into vector instructions; what depends on the
triangle is worked out once for every run of pixels that show the same one.

Over a triangle the weights of its corners are ``edge . d`` up to a common factor, in the notation of
:mod:`simharness.rendering.kernels`; so is what hangs on the corners (normals, places in a texture), and everything that
is linear in space is linear in ``d = (x, y, 1)`` and in inverse depth.
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

from __future__ import annotations

import math

import numpy as np
from numba import njit

BIAS = 2.5  # pixels of the map of shadows, over the cosine: what a surface must be nearer to throw a shadow
LEAST_COSINE = 0.25
_BRIGHTEST = np.float32(4.0)
_STRIDE = 32  # pixels along a row over which a texture keeps its level of detail
_BLOCK_SHIFT = np.uint32(3)
_BLOCK = 1 << 3  # pixels of the map of shadows
_LAST = np.uint32(3)
_FILTER = 4  # pixels of the map under the filter that softens edges
_STEPS = 1 << 6  # between two texels
_SHIFT, _WIDE_SHIFT, _FRACTION, _ONE = np.uint32(6), np.uint64(6), np.uint32(_STEPS - 1), np.uint32(1)
_HALF = np.int32(_STEPS // 2)
_ZERO, _UNIT, _TINY, _WHITE = np.float32(0.0), np.float32(1.0), np.float32(1e-30), np.float32(255.0)
_LANE = np.uint64(20)  # bits: 255 x 64 x 64 fits
_TWO_LANES = np.uint64(40)
_MASK = np.uint64((1 << 20) - 1)


@njit(cache=True, error_model="numpy", fastmath=True)
def shade(
    triangle: np.ndarray,
    inverse_depth: np.ndarray,
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
    center: np.ndarray,
    rays: np.ndarray,
    light: np.ndarray,
    strengths: np.ndarray,
    gains: np.ndarray,
    empty: np.ndarray,
    light_P: np.ndarray,
    shadow: np.ndarray,
    blocks: np.ndarray,
    bias: float,
) -> np.ndarray:
    """Colour every pixel by the rule of :class:`simharness.rendering.lighting.Lighting`.

    Args:
        triangle: (h, w) int32, face seen or -1.
        inverse_depth: (h, w) float32, 1/m.
        q: homogeneous pixel coordinates of the vertices, (n, 3).
        faces: (k, 3) int32.
        colors: (k, 3) float32, sRGB albedo.
        smooth: (k,) bool, interpolate the normals of the vertices.
        face_normals: (k, 3) float32.
        vertex_normals: (n, 3) float32.
        texture: index of each face's texture, -1 for none, (k,) int16.
        uv: places of the corners in it, (k, 3, 2) float32; anything where no face has one.
        texels: of all textures and their levels of detail, (m,) uint64, see :func:`packed`.
        pyramids: first texel, height and width of every level of every texture, (textures, levels, 3); around each
            level there is one texel more of what it is when it repeats.
        center: the camera in the world, (3,).
        rays: (3, 3), so that ``center + depth * rays @ (x, y, 1)`` is the point at a pixel.
        light: unit direction to the key light, (3,).
        strengths: of key, sky and fill, (3,).
        gains: 255 times what the colour of the light makes of an albedo, sRGB, (3,).
        empty: what is not hit, of 255, (3,).
        light_P: projection into the map of shadows, (3, 4).
        shadow: the map: inverse depth from the light, (s, s) float32, 0 where nothing stands in the light.
        blocks: the nearest in every block of it, see :func:`nearest_blocks`.
        bias: see ``BIAS``, for a surface that faces the light, in inverse depth.

    Returns:
        (h, w, 3) uint8, sRGB.
    """
    height, width = triangle.shape
    rgb = np.empty((height, width, 3), np.uint8)
    key, fill = np.float32(strengths[0]), np.float32(strengths[2])
    sky_all, sky_up = np.float32(0.65 * strengths[1]), np.float32(0.35 * strengths[1])
    light_x, light_y, light_z = np.float32(light[0]), np.float32(light[1]), np.float32(light[2])
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    white = 255.0 * _STEPS * _STEPS  # a texel that was mixed out of four
    gain_red, gain_green = np.float32(gains[0] / white), np.float32(gains[1] / white)
    gain_blue, mixed = np.float32(gains[2] / white), np.empty(width, np.uint64)
    slope_bias, least_cosine = np.float32(bias), np.float32(LEAST_COSINE)
    # The light's view of a pixel times its inverse depth: away * inverse depth + seen @ (x, y, 1), homogeneous.
    seen, away = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        away[i] = light_P[i, 0] * center[0] + light_P[i, 1] * center[1] + light_P[i, 2] * center[2] + light_P[i, 3]
        for j in range(3):
            for k in range(3):
                seen[i, j] += light_P[i, k] * rays[k, j]
    seen_x, seen_y, seen_w = np.float32(seen[0, 0]), np.float32(seen[1, 0]), np.float32(seen[2, 0])
    away_x, away_y, away_w = np.float32(away[0]), np.float32(away[1]), np.float32(away[2])

    # Of every pixel of a row: place in the map of shadows and inverse depth there, light in the shade and light of
    # the key, albedo times gain.
    map_x, map_y, near = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    shade_light, key_light = np.empty(width, np.float32), np.empty(width, np.float32)
    red, green, blue = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    # The texel and the one below it; the steps to the next right and down, six bits each.
    upper, lower, between = np.empty(width, np.uint32), np.empty(width, np.uint32), np.empty(width, np.uint32)
    base, stride, wide, high = np.uint32(0), np.uint32(0), _ZERO, _ZERO
    edge, across = np.zeros((3, 3)), np.zeros((3, 3))
    # Runs of the row, and of those with normals that turn what their pixels need.
    starts = np.empty(width + 1, np.int64)
    spans, slopes = np.empty((width, 4), np.uint32), np.empty((width, 16), np.float32)
    for y in range(height):
        from_x = np.float32(seen[0, 1] * y + seen[0, 2])
        from_y = np.float32(seen[1, 1] * y + seen[1, 2])
        from_w = np.float32(seen[2, 1] * y + seen[2, 2])
        ray_x = np.float32(rays[0, 1] * y + rays[0, 2])
        ray_y = np.float32(rays[1, 1] * y + rays[1, 2])
        ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
        for x in range(width):
            w, place = inverse_depth[y, x], np.float32(x)
            scale = np.float32(1.0) / (away_w * w + (seen_w * place + from_w))
            map_x[x] = (away_x * w + (seen_x * place + from_x)) * scale - np.float32(1.0)
            map_y[x] = (away_y * w + (seen_y * place + from_y)) * scale - np.float32(1.0)
            near[x] = w * scale

        # Where runs begin is found without a branch, and what has a loop of unknown length comes after what has none: a
        # wrong guess would throw away the work on the runs ahead.
        runs = 0
        for x in range(width):
            starts[runs] = x
            runs += (x == 0) | (triangle[y, x] != triangle[y, max(x - 1, 0)])
        starts[runs] = width
        kept, kept_until, bends = -1, 0, 0
        for run in range(runs):
            start, end = starts[run], starts[run + 1]
            label = triangle[y, start]
            if label < 0:
                shade_light[start:end], key_light[start:end] = 1.0, 0.0
                red[start:end], green[start:end], blue[start:end] = empty[0] / white, empty[1] / white, empty[2] / white
                upper[start:end], lower[start:end], between[start:end] = 0, 0, 0
                continue
            t = np.uint32(label)

            textured = texture[t]
            a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
            is_smooth = smooth[t]
            if is_smooth or textured >= 0:
                ax, ay, az, bx, by, bz = q[a, 0], q[a, 1], q[a, 2], q[b, 0], q[b, 1], q[b, 2]
                cx, cy, cz = q[c, 0], q[c, 1], q[c, 2]
                edge[0, 0], edge[0, 1], edge[0, 2] = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
                edge[1, 0], edge[1, 1], edge[1, 2] = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
                edge[2, 0], edge[2, 1], edge[2, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx

            dye_red, dye_green, dye_blue = gain_red * colors[t, 0], gain_green * colors[t, 1], gain_blue * colors[t, 2]
            if textured >= 0:
                for k in range(3):
                    across[0, k] = edge[0, k] * uv[t, 0, 0] + edge[1, k] * uv[t, 1, 0] + edge[2, k] * uv[t, 2, 0]
                    across[1, k] = edge[0, k] * uv[t, 0, 1] + edge[1, k] * uv[t, 1, 1] + edge[2, k] * uv[t, 2, 1]
                    across[2, k] = edge[0, k] + edge[1, k] + edge[2, k]
            if is_smooth:
                to, at = spans[bends], slopes[bends]
                bends += 1
                to[0], to[1], to[2], to[3] = start, end, 0, 0
                at[6], at[7], at[8] = dye_red, dye_green, dye_blue
                at[9], at[10], at[11], at[12], at[13], at[14], at[15] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                if textured >= 0:
                    if textured != kept or start >= kept_until:
                        kept, kept_until = textured, start + _STRIDE
                        base, stride, wide, high = _level(across, start, y, pyramids[textured])
                    to[2], to[3], at[9], at[10] = base, stride, wide, high
                    at[11], at[12], at[13], at[14], at[15] = _steps(across, start, y)
                # The weights are negative where the triangle faces the camera, so this normal always does.
                wa = -(edge[0, 0] * start + (edge[0, 1] * y + edge[0, 2]))
                wb = -(edge[1, 0] * start + (edge[1, 1] * y + edge[1, 2]))
                wc = -(edge[2, 0] * start + (edge[2, 1] * y + edge[2, 2]))
                for k in range(3):
                    na, nb, nc = vertex_normals[a, k], vertex_normals[b, k], vertex_normals[c, k]
                    at[k] = np.float32(wa * na + wb * nb + wc * nc)
                    at[3 + k] = np.float32(-(edge[0, 0] * na + edge[1, 0] * nb + edge[2, 0] * nc))
            else:
                nx, ny, nz = face_normals[t, 0], face_normals[t, 1], face_normals[t, 2]
                more = nx * rise_x + ny * rise_y + nz * rise_z
                first = nx * ray_x + ny * ray_y + nz * ray_z + more * np.float32(start)
                turn = -_UNIT if first > 0 else _UNIT  # seen from behind: the sheet's other side
                cosine = turn * (nx * light_x + ny * light_y + nz * light_z)
                lit, nearer = key * max(cosine, _ZERO), slope_bias / max(cosine, least_cosine)
                least = sky_all + sky_up * turn * nz
                first, more = -fill * turn * first, -fill * turn * more
                shades, keys, nears = shade_light[start:end], key_light[start:end], near[start:end]
                for n in range(len(shades)):
                    glance = first + more * np.float32(np.int32(n))
                    shades[n] = least + (glance if glance < fill else fill)
                    keys[n] = lit
                    nears[n] += nearer
                reds, greens, blues = red[start:end], green[start:end], blue[start:end]
                for n in range(len(reds)):
                    reds[n], greens[n], blues[n] = dye_red, dye_green, dye_blue
                if textured < 0:
                    upper[start:end], lower[start:end], between[start:end] = 0, 0, 0
                    continue
                stop = start
                while stop < end:
                    begin = stop
                    if textured != kept or begin >= kept_until:
                        kept, kept_until = textured, begin + _STRIDE
                        base, stride, wide, high = _level(across, begin, y, pyramids[textured])
                    stop = min(kept_until, end)
                    from_u, from_v, step_u, step_v, bend = _steps(across, begin, y)
                    uppers, lowers, betweens = upper[begin:stop], lower[begin:stop], between[begin:stop]
                    for n in range(len(uppers)):
                        place = np.float32(np.int32(n))
                        place = place / (_UNIT + place * bend)
                        here_u, here_v = from_u + place * step_u, from_v + place * step_v
                        i = np.uint32(np.int32((here_u - np.floor(here_u)) * wide) + _HALF)
                        j = np.uint32(np.int32((here_v - np.floor(here_v)) * high) + _HALF)
                        texel = base + (j >> _SHIFT) * stride + (i >> _SHIFT)
                        uppers[n], lowers[n] = texel, texel + stride
                        betweens[n] = (i & _FRACTION) | ((j & _FRACTION) << _SHIFT)

        for run in range(bends):
            to, at = spans[run], slopes[run]
            start, end, first_texel, next_row = np.int64(to[0]), np.int64(to[1]), to[2], to[3]
            nx, ny, nz, turn_x, turn_y, turn_z = at[0], at[1], at[2], at[3], at[4], at[5]
            dye_red, dye_green, dye_blue, columns, rows = at[6], at[7], at[8], at[9], at[10]
            from_u, from_v, step_u, step_v, bend = at[11], at[12], at[13], at[14], at[15]
            for x in range(start, end):
                place = np.float32(np.int32(x))
                scale = _UNIT / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), _TINY)
                cosine = (nx * light_x + ny * light_y + nz * light_z) * scale
                # The ray to the pixel is a little longer than 1: near enough.
                glance = nx * (rise_x * place + ray_x) + ny * (rise_y * place + ray_y)
                glance += nz * (rise_z * place + ray_z)
                key_light[x] = key * max(cosine, _ZERO)
                shade_light[x] = sky_up * nz * scale + sky_all + fill * min(max(-glance * scale, _ZERO), _UNIT)
                near[x] += slope_bias / max(cosine, least_cosine)
                red[x], green[x], blue[x] = dye_red, dye_green, dye_blue
                nx, ny, nz = nx + turn_x, ny + turn_y, nz + turn_z
                n = place - np.float32(start)
                n = n / (_UNIT + n * bend)
                here_u, here_v = from_u + n * step_u, from_v + n * step_v
                i = np.uint32(np.int32((here_u - np.floor(here_u)) * columns) + _HALF)
                j = np.uint32(np.int32((here_v - np.floor(here_v)) * rows) + _HALF)
                texel = first_texel + (j >> _SHIFT) * next_row + (i >> _SHIFT)
                upper[x], lower[x] = texel, texel + next_row
                between[x] = (i & _FRACTION) | ((j & _FRACTION) << _SHIFT)
        _darken(key_light, map_x, map_y, near, shadow, blocks)
        for x in range(width):
            weight_x, weight_y = np.uint64(between[x] & _FRACTION), np.uint64(between[x] >> _SHIFT)
            # A difference may borrow from the next lane, and the sum gives it back.
            one, two = texels[upper[x]], texels[lower[x]]
            one = (one << _WIDE_SHIFT) + weight_x * (texels[upper[x] + _ONE] - one)
            two = (two << _WIDE_SHIFT) + weight_x * (texels[lower[x] + _ONE] - two)
            mixed[x] = (one << _WIDE_SHIFT) + weight_y * (two - one)
        row = rgb[y]
        for x in range(width):
            gain = np.float32(math.sqrt(min(shade_light[x] + key_light[x], _BRIGHTEST)))
            hue = gain * red[x] * np.float32(np.int32(mixed[x] & _MASK))
            row[x, 0] = np.uint8(np.int32(min(hue + np.float32(0.5), _WHITE)))
            hue = gain * green[x] * np.float32(np.int32((mixed[x] >> _LANE) & _MASK))
            row[x, 1] = np.uint8(np.int32(min(hue + np.float32(0.5), _WHITE)))
            hue = gain * blue[x] * np.float32(np.int32(mixed[x] >> _TWO_LANES))
            row[x, 2] = np.uint8(np.int32(min(hue + np.float32(0.5), _WHITE)))
    return rgb


@njit(cache=True, error_model="numpy", fastmath=True)
def _steps(across: np.ndarray, x: int, y: int) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Place u, v in a texture at a pixel, from 0 to 1, and how it moves: n pixels on by ``n / (1 + n * bend)`` steps.

    Returns:
        Both places, both steps, and the bend.
    """
    scale = 1.0 / (across[2, 0] * x + (across[2, 1] * y + across[2, 2]))
    u = (across[0, 0] * x + (across[0, 1] * y + across[0, 2])) * scale
    v = (across[1, 0] * x + (across[1, 1] * y + across[1, 2])) * scale
    step_u, step_v = (across[0, 0] - u * across[2, 0]) * scale, (across[1, 0] - v * across[2, 0]) * scale
    u, v = u - np.floor(u), v - np.floor(v)
    return np.float32(u), np.float32(v), np.float32(step_u), np.float32(step_v), np.float32(across[2, 0] * scale)


@njit(cache=True, error_model="numpy", fastmath=True)
def _level(
    across: np.ndarray, x: int, y: int, pyramid: np.ndarray
) -> tuple[np.uint32, np.uint32, np.float32, np.float32]:
    """The level of detail of a texture whose texels are about as large as the pixel.

    Returns:
        Its first texel, texels in a row, and how many steps it is wide and high.
    """
    scale = 1.0 / (across[2, 0] * x + (across[2, 1] * y + across[2, 2]))
    u = (across[0, 0] * x + (across[0, 1] * y + across[0, 2])) * scale
    v = (across[1, 0] * x + (across[1, 1] * y + across[1, 2])) * scale
    rows, columns = pyramid[0, 1], pyramid[0, 2]
    area = 0.0
    for k in range(2):
        du = (across[0, k] - u * across[2, k]) * scale * columns
        dv = (across[1, k] - v * across[2, k]) * scale * rows
        area += 0.5 * (du * du + dv * dv)
    level = 0
    while area > 2.0 and level < len(pyramid) - 1:
        area *= 0.25
        level += 1
    base, rows, columns = pyramid[level, 0], pyramid[level, 1], pyramid[level, 2]
    return np.uint32(base), np.uint32(columns + 2), np.float32(_STEPS * columns), np.float32(_STEPS * rows)


@njit(cache=True, error_model="numpy", fastmath=True)
def _darken(
    key_light: np.ndarray,
    map_x: np.ndarray,
    map_y: np.ndarray,
    near: np.ndarray,
    shadow: np.ndarray,
    blocks: np.ndarray,
) -> None:
    """Take the key light, in place, from the pixels of a row that something shades, softly at the edges."""
    end = np.float32(len(shadow) - _FILTER + 1)
    for x in range(len(key_light)):
        if key_light[x] <= 0:
            continue
        u, v, here = map_x[x], map_y[x], near[x]
        if not ((u >= 0) & (u < end) & (v >= 0) & (v < end)):
            continue
        i, j = np.uint32(u), np.uint32(v)
        if blocks[j >> _BLOCK_SHIFT, i >> _BLOCK_SHIFT] <= here:  # nothing thereabouts is nearer to the light
            continue
        # Percentage-closer filtering: 4 x 4 comparisons under a sliding box of 3 x 3, but for the most part the corners
        # agree and speak for the rest.
        corners = int(shadow[j, i] > here) + int(shadow[j, i + _LAST] > here)
        corners += int(shadow[j + _LAST, i] > here) + int(shadow[j + _LAST, i + _LAST] > here)
        blocked = 0.25 * corners
        if 0 < corners < 4:
            du, dv = u - i, v - j
            blocked = 0.0
            for m in range(_FILTER):
                row = 0.0
                for n in range(_FILTER):
                    if shadow[j + np.uint32(m), i + np.uint32(n)] > here:
                        row += (1.0 - du) if n == 0 else (du if n == _FILTER - 1 else 1.0)
                blocked += row * ((1.0 - dv) if m == 0 else (dv if m == _FILTER - 1 else 1.0)) / 9.0
        key_light[x] *= 1.0 - blocked


@njit(cache=True, error_model="numpy", fastmath=True)
def nearest_blocks(shadow: np.ndarray) -> np.ndarray:
    """The nearest to the light, inverse depth, under all filters that begin in a block of 8 x 8 pixels of the map."""
    side = len(shadow)
    count = (side + _BLOCK - 1) // _BLOCK
    bands, blocks = np.zeros((count, side), np.float32), np.zeros((count, count), np.float32)
    for block in range(count):
        band = bands[block]
        for y in range(_BLOCK * block, min(_BLOCK * (block + 1) + _FILTER - 1, side)):
            row = shadow[y]
            for x in range(side):
                band[x] = row[x] if row[x] > band[x] else band[x]
        for column in range(count):
            for value in band[_BLOCK * column : _BLOCK * (column + 1) + _FILTER - 1]:
                blocks[block, column] = max(blocks[block, column], value)
    return blocks


def packed(picture: np.ndarray) -> np.ndarray:
    """Texels (m, 3) uint8 as numbers (m,) uint64: red, green and blue 20 bits apart, so that one product weighs all."""
    red, green, blue = picture.astype(np.uint64).T
    return np.asarray(red | green << _LANE | blue << _TWO_LANES)
