import numpy as np
import pytest
from walkers import Rays, ring, space

from simharness.scenario.sections.room_section import ClutterSection
from simharness.world.scene.placement.clutter import place_clutter
from simharness.world.scene.placement.occlusion_target import lines_in


def measured(free, solids) -> float:
    """Share of joints in the pictures that MuJoCo rays do not reach, at other times than used for placement."""
    rays = Rays(solids)
    hidden, count = 0, 0
    for moment in np.linspace(0.13, free.time[-1] - 1.2, 9):
        rays.put(moment)
        joints = free.joints[np.abs(free.time - moment).argmin()].reshape(-1, 3)
        for camera in free.rig:
            shown = joints[camera.inside(camera.project(joints))]
            hidden += np.isfinite(rays.distance(camera.center, shown)).sum()
            count += len(shown)
    return hidden / count


@pytest.mark.slow
@pytest.mark.parametrize("requested", [0.1, 0.25, 0.4])
@pytest.mark.parametrize("seed", range(2))
def test_the_requested_share_is_occluded(requested, seed):
    free = space(seed=seed)
    solids = place_clutter(seed, ClutterSection(coverage=requested), free)
    assert measured(free, solids) == pytest.approx(requested, abs=0.05)


@pytest.mark.slow
def test_requested_objects_and_moving_carts_count():
    free = space(seed=3, duration=10.0)
    requested = ClutterSection(boxes=3, shelves=1, carts=1, coverage=0.3)
    solids = place_clutter(3, requested, free)
    assert [solid.name for solid in solids][:5] == ["shelf0", "box0", "box1", "box2", "cart0"]
    assert len(solids) > 5
    assert measured(free, solids) == pytest.approx(0.3, abs=0.05)
    assert lines_in(free).hidden(solids).mean() == pytest.approx(measured(free, solids), abs=0.03)


@pytest.mark.slow
def test_a_larger_share_adds_to_the_same_objects():
    free = space(seed=1)
    less, more = (place_clutter(1, ClutterSection(coverage=share), free) for share in (0.2, 0.35))
    assert len(more) > len(less)
    for one, two in zip(less[:-1], more, strict=False):
        np.testing.assert_array_equal(one.mesh.vertices, two.mesh.vertices)


def test_zero_adds_nothing():
    assert place_clutter(0, ClutterSection(coverage=0.0), space()) == ()


@pytest.mark.slow
def test_unreachable_coverage_is_refused():
    high = ring(3, radius=1.2, height=5.0)  # they look down on all people
    with pytest.raises(ValueError, match=r"clutter.coverage = 0.8 cannot be reached: with \d+ added objects 0\.\d\d"):
        place_clutter(0, ClutterSection(coverage=0.8), space(2, duration=2.0, rig=high))
    with pytest.raises(ValueError, match=r"clutter.coverage = 0.02 is less than the share of joints that the"):
        place_clutter(0, ClutterSection(shelves=3, pillars=3, coverage=0.02), space())
    with pytest.raises(ValueError, match=r"no joint is in any picture: use people.count above 0"):
        place_clutter(0, ClutterSection(coverage=0.2), space(0))
