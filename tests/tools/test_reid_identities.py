import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.sections.scenario import Cameras, People, Scenario
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.registry import activities
from simharness.world.motion.trajectory import motion_clock
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from tools.reid.identities import CHILDREN, SPLITS, Group, figures, groups, split_of
from tools.reid.poses import bearing, placed, plan_poses, upright

runs, counts = st.integers(0, 10**6 - 1), st.integers(1, 50)


@given(runs, runs, counts, counts)
def test_no_two_splits_share_a_seed_nor_any_with_scenarios(run, other, count, more):
    seeds = [{group.seed for group in groups(split, run, count, size=4)} for split in SPLITS]
    seeds += [{group.seed for group in groups(split, other, more, size=2)} for split in SPLITS if other != run]
    assert sum(map(len, seeds)) == len(set().union(*seeds))
    assert min(set().union(*seeds)) >= 10**9  # nobody writes such a seed into a scenario


@given(runs, counts, st.sampled_from(SPLITS))
def test_a_seed_tells_its_split(run, count, split):
    assert {split_of(group.seed) for group in groups(split, run, count, size=1)} == {split}
    assert split_of(0) is split_of(run) is None


def test_more_groups_change_none_and_dials_go_round():
    few, many = (groups("training", 3, count, size=4, look_alike=(0.0, 0.5, 1.0)) for count in (4, 9))
    assert many[:4] == few
    assert [group.look_alike for group in many] == [0.0, 0.5, 1.0] * 3
    sites = [group.site for group in groups("training", 3, 9, size=4, at_a_site=4)]
    assert sites == [many[0].site] * 4 + [many[0].site + 1] * 4 + [many[0].site + 2]


@pytest.mark.parametrize(("run", "count"), [(-1, 1), (10**6, 1), (0, 10**6 + 1)])
def test_runs_and_counts_out_of_range_are_refused(run, count):
    with pytest.raises(ValueError, match=r"seed from 0 to 999999 and at most 1000000 groups"):
        groups("training", run, count, size=4)


def test_identities_are_the_people_of_a_scenario_of_that_seed():
    people = People(count=3, activities=("stand",), children=CHILDREN, look_alike=0.6)
    scenario = Scenario(name="same", seed=41, duration=0.1, people=people)
    scene = build(scenario, build_rig(Cameras(count=2)))
    for size in (3, 5):
        for figure in figures(Group(41, size, look_alike=0.6), range(3)):
            there, shown = scene.bodies[figure.person], scene.figures[figure.person]
            np.testing.assert_array_equal(figure.body.vertices, there.vertices)
            np.testing.assert_array_equal(figure.mesh.colors, shown.colors)
            assert (figure.mesh.texture is None) == (shown.texture is None)


def test_poses_lent_to_the_body_that_they_were_planned_on_are_the_planned_ones():
    body = make_body(Shape())
    mover = Kinematics(body)
    activity = activities()["dance"]
    performance = activity.perform(
        [mover], Spot(np.zeros(2), 0.7), motion_clock(1.0), rng=np.random.default_rng(1), pace=1.0
    )
    motion = performance.motions[0].at(np.array([0.2, 0.9]))
    for bones, joints in zip(mover.transforms(motion), mover.joints(motion), strict=True):
        ours, skin = placed(body, bones[:, :, :3], np.array([1.0, -2.0]), 0.0)
        apart = body.joints(ours) - joints
        assert np.ptp(apart, axis=0).max() < 1e-6  # shifted as a whole
        assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-6)


def test_poses_face_along_x_and_bodies_where_they_are_put():
    poses = plan_poses(5, frames=2, takes=1)
    assert len(poses) >= 2 * len(activities())
    np.testing.assert_allclose(bearing(poses.turns), 0.0, atol=1e-9)
    body = figures(Group(7, 1), [0])[0].body
    rest = np.linalg.norm(body.heads - body.heads[np.maximum(body.parents, 0)], axis=1)
    for k in range(0, len(poses), 7):
        bones, skin = placed(body, poses.turns[k], np.array([0.4, 0.3]), 1.1)
        heads = np.einsum("brc,bc->br", bones, np.column_stack([body.heads, np.ones(len(rest))]))
        np.testing.assert_allclose(np.linalg.norm(heads - heads[np.maximum(body.parents, 0)], axis=1), rest, atol=1e-9)
        np.testing.assert_allclose(heads[0, :2], [0.4, 0.3], atol=1e-9)
        assert bearing(bones[..., :3]) == pytest.approx(1.1)
        assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(upright(0.3) @ upright(-0.3), np.eye(3), atol=1e-15)
