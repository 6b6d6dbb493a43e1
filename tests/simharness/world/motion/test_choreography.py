import numpy as np
import pytest
from casting import penetration, performer
from scipy.spatial.transform import Rotation

from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.motion.activity_registry import Activity, activities, solo
from simharness.world.motion.choreography import assign_activities, choreograph, move_to, obstructs
from simharness.world.motion.motion import Performance, Prop, Trajectory, motion_clock
from simharness.world.motion.paths import Spot

CLOCK = motion_clock(4.0, margin=1.0)


def scenario(seed=0, **people):
    return Scenario(name="crowd", seed=seed, duration=4.0, people=people)


def cast(count):
    return [performer(k % 4, child=k % 4 == 3) for k in range(count)]


def test_activities_are_assigned_in_turn_and_pairs_take_two():
    one, two = (Activity(name, solo(lambda: None), n) for name, n in (("one", 1), ("two", 2)))
    spare = Activity("stand", solo(lambda: None))
    groups = assign_activities([one, two], 7, fallback=spare)
    assert [(group.people, group.activity.name) for group in groups] == [
        ((0,), "one"),
        ((1, 2), "two"),
        ((3,), "one"),
        ((4, 5), "two"),
        ((6,), "one"),
    ]
    assert assign_activities([two], 3, fallback=spare)[-1].activity.name == "stand"  # no partner is left
    assert assign_activities([one], 0, fallback=spare) == ()


@pytest.mark.parametrize("seed", range(3))
def test_people_of_different_groups_do_not_touch(seed):
    people = cast(6)
    made = choreograph(
        scenario(seed, count=6, activities=("walk", "point", "walk", "wave"), area=2.0, spacing=0.6), people, CLOCK
    )
    assert len(made.motions) == 6
    assert penetration(people, made.motions, CLOCK[::2]).max() < 0.015  # between the instants that were checked
    ways = np.stack([motion.root[:, :2] for motion in made.motions])
    apart = np.linalg.norm(ways[:, None] - ways[None], axis=-1)[~np.eye(6, dtype=bool)]
    assert apart.min() >= 0.6
    assert np.abs(ways).max() <= 2.0
    for motion in made.motions:
        np.testing.assert_array_equal(motion.time, CLOCK)


def test_pairs_meet_and_keep_away_from_the_others():
    people = cast(5)
    made = choreograph(scenario(count=5, activities=("shake_hands", "walk", "table"), area=2.5), people, CLOCK)
    ways = np.stack([motion.root[:, :2] for motion in made.motions])
    apart = np.linalg.norm(ways[:, None] - ways[None], axis=-1).min(axis=-1)
    assert apart[0, 1] < 1.2
    assert apart[3, 4] < 1.6
    together = np.zeros((5, 5), bool)
    together[[0, 3], [1, 4]] = True
    others = ~(together | together.T | np.eye(5, dtype=bool))
    assert apart[others].min() >= 0.8
    depth = penetration(people, made.motions, CLOCK[::3])
    assert depth[:, others].max() < 0.01
    assert depth.max() < 0.05
    assert {prop.kind for prop in made.props} <= {"table", "chair"}
    for prop in made.props:
        for person in (0, 1, 2):
            assert not obstructs(prop, made.motions[person])


def test_one_more_person_changes_none_of_the_others():
    people = cast(4)
    three = choreograph(scenario(2, count=3, activities=("wave", "walk")), people[:3], CLOCK)
    four = choreograph(scenario(2, count=4, activities=("wave", "walk")), people, CLOCK)
    for before, after in zip(three.motions, four.motions, strict=False):
        np.testing.assert_array_equal(before.root, after.root)
        np.testing.assert_array_equal(before.angles, after.angles)


@pytest.mark.slow
def test_an_area_too_small_names_its_keys():
    with pytest.raises(ValueError, match=r"people.count = 4 .*people.area = 0.3 m .*people.spacing = 0.15 m"):
        choreograph(scenario(count=4, activities=("point",), area=0.3, spacing=0.15), cast(4), CLOCK[:60])


def test_no_people():
    assert choreograph(scenario(count=0), [], CLOCK).motions == ()


@pytest.mark.parametrize("name", ["wave", "table", "hand_over"])
def test_a_performance_moved_to_a_spot_equals_one_made_there(name):
    activity = activities()[name]
    people = [performer(0), performer(1)][: activity.performers]
    spot = Spot(np.array([0.7, -1.1]), 2.2)
    clock = CLOCK[:90]
    expected, result = (
        activity.perform(people, where, clock, rng=stream(1, name), pace=1.1)
        for where in (spot, Spot(np.zeros(2), 0.0))
    )
    result = move_to(result, spot)
    for one, other in zip(expected.motions, result.motions, strict=True):
        np.testing.assert_allclose(one.root[:, :3], other.root[:, :3], atol=1e-6)
        np.testing.assert_allclose(one.angles, other.angles, atol=2e-4)
    for one, other in zip(expected.props, result.props, strict=True):
        np.testing.assert_allclose(one.trajectory.at(clock)[:, :3], other.trajectory.at(clock)[:, :3], atol=1e-6)


def test_moved_poses_rotate_about_the_vertical():
    pose = np.array([[1.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]])
    prop = Prop("box", (0.2, 0.3, 0.2), Trajectory(np.zeros(1), pose))
    (result,) = move_to(Performance((), (prop,)), Spot(np.array([2.0, 3.0]), np.pi / 2)).props
    np.testing.assert_allclose(result.trajectory.pose[0, :3], [2.0, 4.0, 0.5], atol=1e-12)
    turn = Rotation.from_quat(result.trajectory.pose[0, 3:], scalar_first=True)
    np.testing.assert_allclose(turn.apply([1, 0, 0]), [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(("ahead", "blocked"), [(0.2, True), (0.45, True), (0.55, False), (2.0, False)])
def test_a_prop_obstructs_pelvises_near_its_footprint(ahead, blocked):
    made = choreograph(scenario(count=1, activities=("stand",)), cast(1), CLOCK)
    (motion,) = made.motions
    place = [*(motion.root[0, :2] + [0.0, ahead]), 0.0, np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)]
    prop = Prop("table", (0.4, 1.0, 0.7), Trajectory(np.zeros(1), np.array([place])))  # turned: 0.2 m towards it
    assert obstructs(prop, motion) == blocked


@pytest.mark.slow
def test_a_recorded_walk_longer_than_the_area_is_played_in_the_room(shared_data):
    file = str(shared_data / "motion/bvh/AV_8Walk_Meredith_HVHA_Rep1.bvh")
    crowd = scenario(count=4, area=2.0, motion={"file": file})
    made = choreograph(crowd, cast(4), CLOCK, widest=3.58)
    paths = np.stack([motion.root[:, :2] for motion in made.motions])
    assert 2.0 < np.abs(paths).max() <= 3.58
    apart = np.linalg.norm(paths[:, None] - paths[None], axis=-1)[~np.eye(4, dtype=bool)]
    assert apart.min() >= crowd.people.spacing
    with pytest.raises(ValueError, match=r"people.motion: the recorded path extends over 6.* set people.area to"):
        choreograph(crowd, cast(4), CLOCK)
