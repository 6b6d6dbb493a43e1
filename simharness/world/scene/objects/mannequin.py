"""Mannequins of shops: decoys whose joints a detector would find (``Solid.figure``)."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.scene.objects.geoms import Surface
from simharness.world.scene.objects.shapes import bar_mesh, joined
from simharness.world.scene.objects.solids import ObjectModel

_BASE = np.array([0.44, 0.45, 0.46])
_SHOP_COLORS = np.array([[0.90, 0.88, 0.85], [0.80, 0.69, 0.58], [0.30, 0.31, 0.33], [0.74, 0.75, 0.77]])
_ARM_OUT = 0.2  # angle of the upper arms of a mannequin from the vertical, radians


def draw_mannequin(rng: np.random.Generator) -> ObjectModel:
    """Draw a shop mannequin: an unclothed body of one colour on a round base."""
    body = make_body(
        Shape(
            gender=float(rng.choice([0.05, 0.95])),
            muscle=0.35,
            weight=float(rng.uniform(0.2, 0.5)),
            height=float(rng.uniform(0.35, 0.45)),
            proportions=0.0,
        )
    )
    color, twist, bend = _SHOP_COLORS[rng.integers(len(_SHOP_COLORS))], rng.uniform(-0.2, 0.2), rng.uniform(0.1, 0.6, 2)
    turns = {"Spine": np.array([0.0, 0.0, twist])}
    for side, flexed in zip(("Left", "Right"), bend, strict=True):
        arm, forearm = (body.heads[body.index(side + bone)] for bone in ("Arm", "ForeArm"))
        out, down = np.abs((forearm - arm)[1:])
        sense = -1.0 if side == "Left" else 1.0
        turns[side + "Arm"] = np.array([sense * (np.arctan2(out, down) - _ARM_OUT), 0.0, 0.0])
        hinge = np.cross(forearm - arm, [1.0, 0.0, 0.0])
        turns[side + "ForeArm"] = flexed * hinge / np.linalg.norm(hinge)
    bones = _posed(body, turns)
    skin = body.skin(bones)
    base = 0.025
    offset = np.array([0.0, 0.0, base - float(skin[:, 2].min())])
    offset[:2] = -skin[skin[:, 2] < skin[:, 2].min() + 0.05, :2].mean(axis=0)
    statue = Mesh(
        vertices=(skin + offset).astype(np.float32),
        faces=body.faces,
        colors=np.tile(color.astype(np.float32), (len(body.faces), 1)),
        smooth=True,
    )
    foot = bar_mesh((0.0, 0.0, 0.0), (0.0, 0.0, base), 0.27, _BASE, sides=28)
    geoms = tuple(Surface(mesh.vertices.astype(float), mesh.faces) for mesh in (statue, foot))
    return ObjectModel(joined(statue, foot), geoms, body.joints(bones) + offset)


def _posed(body: Body, turns: Mapping[str, Floats]) -> Floats:
    """Return bone transforms (B, 3, 4) of the rest pose with bones rotated about their heads by rotation vectors."""
    transforms = np.empty((len(body.bones), 3, 4))
    for bone, (name, parent) in enumerate(zip(body.bones, body.parents, strict=True)):
        rest = np.eye(3, 4) if parent < 0 else transforms[parent]
        turn = Rotation.from_rotvec(turns.get(name, np.zeros(3))).as_matrix()
        head = body.heads[bone]
        transforms[bone, :, :3] = rest[:, :3] @ turn
        transforms[bone, :, 3] = rest[:, :3] @ (head - turn @ head) + rest[:, 3]
    return transforms
