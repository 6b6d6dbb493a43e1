"""Stand-in meshes for the renderers' tests: nothing here knows about people or rooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simharness.types.mesh import Mesh

_BOX = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
_QUADS = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]


def _mesh(vertices, faces, color, *, smooth=False):
    faces = np.asarray(faces, np.int32)
    return Mesh(
        vertices=np.asarray(vertices, np.float32),
        faces=faces,
        colors=np.tile(np.float32(color), (len(faces), 1)),
        smooth=smooth,
    )


def box(center, size, color=(0.7, 0.6, 0.5)):
    """A closed box, its faces counter-clockwise from outside."""
    faces = [(a, b, c) for a, b, c, _ in _QUADS] + [(a, c, d) for a, _, c, d in _QUADS]
    return _mesh(_BOX * size + center, faces, color)


def room(size=(8, 8, 3), color=(0.85, 0.83, 0.8)):
    """Floor, walls and ceiling, seen from inside."""
    outside = box((0, 0, size[2] / 2), size, color)
    return _mesh(outside.vertices, outside.faces[:, ::-1], color)


def sheet(corners, color=(0.5, 0.5, 0.5)):
    """Four corners, counter-clockwise, as two triangles."""
    return _mesh(corners, [(0, 1, 2), (0, 2, 3)], color)


def ball(center, radius, color=(0.8, 0.5, 0.4), *, rings=24, stretch=1.0):
    """A sphere of 4 rings² faces whose vertices lie on it; ``stretch`` makes it a spheroid along z."""
    theta = np.pi * np.arange(1, rings)[:, None] / rings
    phi = np.pi * np.arange(2 * rings)[None] / rings
    body = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1
    ).reshape(-1, 3)
    unit = np.concatenate([body, [[0, 0, 1], [0, 0, -1]]])
    around = 2 * rings
    index = np.arange(len(body)).reshape(rings - 1, around)
    right = np.roll(index, -1, axis=1)
    top, bottom = len(body), len(body) + 1
    faces = np.concatenate(
        [
            np.stack([index[:-1], index[1:], right[1:]], -1).reshape(-1, 3),
            np.stack([index[:-1], right[1:], right[:-1]], -1).reshape(-1, 3),
            np.stack([np.full(around, top), index[0], right[0]], -1),
            np.stack([np.full(around, bottom), right[-1], index[-1]], -1),
        ]
    )
    return _mesh(unit * radius * [1, 1, stretch] + center, faces, color, smooth=True)


def figure(x, y, color=(0.3, 0.5, 0.8), *, rings=24, turn=0.0):
    """A simplified person of balls: legs, torso, arms, head; about 1.75 m tall, on the floor."""
    across = np.array([-np.sin(turn), np.cos(turn), 0.0])
    base = np.array([x, y, 0.0])
    parts = [
        ball(base + [0, 0, 1.18], 0.18, color, rings=rings, stretch=1.8),
        ball(base + [0, 0, 1.62], 0.11, (0.85, 0.65, 0.55), rings=rings, stretch=1.25),
    ]
    for side in (-1, 1):
        parts.append(
            ball(base + side * 0.1 * across + [0, 0, 0.46], 0.085, (0.25, 0.27, 0.35), rings=rings, stretch=5.4)
        )
        parts.append(ball(base + side * 0.26 * across + [0, 0, 1.12], 0.055, color, rings=rings, stretch=6.0))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]).astype(np.int32),
        colors=np.concatenate([part.colors for part in parts]),
        smooth=True,
    )


def crowd(rings=24):
    """Four people, boxes, a thin board and a room: meshes 0..3 are people, 4.. objects, the last is the room."""
    people = [
        figure(0.4, 0.3, (0.2, 0.45, 0.7), rings=rings, turn=0.4),
        figure(-0.9, 0.6, (0.75, 0.3, 0.25), rings=rings, turn=1.9),
        figure(0.1, -1.2, (0.3, 0.6, 0.35), rings=rings, turn=3.0),
        figure(1.5, -0.4, (0.8, 0.7, 0.3), rings=rings, turn=5.0),
    ]
    things = [
        box((-1.4, -1.0, 0.35), (0.7, 0.5, 0.7), (0.65, 0.5, 0.35)),
        box((1.2, 1.3, 0.25), (0.5, 0.5, 0.5), (0.6, 0.45, 0.3)),
        box((-0.2, 1.6, 0.9), (1.4, 0.3, 0.02), (0.5, 0.4, 0.3)),
        sheet([(2.2, -0.6, 0), (2.2, 0.4, 0), (2.2, 0.4, 1.1), (2.2, -0.6, 1.1)], (0.4, 0.5, 0.5)),
    ]
    return [*people, *things, room()]


def disc(center, normal, radius, color=(0.9, 0.2, 0.2), *, sides=48):
    """A flat disc that faces along ``normal``."""
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.cross(normal, [0.0, 0.0, 1.0])
    u /= np.linalg.norm(u)
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = center + radius * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.cross(normal, u))
    k = np.arange(sides)
    return _mesh(np.vstack([rim, center]), np.stack([k, (k + 1) % sides, np.full(sides, sides)], axis=-1), color)


def with_parts(mesh, labels):
    """The mesh with a label for each face."""
    return replace(mesh, parts=np.asarray(labels, np.int8))


def chequered(size, *, repeat=(1, 1), color=(1.0, 1.0, 1.0)):
    """An upright board in the plane x = 0, its foot at z = 0, seen from -x: 5 x 3 fields, no two alike, 40 x 24 texels.

    From there +y is to the left: u grows against y, v against z.
    """
    width, height = size
    fields = np.random.default_rng(2).permutation(np.linspace(20, 250, 45)).reshape(3, 5, 3).astype(np.uint8)
    texture = np.repeat(np.repeat(fields, 8, axis=0), 8, axis=1)
    y, (u, v) = width / 2, repeat
    board = sheet([(0, y, 0), (0, -y, 0), (0, -y, height), (0, y, height)], color)
    corners = np.array([(0, v), (u, v), (u, 0), (0, 0)], np.float32)
    return replace(board, texture=texture, uv=corners[[[0, 1, 2], [0, 2, 3]]])
