import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.scenario import Scenario
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.activity_registry import activities
from simharness.world.motion.motion import motion_clock
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from tools.reid.identities import CHILDREN, SPLITS, Group, dressed_people, groups, split_of
from tools.reid.poses import bearing, place_body, plan_poses, vertical_rotation

runs, counts = st.integers(0, 10**6 - 1), st.integers(1, 50)


@given(runs, runs, counts, counts)
def test_seeds_differ_between_splits_runs_and_ordinary_scenarios(run, other, count, more):
    seeds = [{group.seed for group in groups(split, run, count, size=4)} for split in SPLITS]
    seeds += [{group.seed for group in groups(split, other, more, size=2)} for split in SPLITS if other != run]
    assert sum(map(len, seeds)) == len(set().union(*seeds))
    assert min(set().union(*seeds)) >= 10**9  # larger than the seeds of scenario files


@given(runs, counts, st.sampled_from(SPLITS))
def test_the_split_of_a_seed(run, count, split):
    assert {split_of(group.seed) for group in groups(split, run, count, size=1)} == {split}
    assert split_of(0) is split_of(run) is None


def test_more_groups_keep_the_first_ones_and_values_of_look_alike_repeat():
    few, many = (groups("training", 3, count, size=4, look_alike=(0.0, 0.5, 1.0)) for count in (4, 9))
    assert many[:4] == few
    assert [group.look_alike for group in many] == [0.0, 0.5, 1.0] * 3
    sites = [group.site for group in groups("training", 3, 9, size=4, at_a_site=4)]
    assert sites == [many[0].site] * 4 + [many[0].site + 1] * 4 + [many[0].site + 2]


@pytest.mark.parametrize(("run", "count"), [(-1, 1), (10**6, 1), (0, 10**6 + 1)])
def test_runs_and_counts_out_of_range_are_refused(run, count):
    with pytest.raises(ValueError, match=r"from 0 to 999999 and its groups at most 1000000, got"):
        groups("training", run, count, size=4)


@pytest.mark.slow
def test_identities_are_the_people_of_a_scenario_of_that_seed():
    people = PeopleSection(count=3, activities=("stand",), children=CHILDREN, look_alike=0.6)
    scenario = Scenario(name="same", seed=41, duration=0.1, people=people)
    scene = build(scenario, build_rig(CamerasSection(count=2)))
    for size in (3, 5):
        for person in dressed_people(Group(41, size, look_alike=0.6), range(3)):
            body, shown = scene.bodies[person.person], scene.figures[person.person]
            np.testing.assert_array_equal(person.body.vertices, body.vertices)
            np.testing.assert_array_equal(person.mesh.colors, shown.colors)
            assert (person.mesh.texture is None) == (shown.texture is None)


def test_a_pose_on_its_original_body_is_the_planned_pose():
    body = make_body(Shape())
    mover = Kinematics(body)
    activity = activities()["dance"]
    performance = activity.perform(
        [mover], Spot(np.zeros(2), 0.7), motion_clock(1.0), rng=np.random.default_rng(1), pace=1.0
    )
    motion = performance.motions[0].at(np.array([0.2, 0.9]))
    for bones, joints in zip(mover.transforms(motion), mover.joints(motion), strict=True):
        transforms, skin = place_body(body, bones[:, :, :3], np.array([1.0, -2.0]), 0.0)
        apart = body.joints(transforms) - joints
        assert np.ptp(apart, axis=0).max() < 1e-6  # only a translation
        assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_poses_face_along_x_and_placed_bodies_have_the_given_position_and_direction():
    poses = plan_poses(5, frames=2, takes=1)
    assert len(poses) >= 2 * len(activities())
    np.testing.assert_allclose(bearing(poses.turns), 0.0, atol=1e-9)
    body = dressed_people(Group(7, 1), [0])[0].body
    rest = np.linalg.norm(body.heads - body.heads[np.maximum(body.parents, 0)], axis=1)
    for k in range(0, len(poses), 7):
        bones, skin = place_body(body, poses.turns[k], np.array([0.4, 0.3]), 1.1)
        heads = np.einsum("brc,bc->br", bones, np.column_stack([body.heads, np.ones(len(rest))]))
        np.testing.assert_allclose(np.linalg.norm(heads - heads[np.maximum(body.parents, 0)], axis=1), rest, atol=1e-9)
        np.testing.assert_allclose(heads[0, :2], [0.4, 0.3], atol=1e-9)
        assert bearing(bones[..., :3]) == pytest.approx(1.1)
        assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(vertical_rotation(0.3) @ vertical_rotation(-0.3), np.eye(3), atol=1e-15)
