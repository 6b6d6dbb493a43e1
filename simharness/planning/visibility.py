"""What one camera sees of the people of all scenes: pixels, visibility of joints, boxes.

The rule of visibility, the capsules and the outlines are those of the simulator without pictures
(:mod:`simharness.capture.ray_visibility`); only obstacles are boxes here, because a user who plans knows no more.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.capture.body_outlines import IN_FRONT, bounding_box, packed, project_vertex
from simharness.capture.joint_visibility import classify
from simharness.capture.ray_casting import hit_people
from simharness.capture.rendering.renderer import NEAR
from simharness.planning.standing_people import StandingScenes
from simharness.types.views import Views, Visibility
from simharness.world.rigs.projection import project_to_image
from simharness.world.scene.objects.geoms import Box


def see(camera: Camera, scenes: StandingScenes, obstacles: Sequence[Box] = ()) -> Views:
    """Return what a camera sees of everyone: the views of S frames in one camera.

    Args:
        camera: the camera, which must not be inside an obstacle.
        scenes: S scenes of Q people.
        obstacles: boxes that hide people.
    """
    joints, pool = scenes.joints, scenes.pool
    pixels = project_to_image(camera, joints)
    pixels[~scenes.present] = np.nan
    inside = camera.inside(pixels)
    direction = joints - camera.center
    length = np.linalg.norm(direction, axis=-1)
    direction = direction / length[..., None]
    shape = inside.shape
    owner, in_front = np.full(shape, -1), np.full(shape, -np.inf)
    boxes_of_objects = np.array([[*each.center, *each.half, np.cos(each.yaw), np.sin(each.yaw)] for each in obstacles])
    _cast(
        camera.center,
        camera.R[2],
        inside,
        direction,
        length,
        scenes.capsules,
        pool.radii[scenes.pose],
        boxes_of_objects.reshape(-1, 8),
        owner,
        in_front,
    )
    labels = classify(owner, in_front, inside, radii=pool.depths[scenes.pose])
    boxes = _boxes(camera, scenes)
    return Views(
        pixels=pixels[:, None],
        visibility=labels[:, None],
        boxes=boxes[:, None],
        area_visible=np.zeros((*shape[:1], 1, shape[1]), np.int64),  # no step of the detector reads it
        source=np.arange(len(scenes))[:, None],
    )


def seen_joints(views: Views) -> Bools:
    """Return which joints a camera sees, itself unhidden or behind the person's own body alone, (S, Q, J)."""
    return np.isin(views.visibility[:, 0], (Visibility.VISIBLE, Visibility.SELF_OCCLUDED))


@njit(cache=True)
def _cast(center, forward, inside, direction, length, capsules, radii, objects, owner, in_front):
    """Write owner and distance of the surface in front of each joint that is inside the picture, (S, Q, J).

    Args:
        center: of the camera, (3,).
        forward: direction of its axis, (3,).
        inside: which joints are inside the picture, (S, Q, J).
        direction: of the rays to the joints, (S, Q, J, 3).
        length: of these rays, (S, Q, J).
        capsules: ends of the axes of everyone's capsules, (S, Q, C, 2, 3).
        radii: their radii, (S, Q, C).
        objects: centre, half sizes, cosine and sine of the yaw of each obstacle, (n, 8).
        owner: output: person, Q for an obstacle; unchanged without a surface.
        in_front: output: distance of the surface before the joint, metres; unchanged without a surface.
    """
    scenes, people, joints = inside.shape
    count = capsules.shape[2]
    first, around = np.arange(people + 1) * count, np.empty((people, 4))
    rays = people * joints
    which = np.empty(rays, np.int64)
    way, reach, near = np.empty((rays, 3)), np.empty(rays), np.empty(rays)
    hit, distance = np.empty(rays, np.int64), np.empty(rays)
    for s in range(scenes):
        for q in range(people):
            low, high = np.full(3, np.inf), np.full(3, -np.inf)
            for c in range(count):
                for e in range(2):
                    for k in range(3):
                        at = capsules[s, q, c, e, k]
                        low[k], high[k] = min(low[k], at - radii[s, q, c]), max(high[k], at + radii[s, q, c])
            around[q, :3] = (low + high) / 2
            around[q, 3] = np.sqrt(((high - low) ** 2).sum()) / 2
        n = 0
        for r in range(rays):
            q, j = r // joints, r % joints
            if inside[s, q, j]:
                which[n], reach[n] = r, length[s, q, j]
                along = 0.0
                for k in range(3):
                    way[n, k] = direction[s, q, j, k]
                    along += way[n, k] * forward[k]
                near[n], hit[n], distance[n] = NEAR / along, -1, np.inf
                n += 1
        placed = capsules[s].copy().reshape(people * count, 2, 3)
        bodies = placed, radii[s].copy().ravel(), first, around
        hit_people(center, way[:n], near[:n], reach[:n], bodies, hit[:n], distance[:n])
        for i in range(n):
            for b in range(len(objects)):
                entry = _enter_box(center, way[i], objects[b])
                if near[i] <= entry < min(distance[i], reach[i]):
                    hit[i], distance[i] = people, entry
            if hit[i] >= 0:
                q, j = which[i] // joints, which[i] % joints
                owner[s, q, j], in_front[s, q, j] = hit[i], reach[i] - distance[i]


@njit(cache=True)
def _enter_box(start, way, box):
    """Return where a ray enters a box, metres; infinite where it misses it or starts inside."""
    low, high = -np.inf, np.inf
    x, y = start[0] - box[0], start[1] - box[1]
    for k in range(3):
        if k == 2:
            at, along = start[2] - box[2], way[2]
        elif k == 0:
            at, along = box[6] * x + box[7] * y, box[6] * way[0] + box[7] * way[1]
        else:
            at, along = -box[7] * x + box[6] * y, -box[7] * way[0] + box[6] * way[1]
        if abs(along) < 1e-12:
            if abs(at) > box[3 + k]:
                return np.inf
            continue
        one, two = (-box[3 + k] - at) / along, (box[3 + k] - at) / along
        low, high = max(low, min(one, two)), min(high, max(one, two))
    return low if 0.0 <= low <= high else np.inf


def _boxes(camera: Camera, scenes: StandingScenes) -> Floats:
    """Return the boxes of everyone in the image, (S, Q, 4); zeros where nothing of the person is inside."""
    limits = np.full((len(scenes), scenes.people, 4), np.nan)
    people = _Placed(scenes.pose, scenes.turn, scenes.position, scenes.present)
    _box_everyone(people, scenes.pool.silhouettes, packed(camera)[None], limits)
    low, high = limits[..., :2], limits[..., 2:]
    inside = (high >= low).all(axis=-1, keepdims=True)  # False where NaN
    return np.where(inside, np.concatenate([low, high - low], axis=-1), 0.0)


class _Placed(NamedTuple):
    """People of S scenes."""

    pose: Integers
    """Poses of the pool, (S, Q)."""
    turn: Floats
    """Rotations, (S, Q, 3, 3)."""
    position: Floats
    """Positions, (S, Q, 3), metres."""
    present: Bools
    """Who is in the scene, (S, Q)."""


@njit(cache=True)
def _box_everyone(people, shapes, camera, out):
    """Write left, top, right, bottom of everyone in one image, (S, Q, 4).

    Where all extreme vertices are inside the image, their bounds are the box; else outline and edges are clipped.

    Args:
        people: the people, :class:`_Placed`.
        shapes: shapes of the poses, :class:`~simharness.planning.standing_people.Silhouettes`.
        camera: parameters of the camera, (1, 26).
        out: output.
    """
    c, limits = camera[0], np.empty((1, 4))
    for s in range(len(people.pose)):
        for q in range(people.pose.shape[1]):
            if not people.present[s, q]:
                continue
            pose = people.pose[s, q]
            turn, at, box = people.turn[s, q], people.position[s, q], out[s, q]
            box[:] = np.inf, np.inf, -np.inf, -np.inf
            inside, ahead = True, False
            for i in range(shapes.extremes_of[pose], shapes.extremes_of[pose + 1]):
                x, y, z = _moved(shapes.extremes[i], turn, at)
                a = c[5] * x + c[6] * y + c[7] * z + c[14]
                b = c[8] * x + c[9] * y + c[10] * z + c[15]
                d = c[11] * x + c[12] * y + c[13] * z + c[16]
                state, u, v = project_vertex(a, b, d, c)
                ahead |= d > 0
                if state == IN_FRONT and -0.5 <= u <= c[22] - 0.5 and -0.5 <= v <= c[23] - 0.5:
                    box[0], box[1] = min(box[0], u), min(box[1], v)
                    box[2], box[3] = max(box[2], u), max(box[3], v)
                else:
                    inside = False
            if inside or not ahead:
                continue
            first, last = shapes.outline_of[pose], shapes.outline_of[pose + 1]
            moved = np.empty((last - first, 3))
            for i in range(first, last):
                moved[i - first] = _moved(shapes.outlines[i], turn, at)
            body = shapes.body[pose]
            edges = shapes.edges[shapes.edges_of[body] : shapes.edges_of[body + 1]]
            bounding_box(moved, edges, camera, 0.0, 1.0, limits)
            box[:] = limits[0]


@njit(cache=True)
def _moved(vertex, turn, position):
    """Return the coordinates of a vertex (3,) turned (3, 3) and moved (3,)."""
    x, y, z = vertex[0], vertex[1], vertex[2]
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + position[0],
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + position[1],
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + position[2],
    )
