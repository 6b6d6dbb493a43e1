import numpy as np
import pytest
from walkers import Rays

from simharness.world.motion.motion import Prop, Trajectory
from simharness.world.scene.objects.laboratory import make_prop

SIZES = {
    "chair": (0.45, 0.43, 0.46),
    "table": (0.8, 1.4, 0.74),
    "box": (0.35, 0.45, 0.30),
    "step": (0.4, 0.9, 0.18),
    "bottle": (0.08, 0.08, 0.26),
    "booth": (1.4, 1.1, 2.02),
    "door": (0.06, 1.1, 2.15),
}


def standing(place=(0.0, 0.0), yaw=0.0):
    return Trajectory(np.zeros(1), np.array([[*place, 0.0, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]]))


@pytest.mark.parametrize("kind", SIZES)
def test_props_have_their_size(kind):
    """Depth along x, width along y, height of a table, box, step, bottle, or of the seat of a chair."""
    solid = make_prop(Prop(kind, SIZES[kind], standing()), f"{kind} 0")
    assert solid.kind == "prop"
    assert solid.trajectory is None
    low, high = solid.mesh.vertices.min(axis=0), solid.mesh.vertices.max(axis=0)
    assert low[2] == pytest.approx(0, abs=1e-6)
    depth, width, height = SIZES[kind]
    assert high[1] - low[1] == pytest.approx(width, rel=0.03)
    top = Rays([solid]).distance(np.array([0.004, 0.003, 3]), np.array([[0.004, 0.003, 0.001]]))[0] * 2.999
    assert 3 - top == pytest.approx(height, abs=1e-3)
    if kind == "chair":
        assert high[0] == pytest.approx(depth / 2, abs=0.01)
        assert high[2] > height + 0.3
        back = solid.mesh.vertices[solid.mesh.vertices[:, 2] > height + 0.05]
        assert back[:, 0].max() < -depth / 2 + 0.03  # a person who sits on it does not touch its back
    else:
        assert high[0] - low[0] == pytest.approx(depth, rel=0.03)


def test_a_prop_at_rest_is_placed():
    still = Trajectory(np.array([0.0, 1.0]), np.tile(standing((1.0, 2.0), 0.8).pose, (2, 1)))
    one = make_prop(Prop("box", SIZES["box"], still), "prop 1")
    two = make_prop(Prop("box", SIZES["box"], standing((1.0, 2.0), 0.8)), "prop 1")
    assert one.trajectory is None
    np.testing.assert_array_equal(one.mesh.vertices, two.mesh.vertices)
    np.testing.assert_allclose(one.hull.center[:2], (1.0, 2.0), atol=1e-6)
    assert one.hull.yaw == pytest.approx(0.8)


def test_a_carried_prop_moves():
    pose = np.tile(standing((1.0, 0.0)).pose, (2, 1))
    pose[1, 2] = 0.9
    carried = Trajectory(np.array([0.0, 1.0]), pose)
    solid = make_prop(Prop("box", SIZES["box"], carried), "prop 2")
    assert solid.trajectory is carried
    assert solid.hull_at(1.0).center[2] == pytest.approx(0.9 + 0.15)
    held = standing((0.0, 0.0)).pose.copy()
    held[0, 2] = 0.7
    assert make_prop(Prop("box", SIZES["box"], Trajectory(np.zeros(1), held)), "prop 3").trajectory is not None


def test_nothing_in_a_booth_is_seen_from_outside():
    solid = make_prop(Prop("booth", SIZES["booth"], standing()), "booth 0")
    rng = np.random.default_rng(0)
    inside = rng.uniform([-0.6, -0.45, 0.05], [0.6, 0.45, 1.9], (200, 3))
    for bearing in np.linspace(0.0, 2 * np.pi, 12, endpoint=False):
        eye = np.array([3.0 * np.cos(bearing), 3.0 * np.sin(bearing), 2.6])
        share = Rays([solid]).distance(eye, inside)
        assert (share < 1.0).all()
