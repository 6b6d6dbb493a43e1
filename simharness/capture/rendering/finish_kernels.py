"""Compiled shading of skin, hair, cloth and leather: private, on plain arrays, single-threaded.

A picture shows the light that a surface receives times its albedo. These kernels add what that leaves out, for the
pixels of a row: they multiply the received light, and write the share of it that the surface reflects like a mirror.

- All but matte surfaces have a GGX lobe (Walter et al., "Microfacet models for refraction through rough surfaces",
  2007; in the cheap form of Zioma, "Optimizing PBR for mobile", SIGGRAPH 2015), and reflect their surroundings (Karis,
  "Physically based shading on mobile", 2014).
- Skin lets light through: where the light ends, red reaches farther (wrapped diffuse light, Green in "GPU Gems", 2004).
- Hair has two highlights along its strands: one of the surface, towards the root, and one that went through the hair,
  in its colour, towards the tip (Kajiya & Kay, 1989; Scheuermann, "Hair rendering and shading", 2004).
- Cloth that is shorter along its grain than at rest folds, so deep that its length stays (Rohmer et al., "Animation
  wrinkling", 2010): its normal is tilted by a fixed profile of folds. The surface does not move.

The light around a figure is taken as one direction and an even rest: a row of :func:`figure_light`.
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.occlusion_kernels import light_at
from simharness.types.finish import Material

_HEIGHT = 0.75  # share of a figure's height at which its light is taken
_FOLD_PERIOD, _FOLD_STEPS = 0.36, 256  # metres and entries of the profile of folds
_HAIR_STEPS = 512
_SLACK = 0.02  # share of its length by which cloth shortens without a fold
_DEPTH, _DEEPEST = 1.3, 0.65  # slope of folds for each unit of shortening beyond it, and at most
_EVER = 0.07  # slope of folds of loose cloth at rest
_LEAST = np.float32(0.012)  # slope of folds that cannot be seen
_ZERO, _UNIT, _HALF, _TINY = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(1e-6)
_PRIMARY, _SECONDARY, _STREAKS = np.float32(0.07), np.float32(0.9), np.float32(0.22)
_SHIFT, _RAGGED = np.float32(0.09), np.float32(0.12)  # tilt of the highlights, and its change between strands
_DULL = np.float32(0.012)  # share of even light that hair reflects
_MOST_TINT = np.float32(0.22)  # by light that went through skin: in a cast shadow there is none
_OF_GREEN, _OF_BLUE = np.float32(0.38), np.float32(0.2)  # share of it in green and blue light

# Reflectance at normal incidence, roughness, and wrap of red light. Skin: Weyrich et al., "Analysis of human
# faces", 2006 (roughness 0.3 to 0.45, refractive index 1.4); hair and leather: refractive index 1.55 and 1.5.
_SURFACES = {
    Material.SKIN: (0.028, 0.45, 0.14),
    Material.HAIR: (0.046, 0.60, 0.0),
    Material.CLOTH: (0.02, 0.95, 0.0),
    Material.LEATHER: (0.04, 0.50, 0.0),
    Material.PLASTIC: (0.045, 0.28, 0.0),
    Material.EYE: (0.035, 0.16, 0.0),
    Material.METAL: (0.60, 0.30, 0.0),
}
_MATTE, _HAIR, _CLOTH = int(Material.MATTE), int(Material.HAIR), int(Material.CLOTH)


def _surface_table() -> np.ndarray:
    """Return reflectance, roughness and wrap by material, (materials, 3) float32."""
    table = np.zeros((len(Material), 3), np.float32)
    for material, row in _SURFACES.items():
        table[material] = row
    return table


def _fold_table() -> np.ndarray:
    """Return the slope of the profile of folds, -1 to 1, (_FOLD_STEPS,) float32."""
    turn = 2 * np.pi * np.arange(_FOLD_STEPS) / _FOLD_STEPS
    waves = ((5, 0.6, 0.3), (7, 0.8, 2.1), (9, 1.0, 4.4), (12, 0.8, 1.2), (17, 0.5, 5.3), (23, 0.35, 3.0))
    slope = sum(size * np.cos(n * turn + phase) for n, size, phase in waves)
    return np.asarray(slope / np.abs(slope).max(), np.float32)


def _strand_tables() -> tuple[np.ndarray, np.ndarray]:
    """Return how locks and single strands differ around the head, each (_HAIR_STEPS,) float32 of -1 to 1."""
    drawn = np.random.Generator(np.random.Philox(key=np.array([5, 11], np.uint64))).uniform(-1, 1, (2, _HAIR_STEPS))
    wide = sum(np.roll(drawn[0], k) * (6 - abs(k)) for k in range(-5, 6)) / 36 * 2.2
    fine = (np.roll(drawn[1], 1) + 2 * drawn[1] + np.roll(drawn[1], -1)) / 4 * 1.4
    return np.clip(wide, -1, 1).astype(np.float32), np.clip(fine, -1, 1).astype(np.float32)


_TABLE, _SLOPES = _surface_table(), _fold_table()
_LOCKS, _STRANDS = _strand_tables()


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def grain_of(vertices: np.ndarray, toward: np.ndarray, rest: np.ndarray, looseness: np.ndarray) -> np.ndarray:
    """Return the unit direction of the grain at every vertex and the slope of the folds there, (n, 4) float32.

    Args:
        vertices: positions, (n, 3) float32.
        toward: vertex that each points to, (n,).
        rest: distance to it at rest, metres, (n,) float32.
        looseness: see :class:`simharness.types.finish.Finish`, (n,) float32.
    """
    grain = np.zeros((len(vertices), 4), np.float32)
    for i in range(len(vertices)):
        k = toward[i]
        if k == i:
            continue
        x, y, z = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
        length = np.float32(math.sqrt(x * x + y * y + z * z))
        scale = _UNIT / max(length, _TINY)
        grain[i, 0], grain[i, 1], grain[i, 2] = x * scale, y * scale, z * scale
        if looseness[i] > _ZERO:
            short = np.float32(_DEPTH) * max(_UNIT - length / rest[i] - np.float32(_SLACK), _ZERO)
            grain[i, 3] = min(looseness[i] * (np.float32(_EVER) + short), np.float32(_DEEPEST))
    return grain


@njit(cache=True, error_model="numpy")
def figure_light(
    vertices: np.ndarray, spans: np.ndarray, origin: np.ndarray, step: np.ndarray, every: np.ndarray,
    straight: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the light around figures, (meshes, 7) float32.

    A row is the unit direction to the direct light, the luminance of its irradiance, that of the rest, the change of
    the rest with the upward part of a normal, and how wide the direct light is as roughness.

    Args:
        vertices: vertices of the moving meshes, (v, 3).
        spans: first and end of the vertices of each mesh, (meshes, 2).
        origin: origin of the probes, (3,).
        step: distances of the probes, (3,).
        every: light of all sources at the probes by the six directions, (nx, ny, nz, 18).
        straight: luminance of what comes straight from area lights and sun, (nx, ny, nz, 6).
    """
    result = np.zeros((len(spans), 7), np.float32)
    column, direct, rest = np.empty(18), np.empty(6), np.empty(6)
    for mesh in range(len(spans)):
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(spans[mesh, 0], spans[mesh, 1]):
            for c in range(3):
                value = np.float64(vertices[i, c])
                low[c], high[c] = min(low[c], value), max(high[c], value)
        if not high[0] >= low[0]:
            continue
        x, y, z = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] + _HEIGHT * (high[2] - low[2])
        light_at(origin, step, every, x, y, z, column)
        light_at(origin, step, straight, x, y, z, direct)
        dx, dy, dz = direct[0] - direct[1], direct[2] - direct[3], direct[4] - direct[5]
        length, whole, mean = math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6, 0.0
        scale = 1.0 / max(length, 1e-9)
        dx, dy, dz = dx * scale, dy * scale, dz * scale
        for axis in range(6):
            whole += direct[axis]
            way = (dx if axis < 2 else (dy if axis < 4 else dz)) * (1.0 - 2.0 * (axis % 2))
            total = 0.2126 * column[3 * axis] + 0.7152 * column[3 * axis + 1] + 0.0722 * column[3 * axis + 2]
            rest[axis] = max(total - length * max(way, 0.0), 0.05 * total)
            mean += rest[axis] / 6.0
        rise = min(max(0.5 * (rest[4] - rest[5]), -0.9 * mean), 0.9 * mean)
        wide = 0.5 * min(max(0.9 - 0.8 * length / whole, 0.1), 0.7)
        result[mesh, 0], result[mesh, 1], result[mesh, 2], result[mesh, 3] = dx, dy, dz, length
        result[mesh, 4], result[mesh, 5], result[mesh, 6] = mean, rise, wide
    return result


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def finish(
    triangle: np.ndarray,
    y: int,
    first: int,
    last: int,
    first_face: int,
    faces: np.ndarray,
    first_vertex: int,
    rays: np.ndarray,
    normal: np.ndarray,
    weights: np.ndarray,
    material: np.ndarray,
    figure: np.ndarray,
    lights: np.ndarray,
    pixel: np.ndarray,
    grain: np.ndarray,
    place: np.ndarray,
    around: float,
    work: np.ndarray,
    received: np.ndarray,
    gloss: np.ndarray,
) -> None:
    """Finish the pixels ``first`` to before ``last`` of a row: multiply the received light, and write the gloss.

    Args:
        triangle: visible faces of the row, (w,) int32; none of the pixels shows a face before ``first_face``.
        y: row of the picture.
        first: first pixel.
        last: end of the pixels.
        first_face: first face of the moving meshes.
        faces: vertex indices of all faces, (k, 3).
        first_vertex: first vertex of the moving meshes.
        rays: see :func:`.shading_kernels.shade`.
        normal: unit normals of the pixels, (3, w).
        weights: weights of the second and third corner, (2, w).
        material: material of the moving faces, (m,) int8.
        figure: mesh of the moving faces, (m,) int16.
        lights: light around the meshes, see :func:`figure_light`, (meshes, 7).
        pixel: size of a pixel at each mesh, metres, (meshes,) float32.
        grain: see :func:`grain_of`; of the moving vertices, (v, 4).
        place: see :class:`simharness.types.finish.Finish`, (v,).
        around: period of the place of hair, metres.
        work: memory, (5, w) float32.
        received: light on the pixels, (3, w), changed.
        gloss: share of it that is reflected without colour, (w,), written.
    """
    second, third, per_turn = weights[0], weights[1], np.float32(around)
    grain_x, grain_y, grain_z, tilt, tone = work[0], work[1], work[2], work[3], work[4]
    end, stop = first, first
    while end < last:
        start, f = end, np.uint32(triangle[end] - first_face)
        kind, m = material[f], figure[f]
        fade = min(max(np.float32(1.6) - pixel[m] * np.float32(90.0), _ZERO), _UNIT)
        fine = min(max(np.float32(1.5) - pixel[m] * np.float32(300.0), _ZERO), _UNIT)
        ragged = False
        # A stretch of pixels of one material and figure, triangle by triangle.
        while end < last:
            stop, label = end, triangle[end]
            f = np.uint32(label - first_face)
            if material[f] != kind or figure[f] != m:
                break
            while end < last and triangle[end] == label:
                end += 1
            if kind != _HAIR and kind != _CLOTH:
                continue
            t = np.uint32(label)
            a, b, c = faces[t, 0] - first_vertex, faces[t, 1] - first_vertex, faces[t, 2] - first_vertex
            ax, ay, az, depth, at = grain[a, 0], grain[a, 1], grain[a, 2], grain[a, 3], place[a]
            depth_b, depth_c = grain[b, 3] - depth, grain[c, 3] - depth
            if kind == _CLOTH and fade * max(depth, depth + depth_b, depth + depth_c) < _LEAST:
                grain_x[stop:end], grain_y[stop:end], grain_z[stop:end], tilt[stop:end] = _ZERO, _ZERO, _UNIT, _ZERO
                continue
            ragged = True
            bx, by, bz, at_b = grain[b, 0] - ax, grain[b, 1] - ay, grain[b, 2] - az, place[b] - at
            cx, cy, cz, at_c = grain[c, 0] - ax, grain[c, 1] - ay, grain[c, 2] - az, place[c] - at
            if kind == _HAIR:
                at_b -= per_turn * np.float32(np.rint(at_b / per_turn))
                at_c -= per_turn * np.float32(np.rint(at_c / per_turn))
            for x in range(stop, end):
                vb, vc = second[x], third[x]
                grain_x[x], grain_y[x] = ax + vb * bx + vc * cx, ay + vb * by + vc * cy
                grain_z[x] = az + vb * bz + vc * cz
                u = at + vb * at_b + vc * at_c
                if kind == _HAIR:
                    row = np.int32(np.floor(u * np.float32(_HAIR_STEPS / around))) & np.int32(_HAIR_STEPS - 1)
                    tilt[x] = fade * _LOCKS[row] + fine * _STRANDS[row]
                else:
                    row = np.int32(np.floor(u * np.float32(_FOLD_STEPS / _FOLD_PERIOD))) & np.int32(_FOLD_STEPS - 1)
                    tilt[x] = fade * max(depth + vb * depth_b + vc * depth_c, _ZERO) * _SLOPES[row]
        if kind == _MATTE or kind == _CLOTH:
            gloss[start:end] = _ZERO
        if kind == _MATTE or (kind == _CLOTH and not ragged):
            continue
        span = slice(start, end)
        normals, strands = normal[:, span], work[:3, span]
        if kind == _CLOTH:
            _fold(normals, strands, tilt[span], lights[m], tone[span])
        elif kind == _HAIR:
            _strands_through(normals, strands, tilt[span], lights[m], rays, start, y, tone[span])
            _strands_over(normals, strands, tilt[span], lights[m], rays, start, y, gloss[span])
            for x in range(start, end):
                gloss[x] /= tone[x]
        else:
            _lobe(normals, lights[m], rays, start, y, _TABLE[kind], gloss[span])
            if _TABLE[kind, 2] > _ZERO:
                _tint(normals, lights[m], _TABLE[kind, 2], tone[span])
                red, green, blue = received[0], received[1], received[2]
                for x in range(start, end):
                    more = tone[x]
                    red[x] += more * red[x]
                    green[x] += _OF_GREEN * more * green[x]
                    blue[x] += _OF_BLUE * more * blue[x]
            continue
        for k in range(3):
            lit = received[k]
            for x in range(start, end):
                lit[x] *= tone[x]


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _lobe(
    normal: np.ndarray, light: np.ndarray, rays: np.ndarray, first: int, y: int, surface: np.ndarray, gloss: np.ndarray
) -> None:
    """Write the gloss of pixels of one material, (n,), from unit normals (3, n); ``light`` is a row of lights."""
    rise_x, rise_y, rise_z, ray_x, ray_y, ray_z = _view(rays, first, y)
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    reflectance, rough = surface[0], surface[1]
    alpha = rough * rough + light[6] * _HALF
    square, share_of_lobe = alpha * alpha, reflectance / (np.float32(4.0) * (rough + _HALF))
    # The surroundings: reflectance straight ahead and, on a rough surface less, at a glance.
    plain, glance = reflectance, np.float32(0.4) * (_UNIT - rough) ** 2
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    for n in range(len(gloss)):
        column, nx, ny, nz = np.float32(n), normal_x[n], normal_y[n], normal_z[n]
        vx, vy, vz = ray_x - rise_x * column, ray_y - rise_y * column, ray_z - rise_z * column
        scale = _UNIT / np.float32(math.sqrt(vx * vx + vy * vy + vz * vz))
        vx, vy, vz = vx * scale, vy * scale, vz * scale
        direct = key * max(nx * light_x + ny * light_y + nz * light_z, _ZERO)
        share = direct / (rest + rise * nz + direct + _TINY)
        hx, hy, hz = vx + light_x, vy + light_y, vz + light_z
        along = max(hx * hx + hy * hy + hz * hz, _LEAST)  # of half the angle: 4 cos^2
        ahead = nx * hx + ny * hy + nz * hz
        spread = ahead * ahead / along * (square - _UNIT) + _UNIT
        lobe = share_of_lobe * square / (spread * spread * max(np.float32(0.25) * along, np.float32(0.1)))
        away = _UNIT - min(max(nx * vx + ny * vy + nz * vz, _ZERO), _UNIT)
        away *= away
        gloss[n] = share * lobe + (_UNIT - share) * (plain + glance * away * away)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _tint(normal: np.ndarray, light: np.ndarray, wrap: np.float32, more: np.ndarray) -> None:
    """Write by which share there is more red light on skin (n,), since it reaches farther through skin than over it."""
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x, normal_y, normal_z, scale = normal[0], normal[1], normal[2], _UNIT / (_UNIT + wrap)
    for n in range(len(more)):
        nz = normal_z[n]
        cosine = normal_x[n] * light_x + normal_y[n] * light_y + nz * light_z
        plain, wrapped = max(cosine, _ZERO), max((cosine + wrap) * scale, _ZERO)
        more[n] = min(key * (wrapped - plain) / (rest + rise * nz + key * plain + _TINY), _MOST_TINT)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _fold(normal: np.ndarray, strands: np.ndarray, tilt: np.ndarray, light: np.ndarray, tone: np.ndarray) -> None:
    """Write how the light changes on normals (3, n) that are tilted by slopes (n,) along the grain (3, n), (n,)."""
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    grain_x, grain_y, grain_z = strands[0], strands[1], strands[2]
    for n in range(len(tone)):
        nx, ny, nz, gx, gy, gz = normal_x[n], normal_y[n], normal_z[n], grain_x[n], grain_y[n], grain_z[n]
        along = nx * gx + ny * gy + nz * gz
        square = max(gx * gx + gy * gy + gz * gz - along * along, _LEAST)
        slope = tilt[n]
        per_length = slope / np.float32(math.sqrt(square))
        scale = _UNIT / np.float32(math.sqrt(_UNIT + slope * slope))
        # The grain without its part along the normal has the slope.
        keep = _UNIT + per_length * along
        before = nx * light_x + ny * light_y + nz * light_z
        after = (keep * before - per_length * (gx * light_x + gy * light_y + gz * light_z)) * scale
        up = (keep * nz - per_length * gz) * scale
        was = rest + rise * nz + key * max(before, _ZERO) + _TINY
        tone[n] = (rest + rise * up + key * max(after, _ZERO) + _TINY) / was


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _strands_over(
    normal: np.ndarray, strands: np.ndarray, tilt: np.ndarray, light: np.ndarray, rays: np.ndarray, first: int, y: int,
    gloss: np.ndarray,
) -> None:  # fmt: skip
    """Write the highlight of the surface of hair, (n,); ``tilt`` (n,) is how the strands differ."""
    rise_x, rise_y, rise_z, ray_x, ray_y, ray_z = _view(rays, first, y)
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    grain_x, grain_y, grain_z = strands[0], strands[1], strands[2]
    for n in range(len(gloss)):
        column, nx, ny, nz = np.float32(n), normal_x[n], normal_y[n], normal_z[n]
        vx, vy, vz = ray_x - rise_x * column, ray_y - rise_y * column, ray_z - rise_z * column
        scale = _UNIT / np.float32(math.sqrt(vx * vx + vy * vy + vz * vz))
        direct = key * max(nx * light_x + ny * light_y + nz * light_z, _ZERO)
        share = direct / (rest + rise * nz + direct + _TINY)
        hx, hy, hz = vx * scale + light_x, vy * scale + light_y, vz * scale + light_z
        gx, gy, gz = grain_x[n], grain_y[n], grain_z[n]
        along = nx * gx + ny * gy + nz * gz
        square = max(gx * gx + gy * gy + gz * gz - along * along, _LEAST)
        ahead = nx * hx + ny * hy + nz * hz
        over = (gx * hx + gy * hy + gz * hz - along * ahead) / np.float32(math.sqrt(square))
        lean = _RAGGED * tilt[n] + _SHIFT
        over -= lean * ahead
        sine = _UNIT - over * over / ((_UNIT + lean * lean) * max(hx * hx + hy * hy + hz * hz, _LEAST))
        sine = max(sine, _ZERO)
        sine *= sine
        sine *= sine
        sine *= sine
        sine *= sine
        away = _UNIT - min(max((nx * vx + ny * vy + nz * vz) * scale, _ZERO), _UNIT)
        away *= away
        lit = _UNIT + _STREAKS * tilt[n]
        # Where hair has no direction, as at its edges, it has no highlight.
        known = min(np.float32(4.0) * square, _UNIT)
        gloss[n] = lit * known * share * _PRIMARY * sine * sine + (_UNIT - share) * (_DULL + _DULL * away * away)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _strands_through(
    normal: np.ndarray, strands: np.ndarray, tilt: np.ndarray, light: np.ndarray, rays: np.ndarray, first: int, y: int,
    tone: np.ndarray,
) -> None:  # fmt: skip
    """Write how much more light comes back in the colour of hair, (n,): by strands, and by light through them."""
    rise_x, rise_y, rise_z, ray_x, ray_y, ray_z = _view(rays, first, y)
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x, normal_y, normal_z = normal[0], normal[1], normal[2]
    grain_x, grain_y, grain_z = strands[0], strands[1], strands[2]
    for n in range(len(tone)):
        column, nx, ny, nz = np.float32(n), normal_x[n], normal_y[n], normal_z[n]
        vx, vy, vz = ray_x - rise_x * column, ray_y - rise_y * column, ray_z - rise_z * column
        scale = _UNIT / np.float32(math.sqrt(vx * vx + vy * vy + vz * vz))
        direct = key * max(nx * light_x + ny * light_y + nz * light_z, _ZERO)
        share = direct / (rest + rise * nz + direct + _TINY)
        hx, hy, hz = vx * scale + light_x, vy * scale + light_y, vz * scale + light_z
        gx, gy, gz = grain_x[n], grain_y[n], grain_z[n]
        along = nx * gx + ny * gy + nz * gz
        square = max(gx * gx + gy * gy + gz * gz - along * along, _LEAST)
        ahead = nx * hx + ny * hy + nz * hz
        over = (gx * hx + gy * hy + gz * hz - along * ahead) / np.float32(math.sqrt(square))
        lean = _RAGGED * tilt[n] - np.float32(1.5) * _SHIFT
        over -= lean * ahead
        sine = _UNIT - over * over / ((_UNIT + lean * lean) * max(hx * hx + hy * hy + hz * hz, _LEAST))
        sine = max(sine, _ZERO)
        sine *= sine
        sine *= sine
        known = min(np.float32(4.0) * square, _UNIT)
        tone[n] = (_UNIT + _STREAKS * tilt[n]) * (_UNIT + _SECONDARY * known * share * sine * sine)


@njit(cache=True, error_model="numpy", inline="always")
def _view(rays: np.ndarray, first: int, y: int) -> tuple:
    """Return the change of the way to the camera from pixel to pixel, and minus that way at the first pixel."""
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    ray_x = np.float32(-(rays[0, 0] * first + rays[0, 1] * y + rays[0, 2]))
    ray_y = np.float32(-(rays[1, 0] * first + rays[1, 1] * y + rays[1, 2]))
    ray_z = np.float32(-(rays[2, 0] * first + rays[2, 1] * y + rays[2, 2]))
    return rise_x, rise_y, rise_z, ray_x, ray_y, ray_z
