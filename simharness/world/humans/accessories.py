"""Accessories on a dressed body: their meshes come after all others, so they can be taken off again.

Kinematics, capsules and collisions are those of :func:`plain` looks: how people move does not depend on what they wear
on head and shoulders, nor on how their hair is cut or tied.

Straps of bags are taut: they lie on the convex hull of the trunk in a plane, and move with the skin below them.
Glasses, masks and hats move with the head; each is fitted to the face and hair of the dressed head at rest, so nothing
below it comes through.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.world.humans.added_mesh import (
    AddedMesh,
    FacePoints,
    add_mesh,
    attached,
    directions_at,
    grid,
    hull,
    hull_reach,
    rigid,
    rounded,
    unit,
)
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.face_colors import Color
from simharness.world.humans.wardrobe import Look, mix

_LENS: Color = (0.05, 0.05, 0.06)
_GROWN = {"bob": "short", "curly": "short", "ponytail": "long"}  # hair styles are drawn for people with these


def plain(look: Look) -> Look:
    """Return the look without accessories, its hair short, long or in a bun."""
    hair_style = _GROWN.get(look.hair_style, look.hair_style)
    return replace(look, hair_style=hair_style, glasses="none", hat="none", mask="none", bag="none")


def wear(body: Body, look: Look) -> Body:
    """Return a dressed body with the meshes of the accessories of its look; joints do not move."""
    meshes = []
    if look.mask != "none":
        meshes += mask(body)
    if look.glasses != "none":
        below = add_mesh(body, meshes[0]) if meshes else body
        meshes += glasses(below, kind=look.glasses)
    if look.hat != "none":
        meshes += hat(body, kind=look.hat)
    if look.bag != "none":
        meshes += (backpack if look.bag == "backpack" else shoulder_bag)(body)
    for mesh in meshes:
        body = add_mesh(body, mesh)
    return body


def take_off(body: Body) -> Body:
    """Return the body without accessories: the inverse of :func:`wear`."""
    worn = body.part >= FacePart.GLASSES
    if not worn.any():
        return body
    k = int(np.argmax(worn))
    n = int(body.faces[worn].min())
    fewer = {key: getattr(body, key)[:n] for key in ("vertices", "weight_bones", "weights")}
    return replace(body, **fewer, **{key: getattr(body, key)[:k] for key in ("faces", "part", "level")})


def accessory_colors(look: Look) -> Mapping[FacePart, Color]:
    """Return the colour of the faces of every kind of accessory."""
    return {
        FacePart.GLASSES: look.frame_color,
        FacePart.LENS: _LENS,
        FacePart.HAT: look.hat_color,
        FacePart.HAT_BAND: mix(look.hat_color, (0.05, 0.05, 0.05), 0.6),
        FacePart.MASK: look.mask_color,
        FacePart.BAG: look.bag_color,
        FacePart.STRAP: mix(look.bag_color, (0.05, 0.05, 0.05), 0.35),
    }


_TORSO = 0.57  # height of an adult's neck over the hips, metres
_PACK = np.array([0.15, 0.29, 0.42])  # depth, width, height of a backpack for an adult, metres
_BAG = np.array([0.27, 0.085, 0.21])  # length, depth, height of a shoulder bag, metres
_ROUND = 0.45  # power of the superellipsoid of a bag
_PUSHED = np.radians(30.0)  # angle by which a shoulder bag is pushed back from the side, so that the arm hangs free
_PRESSED = 0.015  # depth by which a shoulder bag is pressed into the clothes, metres
_STRAP = 0.036  # width of a strap, metres
_OVER, _SIDES = 0.005, 0.014  # height of straps over the clothes, and depth of their sides, metres
_APART = 0.085  # distance of the straps of a backpack from the middle, metres


def backpack(body: Body) -> list[AddedMesh]:
    """Make a backpack with a pocket and two straps."""
    trunk, rows, scale = _trunk(body)
    neck = body.heads[body.index("Neck")]
    depth, width, height = scale * _PACK
    top = neck[2] - 0.02 * scale
    behind = trunk[(np.abs(trunk[:, 1]) < 0.4 * width) & (trunk[:, 2] < top) & (trunk[:, 2] > top - 0.7 * height)]
    back = float(behind[:, 0].min())
    middle = np.array([back - 0.5 * depth + 0.012, 0.0, top - 0.5 * height])
    pocket = middle + [-0.5 * depth, 0.0, -0.2 * height]
    boxes = [
        _rounded_box(middle, np.array([depth, width, height]) / 2),
        _rounded_box(pocket, np.array([0.3 * depth, 0.72 * width, 0.42 * height]) / 2),
    ]
    straps = [_shoulder_strap(trunk, side, middle, height, neck, scale) for side in (1.0, -1.0)]
    return [rigid(body, "Spine1", boxes, FacePart.BAG), attached(body, straps, FacePart.STRAP, to=rows)]


def _shoulder_strap(
    trunk: Floats, side: float, middle: Floats, height: float, neck: Floats, scale: float
) -> tuple[Floats, NDArray[np.int32]]:
    """Return one strap: from the top of the pack over the shoulder and under the arm to the bottom of the pack."""
    over = np.radians(np.linspace(165, -28, 12))
    low, edges = neck[2] - 0.13 * scale, []
    core = np.array([float(np.median(trunk[:, 0])), low])
    for shift in (0.5 * _STRAP, -0.5 * _STRAP):
        y = side * scale * (_APART + shift)
        slab = trunk[(np.abs(trunk[:, 1] - y) < 0.018) & (trunk[:, 2] > low - 0.12 * scale)]
        reach = hull(slab[:, [0, 2]] - core, over) + _OVER
        line = core + reach[:, None] * directions_at(over)
        edges.append(np.column_stack([line[:, 0], np.full(len(line), y), line[:, 1]]))
    front = 0.5 * (edges[0][-1] + edges[1][-1])
    start = np.arctan2(abs(front[1]), front[0] - core[0])
    under = np.linspace(start, np.radians(150), 6)
    heights = np.linspace(front[2], middle[2] - 0.28 * height, len(under))
    for edge, shift in enumerate((0.4 * _STRAP, -0.4 * _STRAP)):
        below = []
        for bearing, z in zip(under, heights + shift, strict=True):
            slab = trunk[np.abs(trunk[:, 2] - z) < 0.02]
            fan = np.array([bearing - 0.35, bearing - 0.17, bearing, bearing + 0.17, bearing + 0.35])
            away = float(hull((slab[:, :2] - [core[0], 0.0]) * [1, side], fan)[2]) + _OVER
            below.append([core[0] + away * np.cos(bearing), side * away * np.sin(bearing), z])
        edges[edge] = np.concatenate([edges[edge], below[1:]])
    return _band(edges[0], edges[1], np.array([core[0], side * 0.6 * _APART * scale, low]), closed=False)


def shoulder_bag(body: Body) -> list[AddedMesh]:
    """Make a bag behind the right hip whose strap crosses the trunk to the left shoulder."""
    trunk, rows, scale = _trunk(body, lower=(FacePart.SKIRT, FacePart.LEG))
    size = scale * _BAG
    low = body.heads[body.index("RightUpLeg"), 2] + 0.02 * scale
    around = trunk[np.abs(trunk[:, 2] - low) < 0.5 * size[2]]
    core = float(np.median(around[:, 0]))
    shoulder = np.array([core, 0.06 * scale, body.heads[body.index("Neck"), 2]])
    hip = np.array([core, around[:, 1].min(), low + 0.3 * size[2]])
    return [
        rigid(body, "Hips", _bag(around, np.array([core, 0.0, low]), size), FacePart.BAG),
        attached(body, [_cross_strap(trunk, shoulder, hip)], FacePart.STRAP, to=rows),
    ]


def _bag(around: Floats, core: Floats, size: Floats) -> list[tuple[Floats, NDArray[np.int32]]]:
    """Return the body and the flap of a bag of a size (3,) that lies on points around the hips (n, 3)."""
    outward = np.array([-np.sin(_PUSHED), -np.cos(_PUSHED), 0.0])
    along = np.array([-outward[1], outward[0], 0.0])
    near = np.abs((around - core) @ along) < 0.35 * size[0]
    middle = core + (((around[near] - core) @ outward).max() + 0.5 * size[1] - _PRESSED) * outward
    axes = np.stack([along, -outward, [0.0, 0.0, 1.0]])
    whole = _rounded_box(np.zeros(3), size / 2)
    flap = _rounded_box(size * [0.0, -0.08, 0.2], size * [1.03, 1.0, 0.66] / 2)
    return [(middle + points @ axes, faces) for points, faces in (whole, flap)]


def _cross_strap(trunk: Floats, shoulder: Floats, hip: Floats) -> tuple[Floats, NDArray[np.int32]]:
    """Return the strap around points on the trunk (n, 3) in the plane through shoulder and hip, both (3,)."""
    up = (shoulder - hip) / np.linalg.norm(shoulder - hip)
    across = np.array([0.0, up[2], -up[1]])
    center = 0.5 * (shoulder + hip)
    local = trunk - center
    plane = np.column_stack([local[:, 0], local @ up])
    bearing = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    edges = []
    for shift in (0.5 * _STRAP, -0.5 * _STRAP):
        slab = plane[(np.abs(local @ across - shift) < 0.018) & (plane[:, 1] > (hip - center) @ up)]
        reach = hull(slab, bearing) + _OVER
        forward, upward = reach * np.cos(bearing), reach * np.sin(bearing)
        edges.append(center + shift * across + np.outer(forward, [1.0, 0.0, 0.0]) + np.outer(upward, up))
    return _band(edges[0], edges[1], center, closed=True)


def _trunk(body: Body, lower: tuple[FacePart, ...] = ()) -> tuple[Floats, NDArray[np.int64], float]:
    """Return the vertices of the trunk (n, 3), their rows in the body (n,), and the size relative to an adult."""
    rows = np.unique(body.faces[np.isin(body.part, [FacePart.TORSO, *lower])]).astype(np.int64)
    height = body.heads[body.index("Neck"), 2] - body.heads[body.index("LeftUpLeg"), 2]
    return body.vertices[rows].astype(float), rows, float(height) / _TORSO


def _band(first: Floats, second: Floats, core: Floats, *, closed: bool) -> tuple[Floats, NDArray[np.int32]]:
    """Return a strap between two edges (c, 3), with sides that reach into the clothes towards a point ``core`` (3,)."""
    inner = [edge + _SIDES * unit(core - edge) for edge in (first, second)]
    return np.concatenate([inner[0], first, second, inner[1]]), grid(4, len(first), closed=closed)


def _rounded_box(middle: Floats, half: Floats) -> tuple[Floats, NDArray[np.int32]]:
    """Return a box with rounded edges, a superellipsoid, of half sizes (3,)."""
    up = np.linspace(np.pi / 2, -np.pi / 2, 8)
    around = np.linspace(0, 2 * np.pi, 12, endpoint=False) + np.pi / 4
    wide, high, x, y = (rounded(each, _ROUND) for each in (np.cos(up), np.sin(up), np.cos(around), np.sin(around)))
    ball = np.stack(np.broadcast_arrays(wide[:, None] * x, wide[:, None] * y, high[:, None]), axis=-1)
    return middle + half * ball.reshape(-1, 3), grid(8, 12, closed=True)


Sheet = tuple[Floats, NDArray[np.int32]]

_HEAD = "Head"
_RIM, _LENS_CORNERS = 0.0035, 12  # width of the rims of glasses, metres; corners of a lens
_LENSES = {"rectangular": (0.026, 0.017, 4.0), "round": (0.0225, 0.021, 2.0), "sunglasses": (0.027, 0.0195, 3.0)}
_COLUMNS, _ROWS = 20, 6  # of the shell of a hat
_GAP = 0.004  # between a hat or mask and what is below it, metres
# Of a hat above the eyes, in front, behind.
_EDGE = {"cap": (0.46, 0.0), "beanie": (0.44, -0.2), "brimmed": (0.46, 0.0)}
_VISOR, _BRIM = 0.068, 0.065  # metres
_TALLER = {"cap": 0.006, "beanie": 0.016, "brimmed": 0.022}  # height of a hat over the crown beyond the gap, metres


def glasses(body: Body, *, kind: str) -> list[AddedMesh]:
    """Make frame and temples of glasses, over a mask if there is one, and the dark lenses of sunglasses."""
    face = FacePoints.of_body(body)
    scale = face.scale
    half_width, half_height, power = (value * k for value, k in zip(_LENSES[kind], (scale, scale, 1.0), strict=True))
    middle = np.array([max(face.eye[1], half_width + 0.006 * scale), face.eye[2] - 0.002 * scale])
    around = np.linspace(0, 2 * np.pi, _LENS_CORNERS, endpoint=False)
    outline = np.column_stack(
        [half_width * rounded(np.cos(around), 2 / power), half_height * rounded(np.sin(around), 2 / power)]
    )
    below = body.vertices[np.unique(body.faces[body.part == FacePart.MASK])].astype(float)
    front = _lens_plane(
        np.concatenate([face.face[face.face[:, 0] > face.ear[0]], below]), middle, half_width, half_height
    )
    frames, lenses = [], []
    for side in (1.0, -1.0):
        inner, outer = (
            np.column_stack([front(flat[:, 0]), side * flat[:, 0], flat[:, 1]])
            for flat in (middle + outline, middle + outline * (1 + _RIM / np.array([half_width, half_height])))
        )
        rim = np.concatenate([outer - [0.003, 0, 0], outer, inner, inner - [0.003, 0, 0]])
        frames.append((rim, grid(4, _LENS_CORNERS, closed=True)))
        lenses.append(_disc(inner - [0.001, 0, 0]))
        corner = middle[0] + half_width + _RIM
        frames.append(_temple(face, side, np.array([front(corner), corner, middle[1] + 0.4 * half_height])))
    nasal = middle[0] - half_width
    high = middle[1] + 0.3 * half_height
    bridge = np.array([[front(0.0) + 0.002, y, high + h] for h in (0.002, -0.002) for y in (-nasal, 0.0, nasal)])
    bridge[[0, 2, 3, 5], 0] = front(nasal)
    frames.append((bridge, grid(2, 3, closed=False)))
    meshes = [rigid(body, _HEAD, frames, FacePart.GLASSES)]
    if kind == "sunglasses":
        meshes.append(rigid(body, _HEAD, lenses, FacePart.LENS))
    return meshes


def _lens_plane(points: Floats, middle: Floats, half_width: float, half_height: float) -> Callable[[ArrayLike], Floats]:
    """Return the function from y to x of the front of glasses: a line over points (n, 3) of brow and cheek."""
    near = points[np.abs(points[:, 2] - middle[1]) < half_height]
    away = np.abs(near[:, 1])
    covered = (away > middle[0] - half_width) & (away < middle[0] + half_width)
    slope = 0.28
    start = (near[covered, 0] + slope * away[covered]).max() + 0.003
    return lambda y: start - slope * np.abs(y)


def _temple(face: FacePoints, side: float, hinge: Floats) -> Sheet:
    """Return one temple: a band from the hinge (x, |y|, z) over the ear, outside the skin."""
    end = np.array([face.ear[0] - 0.012 * face.scale, face.ear[2] + 0.022 * face.scale])
    rows = []
    for share in np.linspace(0, 1, 6):
        x, z = (1 - share) * hinge[0] + share * end[0], (1 - share) * hinge[2] + share * end[1]
        around = (np.abs(face.face[:, 0] - x) < 0.012) & (np.abs(face.face[:, 2] - z) < 0.008)
        skin = np.abs(face.face[around, 1]).max(initial=0.0)
        y = max(skin + 0.0015, hinge[1] if share < 0.5 else 0.0)
        rows.append([x, side * y, z])
    line = np.array(rows)
    line[1:-1, 1] = side * np.maximum(np.abs(line[1:-1, 1]), 0.5 * (np.abs(line[:-2, 1]) + np.abs(line[2:, 1])))
    return np.concatenate([line + [0, 0, 0.0025], line - [0, 0, 0.0025]]), grid(2, len(line), closed=False)


def mask(body: Body) -> list[AddedMesh]:
    """Make a mask over nose, mouth and chin with its ear loops."""
    face = FacePoints.of_body(body)
    scale = face.scale
    axis = np.array([face.ear[0] + 0.012 * scale, 0.0])
    heights = face.nose[2] + scale * np.array([0.014, 0.005, -0.008, -0.025, -0.045, -0.066, -0.084])
    widest = np.radians([48, 62, 68, 68, 65, 56, 44])
    rows = []
    for z, wide in zip(heights, widest, strict=True):
        bearing = np.linspace(-wide, wide, 11)
        slab = face.face[np.abs(face.face[:, 2] - z) < 0.010 * scale]
        slab = slab[slab[:, 0] > axis[0]]
        reach = hull(slab[:, :2] - axis, bearing) + _GAP
        rows.append(np.column_stack([axis + reach[:, None] * directions_at(bearing), np.full(len(bearing), z)]))
    cloth = np.stack(rows)
    cloth[-1, :, 0] = np.minimum(cloth[-1, :, 0], cloth[-2, :, 0] - 0.012 * scale)  # under the chin
    sheets: list[Sheet] = [(cloth.reshape(-1, 3), grid(len(rows), cloth.shape[1], closed=False))]
    for side, column in ((1.0, -1), (-1.0, 0)):
        ear = np.array([face.ear[0] - 0.004, side * (np.abs(face.face[:, 1]).max() - 0.006), face.ear[2]])
        for row, height in ((1, 0.014), (4, -0.016)):
            start, end = cloth[row, column], ear + [0.0, 0.0, height * scale]
            band = np.linspace(start, end, 4)
            band[1:-1, 1] += side * 0.002
            sheets.append((np.concatenate([band + [0, 0, 0.0015], band - [0, 0, 0.0015]]), grid(2, 4, closed=False)))
    return [rigid(body, _HEAD, sheets, FacePart.MASK)]


def hat(body: Body, *, kind: str) -> list[AddedMesh]:
    """Make a cap with its visor, a beanie, or a hat with a brim."""
    face = FacePoints.of_body(body)
    height = face.crown - face.eye[2]
    front, behind = (face.eye[2] + share * height for share in _EDGE[kind])
    ahead, back = face.face[:, 0].max(), face.scalp[:, 0].min()
    slope = (front - behind) / (ahead - back)

    def above_edge(points: Floats) -> Floats:
        return points[:, 2] - (behind + slope * (points[:, 0] - back))

    points = np.concatenate([face.face, face.scalp])
    points = points[above_edge(points) > -0.004]
    center = np.array([0.5 * (points[:, 0].min() + points[:, 0].max()), 0.0, 0.0])
    center[2] = behind + slope * (center[0] - back)
    bearing = np.linspace(0, 2 * np.pi, _COLUMNS, endpoint=False)
    rise = np.linspace(np.pi / 2, 0, _ROWS)
    around = np.column_stack([directions_at(bearing), np.zeros(_COLUMNS)])
    flat = (np.cos(rise)[:, None, None] * around + np.sin(rise)[:, None, None] * [0, 0, 1]).reshape(-1, 3)
    directions = flat + np.outer(slope * flat[:, 0], [0, 0, 1])  # the edge is tilted to the front
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shell = directions * (hull_reach(points - center, directions) + _GAP)[:, None]
    shell[:, 2] += _TALLER[kind] * np.clip(flat[:, 2], 0, 1) ** (0.5 if kind == "brimmed" else 1.0)
    rings = (center + shell).reshape(_ROWS, _COLUMNS, 3)
    if kind == "beanie":
        rings[-2:] += 0.004 * flat.reshape(_ROWS, _COLUMNS, 3)[-1]  # the fold
    edge = rings[-1]
    tucked = edge - 0.010 * flat[-_COLUMNS:]
    sheets: list[Sheet] = [(np.concatenate([*rings, tucked]), grid(_ROWS + 1, _COLUMNS, closed=True))]
    meshes = []
    if kind == "cap":
        sheets.append(_visor(edge, bearing, face.scale))
    if kind == "brimmed":
        sheets.append(_brim(edge, bearing, face.scale))
        band = np.stack([rings[-2], rings[-1]]) + 0.0015 * flat.reshape(_ROWS, _COLUMNS, 3)[-1]
        meshes.append(rigid(body, _HEAD, [(band.reshape(-1, 3), grid(2, _COLUMNS, closed=True))], FacePart.HAT_BAND))
    return [rigid(body, _HEAD, sheets, FacePart.HAT), *meshes]


def _visor(edge: Floats, bearing: Floats, scale: float) -> Sheet:
    """Return the visor of a cap: a curved sheet in front of its edge (c, 3)."""
    wide = np.radians(60)
    turned = (bearing + np.pi) % (2 * np.pi) - np.pi
    order = np.argsort(turned)
    order = order[np.abs(turned[order]) < wide]
    across, start = turned[order], edge[order]  # the vertices of the edge, so that no gap is left
    reach = _VISOR * scale * np.cos(across / wide * np.pi / 2) ** 0.6
    rows = []
    for share in (0.0, 0.5, 1.0):
        ahead = np.column_stack([reach * share, np.zeros(len(across)), -0.18 * reach * share])
        ahead[:, 2] -= 0.010 * scale * (np.sin(across) / np.sin(wide)) ** 2 * share  # bent down at the sides
        rows.append(start + ahead)
    thick = np.stack([*rows, *(row - [0, 0, 0.002] for row in rows[::-1])])
    return thick.reshape(-1, 3), grid(6, len(across), closed=False)[:, ::-1].copy()


def _brim(edge: Floats, bearing: Floats, scale: float) -> Sheet:
    """Return the brim around the edge (c, 3) of a hat."""
    outward = np.column_stack([directions_at(bearing), np.zeros(len(bearing))])
    rows = [edge - 0.003 * outward]
    for share in (0.5, 1.0):
        droop = -0.10 * share + 0.22 * share**2 * np.sin(bearing) ** 2  # turned up at the sides
        rows.append(edge + _BRIM * scale * (share * outward + np.column_stack([np.zeros((len(bearing), 2)), droop])))
    return np.concatenate(rows), grid(3, len(bearing), closed=True)


def _disc(outline: Floats) -> Sheet:
    """Return the faces of a disc with an outline (c, 3)."""
    count = len(outline)
    across = np.arange(count)
    faces = np.column_stack([np.full(count, count), across, (across + 1) % count]).astype(np.int32)
    return np.concatenate([outline, outline.mean(axis=0, keepdims=True)]), faces
