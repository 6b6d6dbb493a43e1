from dataclasses import replace

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import dress, face_colors
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import draw_look, draw_looks


@pytest.fixture(scope="module")
def look():
    return replace(draw_look(stream(0, "test")), skin=(0.8, 0.6, 0.5), hair=(0.1, 0.1, 0.1), hair_style="short")


def changed(body, look, **grooming):
    """Return which faces have another colour with a beard or a bald head."""
    return (face_colors(body, look) != face_colors(body, replace(look, **grooming))).any(axis=1)


def test_a_beard_is_around_the_mouth_and_on_skin_only(look):
    body = make_body(Shape())
    faces = changed(body, look, beard=1.0)
    assert faces.sum() > 50
    assert (body.part[faces] == FacePart.SKIN).all()
    centers = body.vertices[body.faces].mean(axis=1)
    mouth = centers[body.part == FacePart.LIPS].mean(axis=0)
    eyes = centers[body.part == FacePart.IRIS].mean(axis=0)
    assert centers[faces, 2].max() < eyes[2]  # sideburns reach higher than the moustache
    assert np.linalg.norm(centers[faces] - mouth, axis=1).max() < 0.14
    assert (centers[faces, 2] < mouth[2]).any()
    assert (centers[faces, 2] > mouth[2]).any()


def test_a_bald_head_keeps_a_rim_of_hair(look):
    body = make_body(Shape())
    faces, scalp = changed(body, look, bald=1.0), body.part == FacePart.SCALP
    assert faces.any()
    assert scalp[faces].all()
    height = body.vertices[body.faces].mean(axis=1)[:, 2]
    assert height[scalp & ~faces].max() < height[faces].min() + 0.005  # a level line of the mean body
    assert (scalp & ~faces).any()


def test_children_have_no_beard_and_are_not_bald(look):
    body = make_body(Shape(age=0.35))
    assert not changed(body, look, beard=1.0, bald=1.0).any()


def test_grooming_changes_no_vertex(look):
    body = make_body(Shape())
    groomed = dress(body, replace(look, beard=1.0, bald=1.0))
    np.testing.assert_array_equal(groomed.vertices, dress(body, look).vertices)


def test_some_men_and_no_women_have_beards():
    looks = [look for seed in range(60) for look in draw_looks(seed, 5)]
    bearded = [look for look in looks if look.beard > 0]
    assert 0.1 < len(bearded) / len(looks) < 0.3  # half of the people are men
    assert not any(look.lower_garment in ("skirt", "dress") for look in bearded)
