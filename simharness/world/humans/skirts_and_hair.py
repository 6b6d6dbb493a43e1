"""Meshes of skirts, long hair, buns, bobs and ponytails, which are added to the mesh of the body, and curls.

A skirt consists of rings of vertices. Above the hips a ring follows the pelvis. Below, it is the common outline of the
two thighs: every vertex has a direction and lies on the thigh that extends further in that direction, in every pose.
So a ring is the hull of two round sections, like cloth around both legs, and no thigh comes through during a stride.
"""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.added_mesh import AddedMesh, FacePoints, directions_at, grid, hull, rigid
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.skinning import Skirt

_THIGH = ("UpLeg", "Leg")
_COLUMNS = 40
_RING_GAP = 0.035  # metres
_FITTED = 0.15  # metres below the waistband at which a skirt reaches its full width
_EASE = 0.015  # least gap between a skirt and the skin or clothes below it, metres
_FLARE = {"skirt": 0.05, "dress": 0.06, "coat": 0.045}  # metres by which a hem at the knee is wider than the thigh
_TOP = {"skirt": 0.003, "dress": 0.0, "coat": 0.0}  # gap at the upper edge, metres
_HELD = (-0.15, 0.25)  # range in which the weight of the pelvis falls from 1 to 0, thigh lengths below the hip joint
_BEHIND = (98.0, 262.0)  # bearings from the face around the head's axis, degrees: from behind one ear to the other


def skirt(body: Body, *, top: float, length: float, kind: str, ease: float) -> tuple[AddedMesh, Skirt]:
    """Make the mesh of a skirt and its motion; ``Skirt.first`` is 0, so the caller adds the number of other vertices.

    Args:
        body: rest body with the clothes below the skirt.
        top: height of the upper edge, metres.
        length: level of the hem, 0 at the hips to 1 at the knees.
        kind: "skirt", "dress" or "coat".
        ease: additional width beyond the least gap, metres.
    """
    hips, knees = (np.stack([body.heads[body.index(side + bone)] for side in ("Left", "Right")]) for bone in _THIGH)
    axis = knees - hips
    thigh = np.linalg.norm(axis, axis=1).mean()
    first = -(top - hips[:, 2].mean()) / thigh
    depth = np.linspace(first, length, max(4, int((length - first) * thigh / _RING_GAP)))
    bearing = np.linspace(0, 2 * np.pi, _COLUMNS, endpoint=False)
    directions = np.column_stack([np.cos(bearing), np.sin(bearing), np.zeros(_COLUMNS)])

    trunk, legs = _body_points(body)
    pelvis = np.array([body.heads[0, 0], 0.0])
    pelvis_share = 1 - _smoothstep((depth - _HELD[0]) / (_HELD[1] - _HELD[0]))
    anchors = np.zeros((len(depth), _COLUMNS, 3, 3))  # on the pelvis, the left thigh, the right thigh
    centers = np.zeros((len(depth), 2, 3))
    outline = np.zeros(_COLUMNS)
    for k, t in enumerate(depth):
        wide = _EASE + ease + _FLARE[kind] * max(t, 0.0) ** 1.3
        height = hips[:, 2].mean() + t * axis[:, 2].mean()
        around = trunk[np.abs(trunk[:, 2] - height) < 0.025]
        if len(around) > 20:  # below the crotch there is no trunk: the outline of the last ring is kept
            outline = hull(around[:, :2] - pelvis, bearing)
        fitted = min((t - first) * thigh / _FITTED, 1.0)
        ring = directions[:, :2] * (outline + wide * fitted + _TOP[kind] * (1 - fitted))[:, None]
        anchors[k, :, 0] = np.column_stack([pelvis + ring, np.full(_COLUMNS, height)])
        for side in range(2):
            along = max(t, 0.12)
            centers[k, side] = hips[side] + t * axis[side]
            leg = legs[side] - hips[side]
            near = leg[np.abs(leg @ axis[side] / (axis[side] @ axis[side]) - along) < 0.06] - along * axis[side]
            reach = (near[:, :2] @ directions[:, :2].T).max(0)
            anchors[k, :, 1 + side] = centers[k, side] + (reach + wide)[:, None] * directions

    shape = (len(depth), _COLUMNS)
    hang = Skirt(
        first=0,
        anchors=anchors.reshape(-1, 3, 3).astype(np.float32),
        centers=np.broadcast_to(centers[:, None], (*shape, 2, 3)).reshape(-1, 2, 3).astype(np.float32),
        directions=np.broadcast_to(directions, (*shape, 3)).reshape(-1, 3).astype(np.float32),
        pelvis_share=np.repeat(pelvis_share, _COLUMNS).astype(np.float32),
        bones=(0, body.index("LeftUpLeg"), body.index("RightUpLeg")),
    )
    vertices = np.zeros((len(hang.directions), 3), np.float32)
    hang.hang(np.tile(np.eye(3, 4, dtype=np.float32), (len(body.bones), 1, 1)), vertices)
    faces = grid(*shape, closed=True)
    left = _smoothstep(0.5 + 4.0 * vertices[:, 1].astype(float))
    weights = np.zeros((len(vertices), 4), np.float32)
    on_legs = 1 - hang.pelvis_share
    weights[:, :3] = np.column_stack([hang.pelvis_share, on_legs * left, on_legs * (1 - left)])
    level = np.repeat(depth, _COLUMNS)[faces].mean(1)
    bones = np.tile(np.array([*hang.bones, 0], np.uint8), (len(vertices), 1))
    return AddedMesh(vertices.astype(float), faces, FacePart.SKIRT, level, bones, weights), hang


def _body_points(body: Body) -> tuple[Floats, tuple[Floats, Floats]]:
    """Return the vertices of the trunk, and those of the left and the right leg with that half of the trunk."""
    trunk, both = (
        body.vertices[np.unique(body.faces[np.isin(body.part, parts)])].astype(float)
        for parts in ([FacePart.TORSO], [FacePart.TORSO, FacePart.LEG])
    )
    return trunk, (both[both[:, 1] > 0], both[both[:, 1] < 0])


def _smoothstep(share: Floats) -> Floats:
    """Return the cubic smoothstep of values clipped to 0..1."""
    share = np.clip(share, 0, 1)
    return share * share * (3 - 2 * share)


def long_hair(body: Body, *, volume: float) -> AddedMesh:
    """Make the mesh of hair that falls from behind the ears to the shoulder blades."""
    head, neck = body.heads[body.index("Head")], body.heads[body.index("Neck")]
    points, scalp = head_points(body)
    crown = points[:, 2].max()
    top, end = head[2] + 0.62 * (crown - head[2]), neck[2] - 0.55 * (crown - neck[2])
    nape = scalp[:, 2].min() + 0.03
    height = np.linspace(top, end, 18)
    bearing = np.radians(np.linspace(*_BEHIND, 25))
    center = np.array([0.5 * (scalp[:, 0].min() + scalp[:, 0].max()), 0.0])
    directions = directions_at(bearing)
    thick = 0.006 + 0.006 * volume
    rows, fall = [], np.zeros(len(bearing))
    for z in height:
        if z > nape:  # hair lies on the skull and falls from its widest part
            around = scalp[np.abs(scalp[:, 2] - z) < 0.015, :2] - center
            fall = np.maximum(hull(around, bearing), fall)
            reach = fall + thick * np.sin(np.linspace(0, np.pi, len(bearing))) ** 0.5 - (0.006 if z == top else 0.0)
        else:  # hair falls, and lies on neck and back where they stand out further
            around = points[np.abs(points[:, 2] - z) < 0.02, :2] - center
            limit = fall + 0.01 + 0.04 * np.abs(directions[:, 0])
            reach = np.clip(_reach(around, directions) + 0.012, 0.88 * fall, limit)
        rows.append(np.column_stack([center + directions * reach[:, None], np.full(len(bearing), z)]))
    vertices = np.concatenate(rows)
    faces = grid(len(height), len(bearing), closed=False)
    below = _smoothstep((head[2] - vertices[:, 2]) / (head[2] - end))
    weights = np.zeros((len(vertices), 4), np.float32)
    weights[:, :3] = np.column_stack([1 - 0.45 * below, 0.2 * below, 0.25 * below])
    bones = np.array([body.index("Head"), body.index("Neck"), body.index("Spine1"), 0], np.uint8)
    return AddedMesh(vertices, faces, FacePart.SCALP, np.ones(len(faces)), np.tile(bones, (len(vertices), 1)), weights)


def bun(body: Body, *, volume: float, low: bool = False) -> AddedMesh:
    """Make the mesh of a bun, a knot of hair on the back of the head, or ``low`` at the nape."""
    points, scalp = head_points(body)
    head = body.heads[body.index("Head")]
    radius = 0.028 + 0.008 * volume
    height = head[2] + (-0.12 if low else 0.62) * (points[:, 2].max() - head[2])
    behind = scalp[np.abs(scalp[:, 2] - height) < 0.02, 0].min()
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 16, endpoint=False), np.linspace(np.pi / 2, -np.pi / 2, 9))
    ball = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), 0.9 * np.sin(up)], -1).reshape(-1, 3)
    vertices = np.array([behind - (0.2 if low else 0.55) * radius, 0.0, height]) + radius * ball
    return rigid(body, "Head", [(vertices, grid(9, 16, closed=True))], FacePart.SCALP)


def head_points(body: Body) -> tuple[Floats, Floats]:
    """Return the vertices of head, neck and trunk, (n, 3), and those of the scalp, (s, 3)."""
    points = body.vertices.astype(float)
    scalp = np.unique(body.faces[body.part == FacePart.SCALP])
    upper_body = np.unique(body.faces[np.isin(body.part, [FacePart.SCALP, FacePart.SKIN, FacePart.TORSO])])
    return points[upper_body], points[scalp]


def _reach(points: Floats, directions: Floats) -> Floats:
    """Return the greatest distance of points (n, 2) within 15 degrees of directions (c, 2); 0 if there are none."""
    distance = np.linalg.norm(points, axis=1)
    near = points @ directions.T > np.cos(np.radians(15)) * distance[:, None]
    return np.where(near, distance[:, None], 0.0).max(0, initial=0.0)


_BOB = (62.0, 298.0)  # bearings from the face around the head's axis, degrees: in front of one ear to the other
_CURLS = 0.006  # height of curls, metres


def bob(body: Body, *, volume: float) -> AddedMesh:
    """Make the mesh of hair cut at the chin: it covers the ears and the nape."""
    face = FacePoints.of_body(body)
    eyes, height = face.eye[2], face.crown - face.eye[2]
    center = np.array([0.5 * (face.scalp[:, 0].min() + face.scalp[:, 0].max()), 0.0])
    bearing = np.radians(np.linspace(*_BOB, 23))
    directions = directions_at(bearing)
    points = np.concatenate([face.face, face.scalp])
    rows, fall = [], np.zeros(len(bearing))
    levels = np.linspace(eyes + 0.86 * height, eyes - 0.85 * height, 12)
    for k, z in enumerate(levels):
        slab = points[np.abs(points[:, 2] - z) < 0.012 * face.scale, :2] - center
        if z > eyes - 0.5 * height:
            fall = np.maximum(hull(slab, bearing), fall)
        fullness = float(np.clip((levels[0] - z) / height, 0, 1)) ** 0.7
        reach = fall - 0.006 + (0.013 + 0.006 * volume) * fullness  # from inside the hair on top outwards
        reach -= 0.008 if k == len(levels) - 1 else 0.0
        beside = slab[np.abs(slab[:, 0] + center[0] - face.ear[0]) > 0.025 * face.scale]  # the front edge lies on the
        reach[[0, -1]] = np.minimum(hull(beside, bearing[[0, -1]]) - 0.002, reach[[0, -1]])  # cheek before the ear
        rows.append(np.column_stack([center + directions * reach[:, None], np.full(len(bearing), z)]))
    sheet = np.concatenate(rows), grid(len(rows), len(bearing), closed=False)
    return rigid(body, "Head", [sheet], FacePart.SCALP)


def ponytail(body: Body, *, volume: float, low: bool = False) -> AddedMesh:
    """Make the mesh of a ponytail, from the back of the head or ``low`` from the nape to the shoulder blades."""
    face = FacePoints.of_body(body)
    eyes, height = face.eye[2], face.crown - face.eye[2]
    start = eyes + (-0.25 if low else 0.45) * height
    behind = float(face.scalp[np.abs(face.scalp[:, 2] - start) < 0.015, 0].min())
    share = np.linspace(0, 1, 10)[:, None]
    length = (0.17 if low else 0.24) * face.scale
    out = 0.045 * face.scale * np.sin(np.minimum(share * 1.9, 1.0) * np.pi / 2)
    line = np.column_stack([behind + 0.016 - out, np.zeros_like(share), start + 0.012 - length * share**1.35])
    radius = (
        (0.017 + 0.007 * volume) * np.sqrt(np.clip(share * 6, 0.25, 1.0)) * np.clip((1.02 - share) * 3, 0.05, 1) ** 0.6
    )
    around = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    sideways = np.array([0.0, 1.0, 0.0])
    across = np.cross(tangent, sideways)
    rings = line[:, None] + radius[:, None] * (
        np.cos(around)[:, None] * across[:, None] + np.sin(around)[:, None] * sideways
    )
    return rigid(body, "Head", [(rings.reshape(-1, 3), grid(10, 9, closed=True))], FacePart.SCALP)


def curls(vertices: Floats, level: Floats, *, volume: float) -> Floats:
    """Return the thickness of curly hair at vertices (v, 3) of the scalp of given levels (v,), metres, (v,)."""
    full = 0.012 + 0.022 * volume
    x, y, z = vertices.T
    bumps = np.sin(251 * x + 97 * z) + np.sin(223 * y - 131 * x) + np.sin(267 * z + 111 * y)
    dense = np.sqrt(np.clip(level * (2 - level), 0, 1))
    return dense * (full + _CURLS / 3 * bumps * np.clip(2 * level, 0, 1))
