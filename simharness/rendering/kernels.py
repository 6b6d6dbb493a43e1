"""The compiled loops of the rasteriser: private, on plain arrays, single-threaded."""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

from __future__ import annotations

import math

import numpy as np
from numba import njit

# The kernels are typed by the arrays that the first call hands in. Float64 throughout: a room's floor and a
# fingertip go through the same arithmetic.


@njit(cache=True, error_model="numpy")
def rasterise(
    vertices: np.ndarray,
    faces: np.ndarray,
    P: np.ndarray,
    near: float,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
) -> None:
    """Write the nearest triangle at every pixel centre into ``inverse_depth`` and ``triangle``, in place.

    A triangle with vertices ``a, b, c`` in homogeneous pixel coordinates (``P @ (x, 1)``, the third is depth) is
    hit by the ray ``d = (x, y, 1)`` of a pixel where all of ``[b x c, c x a, a x b] . d`` have the sign of the
    determinant ``a . (b x c)``, and their sum over the determinant is the inverse depth of the hit. That needs
    no clipping: vertices behind the camera are as good as any (Olano & Greer, "Triangle scan conversion using
    2D homogeneous coordinates", 1997). Two triangles on one edge compute it with opposite signs and the same
    rounding, so no pixel falls between them. Both sides of a triangle are drawn.

    Args:
        vertices: (n, 3) float32, world.
        faces: (k, 3) int32.
        P: projection matrix, (3, 4), its last row unit: ``K [R | t]``.
        near: depth below which nothing is drawn.
        inverse_depth: (h, w) float32, zeros before the first call.
        triangle: (h, w) int32, index of the face seen; -1 before the first call.
    """
    height, width = triangle.shape
    q = np.empty((len(vertices), 3))
    uv = np.empty((len(vertices), 2))
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(3):
            q[i, k] = P[k, 0] * x + P[k, 1] * y + P[k, 2] * z + P[k, 3]
        if q[i, 2] >= near:
            uv[i, 0] = q[i, 0] / q[i, 2]
            uv[i, 1] = q[i, 1] / q[i, 2]

    edge, plane = np.empty((4, 3)), np.empty(3)
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        least = min(q[a, 2], q[b, 2], q[c, 2])
        most = max(q[a, 2], q[b, 2], q[c, 2])
        if most < near:
            continue
        left, right, top, bottom = 0.0, width - 1.0, 0.0, height - 1.0
        if least >= near:
            left = max(left, np.ceil(min(uv[a, 0], uv[b, 0], uv[c, 0])))
            right = min(right, np.floor(max(uv[a, 0], uv[b, 0], uv[c, 0])))
            top = max(top, np.ceil(min(uv[a, 1], uv[b, 1], uv[c, 1])))
            bottom = min(bottom, np.floor(max(uv[a, 1], uv[b, 1], uv[c, 1])))
        if left > right or top > bottom:  # most triangles of a body: they cover no pixel's centre
            continue

        for k in range(3):
            i, j = (b, c) if k == 0 else ((c, a) if k == 1 else (a, b))
            edge[k, 0] = q[i, 1] * q[j, 2] - q[i, 2] * q[j, 1]
            edge[k, 1] = q[i, 2] * q[j, 0] - q[i, 0] * q[j, 2]
            edge[k, 2] = q[i, 0] * q[j, 1] - q[i, 1] * q[j, 0]
        determinant = q[a, 0] * edge[0, 0] + q[a, 1] * edge[0, 1] + q[a, 2] * edge[0, 2]
        if determinant == 0.0:  # seen from its edge
            continue
        sides = 3
        for k in range(3):
            plane[k] = (edge[0, k] + edge[1, k] + edge[2, k]) / determinant
            for n in range(3):
                edge[n, k] = edge[n, k] if determinant > 0 else -edge[n, k]
        # Rounding must not lift a sliver out of its own range of depth.
        floor, ceiling = np.float32(1.0 / most), np.float32(1.0 / near)
        if least >= near:
            ceiling = np.float32(1.0 / least)
        else:  # the near plane cuts it: one more side
            sides = 4
            edge[3, 0], edge[3, 1], edge[3, 2] = -plane[0], -plane[1], 1.0 / near - plane[2]

        for y in range(int(top), int(bottom) + 1):
            start, end = left, right
            for n in range(sides):
                rise = edge[n, 0]
                offset = edge[n, 1] * y + edge[n, 2]
                if rise > 0:
                    start = max(start, np.ceil(-offset / rise))
                elif rise < 0:
                    end = min(end, np.floor(-offset / rise))
                elif offset < 0:
                    end = -1.0
            if start > end:
                continue
            slope, offset = plane[0], plane[1] * y + plane[2]
            depths, triangles = inverse_depth[y], triangle[y]
            for x in range(int(start), int(end) + 1):
                w = min(max(np.float32(offset + slope * x), floor), ceiling)
                if w > depths[x]:
                    depths[x] = w
                    triangles[x] = t


@njit(cache=True, error_model="numpy")
def normals(vertices: np.ndarray, faces: np.ndarray, smooth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals of faces (k, 3) and, area-weighted over the smooth faces, of vertices (n, 3); float32."""
    of_face = np.zeros((len(faces), 3), np.float32)
    of_vertex = np.zeros((len(vertices), 3), np.float32)
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ux, uy, uz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        vx, vy, vz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        if smooth[t]:
            for i in (a, b, c):
                of_vertex[i, 0] += nx
                of_vertex[i, 1] += ny
                of_vertex[i, 2] += nz
        length = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-20)
        of_face[t, 0], of_face[t, 1], of_face[t, 2] = nx / length, ny / length, nz / length
    for i in range(len(vertices)):
        nx, ny, nz = of_vertex[i, 0], of_vertex[i, 1], of_vertex[i, 2]
        length = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-20)
        of_vertex[i, 0], of_vertex[i, 1], of_vertex[i, 2] = nx / length, ny / length, nz / length
    return of_face, of_vertex


@njit(cache=True, error_model="numpy", fastmath=True)
def shade(
    triangle: np.ndarray,
    inverse_depth: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    colors: np.ndarray,
    smooth: np.ndarray,
    face_normals: np.ndarray,
    vertex_normals: np.ndarray,
    center: np.ndarray,
    rays: np.ndarray,
    light: np.ndarray,
    light_P: np.ndarray,
    shadow: np.ndarray,
    texel: float,
    background: np.ndarray,
) -> np.ndarray:
    """Colour every pixel: sky light from above, a key light with shadows, a little light from the camera.

    Args:
        triangle: (h, w) int32, face seen or -1.
        inverse_depth: (h, w) float32, 1/m.
        vertices: (n, 3) float32, world.
        faces: (k, 3) int32.
        colors: (k, 3) float32, sRGB albedo.
        smooth: (k,) bool, interpolate the normals of the vertices.
        face_normals: (k, 3) float32.
        vertex_normals: (n, 3) float32.
        center: the camera in the world, (3,).
        rays: (3, 3), so that ``center + depth * rays @ (x, y, 1)`` is the point at a pixel.
        light: unit direction to the key light, (3,).
        light_P: projection into the shadow map, (3, 4).
        shadow: inverse depth from the light, (s, s) float32, 0 where nothing stands in the light.
        texel: side of a pixel of the shadow map in the scene, metres.
        background: sRGB of what is not hit, (3,).

    Returns:
        (h, w, 3) uint8, sRGB.
    """
    height, width = triangle.shape
    side = shadow.shape[0]
    rgb = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            t = triangle[y, x]
            if t < 0:
                for k in range(3):
                    rgb[y, x, k] = np.uint8(255.0 * background[k] + 0.5)
                continue
            vx = rays[0, 0] * x + rays[0, 1] * y + rays[0, 2]
            vy = rays[1, 0] * x + rays[1, 1] * y + rays[1, 2]
            vz = rays[2, 0] * x + rays[2, 1] * y + rays[2, 2]
            depth = 1.0 / inverse_depth[y, x]
            px, py, pz = center[0] + depth * vx, center[1] + depth * vy, center[2] + depth * vz
            fx, fy, fz = face_normals[t, 0], face_normals[t, 1], face_normals[t, 2]
            nx, ny, nz = fx, fy, fz
            if smooth[t]:
                nx, ny, nz = 0.0, 0.0, 0.0
                for k in range(3):  # barycentric weight: area of the triangle that the point spans with the far edge
                    i, j = faces[t, (k + 1) % 3], faces[t, (k + 2) % 3]
                    ax, ay, az = vertices[i, 0] - px, vertices[i, 1] - py, vertices[i, 2] - pz
                    bx, by, bz = vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz
                    weight = fx * (ay * bz - az * by) + fy * (az * bx - ax * bz) + fz * (ax * by - ay * bx)
                    a = faces[t, k]
                    nx += weight * vertex_normals[a, 0]
                    ny += weight * vertex_normals[a, 1]
                    nz += weight * vertex_normals[a, 2]
                length = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-20)
                nx, ny, nz = nx / length, ny / length, nz / length
            facing = -(fx * vx + fy * vy + fz * vz)
            if facing < 0:  # seen from behind: the sheet's other side
                nx, ny, nz = -nx, -ny, -nz
                fx, fy, fz = -fx, -fy, -fz
            glance = -(nx * vx + ny * vy + nz * vz)  # the ray is a little longer than 1: near enough

            lit = nx * light[0] + ny * light[1] + nz * light[2]
            if lit > 0.0:
                # Step off the surface by the size of a shadow pixel, or the surface shadows itself.
                sx, sy, sz = px + 2.0 * texel * fx, py + 2.0 * texel * fy, pz + 2.0 * texel * fz
                w = 1.0 / (light_P[2, 0] * sx + light_P[2, 1] * sy + light_P[2, 2] * sz + light_P[2, 3])
                u = (light_P[0, 0] * sx + light_P[0, 1] * sy + light_P[0, 2] * sz + light_P[0, 3]) * w - 1.0
                v = (light_P[1, 0] * sx + light_P[1, 1] * sy + light_P[1, 2] * sz + light_P[1, 3]) * w - 1.0
                if 0 <= u < side - 3 and 0 <= v < side - 3:
                    c, r = int(u), int(v)
                    # Percentage-closer filtering: 4 x 4 comparisons under a sliding box of 3 x 3, but for the
                    # most part the corners agree and speak for the rest.
                    here = np.float32(w)
                    corners = (
                        int(shadow[r, c] > here)
                        + int(shadow[r, c + 3] > here)
                        + int(shadow[r + 3, c] > here)
                        + int(shadow[r + 3, c + 3] > here)
                    )
                    blocked = 2.25 * corners
                    if 0 < corners < 4:
                        du, dv = u - c, v - r
                        blocked = 0.0
                        for m in range(4):
                            row = 0.0
                            for n in range(4):
                                if shadow[r + m, c + n] > here:
                                    row += (1.0 - du) if n == 0 else (du if n == 3 else 1.0)
                            blocked += row * ((1.0 - dv) if m == 0 else (dv if m == 3 else 1.0))
                    lit *= 1.0 - blocked / 9.0
            else:
                lit = 0.0
            intensity = 0.26 + 0.14 * nz + 0.12 * min(max(glance, 0.0), 1.0) + 0.62 * lit
            gain = 255.0 * math.sqrt(min(max(intensity, 0.0), 1.0))  # sRGB is about the root of light
            for k in range(3):
                rgb[y, x, k] = np.uint8(min(gain * colors[t, k] + 0.5, 255.0))
    return rgb
