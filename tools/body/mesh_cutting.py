"""Mesh cutting of the bake: split triangles along hems, collar and hairline, and label the part of every face.

Every face has one colour, so a border between two colours is only as straight as the mesh edges. Cutting the triangles
along the lines where garments may end makes it straight. All lines are defined on the mean body of the population.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from mvpose.arrays import Bools, Floats, Integers
from simharness.world.humans.body import FacePart
from simharness.world.humans.wardrobe import HEMS, LEGS, SLEEVES

ByBone = dict[str, Floats]

SOLE = 0.022  # thickness of a shoe's sole, metres
HAIR_DEPTH = 0.035  # distance from the hairline at which hair has its full volume, metres
_BELOW = 0.03  # skin kept below the collar, metres

# Hairline: its height over the eyes as a fraction of the height of the crown over the eyes, at bearings around the
# head's axis from the face (0 degrees) over temple, sideburn and ear to the nape (180 degrees).
_HAIRLINE = PchipInterpolator(
    [0, 25, 45, 60, 70, 80, 90, 105, 125, 150, 180], [0.62, 0.6, 0.52, 0.4, 0.02, -0.1, 0.08, 0.1, -0.42, -0.6, -0.63]
)


@dataclass(frozen=True)
class CutMesh:
    """Mesh whose faces are pieces of the faces of an uncut mesh with N vertices.

    Attributes:
        blend: M vertices as linear combinations of the N original vertices, (M, N).
        faces: vertex indices, (k, 3).
        origin: index of the original face of every face, (k,).
    """

    blend: sparse.csr_array
    faces: Integers
    origin: Integers

    def on_faces(self, field: Floats) -> Floats:
        """Return the mean of a field (N, ...) on the original vertices over the corners of every face, (k, ...)."""
        return np.asarray((self.blend @ field)[self.faces].mean(1))


def cut(mesh: CutMesh, region: Bools, field: Floats) -> CutMesh:
    """Split the faces of a ``region`` (k,) along the zero line of a ``field`` (N,) on the original vertices.

    Vertices closer to the line than a twentieth of an edge count as on it, so that there are no slivers.
    """
    value = mesh.blend @ field
    edge = np.abs(value[mesh.faces] - value[np.roll(mesh.faces, 1, axis=1)])[region]
    value[np.abs(value) < 0.05 * np.median(edge)] = 0.0
    sign = np.sign(value)[mesh.faces]
    crossing = region & (sign.min(1) < 0) & (sign.max(1) > 0)
    rows: list[sparse.csr_array] = []
    made: dict[tuple[int, int], int] = {}

    def zero_on_edge(a: int, b: int) -> int:
        """Return the index of the vertex at the zero of edge a b, made at the first call."""
        a, b = min(a, b), max(a, b)
        if (a, b) not in made:
            share = value[a] / (value[a] - value[b])
            rows.append(mesh.blend[[a]] * (1 - share) + mesh.blend[[b]] * share)
            made[a, b] = mesh.blend.shape[0] + len(made)
        return made[a, b]

    faces, origin = [mesh.faces[~crossing]], [mesh.origin[~crossing]]
    for face, signs, source in zip(mesh.faces[crossing], sign[crossing], mesh.origin[crossing], strict=True):
        on = np.flatnonzero(signs == 0)
        if len(on):
            a, b, c = np.roll(face, -on[0])
            middle = zero_on_edge(b, c)
            new = [[a, b, middle], [a, middle, c]]
        else:
            alone = np.flatnonzero(signs == -np.sign(signs.sum()))[0]
            a, b, c = np.roll(face, -alone)
            ab, ac = zero_on_edge(a, b), zero_on_edge(a, c)
            new = [[a, ab, ac], [ab, b, c], [ab, c, ac]]
        faces.append(np.array(new))
        origin.append(np.full(len(new), source))
    blend = sparse.vstack([mesh.blend, *rows]).tocsr()
    return CutMesh(blend, np.concatenate(faces), np.concatenate(origin))


@dataclass(frozen=True)
class MeanBody:
    """Uncut mean body with N vertices.

    Attributes:
        points: vertices, (N, 3) metres.
        heads: head of every bone by its name, (3,) metres.
        weights: skinning weights of every bone by its name, (N,).
        skin, eyes, suit: faces (k, 3).
        masks: regions of the skin faces by name: face, lips, ears, inside-mouth.
    """

    points: Floats
    heads: ByBone
    weights: ByBone
    skin: Integers
    eyes: Integers
    suit: Integers
    masks: dict[str, Bools]


def cut_and_label(body: MeanBody) -> tuple[sparse.csr_array, Integers, Integers, Floats]:
    """Cut the drawn mesh and label its faces.

    Returns:
        Drawn vertices as linear combinations of those of the body, (M, N); faces (k, 3); parts (k,); levels (k,).
    """
    points, heads = body.points, body.heads
    # The collar is higher at the nape than at the throat. At the sides it is below a plane, which would cut across the
    # shoulders.
    collar = (points - heads["Neck"]) @ [0.5, 0, 1] - 0.35 * np.abs(points[:, 1]) + 0.01
    skin, eye_line = body.skin[_drawn_skin(body, collar)], points[body.eyes].mean((0, 1)) * [1, 0, 1]
    masks = {name: values[_drawn_skin(body, collar)] for name, values in body.masks.items()}
    first = np.cumsum([0, len(skin), len(body.eyes), len(body.suit)])
    faces = np.concatenate([skin, body.eyes, body.suit])
    is_skin, is_eye, is_suit = ((np.arange(first[3]) >= a) & (np.arange(first[3]) < b) for a, b in pairwise(first))

    limbs = {
        (side, limb): (
            np.sum([body.weights[f"{side}{bone}"] for bone in bones], axis=0),
            _level(points, *(heads[f"{side}{bone}"] for bone in _CHAINS[limb])),
        )
        for side in ("Left", "Right")
        for limb, bones in _LIMBS.items()
    }
    crotch = _crotch(points, body.suit)
    trunk = (points[:, 2] - crotch) / (heads["Neck"][2] - crotch)
    floor = points[:, 2] - points[body.suit, 2].min()
    hair = _hair_field(points, heads["Head"], eye_line, points[body.skin, 2].max())
    arms = limbs["Left", "Arm"][0] + limbs["Right", "Arm"][0]

    mesh = CutMesh(sparse.eye_array(len(points), format="csr"), faces, np.arange(len(faces)))
    for (_, limb), (weight, level) in limbs.items():
        for end in (SLEEVES if limb == "Arm" else LEGS).values():
            inside = ((mesh.blend @ weight) > 0.5)[mesh.faces].all(1)
            mesh = cut(mesh, inside & is_suit[mesh.origin], level - end)
    for field in (*(trunk - end for end in HEMS.values()), floor - SOLE, collar):
        inside = ~((mesh.blend @ arms) > 0.5)[mesh.faces].any(1)
        mesh = cut(mesh, inside & is_suit[mesh.origin], field)
    is_head = is_skin & (points[faces].mean(1)[:, 2] > heads["Spine1"][2])
    mesh = cut(mesh, is_head[mesh.origin], hair)

    # First the parts that whole faces belong to, then those that depend on the pieces.
    whole = np.full(len(faces), int(FacePart.TORSO))
    whole[is_skin] = np.where(is_head[is_skin], FacePart.SKIN, FacePart.HAND)
    whole[: first[1]][_brow(points[skin].mean(1), points[body.eyes].mean(1))] = FacePart.BROW
    whole[: first[1]][masks["lips"]] = FacePart.LIPS
    whole[is_eye] = _eye_parts(points[body.eyes].mean(1))
    ears = np.zeros(len(faces), bool)
    ears[: first[1]] = masks["ears"]
    part = whole[mesh.origin]
    level = np.where(is_suit[mesh.origin], mesh.on_faces(trunk), 0.0)
    height = mesh.on_faces(hair)
    scalp = (is_head & ~ears)[mesh.origin] & (height > 0)
    part[scalp], level[scalp] = FacePart.SCALP, np.clip(height[scalp] / HAIR_DEPTH, 0, 1)
    for (_, limb), (weight, along) in limbs.items():
        on_limb = is_suit[mesh.origin] & (mesh.on_faces(weight) > 0.5)
        if limb == "Leg":
            on_limb &= mesh.on_faces(trunk) < 0
        part[on_limb] = FacePart.ARM if limb == "Arm" else FacePart.LEG
        level[on_limb] = mesh.on_faces(along)[on_limb]
    part[(part == FacePart.LEG) & (level > LEGS["long"])] = FacePart.SHOE
    part[(part == FacePart.SHOE) & (mesh.on_faces(floor) < SOLE)] = FacePart.SOLE

    above_collar = (part == FacePart.TORSO) & (mesh.on_faces(collar) > 0)
    in_socket = is_eye[mesh.origin] & (mesh.on_faces(points)[:, 0] < points[body.eyes, 0].max() - 0.014)
    keep = ~above_collar & ~in_socket
    used, kept = np.unique(mesh.faces[keep], return_inverse=True)
    return mesh.blend[used], kept.reshape(-1, 3), part[keep], level[keep]


_LIMBS = {"Arm": ("Arm", "ArmTwist", "ForeArm", "ForeArmTwist", "Hand"), "Leg": ("UpLeg", "Leg", "Foot", "ToeBase")}
_CHAINS = {"Arm": ("Arm", "ForeArm", "Hand"), "Leg": ("UpLeg", "Leg", "Foot")}


def _level(points: Floats, first: Floats, middle: Floats, last: Floats) -> Floats:
    """Return the level of points (n, 3) along a limb: 0 at its first joint, 1 at the middle joint, 2 at the last."""
    upper, lower = middle - first, last - middle
    a = (points - first) @ upper / (upper @ upper)
    b = (points - middle) @ lower / (lower @ lower)
    # The two scales meet on the plane that bisects the angle at the middle joint.
    beyond = (points - middle) @ (upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)) > 0
    return np.where(beyond, 1 + np.maximum(b, 0), np.minimum(a, 1))


def _crotch(points: Floats, suit: Integers) -> float:
    """Return the height of the lowest point of the suit between the legs, metres."""
    middle = points[np.unique(suit)]
    return float(middle[np.abs(middle[:, 1]) < 0.005, 2].min())


def _hair_field(points: Floats, head: Floats, eye_line: Floats, crown: float) -> Floats:
    """Return the height of points (n, 3) above the hairline, metres."""
    bearing = np.degrees(np.arctan2(np.abs(points[:, 1]), points[:, 0] - head[0]))
    return np.asarray(points[:, 2] - (eye_line[2] + (crown - eye_line[2]) * _HAIRLINE(bearing)))


def _drawn_skin(body: MeanBody, collar: Floats) -> Bools:
    """Return the mask of the drawn skin faces: outside the suit, on the neck, and a margin below cuffs and collar."""
    suit = np.unique(body.suit)
    edges = np.sort(body.suit[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    rim = np.isin(suit, edges[count == 1])
    bare = rim[cKDTree(body.points[suit]).query(body.points)[1]]  # skin outside the suit is nearest to its rim
    for _ in range(2):
        bare[body.skin[bare[body.skin].any(1)]] = True
    bare |= collar > -_BELOW
    return np.asarray(bare[body.skin].all(1) & ~body.masks["inside-mouth"])


def _brow(middle: Floats, eyes: Floats) -> Bools:
    """Return which face centres (k, 3) lie on the eyebrows, bands above the centres of the eye faces."""
    across, above = np.abs(middle[:, 1]) - np.abs(eyes[:, 1]).mean(), middle[:, 2] - eyes[:, 2].mean()
    arch = 0.024 - 40.0 * np.maximum(across - 0.008, 0) ** 2
    band = (np.abs(above - arch) < 0.0028) & (across > -0.02) & (across < 0.018)
    return np.asarray(band & (middle[:, 0] > eyes[:, 0].mean() - 0.02))


def _eye_parts(centers: Floats) -> Integers:
    """Return the part of eye faces, sclera or iris, from their centres (k, 3)."""
    part = np.full(len(centers), int(FacePart.SCLERA))
    for side in (1, -1):
        eye = centers[:, 1] * side > 0
        pupil = centers[eye][np.argmax(centers[eye][:, 0])]
        part[eye & (np.linalg.norm(centers - pupil, axis=1) < 0.0065)] = FacePart.IRIS
    return part
