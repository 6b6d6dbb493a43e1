"""Compiled shading of skin, hair, cloth and leather.

A picture shows the light that a surface receives times its albedo. These kernels add what that leaves out, for some
pixels together: they multiply the received light, and write the share of it that the surface reflects like a mirror.

- All but matte surfaces have a GGX lobe (Walter et al., "Microfacet models for refraction through rough surfaces",
  2007; in the cheap form of Zioma, "Optimizing PBR for mobile", SIGGRAPH 2015), and reflect their surroundings (Karis,
  "Physically based shading on mobile", 2014).
- Skin lets light through: where the light ends, red reaches farther (wrapped diffuse light, Green in "GPU Gems", 2004).
- Hair has two highlights along its strands: one of the surface, towards the root, and one that went through the hair,
  in its colour, towards the tip (Kajiya & Kay, 1989; Scheuermann, "Hair rendering and shading", 2004).
- Cloth that is shorter along its grain than at rest folds, so deep that its length stays (Rohmer et al., "Animation
  wrinkling", 2010): its normal is tilted by a fixed profile of folds. The surface does not move.

The light around a figure is taken as one direction and an even rest: a row of :func:`.finishes.figure_light`.
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.surface_kernels import NORMAL_X, NORMAL_Y, NORMAL_Z, PIXELS, SECOND, THIRD
from simharness.types.mesh import Material

_FOLD_PERIOD, _FOLD_STEPS = 0.36, 256  # metres and entries of the profile of folds
_HAIR_STEPS = 512
_LEAST = np.float32(0.012)  # slope of folds that cannot be seen
_ZERO, _UNIT, _HALF, _TINY = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(1e-6)
_PRIMARY, _SECONDARY, _STREAKS = np.float32(0.07), np.float32(0.9), np.float32(0.22)
_SHIFT, _RAGGED = np.float32(0.09), np.float32(0.12)  # tilt of the highlights, and its change between strands
_DULL = np.float32(0.012)  # share of even light that hair reflects
_MOST_TINT = np.float32(0.22)  # by light that went through skin: in a cast shadow there is none
_TINTS = (np.float32(1.0), np.float32(0.38), np.float32(0.2))  # shares of it in red, green and blue light

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


_GRAIN_X, _GRAIN_Y, _GRAIN_Z, _TILT, _TONE, _VIEW_X, _VIEW_Y, _VIEW_Z, GLOSS, FINISHING = (
    PIXELS * row for row in range(10)
)
"""Rows of memory of :func:`finish`, float32, and their end."""

_TABLE, _SLOPES = _surface_table(), _fold_table()
_LOCKS, _STRANDS = _strand_tables()


class FinishArrays(NamedTuple):
    """Finishes of moving meshes in a pose and light, for one camera; of m faces and v vertices."""

    material: NDArray[np.int8]
    """Material of the faces, (m,) int8; empty where all surfaces are matte."""
    figure: NDArray[np.int16]
    """Mesh of the faces, (m,) int16."""
    lights: NDArray[np.float32]
    """Light around the meshes, see :func:`.finishes.figure_light`, (meshes, 7)."""
    pixel: NDArray[np.float32]
    """Size of a pixel at each mesh, metres, (meshes,) float32."""
    grain: NDArray[np.float32]
    """See :func:`.finishes.grain_of`, (v, 4)."""
    place: NDArray[np.float32]
    """See :class:`simharness.types.mesh.Finish`, (v,)."""
    around: float
    """Period of the place of hair, metres."""


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def finish(
    pixels: tuple[np.ndarray, ...],
    first: tuple[int, int],
    faces: np.ndarray,
    rays: np.ndarray,
    narrow: np.ndarray,
    finishes: FinishArrays,
    work: np.ndarray,
    received: np.ndarray,
) -> None:
    """Finish some pixels: multiply the received light, and write the share of it that is reflected without colour.

    Args:
        pixels: see :func:`.surface_kernels.gather`; no face is before the first moving one.
        first: first face and first vertex of the moving meshes.
        faces: vertex indices of all faces, (k, 3).
        rays: matrix that turns pixels into rays, (3, 3).
        narrow: surfaces of the pixels, see :func:`.surface_kernels.gather`.
        finishes: finishes of the moving meshes.
        work: memory, (``FINISHING``,) float32; the row from ``GLOSS`` on is the share that is reflected without colour.
        received: light on the pixels in rows of ``PIXELS``: red, green, blue; changed.
    """
    labels, columns, rows = pixels
    first_face, first_vertex = first
    material, figure, lights, pixel, grain, place, around = finishes
    _face_camera(columns, rows, rays, work)
    per_turn, end, last = np.float32(around), 0, len(labels)
    while end < last:
        start, f = end, np.uint32(labels[end] - first_face)
        kind, m = material[f], figure[f]
        fade = min(max(np.float32(1.6) - pixel[m] * np.float32(90.0), _ZERO), _UNIT)
        fine = min(max(np.float32(1.5) - pixel[m] * np.float32(300.0), _ZERO), _UNIT)
        ragged = False
        while end < last:  # a stretch of pixels of one material and figure
            f = np.uint32(labels[end] - first_face)
            if material[f] != kind or figure[f] != m:
                break
            n = end
            end += 1
            if kind != _HAIR and kind != _CLOTH:
                continue
            t = np.uint32(labels[n])
            a, b, c = faces[t, 0] - first_vertex, faces[t, 1] - first_vertex, faces[t, 2] - first_vertex
            ax, ay, az, depth, at = grain[a, 0], grain[a, 1], grain[a, 2], grain[a, 3], place[a]
            depth_b, depth_c = grain[b, 3] - depth, grain[c, 3] - depth
            if kind == _CLOTH and fade * max(depth, depth + depth_b, depth + depth_c) < _LEAST:
                work[_GRAIN_X + n], work[_GRAIN_Y + n], work[_GRAIN_Z + n] = _ZERO, _ZERO, _UNIT
                work[_TILT + n] = _ZERO
                continue
            ragged = True
            at_b, at_c, second, third = place[b] - at, place[c] - at, narrow[SECOND + n], narrow[THIRD + n]
            work[_GRAIN_X + n] = ax + second * (grain[b, 0] - ax) + third * (grain[c, 0] - ax)
            work[_GRAIN_Y + n] = ay + second * (grain[b, 1] - ay) + third * (grain[c, 1] - ay)
            work[_GRAIN_Z + n] = az + second * (grain[b, 2] - az) + third * (grain[c, 2] - az)
            if kind == _HAIR:
                at_b -= per_turn * np.float32(np.rint(at_b / per_turn))
                at_c -= per_turn * np.float32(np.rint(at_c / per_turn))
                u = at + second * at_b + third * at_c
                at_u = np.int32(np.floor(u * np.float32(_HAIR_STEPS / around))) & np.int32(_HAIR_STEPS - 1)
                work[_TILT + n] = fade * _LOCKS[at_u] + fine * _STRANDS[at_u]
            else:
                u = at + second * at_b + third * at_c
                at_u = np.int32(np.floor(u * np.float32(_FOLD_STEPS / _FOLD_PERIOD))) & np.int32(_FOLD_STEPS - 1)
                work[_TILT + n] = fade * max(depth + second * depth_b + third * depth_c, _ZERO) * _SLOPES[at_u]
        if kind == _MATTE or kind == _CLOTH:
            work[GLOSS + start : GLOSS + end] = _ZERO
        if kind == _MATTE or (kind == _CLOTH and not ragged):
            continue
        if kind == _CLOTH:
            _fold(narrow, work, start, end, lights[m])
        elif kind == _HAIR:
            _strands(narrow, work, start, end, lights[m])
        else:
            _lobe(narrow, work, start, end, lights[m], _TABLE[kind])
            if _TABLE[kind, 2] > _ZERO:
                _tint(narrow, work, start, end, lights[m], _TABLE[kind, 2])
                more = work[_TONE + start : _TONE + end]
                for k in range(3):
                    lit, part = received[k * PIXELS + start : k * PIXELS + end], _TINTS[k]
                    for n in range(len(more)):
                        lit[n] += part * more[n] * lit[n]
            continue
        tone = work[_TONE + start : _TONE + end]
        for k in range(3):
            lit = received[k * PIXELS + start : k * PIXELS + end]
            for n in range(len(tone)):
                lit[n] *= tone[n]


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _face_camera(columns: np.ndarray, rows: np.ndarray, rays: np.ndarray, work: np.ndarray) -> None:
    """Write the unit directions from pixels to the camera, (n,) each."""
    x_of = work[_VIEW_X : _VIEW_X + PIXELS]
    y_of = work[_VIEW_Y : _VIEW_Y + PIXELS]
    z_of = work[_VIEW_Z : _VIEW_Z + PIXELS]
    ax, bx, cx = np.float32(-rays[0, 0]), np.float32(-rays[0, 1]), np.float32(-rays[0, 2])
    ay, by, cy = np.float32(-rays[1, 0]), np.float32(-rays[1, 1]), np.float32(-rays[1, 2])
    az, bz, cz = np.float32(-rays[2, 0]), np.float32(-rays[2, 1]), np.float32(-rays[2, 2])
    for n in range(len(columns)):
        x, y = np.float32(columns[n]), np.float32(rows[n])
        vx, vy, vz = ax * x + bx * y + cx, ay * x + by * y + cy, az * x + bz * y + cz
        scale = _UNIT / np.float32(math.sqrt(vx * vx + vy * vy + vz * vz))
        x_of[n], y_of[n], z_of[n] = vx * scale, vy * scale, vz * scale


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _lobe(narrow: np.ndarray, work: np.ndarray, first: int, last: int, light: np.ndarray, surface: np.ndarray) -> None:
    """Write the gloss of pixels of one material; ``light`` is a row of lights."""
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x = narrow[NORMAL_X + first : NORMAL_X + last]
    normal_y = narrow[NORMAL_Y + first : NORMAL_Y + last]
    normal_z = narrow[NORMAL_Z + first : NORMAL_Z + last]
    view_x = work[_VIEW_X + first : _VIEW_X + last]
    view_y = work[_VIEW_Y + first : _VIEW_Y + last]
    view_z = work[_VIEW_Z + first : _VIEW_Z + last]
    gloss = work[GLOSS + first : GLOSS + last]
    reflectance, rough = surface[0], surface[1]
    alpha = rough * rough + light[6] * _HALF
    square, share_of_lobe = alpha * alpha, reflectance / (np.float32(4.0) * (rough + _HALF))
    # The surroundings: reflectance straight ahead and, on a rough surface less, at a glance.
    plain, glance = reflectance, np.float32(0.4) * (_UNIT - rough) ** 2
    for n in range(len(gloss)):
        nx, ny, nz, vx, vy, vz = normal_x[n], normal_y[n], normal_z[n], view_x[n], view_y[n], view_z[n]
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


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _tint(narrow: np.ndarray, work: np.ndarray, first: int, last: int, light: np.ndarray, wrap: np.float32) -> None:
    """Write to ``_TONE`` by which share there is more red light on skin: it reaches farther through than over it."""
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x = narrow[NORMAL_X + first : NORMAL_X + last]
    normal_y = narrow[NORMAL_Y + first : NORMAL_Y + last]
    normal_z = narrow[NORMAL_Z + first : NORMAL_Z + last]
    more, scale = work[_TONE + first : _TONE + last], _UNIT / (_UNIT + wrap)
    for n in range(len(more)):
        nz = normal_z[n]
        cosine = normal_x[n] * light_x + normal_y[n] * light_y + nz * light_z
        plain, wrapped = max(cosine, _ZERO), max((cosine + wrap) * scale, _ZERO)
        more[n] = min(key * (wrapped - plain) / (rest + rise * nz + key * plain + _TINY), _MOST_TINT)


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _fold(narrow: np.ndarray, work: np.ndarray, first: int, last: int, light: np.ndarray) -> None:
    """Write to ``_TONE`` how the light changes on normals that are tilted by slopes along the grain."""
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x = narrow[NORMAL_X + first : NORMAL_X + last]
    normal_y = narrow[NORMAL_Y + first : NORMAL_Y + last]
    normal_z = narrow[NORMAL_Z + first : NORMAL_Z + last]
    grain_x = work[_GRAIN_X + first : _GRAIN_X + last]
    grain_y = work[_GRAIN_Y + first : _GRAIN_Y + last]
    grain_z = work[_GRAIN_Z + first : _GRAIN_Z + last]
    tilt, tone = work[_TILT + first : _TILT + last], work[_TONE + first : _TONE + last]
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


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _strands(narrow: np.ndarray, work: np.ndarray, first: int, last: int, light: np.ndarray) -> None:
    """Write how hair shines.

    To ``_TONE`` how much more light comes back in the colour of hair, by strands and through them; to ``GLOSS`` the
    highlight of their surface, as a share of the light so changed.
    """
    light_x, light_y, light_z, key, rest, rise = light[0], light[1], light[2], light[3], light[4], light[5]
    normal_x = narrow[NORMAL_X + first : NORMAL_X + last]
    normal_y = narrow[NORMAL_Y + first : NORMAL_Y + last]
    normal_z = narrow[NORMAL_Z + first : NORMAL_Z + last]
    view_x = work[_VIEW_X + first : _VIEW_X + last]
    view_y = work[_VIEW_Y + first : _VIEW_Y + last]
    view_z = work[_VIEW_Z + first : _VIEW_Z + last]
    grain_x = work[_GRAIN_X + first : _GRAIN_X + last]
    grain_y = work[_GRAIN_Y + first : _GRAIN_Y + last]
    grain_z = work[_GRAIN_Z + first : _GRAIN_Z + last]
    tilt, tone = work[_TILT + first : _TILT + last], work[_TONE + first : _TONE + last]
    gloss = work[GLOSS + first : GLOSS + last]
    for n in range(len(gloss)):
        nx, ny, nz, vx, vy, vz = normal_x[n], normal_y[n], normal_z[n], view_x[n], view_y[n], view_z[n]
        direct = key * max(nx * light_x + ny * light_y + nz * light_z, _ZERO)
        share = direct / (rest + rise * nz + direct + _TINY)
        hx, hy, hz = vx + light_x, vy + light_y, vz + light_z
        gx, gy, gz = grain_x[n], grain_y[n], grain_z[n]
        along = nx * gx + ny * gy + nz * gz
        square = max(gx * gx + gy * gy + gz * gz - along * along, _LEAST)
        ahead, half = nx * hx + ny * hy + nz * hz, max(hx * hx + hy * hy + hz * hz, _LEAST)
        across = (gx * hx + gy * hy + gz * hz - along * ahead) / np.float32(math.sqrt(square))
        # Where hair has no direction, as at its edges, it has no highlight.
        lit, known = _UNIT + _STREAKS * tilt[n], min(np.float32(4.0) * square, _UNIT)
        through = _spot(across, ahead, half, _RAGGED * tilt[n] - np.float32(1.5) * _SHIFT)
        tone[n] = lit * (_UNIT + _SECONDARY * known * share * through * through)
        over = _spot(across, ahead, half, _RAGGED * tilt[n] + _SHIFT)
        over *= over
        over *= over
        away = _UNIT - min(max(nx * vx + ny * vy + nz * vz, _ZERO), _UNIT)
        away *= away
        spot = lit * known * share * _PRIMARY * over * over
        gloss[n] = (spot + (_UNIT - share) * (_DULL + _DULL * away * away)) / tone[n]


@njit(cache=True, borrows=True, inline="always", error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _spot(across: np.float32, ahead: np.float32, half: np.float32, lean: np.float32) -> np.float32:
    """Return the eighth power of the sine of the angle between a strand that leans and the half vector.

    Args:
        across: part of the half vector along the strand.
        ahead: part of it along the normal.
        half: its squared length.
        lean: slope of the strand.
    """
    across -= lean * ahead
    sine = max(_UNIT - across * across / ((_UNIT + lean * lean) * half), _ZERO)
    sine *= sine
    sine *= sine
    return sine
