"""Accessories on a dressed body: their meshes come after all others, so they can be taken off again.

Kinematics, capsules and collisions are those of :func:`plain` looks: how people move does not depend on what they wear
on head and shoulders, nor on how their hair is cut or tied.

Straps of bags are taut: they lie on the convex hull of the trunk in a plane, and move with the skin below them.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.added_mesh import AddedMesh, add_mesh, attached, grid, heading, hull, rigid, rounded, unit
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.face_colors import Color
from simharness.world.humans.head_wear import glasses, hat, mask
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
    return replace(
        body,
        vertices=body.vertices[:n],
        faces=body.faces[:k],
        part=body.part[:k],
        level=body.level[:k],
        weight_bones=body.weight_bones[:n],
        weights=body.weights[:n],
    )


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
        line = core + reach[:, None] * heading(over)
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
