import colorsys
from dataclasses import replace

import numpy as np
import pytest

from simharness.humans.body import Part, make_body
from simharness.humans.looks import HEMS, LEGS, SLEEVES, Garment, draw_look, draw_looks, dress, face_colors, garments
from simharness.humans.shape import Shape
from simharness.random import stream


@pytest.fixture(scope="module")
def body():
    return make_body(Shape())


@pytest.fixture(scope="module")
def look():
    return draw_look(stream(0, "test"))


def hue(look):
    return colorsys.rgb_to_hsv(*look.top)[0]


@pytest.mark.parametrize("count", [2, 4, 8])
def test_hues_of_one_scene_are_spread_over_the_circle(count):
    for seed in range(5):
        hues = np.sort([hue(look) for look in draw_looks(seed, count)])
        gaps = np.diff([*hues, hues[0] + 1])
        assert gaps.min() > 0.5 / count


def test_looks_depend_on_the_seed_and_not_on_who_else_is_there():
    assert draw_looks(0, 3) == draw_looks(0, 5)[:3]
    assert draw_looks(0, 3) != draw_looks(1, 3)
    assert draw_looks(0, 0) == ()


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
    """The mesh has an edge along every hem: no face reaches more than a little over the line it ends at."""
    look = replace(look, sleeves=sleeves, legs=legs, hem=hem)
    worn = garments(body, look)
    arm, leg = body.part == Part.ARM, body.part == Part.LEG
    for limb, garment, end, chain in (
        (arm, Garment.TOP, SLEEVES[sleeves], ("Arm", "ForeArm", "Hand")),
        (leg, Garment.TROUSERS, LEGS[legs], ("UpLeg", "Leg", "Foot")),
    ):
        on, off = limb & (worn == garment), limb & (worn == Garment.NONE)
        assert on.any()
        if not off.any():
            continue  # a long sleeve or leg: nothing of the limb's suit is bare
        shared = np.intersect1d(body.faces[on], body.faces[off])
        left = shared[body.vertices[shared, 1] > 0]
        assert len(left) >= 8
        heads = np.array([body.heads[body.index(f"Left{bone}")] for bone in chain])
        k = int(end > 1)
        axis = heads[k + 1] - heads[k]
        level = k + (body.vertices[left] - heads[k]) @ axis / (axis @ axis)
        assert np.ptp(level) * np.linalg.norm(axis) < 0.012  # on another body than the mean one lines bend a little
        assert level.mean() == pytest.approx(end, abs=0.06)


def test_a_look_colors_what_it_covers(body, look):
    look = replace(look, sleeves="long", legs="shorts")
    colors = face_colors(body, look)
    np.testing.assert_allclose(
        np.unique(colors[(body.part == Part.ARM) & (body.level < 1.5)], axis=0), [look.top], atol=1e-6
    )
    for bare in ((body.part == Part.LEG) & (body.level > 1.2), body.part == Part.HAND):
        np.testing.assert_allclose(np.unique(colors[bare], axis=0), [look.skin], atol=1e-6)


def test_clothes_have_thickness_and_change_nothing_else(body, look):
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


def test_dressed_people_stand_on_the_same_floor(body, look):
    assert dress(body, look).vertices[:, 2].min() == pytest.approx(0, abs=1e-6)


def test_vertices_of_two_garments_are_not_shared(body, look):
    dressed, worn = dress(body, look), garments(body, look)
    owner = np.full(len(dressed.vertices), -1)
    for garment in Garment:
        used = np.unique(dressed.faces[worn == garment])
        assert (owner[used] == -1).all()
        owner[used] = garment
    assert (owner >= 0).all()


@pytest.mark.parametrize(("key", "value"), [("sleeves", "huge"), ("legs", ""), ("top", (2.0, 0, 0)), ("volume", -1.0)])
def test_an_impossible_look_is_refused(look, key, value):
    with pytest.raises(ValueError, match=key):
        replace(look, **{key: value})
