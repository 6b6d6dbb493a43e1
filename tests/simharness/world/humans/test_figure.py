"""Materials and grain of dressed bodies, and expressions of faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simharness.capture.rendering.finishes import grain_of
from simharness.types.mesh import Material
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import Garment, dress, face_colors, garments
from simharness.world.humans.face_colors import EXPRESSIONS
from simharness.world.humans.figure import figure_mesh, materials_of
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import draw_looks

LOOK = replace(draw_looks(1, 1)[0], hat="none", bag="none", mask="none", glasses="none", sleeves="long", legs="long")


@pytest.fixture(scope="module")
def body():
    return dress(make_body(Shape()), LOOK)


@pytest.fixture(scope="module")
def mesh(body):
    return figure_mesh(body, LOOK)


def test_what_is_worn_is_cloth_and_what_is_bare_is_skin(body):
    materials, worn = materials_of(body, LOOK), garments(body, LOOK)
    assert (materials[np.isin(worn, [Garment.TOP, Garment.TROUSERS])] == Material.CLOTH).all()
    assert (materials[body.part == FacePart.HAND] == Material.SKIN).all()
    assert (materials[body.part == FacePart.SCALP] == Material.HAIR).all()


def test_at_rest_no_length_of_cloth_has_changed(mesh):
    kept = mesh.finish
    grain = grain_of(mesh.vertices, kept.toward, kept.rest, kept.looseness)
    cloth = kept.looseness > 0
    assert (kept.toward[cloth] != np.flatnonzero(cloth)).mean() > 0.98
    assert grain[cloth, 3].max() < 0.1


def test_hair_runs_down_at_the_back_of_the_head(body, mesh):
    kept = mesh.finish
    back = np.unique(mesh.faces[kept.materials == Material.HAIR])
    places = mesh.vertices[back]
    low = (places[:, 2] < places[:, 2].max() - 0.1) & (places[:, 0] < np.median(places[:, 0]))
    grain = grain_of(mesh.vertices, kept.toward, kept.rest, kept.looseness)[back[low]]
    assert np.median(grain[:, 2]) < -0.6


def test_a_bent_elbow_folds_its_sleeve(body, mesh):
    kept, elbow = mesh.finish, body.heads[body.index("LeftForeArm")]
    transforms = np.tile(np.eye(3, 4), (len(body.bones), 1, 1))
    shoulder, wrist = (body.heads[body.index(bone)] for bone in ("LeftArm", "LeftHand"))
    axis = np.cross(elbow - shoulder, wrist - elbow)
    turn = Rotation.from_rotvec(np.radians(80) * axis / np.linalg.norm(axis)).as_matrix()
    moved, parents = {body.index("LeftForeArm")}, body.parents
    for bone in range(len(body.bones)):
        if parents[bone] in moved:
            moved.add(bone)
    for bone in moved:
        transforms[bone] = np.column_stack([turn, elbow - turn @ elbow])
    grain = grain_of(body.skin(transforms), kept.toward, kept.rest, kept.looseness)
    rest = grain_of(mesh.vertices, kept.toward, kept.rest, kept.looseness)
    near = (np.linalg.norm(mesh.vertices - elbow, axis=1) < 0.08) & (kept.looseness > 0)
    far = (mesh.vertices[:, 1] < 0) & (kept.looseness > 0)
    assert grain[near, 3].max() > 0.3
    np.testing.assert_array_equal(grain[far, 3], rest[far, 3])


def test_expressions_are_colours_of_the_face_alone(body):
    shown = {name: face_colors(body, replace(LOOK, expression=name)) for name in EXPRESSIONS}
    head = body.vertices[body.faces].mean(axis=1)[:, 2] > body.heads[body.index("Head"), 2] - 0.1
    for name, colors in shown.items():
        changed = (colors != shown["neutral"]).any(axis=1)
        assert changed.any() == (name != "neutral")
        assert head[changed].all()
        assert colors.min() >= 0
        assert colors.max() <= 1


def test_teeth_show_in_a_smile_and_an_open_mouth_is_dark(body):
    lips = body.part == FacePart.LIPS
    brightest, darkest = (
        face_colors(body, replace(LOOK, expression=name))[lips].mean(axis=1) for name in ("smile", "speaking")
    )
    neutral = face_colors(body, replace(LOOK, expression="neutral"))[lips].mean(axis=1)
    assert brightest.max() > neutral.max()
    assert darkest.min() < neutral.min()
