from dataclasses import replace

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import Garment, dress, face_colors, garments, paint
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import HAIR_STYLES, HEMS, LEGS, SLEEVES, draw_look


@pytest.fixture(scope="module")
def body():
    return make_body(Shape())


@pytest.fixture(scope="module")
def look():
    return replace(draw_look(stream(0, "test")), lower_garment="trousers", hair_style="short", fit=0.3)


def test_colors_are_albedos_of_every_face(body, look):
    colors = face_colors(body, look)
    assert colors.shape == (len(body.faces), 3)
    assert colors.dtype == np.float32
    assert colors.min() >= 0
    assert colors.max() <= 1


@pytest.mark.parametrize("sleeves", SLEEVES)
@pytest.mark.parametrize("legs", LEGS)
@pytest.mark.parametrize("hem", HEMS)
def test_garments_end_at_a_clean_line(body, look, sleeves, legs, hem):
    """The mesh has edges along every hem, so the border of a garment lies on a line of constant level."""
    look = replace(look, sleeves=sleeves, legs=legs, hem=hem)
    worn = garments(body, look)
    arm, leg = body.part == FacePart.ARM, body.part == FacePart.LEG
    for limb, garment, end, chain in (
        (arm, Garment.TOP, SLEEVES[sleeves], ("Arm", "ForeArm", "Hand")),
        (leg, Garment.TROUSERS, LEGS[legs], ("UpLeg", "Leg", "Foot")),
    ):
        on, off = limb & (worn == garment), limb & (worn == Garment.NONE)
        assert on.any()
        if not off.any():
            continue  # a long sleeve or leg: no face of the limb's suit is bare
        shared = np.intersect1d(body.faces[on], body.faces[off])
        left = shared[body.vertices[shared, 1] > 0]
        assert len(left) >= 8
        heads = np.array([body.heads[body.index(f"Left{bone}")] for bone in chain])
        k = int(end > 1)
        axis = heads[k + 1] - heads[k]
        level = k + (body.vertices[left] - heads[k]) @ axis / (axis @ axis)
        assert np.ptp(level) * np.linalg.norm(axis) < 0.012  # lines bend a little on bodies other than the mean body
        assert level.mean() == pytest.approx(end, abs=0.06)


def test_faces_have_the_colour_of_their_garment_or_skin(body, look):
    look = replace(look, sleeves="long", legs="shorts")
    colors = face_colors(body, look)
    np.testing.assert_allclose(
        np.unique(colors[(body.part == FacePart.ARM) & (body.level < 1.5)], axis=0), [look.top], atol=1e-6
    )
    for bare in ((body.part == FacePart.LEG) & (body.level > 1.2), body.part == FacePart.HAND):
        np.testing.assert_allclose(np.unique(colors[bare], axis=0), [look.skin], atol=1e-6)


def test_clothes_add_thickness_and_change_nothing_else(body, look):
    dressed = dress(body, look)
    np.testing.assert_array_equal(dressed.part, body.part)
    np.testing.assert_array_equal(dressed.keypoints, body.keypoints)
    np.testing.assert_array_equal(face_colors(dressed, look), face_colors(body, look))
    moved = np.linalg.norm(dressed.vertices[dressed.faces] - body.vertices[body.faces], axis=2)
    worn = garments(body, look)
    assert moved[worn == Garment.NONE].max() == 0
    assert 0.004 < np.median(moved[worn == Garment.TOP]) < 0.02
    assert 0.004 < np.median(moved[worn == Garment.TROUSERS]) < 0.025
    assert moved.max() < 0.05
    np.testing.assert_allclose(dressed.weights.sum(1), 1, atol=1e-6)


def test_soles_of_a_dressed_body_are_on_the_floor(body, look):
    assert dress(body, look).vertices[:, 2].min() == pytest.approx(0, abs=1e-6)


def test_vertices_of_two_garments_are_not_shared(body, look):
    dressed, worn = dress(body, look), garments(body, look)
    garment_of_vertex = np.full(len(dressed.vertices), -1)
    for garment in Garment:
        used = np.unique(dressed.faces[worn == garment])
        assert (garment_of_vertex[used] == -1).all()
        garment_of_vertex[used] = garment
    assert (garment_of_vertex >= 0).all()


def test_wide_clothes_stand_out_further(body, look):
    def stands_out(fit, garment):
        dressed = dress(body, replace(look, fit=fit, legs="long"))
        moved = np.linalg.norm(dressed.vertices[dressed.faces] - body.vertices[body.faces], axis=2)
        return np.median(moved[garments(body, replace(look, legs="long")) == garment])

    for garment in (Garment.TOP, Garment.TROUSERS):
        assert stands_out(1.0, garment) > stands_out(0.5, garment) > stands_out(0.0, garment) + 0.002


def test_wide_trousers_lie_on_the_shoe(body, look):
    """There is no gap between hem and shoe: the hem is lower than the top of the shoe."""
    for fit in (0.0, 1.0):
        wide = replace(look, fit=fit, legs="long")
        dressed, worn = dress(body, wide), garments(body, wide)
        hem = dressed.vertices[dressed.faces[worn == Garment.TROUSERS], 2].min()
        shoe = dressed.vertices[dressed.faces[worn == Garment.SHOE], 2].max()
        assert hem < shoe + 0.002


@pytest.mark.parametrize("lower_garment", ["trousers", "skirt", "dress", "coat"])
@pytest.mark.parametrize("hair_style", HAIR_STYLES)
def test_dressing_moves_no_joint_and_keeps_all_faces(body, look, lower_garment, hair_style):
    dressed = dress(body, replace(look, lower_garment=lower_garment, hair_style=hair_style))
    pose = np.tile(np.eye(3, 4), (len(body.bones), 1, 1))
    np.testing.assert_array_equal(dressed.landmarks(pose), body.landmarks(pose))
    np.testing.assert_array_equal(dressed.part[: len(body.part)], body.part)
    added = dressed.part[len(body.part) :]
    assert (FacePart.SKIRT in added) == (lower_garment != "trousers")
    assert (FacePart.SCALP in added) == (hair_style not in ("short", "curly"))
    assert dressed.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(dressed.skin(pose), dressed.vertices, atol=1e-5)


def test_dresses_and_coats_have_the_colour_of_the_top_and_skirts_that_of_trousers(body, look):
    for lower_garment, color in (("skirt", "trousers"), ("dress", "top"), ("coat", "top")):
        changed = replace(look, lower_garment=lower_garment)
        dressed = dress(body, changed)
        shown = face_colors(dressed, changed)[dressed.part == FacePart.SKIRT]
        np.testing.assert_allclose(np.unique(shown, axis=0), [getattr(changed, color)], atol=1e-6)


def test_plain_clothes_have_no_texture(body, look):
    surface = paint(body, replace(look, top_pattern="plain", bottom_pattern="plain"))
    assert surface.texture is None
    assert surface.uv is None
    np.testing.assert_array_equal(surface.colors, face_colors(body, look))


def test_patterned_faces_take_their_whole_colour_from_the_texture(body, look):
    patterns = replace(look, top_pattern="checks", bottom_pattern="stripes", lower_garment="skirt")
    dressed = dress(body, patterns)
    surface, worn = paint(dressed, patterns), garments(dressed, patterns)
    assert surface.uv.shape == (len(dressed.faces), 3, 2)
    assert surface.texture.dtype == np.uint8
    patterned = np.isin(worn, [Garment.TOP, Garment.TROUSERS])
    assert (surface.colors[patterned] == 1).all()
    np.testing.assert_array_equal(surface.colors[~patterned], face_colors(dressed, patterns)[~patterned])
