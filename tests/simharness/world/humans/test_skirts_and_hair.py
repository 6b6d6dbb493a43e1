from dataclasses import replace
from functools import cache

import cv2
import mujoco
import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import FacePart, body_model, make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.mujoco_model import bone_transforms, person_spec
from simharness.world.humans.population import draw_shape
from simharness.world.humans.wardrobe import draw_look

POSES = {
    "standing": {},
    "heel strike": {
        "left_hip_flexion": 30,
        "left_knee_flexion": 8,
        "right_hip_flexion": -18,
        "right_knee_flexion": 35,
        "right_ankle_dorsiflexion": -8,
    },
    "swing": {"left_hip_flexion": 30, "left_knee_flexion": 60, "right_hip_flexion": -15},
    "turning": {"left_hip_flexion": 25, "left_hip_rotation": -20, "left_hip_abduction": 12, "right_hip_flexion": -5},
}
COLUMNS = 40


class Walker:
    """Body in a skirt, with its MuJoCo model."""

    def __init__(self, seed, *, lower_garment="skirt", length=0.9, fit=0.2, child=False):
        bare = make_body(draw_shape(stream(seed, "test"), child=child))
        look = replace(
            draw_look(stream(seed, "look"), female=True), lower_garment=lower_garment, length=length, fit=fit
        )
        self.body = dress(bare, replace(look, hair_style="long", legs="shorts", hem="tucked"))
        self.length = length
        self.model = person_spec(self.body, "walker").compile()

    def transforms(self, degrees):
        data = mujoco.MjData(self.model)
        for name, angle in degrees.items():
            data.qpos[self.model.joint(name).qposadr[0]] = np.radians(angle)
        mujoco.mj_kinematics(self.model, data)
        rows = [self.model.body(bone).id for bone in self.body.bones]
        return bone_transforms(self.body, data.xpos[rows], data.xmat[rows].reshape(-1, 3, 3))

    def rings(self, skin):
        first, count = self.body.skirt.first, len(self.body.skirt.pelvis_share)
        return skin[first : first + count].reshape(-1, COLUMNS, 3)

    def thighs(self):
        """Return the vertices of the legs that are well above the hem."""
        faces = (self.body.part == FacePart.LEG) & (self.body.level < self.length - 0.08)
        return np.unique(self.body.faces[faces])


@cache
def walker_of(seed, **wear):
    return Walker(seed, **wear)


def slice_at(rings, height):
    """Return the points where the columns of a skirt cross a height, (40, 2), or None if not all columns do."""
    above, below = rings[:-1, :, 2] >= height, rings[1:, :, 2] < height
    crossing = above & below
    if not crossing.any(0).all():
        return None
    ring, column = crossing.argmax(0), np.arange(COLUMNS)
    a, b = rings[ring, column], rings[ring + 1, column]
    share = (a[:, 2] - height) / (a[:, 2] - b[:, 2])
    return (a + share[:, None] * (b - a))[:, :2]


@pytest.mark.parametrize(
    ("seed", "wear"),
    [
        (0, {}),
        (1, {"lower_garment": "dress", "length": 0.65}),
        (2, {"fit": 0.0, "length": 0.98}),
        (3, {"lower_garment": "coat", "fit": 1.0}),
        (4, {"child": True}),
    ],
)
@pytest.mark.parametrize("pose", POSES)
def test_no_thigh_comes_through_a_skirt_in_a_stride(seed, wear, pose):
    walker = walker_of(seed, **wear)
    skin = walker.body.skin(walker.transforms(POSES[pose]))
    rings, checked, worst = walker.rings(skin), 0, 0.0
    for point in skin[walker.thighs()]:
        outline = slice_at(rings, point[2])
        if outline is not None:
            checked += 1
            outline = outline.astype(np.float32).reshape(-1, 1, 2)
            worst = max(worst, -cv2.pointPolygonTest(outline, (float(point[0]), float(point[1])), True))
    assert checked > 0.3 * len(walker.thighs())
    assert worst < 0.02


def test_a_skirt_is_a_closed_tube_with_faces_pointing_outwards():
    """Every edge has two faces, except those of the waist and the hem; the faces point outwards."""
    body = walker_of(0).body
    faces = body.faces[body.part == FacePart.SKIRT]
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    count = np.unique(edges, axis=0, return_counts=True)[1]
    assert set(count.tolist()) == {1, 2}
    assert (count == 1).sum() == 2 * COLUMNS
    a, b, c = np.moveaxis(body.vertices[faces].astype(float) - [0, 0, body.heads[0, 2]], 1, 0)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) * [1, 1, 0])
    assert (outward > 0).mean() > 0.97


def test_a_ring_is_the_hull_of_two_round_thighs():
    """With one leg forward and the other back, the hem extends as far as each leg and is nearly convex."""
    walker = walker_of(2, fit=0.0, length=0.9)
    transforms = walker.transforms({"left_hip_flexion": 30, "right_hip_flexion": -20})
    hem = walker.rings(walker.body.skin(transforms))[-1].astype(float)
    centers = []
    for side, bone in enumerate(("LeftUpLeg", "RightUpLeg")):
        at_rest = walker.body.skirt.centers[-1, side]
        centers.append(transforms[walker.body.index(bone)] @ [*at_rest, 1])
    left, right = np.array(centers)
    assert left[0] - right[0] > 0.2
    assert hem[:, 0].max() > left[0] + 0.07
    assert hem[:, 0].min() < right[0] - 0.07
    hull = cv2.convexHull(hem[:, :2].astype(np.float32))
    area = cv2.contourArea(hem[:, :2].astype(np.float32).reshape(-1, 1, 2))
    assert area > 0.9 * cv2.contourArea(hull)


def test_a_skirt_turns_and_moves_with_the_body():
    walker = walker_of(0)
    pose = walker.transforms(POSES["heel strike"])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = np.einsum("rk,bkc->brc", turn, pose)
    moved[:, :, 3] += [1.0, 2.0, 0.3]
    expected = walker.body.skin(pose) @ turn.T + [1.0, 2.0, 0.3]
    np.testing.assert_allclose(walker.body.skin(moved), expected, atol=1e-4)


def test_a_skirt_moves_continuously_with_the_legs():
    """No vertex jumps when it changes from one leg to the other."""
    walker = walker_of(1)
    last, largest = None, 0.0
    for angle in np.linspace(-25, 25, 101):
        skin = walker.body.skin(walker.transforms({"left_hip_flexion": angle, "right_hip_flexion": -angle}))
        rings = walker.rings(skin)
        if last is not None:
            largest = max(largest, float(np.linalg.norm(rings - last, axis=2).max()))
        last = rings.copy()
    assert 0.002 < largest < 0.02  # metres per half degree; a thigh alone moves by 4 mm


def test_long_hair_hangs_behind_the_face_and_turns_with_the_head():
    body = walker_of(0).body
    added = slice(len(body_model().faces), None)
    hair = np.unique(body.faces[added][body.part[added] == FacePart.SCALP])
    head = body.heads[body.index("Head")]
    added = body.vertices[hair]
    assert added[:, 2].min() < body.heads[body.index("Neck"), 2]
    assert added[:, 0].max() < head[0] + 0.03
    bone = body.weight_bones[hair, body.weights[hair].argmax(1)]
    assert (bone == body.index("Head")).all()
