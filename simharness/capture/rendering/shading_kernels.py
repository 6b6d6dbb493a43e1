"""Compiled shading pass of the rasteriser: private, on plain arrays, single-threaded.

One row of the picture at a time, and of it the spans of pixels that are new. First :func:`gather` writes what the
surfaces are like (albedo, normal) into buffers of the row: values that depend on the triangle are computed once for
every run of pixels that show the same triangle. Then the light on them is computed from these buffers, by loops with
the same rule for every pixel, which the compiler vectorises.

Over a triangle the weights of its corners are ``edge . d`` up to a common factor, in the notation of
:mod:`simharness.capture.rendering.raster_kernels`. So attributes of the corners (normals, texture coordinates) and all
quantities that are linear in space are linear in ``d = (x, y, 1)`` and in inverse depth.

Kernels of this package may not reorder sums, contract products or approximate quotients (``fastmath`` names what they
may do): a loop runs in vectors where its arrays are apart in memory, else not, and both must round alike.
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.shadow_kernels import darken

BIAS = 2.5  # pixels of the shadow map, divided by the cosine: least lead in depth of a surface that casts a shadow
LEAST_COSINE = 0.25
_BRIGHTEST = 4.0
STRIDE = 32  # pixels along a row that share one texture level
_SHIFT = 6
_STEPS = 1 << _SHIFT  # interpolation steps between two texels
_ONE = np.uint64(1)
_ZERO, _UNIT, _TINY = np.float32(0.0), np.float32(1.0), np.float32(1e-30)
_LANE = np.uint64(20)  # bits: 255 x 64 x 64 fits
_TWO_LANES = np.uint64(40)
_MASK = np.uint64((1 << 20) - 1)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
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
    light_P: np.ndarray,
    bias: float,
    still_shadow: np.ndarray,
    still_blocks: np.ndarray,
    shadow: np.ndarray,
    blocks: np.ndarray,
    shadow_place: np.ndarray,
    shadow_depth: np.ndarray,
    first_face: int,
    rgb: np.ndarray,
) -> None:
    """Colour pixels in place, by the rule of :class:`simharness.types.lighting.Lighting` in closed form.

    Args:
        triangle: visible face or -1, (h, w) int32.
        inverse_depth: inverse depth, 1/m, (h, w) float32.
        q: homogeneous pixel coordinates of the vertices, (n, 3).
        faces: vertex indices, (k, 3) int32.
        colors: sRGB albedo, (k, 3) float32.
        smooth: whether to interpolate vertex normals, (k,) bool.
        face_normals: unit normals of the faces, (k, 3) float32.
        vertex_normals: unit normals of the vertices, (n, 3) float32.
        texture: index of each face's texture, -1 for none, (k,) int16.
        uv: texture coordinates of the corners, (k, 3, 2) float32; ignored if no face has a texture.
        texels: texels of all textures at all mipmap levels, (m,) uint64, see :func:`packed`.
        pyramids: first texel, height and width of every level of every texture, (textures, levels, 3); each level has
            a border of one texel, copied from the opposite side.
        center: camera centre in the world, (3,).
        rays: matrix, (3, 3), such that ``center + depth * rays @ (x, y, 1)`` is the point at a pixel.
        light: unit direction to the key light, (3,).
        strengths: strengths of key, sky and fill light, (3,).
        gains: 255 times the factor of the light colour on the albedo, sRGB, (3,).
        light_P: projection into the shadow maps, (3, 4).
        bias: ``BIAS`` as inverse depth, for a surface that faces the light.
        still_shadow: shadow map of still meshes: inverse depth from the light, (s, s) float32, 0 if nothing blocks the
            light.
        still_blocks: highest inverse depth in every block of it, see :func:`.shadow_kernels.nearest_blocks`.
        shadow: shadow map of the other meshes, (s, s) float32.
        blocks: highest inverse depth in every block of it.
        shadow_place: place in the shadow maps of what each pixel shows of still meshes, see
            :func:`.shadow_kernels.shadow_places`.
        shadow_depth: its inverse depth from the light.
        first_face: first face of the meshes that are not still. Only pixels that show them are coloured, and those of
            still meshes on which their shadows may fall.
        rgb: picture to change, (h, w, 3) uint8, sRGB.
    """
    height, width = triangle.shape
    # Shadow map position of a pixel times its inverse depth: away * inverse depth + seen @ (x, y, 1), homogeneous.
    seen, away = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        away[i] = light_P[i, 0] * center[0] + light_P[i, 1] * center[1] + light_P[i, 2] * center[2] + light_P[i, 3]
        for j in range(3):
            for k in range(3):
                seen[i, j] += light_P[i, k] * rays[k, j]
    # For every pixel of a row: albedo, sRGB; unit normal on the side of the camera; light with and without the key
    # light; position in the shadow map and inverse depth there.
    albedo, normal = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
    red, green, blue = albedo[0], albedo[1], albedo[2]
    gain_red, gain_green, gain_blue = np.float32(gains[0]), np.float32(gains[1]), np.float32(gains[2])
    key_light, other_light = np.empty(width, np.float32), np.empty(width, np.float32)
    map_x, map_y, near = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    fresh, shaded_from = np.empty(width, np.bool_), np.append(blocks.ravel(), np.float32(0.0))
    no_weights, edge, across = np.empty((2, 0), np.float32), np.zeros((3, 3)), np.zeros((3, 3))
    steps, mixed = np.empty((2, STRIDE), np.int32), np.empty(STRIDE, np.uint64)
    for y in range(height):
        for x in range(width):
            fresh[x] = (triangle[y, x] >= first_face) | (shaded_from[shadow_place[y, x]] > shadow_depth[y, x])
        last = 0
        while last < width:
            first = last
            while first < width and not fresh[first]:
                first += 1
            last = first
            while last < width and fresh[last]:
                last += 1
            gather(
                triangle[y], y, first, last, q, faces, colors, smooth, face_normals, vertex_normals, texture, uv,
                texels, pyramids, rays, edge, across, steps, mixed, albedo, normal,
                no_weights,
            )  # fmt: skip
            _light(y, first, last, inverse_depth[y], normal, rays, light, strengths, bias, seen, away, key_light,
                   other_light, map_x, map_y, near)  # fmt: skip
            span = slice(first, last)
            darken(key_light[span], map_x[span], map_y[span], near[span], still_shadow, still_blocks, shadow, blocks)
            for x in range(first, last):
                bright = np.float32(math.sqrt(min(other_light[x] + key_light[x], np.float32(_BRIGHTEST))))
                rgb[y, x, 0] = np.uint8(min(bright * (gain_red * red[x]) + np.float32(0.5), np.float32(255.0)))
                rgb[y, x, 1] = np.uint8(min(bright * (gain_green * green[x]) + np.float32(0.5), np.float32(255.0)))
                rgb[y, x, 2] = np.uint8(min(bright * (gain_blue * blue[x]) + np.float32(0.5), np.float32(255.0)))


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _light(
    y: int,
    first: int,
    last: int,
    inverse_depth: np.ndarray,
    normal: np.ndarray,
    rays: np.ndarray,
    light: np.ndarray,
    strengths: np.ndarray,
    bias: float,
    seen: np.ndarray,
    away: np.ndarray,
    key_light: np.ndarray,
    other_light: np.ndarray,
    map_x: np.ndarray,
    map_y: np.ndarray,
    near: np.ndarray,
) -> None:
    """Compute the light on the pixels of a row, without shadows, and their place in the shadow maps.

    Args:
        y: row of the picture.
        first: first pixel.
        last: end of the pixels.
        inverse_depth: inverse depth of the row, (w,).
        normal: unit normals, (3, w).
        rays: see :func:`shade`.
        light: see :func:`shade`.
        strengths: see :func:`shade`.
        bias: see :func:`shade`.
        seen: matrix, (3, 3), and
        away: vector, (3,), such that ``away * inverse depth + seen @ (x, y, 1)`` is the place in the shadow map.
        key_light: key light, written, (w,).
        other_light: sky and fill light, written, (w,).
        map_x: place in the shadow maps, written, (w,).
        map_y: the same downwards.
        near: inverse depth from the light less the bias, written, (w,).
    """
    key, fill = np.float32(strengths[0]), np.float32(strengths[2])
    sky_all, sky_up = np.float32(0.65 * strengths[1]), np.float32(0.35 * strengths[1])
    light_x, light_y, light_z = np.float32(light[0]), np.float32(light[1]), np.float32(light[2])
    slope_bias, least_cosine = np.float32(bias), np.float32(LEAST_COSINE)
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    ray_x = np.float32(rays[0, 1] * y + rays[0, 2])
    ray_y = np.float32(rays[1, 1] * y + rays[1, 2])
    ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
    seen_x, seen_y, seen_w = np.float32(seen[0, 0]), np.float32(seen[1, 0]), np.float32(seen[2, 0])
    away_x, away_y, away_w = np.float32(away[0]), np.float32(away[1]), np.float32(away[2])
    from_x = np.float32(seen[0, 1] * y + seen[0, 2])
    from_y = np.float32(seen[1, 1] * y + seen[1, 2])
    from_w = np.float32(seen[2, 1] * y + seen[2, 2])
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    for x in range(first, last):
        place, w = np.float32(x), inverse_depth[x]
        nx, ny, nz = normal_x[x], normal_y[x], normal_z[x]
        cosine = nx * light_x + ny * light_y + nz * light_z
        # The ray to the pixel is slightly longer than 1; the error is negligible.
        glance = nx * (rise_x * place + ray_x) + ny * (rise_y * place + ray_y) + nz * (rise_z * place + ray_z)
        key_light[x] = key * max(cosine, _ZERO)
        other_light[x] = sky_up * nz + sky_all + fill * min(max(-glance, _ZERO), _UNIT)
        scale = _UNIT / (away_w * w + (seen_w * place + from_w))
        map_x[x] = (away_x * w + (seen_x * place + from_x)) * scale - _UNIT
        map_y[x] = (away_y * w + (seen_y * place + from_y)) * scale - _UNIT
        near[x] = w * scale + slope_bias / max(cosine, least_cosine)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def gather(
    triangle: np.ndarray,
    y: int,
    first: int,
    last: int,
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
    edge: np.ndarray,
    across: np.ndarray,
    steps: np.ndarray,
    mixed: np.ndarray,
    albedo: np.ndarray,
    normal: np.ndarray,
    weights: np.ndarray,
) -> None:
    """Write what the surfaces at the pixels ``first`` to before ``last`` of a row are like; no light is used.

    Args:
        triangle: visible faces of the row, (w,) int32; none of the pixels is empty.
        y: row of the picture.
        first: first pixel.
        last: end of the pixels.
        q: see :func:`shade`, as all arguments up to ``rays``.
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
        edge: memory, (3, 3) float64.
        across: memory, (3, 3) float64.
        steps: memory, (2, ``STRIDE``) int32.
        mixed: memory, (``STRIDE``,) uint64.
        albedo: colour, sRGB, 0 to 1, written, (3, w).
        normal: unit normal on the side of the camera, written, (3, w).
        weights: weights of the second and the third corner of the triangle, written, (2, w); not if it is (2, 0).
    """
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    ray_x = np.float32(rays[0, 1] * y + rays[0, 2])
    ray_y = np.float32(rays[1, 1] * y + rays[1, 2])
    ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
    half, steps_x, steps_y = np.int32(_STEPS // 2), steps[0], steps[1]
    red, green, blue = albedo[0], albedo[1], albedo[2]
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    second, third, weighted = weights[0], weights[1], weights.shape[1] > 0
    base, rows, columns, stride, wide, high = 0, 1, 1, 3, 1.0, 1.0
    end, kept, kept_until = first, -1, 0
    while end < last:
        start, label = end, triangle[end]
        end += 1
        t = np.uint32(label)
        textured = texture[t]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        is_smooth = smooth[t]
        if is_smooth or textured >= 0 or weighted:
            ax, ay, az, bx, by, bz = q[a, 0], q[a, 1], q[a, 2], q[b, 0], q[b, 1], q[b, 2]
            cx, cy, cz = q[c, 0], q[c, 1], q[c, 2]
            edge[0, 0], edge[0, 1], edge[0, 2] = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
            edge[1, 0], edge[1, 1], edge[1, 2] = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
            edge[2, 0], edge[2, 1], edge[2, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx

        dye_red, dye_green, dye_blue = colors[t, 0], colors[t, 1], colors[t, 2]
        if is_smooth:
            # The weights are negative where the triangle faces the camera, so this normal always does.
            wa = -(edge[0, 0] * start + (edge[0, 1] * y + edge[0, 2]))
            wb = -(edge[1, 0] * start + (edge[1, 1] * y + edge[1, 2]))
            wc = -(edge[2, 0] * start + (edge[2, 1] * y + edge[2, 2]))
            nx = np.float32(wa * vertex_normals[a, 0] + wb * vertex_normals[b, 0] + wc * vertex_normals[c, 0])
            ny = np.float32(wa * vertex_normals[a, 1] + wb * vertex_normals[b, 1] + wc * vertex_normals[c, 1])
            nz = np.float32(wa * vertex_normals[a, 2] + wb * vertex_normals[b, 2] + wc * vertex_normals[c, 2])
            wa, wb, wc = -edge[0, 0], -edge[1, 0], -edge[2, 0]
            turn_x = np.float32(wa * vertex_normals[a, 0] + wb * vertex_normals[b, 0] + wc * vertex_normals[c, 0])
            turn_y = np.float32(wa * vertex_normals[a, 1] + wb * vertex_normals[b, 1] + wc * vertex_normals[c, 1])
            turn_z = np.float32(wa * vertex_normals[a, 2] + wb * vertex_normals[b, 2] + wc * vertex_normals[c, 2])
            # Runs are often one or two pixels long: another loop for the end would add a mispredicted branch.
            end = start
            while end < last and triangle[end] == label:
                x = end
                end += 1
                scale = _UNIT / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), _TINY)
                normal_x[x], normal_y[x], normal_z[x] = nx * scale, ny * scale, nz * scale
                red[x], green[x], blue[x] = dye_red, dye_green, dye_blue
                nx, ny, nz = nx + turn_x, ny + turn_y, nz + turn_z
        else:
            while end < last and triangle[end] == label:
                end += 1
            nx, ny, nz = face_normals[t, 0], face_normals[t, 1], face_normals[t, 2]
            place = np.float32(start)
            glance = nx * (rise_x * place + ray_x) + ny * (rise_y * place + ray_y) + nz * (rise_z * place + ray_z)
            turn = -_UNIT if glance > 0 else _UNIT  # seen from behind: the other side of the face
            normal_x[start:end], normal_y[start:end], normal_z[start:end] = turn * nx, turn * ny, turn * nz

        if weighted:
            rise_b, rise_c = edge[1, 0], edge[2, 0]
            wb, wc = rise_b * start + (edge[1, 1] * y + edge[1, 2]), rise_c * start + (edge[2, 1] * y + edge[2, 2])
            total = wb + wc + (edge[0, 0] * start + (edge[0, 1] * y + edge[0, 2]))
            rise = edge[0, 0] + rise_b + rise_c
            for x in range(start, end):
                scale_of = 1.0 / total
                second[x], third[x] = np.float32(wb * scale_of), np.float32(wc * scale_of)
                wb, wc, total = wb + rise_b, wc + rise_c, total + rise
        if textured < 0:
            if not is_smooth:
                red[start:end], green[start:end], blue[start:end] = dye_red, dye_green, dye_blue
            continue
        for k in range(3):
            across[0, k] = edge[0, k] * uv[t, 0, 0] + edge[1, k] * uv[t, 1, 0] + edge[2, k] * uv[t, 2, 0]
            across[1, k] = edge[0, k] * uv[t, 0, 1] + edge[1, k] * uv[t, 1, 1] + edge[2, k] * uv[t, 2, 1]
            across[2, k] = edge[0, k] + edge[1, k] + edge[2, k]
        u_rise, u_first = across[0, 0], across[0, 1] * y + across[0, 2]
        v_rise, v_first = across[1, 0], across[1, 1] * y + across[1, 2]
        sum_rise, sum_first = across[2, 0], across[2, 1] * y + across[2, 2]
        share = 1.0 / (255.0 * _STEPS * _STEPS)
        dye_red, dye_green = np.float32(share * dye_red), np.float32(share * dye_green)
        dye_blue = np.float32(share * dye_blue)
        stop = start
        while stop < end:
            begin = stop
            if textured != kept or begin >= kept_until:
                kept, kept_until = textured, begin + STRIDE
                level = _level(across, begin, y, pyramids[textured])
                base = pyramids[textured, level, 0]
                rows, columns = pyramids[textured, level, 1], pyramids[textured, level, 2]
                stride = columns + 2
                wide, high = np.float64(_STEPS * columns), np.float64(_STEPS * rows)
            stop = min(kept_until, end)
            count = stop - begin
            for n in range(count):
                column = np.float64(begin + n)
                scale = 1.0 / (sum_rise * column + sum_first)
                u, v = (u_rise * column + u_first) * scale, (v_rise * column + v_first) * scale
                # In steps between texel centres; each level has a border of one texel.
                steps_x[n] = np.int32((u - np.floor(u)) * wide) + half
                steps_y[n] = np.int32((v - np.floor(v)) * high) + half
            for n in range(count):
                i, j = steps_x[n], steps_y[n]
                one = np.uint64(base + (j >> _SHIFT) * stride + (i >> _SHIFT))
                two = one + np.uint64(stride)
                weight_x, weight_y = np.uint64(i & (_STEPS - 1)), np.uint64(j & (_STEPS - 1))
                rest_x, rest_y = np.uint64(_STEPS) - weight_x, np.uint64(_STEPS) - weight_y
                mix = rest_y * (rest_x * texels[one] + weight_x * texels[one + _ONE])
                mixed[n] = mix + weight_y * (rest_x * texels[two] + weight_x * texels[two + _ONE])
            reds, greens, blues = red[begin:stop], green[begin:stop], blue[begin:stop]
            for n in range(count):
                reds[n] = dye_red * np.float32(np.int32(mixed[n] & _MASK))
                greens[n] = dye_green * np.float32(np.int32((mixed[n] >> _LANE) & _MASK))
                blues[n] = dye_blue * np.float32(np.int32(mixed[n] >> _TWO_LANES))


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _level(across: np.ndarray, x: int, y: int, pyramid: np.ndarray) -> int:
    """Return the mipmap level whose texels are about as large as the pixel."""
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
    return level


def packed(picture: np.ndarray) -> np.ndarray:
    """Pack texels (m, 3) uint8 into (m,) uint64: colours 20 bits apart, so that one product weights all three."""
    texels = picture[:, 2].astype(np.uint64)
    for channel in (1, 0):
        texels <<= _LANE
        texels |= picture[:, channel]
    return np.asarray(texels)
