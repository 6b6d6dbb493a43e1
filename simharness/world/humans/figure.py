"""Visible mesh of a dressed body: its colours, what its surfaces are made of, and the grain of hair and cloth.

Hair runs from the whorl at the crown over the head and down. Cloth folds across trunk and limbs; its pattern of folds
lies at rest on the body, and is irregular in all directions, so that no fold is a ring.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mvpose.arrays import Floats
from simharness.types.mesh import Finish, Material, Mesh
from simharness.world.humans.added_mesh import unit
from simharness.world.humans.body import Body, FacePart, body_model
from simharness.world.humans.clothing import Garment, garments, limb_frame, paint
from simharness.world.humans.face_colors import places_of_head
from simharness.world.humans.wardrobe import LOOKS, Look

_STRAND, _FOLD = 0.022, 0.055  # metres along hair and cloth over which their direction is measured
_WHORL = (-0.045, 0.01, 0.0)  # metres from the crown: hair runs away from here
_AROUND = 0.6  # metres around the head
_INNER_LIPS = 0.003  # metres: half the height of what lies between the lips
_WANDER = 0.011  # metres by which folds wander along the grain
_SLANT = 0.35  # folds of limbs are not rings: they rise along the surface


def figure_mesh(body: Body, look: Look) -> Mesh:
    """Return the visible mesh of a body that wears a look, in the rest pose."""
    surface = paint(body, look)
    finish, segments = finish_of(body, look), body.segments
    return Mesh(body.vertices, body.faces, surface.colors, True, surface.texture, surface.uv, segments, finish=finish)


def finish_of(body: Body, look: Look) -> Finish:
    """Return the materials of a dressed body and the grain of its hair and cloth."""
    materials = materials_of(body, look)
    vertices = body.vertices.astype(float)
    count = len(vertices)
    toward, place = np.arange(count, dtype=np.int32), np.zeros(count, np.float32)
    looseness = np.zeros(count, np.float32)
    hair = np.unique(body.faces[materials == Material.HAIR])
    if len(hair):
        points = vertices[hair] - _crown(body)
        toward[hair] = hair[_ahead(vertices[hair], _strands(points), _STRAND)]
        place[hair] = _AROUND * (np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) + 0.5)
    cloth = np.unique(body.faces[materials == Material.CLOTH])
    if len(cloth):
        grain, place[cloth] = _cloth(body, cloth)
        toward[cloth] = cloth[_ahead(vertices[cloth], grain, _FOLD)]
        x, y, z = vertices[cloth].T
        looseness[cloth] = (0.5 + 0.5 * look.fit) * (
            0.75 + 0.35 * np.sin(29 * y + 14 * z) * np.sin(19 * x - 23 * z + 2)
        )
    rest = np.linalg.norm(vertices[toward] - vertices, axis=1)
    return Finish(materials, toward, rest.astype(np.float32), place, looseness, _AROUND)


def materials_of(body: Body, look: Look) -> NDArray[np.int8]:
    """Return the :class:`~simharness.types.mesh.Material` of every face of a body, (k,) int8.

    What a person wears is made of cloth or leather; bare arms and legs, and all else of the body, of skin.
    """
    part_of, garment_of = LOOKS["parts"], LOOKS["garments"]
    of_part = np.array([Material[part_of.get(part.name, "SKIN")] for part in FacePart], np.int8)
    of_garment = np.array([Material[garment_of.get(garment.name, "MATTE")] for garment in Garment], np.int8)
    worn = garments(body, look)
    covered = np.isin(worn, [Garment[name] for name in garment_of])
    materials = np.where(covered, of_garment[worn], of_part[body.part]).astype(np.int8)
    lips = np.flatnonzero(body.part == FacePart.LIPS)
    height = places_of_head(body)[lips, 2]
    materials[lips[np.abs(height - height.mean()) < _INNER_LIPS]] = Material.MATTE  # between the lips nothing shines
    return materials


def _crown(body: Body) -> Floats:
    """Return the place of the whorl, (3,) metres."""
    grown = len(body_model().faces)  # what follows are meshes of hair
    scalp = body.vertices[np.unique(body.faces[:grown][body.part[:grown] == FacePart.SCALP])].astype(float)
    return np.array([0.5 * (scalp[:, 0].min() + scalp[:, 0].max()), 0.0, scalp[:, 2].max()]) + _WHORL


def _strands(points: Floats) -> Floats:
    """Return the direction of hair at points relative to the whorl, (n, 3): away from it and, on the sides, down."""
    away = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9)
    away[:, 2] -= np.clip(-points[:, 2] / 0.1, 0, 2)
    return unit(away)


def _cloth(body: Body, cloth: NDArray[np.int64]) -> tuple[Floats, NDArray[np.float32]]:
    """Return the grain of cloth vertices, (n, 3) unit vectors down the trunk or along a limb, and their ``place``."""
    points, part = body.vertices[cloth].astype(float), np.zeros(len(body.vertices), int)
    part[body.faces] = body.part[:, None]
    on_arm, left = part[cloth] == FacePart.ARM, points[:, 1] > 0
    grain, place = np.tile([0.0, 0.0, -1.0], (len(points), 1)), -points[:, 2]
    for side, on_side in (("Left", left), ("Right", ~left)):
        joints = np.stack([body.heads[body.index(side + bone)] for bone in ("Arm", "ForeArm", "Hand")])
        arm = on_arm & on_side
        grain[arm], _, along = limb_frame(points[arm], joints)
        place[arm] = along - joints[0, 2]
    x, y, z = points.T
    place = place + _SLANT * (x + np.abs(y) * np.where(on_arm, 0.0, 1.0))
    place += _WANDER * (2 * np.sin(23 * x + 17 * z + 1) * np.sin(27 * y - 11 * z) + np.sin(13 * x - 25 * y + 23 * z))
    return grain, place.astype(np.float32)


def _ahead(points: Floats, direction: Floats, distance: float) -> NDArray[np.int64]:
    """Return the point that lies about a distance ahead of each in a direction, (n,): among its neighbours the best."""
    _, near = cKDTree(points).query(points + distance * direction, k=min(4, len(points)))
    near = near.reshape(len(points), -1)
    way = points[near] - points[:, None]
    length = np.linalg.norm(way, axis=2)
    straight = (way * direction[:, None]).sum(axis=2) / np.maximum(length, 1e-9)
    score = np.where(length > 0.3 * distance, straight - 2 * np.abs(length / distance - 1), -9.0)
    best = near[np.arange(len(points)), score.argmax(axis=1)]
    return np.where(score.max(axis=1) > -1.5, best, np.arange(len(points)))
