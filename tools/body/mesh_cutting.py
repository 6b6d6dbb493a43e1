"""Part of the bake: cut the mesh along hems, collar and hairline, and name what every face shows.

Colours are one a face, so an edge between two colours is only as straight as the mesh; cutting the triangles along
the lines where garments may end makes it crisp. Everything is measured on the population's mean body.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from mvpose.arrays import Bools, Floats, Integers
from simharness.world.humans.body import Part
from simharness.world.humans.wardrobe import HEMS, LEGS, SLEEVES

Named = dict[str, Floats]

SOLE = 0.022  # metres of a shoe's sole
HAIR_DEPTH = 0.035  # metres from the hairline to where hair has its full volume
_BELOW = 0.03  # metres of skin kept below the collar

# The hairline: its height over the eyes as a share of the height of the crown over them, at bearings around the
# head's axis from the face (0 degrees) over temple, sideburn and ear to the nape (180).
_HAIRLINE = PchipInterpolator(
    [0, 25, 45, 60, 70, 80, 90, 105, 125, 150, 180], [0.62, 0.6, 0.52, 0.4, 0.02, -0.1, 0.08, 0.1, -0.42, -0.6, -0.63]
)


@dataclass(frozen=True)
class Cloth:
    """A mesh in the making.

    Attributes:
        blend: its vertices as mixtures of the source's, (M, N).
        faces: (k, 3).
        origin: the face of the uncut mesh that every face is a piece of, (k,).
    """

    blend: sparse.csr_array
    faces: Integers
    origin: Integers

    def on_faces(self, field: Floats) -> Floats:
        """Mean of a field (N, ...) over the corners of every face, (k, ...)."""
        return np.asarray((self.blend @ field)[self.faces].mean(1))


def cut(cloth: Cloth, region: Bools, field: Floats) -> Cloth:
    """Split the faces of a ``region`` (k,) along the zero line of a ``field`` (N,) over the source's vertices.

    Vertices within a twentieth of an edge of the line count as on it, so that no slivers come up.
    """
    value = cloth.blend @ field
    edge = np.abs(value[cloth.faces] - value[np.roll(cloth.faces, 1, axis=1)])[region]
    value[np.abs(value) < 0.05 * np.median(edge)] = 0.0
    sign = np.sign(value)[cloth.faces]
    crossing = region & (sign.min(1) < 0) & (sign.max(1) > 0)
    rows: list[sparse.csr_array] = []
    made: dict[tuple[int, int], int] = {}

    def between(a: int, b: int) -> int:
        a, b = min(a, b), max(a, b)
        if (a, b) not in made:
            share = value[a] / (value[a] - value[b])
            rows.append(cloth.blend[[a]] * (1 - share) + cloth.blend[[b]] * share)
            made[a, b] = cloth.blend.shape[0] + len(made)
        return made[a, b]

    faces, origin = [cloth.faces[~crossing]], [cloth.origin[~crossing]]
    for face, signs, source in zip(cloth.faces[crossing], sign[crossing], cloth.origin[crossing], strict=True):
        on = np.flatnonzero(signs == 0)
        if len(on):
            a, b, c = np.roll(face, -on[0])
            middle = between(b, c)
            new = [[a, b, middle], [a, middle, c]]
        else:
            alone = np.flatnonzero(signs == -np.sign(signs.sum()))[0]
            a, b, c = np.roll(face, -alone)
            ab, ac = between(a, b), between(a, c)
            new = [[a, ab, ac], [ab, b, c], [ab, c, ac]]
        faces.append(np.array(new))
        origin.append(np.full(len(new), source))
    blend = sparse.vstack([cloth.blend, *rows]).tocsr()
    return Cloth(blend, np.concatenate(faces), np.concatenate(origin))


@dataclass(frozen=True)
class Figure:
    """The uncut mean body: N vertices.

    Attributes:
        points: vertices, (N, 3) metres.
        heads: of every bone by name, (3,).
        weights: of every bone by name, (N,).
        skin, eyes, suit: faces (k, 3).
        masks: regions of the skin's faces by name: face, lips, ears, inside-mouth.
    """

    points: Floats
    heads: Named
    weights: Named
    skin: Integers
    eyes: Integers
    suit: Integers
    masks: dict[str, Bools]


def tailor(figure: Figure) -> tuple[sparse.csr_array, Integers, Integers, Floats]:
    """Cut and name the shown mesh.

    Returns:
        The shown vertices as mixtures of the figure's, (M, N); faces (k, 3); parts (k,); levels (k,).
    """
    points, heads = figure.points, figure.heads
    # Higher at the nape than at the throat, and at the sides lower than a plane, which would cut across the shoulders.
    collar = (points - heads["Neck"]) @ [0.5, 0, 1] - 0.35 * np.abs(points[:, 1]) + 0.01
    skin, eye_line = figure.skin[_shown(figure, collar)], points[figure.eyes].mean((0, 1)) * [1, 0, 1]
    masks = {name: values[_shown(figure, collar)] for name, values in figure.masks.items()}
    first = np.cumsum([0, len(skin), len(figure.eyes), len(figure.suit)])
    faces = np.concatenate([skin, figure.eyes, figure.suit])
    is_skin, is_eye, is_suit = ((np.arange(first[3]) >= a) & (np.arange(first[3]) < b) for a, b in pairwise(first))

    limbs = {
        (side, limb): (
            np.sum([figure.weights[f"{side}{bone}"] for bone in bones], axis=0),
            _level(points, *(heads[f"{side}{bone}"] for bone in _CHAINS[limb])),
        )
        for side in ("Left", "Right")
        for limb, bones in _LIMBS.items()
    }
    crotch = _crotch(points, figure.suit)
    trunk = (points[:, 2] - crotch) / (heads["Neck"][2] - crotch)
    floor = points[:, 2] - points[figure.suit, 2].min()
    hair = _hair_field(points, heads["Head"], eye_line, points[figure.skin, 2].max())
    arms = limbs["Left", "Arm"][0] + limbs["Right", "Arm"][0]

    cloth = Cloth(sparse.eye_array(len(points), format="csr"), faces, np.arange(len(faces)))
    for (_, limb), (weight, level) in limbs.items():
        for end in (SLEEVES if limb == "Arm" else LEGS).values():
            inside = ((cloth.blend @ weight) > 0.5)[cloth.faces].all(1)
            cloth = cut(cloth, inside & is_suit[cloth.origin], level - end)
    for field in (*(trunk - end for end in HEMS.values()), floor - SOLE, collar):
        inside = ~((cloth.blend @ arms) > 0.5)[cloth.faces].any(1)
        cloth = cut(cloth, inside & is_suit[cloth.origin], field)
    is_head = is_skin & (points[faces].mean(1)[:, 2] > heads["Spine1"][2])
    cloth = cut(cloth, is_head[cloth.origin], hair)

    # What a whole face shows, and then what only the pieces tell.
    whole = np.full(len(faces), int(Part.TORSO))
    whole[is_skin] = np.where(is_head[is_skin], Part.SKIN, Part.HAND)
    whole[: first[1]][_brow(points[skin].mean(1), points[figure.eyes].mean(1))] = Part.BROW
    whole[: first[1]][masks["lips"]] = Part.LIPS
    whole[is_eye] = _eye_parts(points[figure.eyes].mean(1))
    ears = np.zeros(len(faces), bool)
    ears[: first[1]] = masks["ears"]
    part = whole[cloth.origin]
    level = np.where(is_suit[cloth.origin], cloth.on_faces(trunk), 0.0)
    height = cloth.on_faces(hair)
    scalp = (is_head & ~ears)[cloth.origin] & (height > 0)
    part[scalp], level[scalp] = Part.SCALP, np.clip(height[scalp] / HAIR_DEPTH, 0, 1)
    for (_, limb), (weight, along) in limbs.items():
        mine = is_suit[cloth.origin] & (cloth.on_faces(weight) > 0.5)
        if limb == "Leg":
            mine &= cloth.on_faces(trunk) < 0
        part[mine] = Part.ARM if limb == "Arm" else Part.LEG
        level[mine] = cloth.on_faces(along)[mine]
    part[(part == Part.LEG) & (level > LEGS["long"])] = Part.SHOE
    part[(part == Part.SHOE) & (cloth.on_faces(floor) < SOLE)] = Part.SOLE

    above_collar = (part == Part.TORSO) & (cloth.on_faces(collar) > 0)
    in_socket = is_eye[cloth.origin] & (cloth.on_faces(points)[:, 0] < points[figure.eyes, 0].max() - 0.014)
    keep = ~above_collar & ~in_socket
    used, kept = np.unique(cloth.faces[keep], return_inverse=True)
    return cloth.blend[used], kept.reshape(-1, 3), part[keep], level[keep]


_LIMBS = {"Arm": ("Arm", "ArmTwist", "ForeArm", "ForeArmTwist", "Hand"), "Leg": ("UpLeg", "Leg", "Foot", "ToeBase")}
_CHAINS = {"Arm": ("Arm", "ForeArm", "Hand"), "Leg": ("UpLeg", "Leg", "Foot")}


def _level(points: Floats, first: Floats, middle: Floats, last: Floats) -> Floats:
    """How far down a limb points (n, 3) are: 0 at its first joint, 1 at the middle one, 2 at the last."""
    upper, lower = middle - first, last - middle
    a = (points - first) @ upper / (upper @ upper)
    b = (points - middle) @ lower / (lower @ lower)
    # The two scales meet on the plane that halves the angle at the middle joint.
    beyond = (points - middle) @ (upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)) > 0
    return np.where(beyond, 1 + np.maximum(b, 0), np.minimum(a, 1))


def _crotch(points: Floats, suit: Integers) -> float:
    """Height of the lowest point of the suit between the legs."""
    middle = points[np.unique(suit)]
    return float(middle[np.abs(middle[:, 1]) < 0.005, 2].min())


def _hair_field(points: Floats, head: Floats, eye_line: Floats, crown: float) -> Floats:
    """Height of points (n, 3) above the hairline, metres."""
    bearing = np.degrees(np.arctan2(np.abs(points[:, 1]), points[:, 0] - head[0]))
    return np.asarray(points[:, 2] - (eye_line[2] + (crown - eye_line[2]) * _HAIRLINE(bearing)))


def _shown(figure: Figure, collar: Floats) -> Bools:
    """Which skin faces show: those beyond the suit's rims, the neck, and a little more below cuffs and collar."""
    cloth = np.unique(figure.suit)
    edges = np.sort(figure.suit[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    rim = np.isin(cloth, edges[count == 1])
    bare = rim[cKDTree(figure.points[cloth]).query(figure.points)[1]]  # whatever lies beyond a rim is nearest to it
    for _ in range(2):
        bare[figure.skin[bare[figure.skin].any(1)]] = True
    bare |= collar > -_BELOW
    return np.asarray(bare[figure.skin].all(1) & ~figure.masks["inside-mouth"])


def _brow(middle: Floats, eyes: Floats) -> Bools:
    """Which face centres (k, 3) lie on the brows, bands above the centres of the eyes' faces."""
    across, above = np.abs(middle[:, 1]) - np.abs(eyes[:, 1]).mean(), middle[:, 2] - eyes[:, 2].mean()
    arch = 0.024 - 40.0 * np.maximum(across - 0.008, 0) ** 2
    band = (np.abs(above - arch) < 0.0028) & (across > -0.02) & (across < 0.018)
    return np.asarray(band & (middle[:, 0] > eyes[:, 0].mean() - 0.02))


def _eye_parts(centers: Floats) -> Integers:
    """White or iris of eye faces by their centres (k, 3)."""
    part = np.full(len(centers), int(Part.SCLERA))
    for side in (1, -1):
        own = centers[:, 1] * side > 0
        pupil = centers[own][np.argmax(centers[own][:, 0])]
        part[own & (np.linalg.norm(centers - pupil, axis=1) < 0.0065)] = Part.IRIS
    return part
