"""Track plans, checked by brute force at a finer time step than the planner uses."""

import numpy as np
import pytest

from simharness.world.motion.paths import SWAY, Loop, Spot
from simharness.world.motion.track_planning import LoopRequest, RecordedRequest, SpotRequest, plan_tracks

WALK = LoopRequest("walk", 1.04, 0.85, 1.15)
RUN = LoopRequest("run", 2.8, 2.0, 3.5, running=True)
STAND = SpotRequest("stand")
SPAN = (-1.0, 7.0)


def apart(tracks, wishes, *, span, step=1 / 50):
    """Return the least distance of two tracks beyond their clearances, and the largest coordinate, metres."""
    times = np.arange(*span, step)
    ways = np.stack([track.position(times) for track in tracks])
    clear = np.array([getattr(wish, "clearance", 0.0) for wish in wishes])
    least = np.inf
    for i in range(len(tracks)):
        for j in range(i):
            least = min(least, np.linalg.norm(ways[i] - ways[j], axis=1).min() - clear[i] - clear[j])
    return least, np.abs(ways).max()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("wishes", "area", "spacing"),
    [
        ([WALK, STAND] * 2, 2.0, 0.8),
        ([WALK, STAND] * 4 + [WALK], 2.0, 0.8),
        ([WALK, STAND] * 3, 3.0, 1.5),
        ([RUN, WALK, STAND], 2.5, 0.8),
        ([SpotRequest("table", 0.7, 2), WALK, SpotRequest("hug", 0.4, 2), WALK], 2.5, 0.8),
    ],
)
def test_everyone_is_apart_and_inside_at_all_times(seed, wishes, area, spacing):
    tracks = plan_tracks(seed, wishes, area=area, spacing=spacing, span=SPAN)
    assert [isinstance(track, Loop) for track in tracks] == [isinstance(wish, LoopRequest) for wish in wishes]
    least, furthest = apart(tracks, wishes, span=SPAN)
    assert least >= spacing + 2 * SWAY - 0.03  # between the planner's instants
    assert furthest <= area - SWAY + 0.01
    for track, wish in zip(tracks, wishes, strict=True):
        if isinstance(track, Spot):
            assert np.abs(track.place).max() <= area - SWAY - wish.clearance
        else:
            assert track.speed <= wish.fastest


@pytest.mark.slow
def test_ten_minutes_of_twenty_people_are_planned():
    wishes = [WALK, STAND] * 10
    tracks = plan_tracks(0, wishes, area=4.0, spacing=0.8, span=(-1.0, 601.0))
    least, _ = apart(tracks, wishes, span=(-1.0, 601.0), step=1 / 20)
    assert least >= 0.85
    assert len({track.length for track in tracks if isinstance(track, Loop)}) >= 3  # not all in one file


def test_crossing_loops_have_commensurable_round_times():
    """Two crossing loops can be walked for long only if they repeat together."""
    crossing = 0
    for seed in range(6):
        one, other = plan_tracks(seed, [WALK, WALK], area=2.0, spacing=0.8, span=(-1.0, 601.0))
        once = [track.position(np.linspace(0, track.length / track.speed, 300)) for track in (one, other)]
        nearest = np.linalg.norm(once[0][:, None] - once[1][None], axis=-1).min()
        beat = (one.length / one.speed) / (other.length / other.speed)
        if nearest < 0.8:
            crossing += 1
            assert min(abs(beat * k - m) for k in (1, 2, 3) for m in (1, 2, 3)) < 1e-6
    assert crossing >= 3


def test_one_more_request_changes_no_other_track():
    four = plan_tracks(5, [WALK, STAND] * 2, area=2.0, spacing=0.8, span=SPAN)
    five = plan_tracks(5, [WALK, STAND] * 2 + [WALK], area=2.0, spacing=0.8, span=SPAN)
    times = np.linspace(*SPAN, 50)
    for before, after in zip(four, five, strict=False):
        np.testing.assert_array_equal(before.position(times), after.position(times))


def test_plans_differ_by_seed_and_repeat():
    times = np.linspace(*SPAN, 50)
    one, again, other = (
        plan_tracks(seed, [WALK, STAND], area=2.0, spacing=0.8, span=SPAN)[0].position(times) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.1


def test_recorded_paths_keep_apart():
    times = np.linspace(*SPAN, 481)
    way = np.column_stack([0.3 * times, 0.1 * np.sin(times)])
    wishes = [RecordedRequest("mocap", times, way)] * 3 + [WALK]
    tracks = plan_tracks(0, wishes, area=2.5, spacing=0.8, span=SPAN)
    least, furthest = apart(tracks, wishes, span=SPAN)
    assert least >= 0.87
    assert furthest <= 2.46


def test_rejected_tracks_are_replaced():
    tried = []

    def admit(index, track, before):
        assert list(before) == list(range(index))
        tried.append((index, tuple(track.place)))
        return track.place[0] > 0

    tracks = plan_tracks(0, [STAND] * 8, area=3.0, spacing=0.5, span=SPAN, admit=admit)
    assert all(track.place[0] > 0 for track in tracks)
    assert any(place[0] <= 0 for _, place in tried)
    assert [index for index, _ in tried] == sorted(index for index, _ in tried)


def test_no_requests_need_no_room():
    assert plan_tracks(0, [], area=0.01, spacing=9.0, span=SPAN) == ()


@pytest.mark.slow
def test_a_crowd_that_does_not_fit_names_the_keys_to_change():
    with pytest.raises(ValueError, match=r"people.count = 9 .*people.area = 1 m.*people.spacing = 1.5 m") as error:
        plan_tracks(0, [STAND] * 9, area=1.0, spacing=1.5, span=SPAN)
    assert "lower people.count" in str(error.value)
    with pytest.raises(ValueError, match=r"raise people\.spacing"):
        plan_tracks(0, [STAND] * 2, area=1.0, spacing=0.5, span=SPAN, admit=lambda index, track, before: index == 0)


@pytest.mark.parametrize(
    ("wish", "area", "least"),
    [(WALK, 0.3, 0.5), (RUN, 1.0, None), (STAND, 0.04, 0.1), (SpotRequest("lie", 1.0), 1.0, 1.05)],
)
def test_an_area_too_small_for_one_alone(wish, area, least):
    with pytest.raises(ValueError, match=rf'people.area = {area:g} m is too small for "{wish.activity}"') as error:
        plan_tracks(0, [wish], area=area, spacing=0.5, span=SPAN)
    named = float(str(error.value).split("it takes ")[1].split(" m")[0])
    if least is not None:
        assert named == pytest.approx(least)
    plan_tracks(0, [wish], area=named + 0.05, spacing=0.5, span=SPAN)  # the value in the message suffices


STRAIGHT = RecordedRequest(
    "mocap", np.linspace(*SPAN, 100), np.column_stack([np.linspace(0.0, 5.0, 100), np.zeros(100)])
)


@pytest.mark.parametrize("count", [1, 4])
def test_a_recorded_path_longer_than_the_area_uses_the_room(count):
    wishes = [STRAIGHT] * count + [STAND]
    tracks = plan_tracks(0, wishes, area=1.2, spacing=0.8, span=SPAN, widest=3.5)
    least, furthest = apart(tracks, wishes, span=SPAN)
    assert least >= 0.87
    assert furthest <= 3.5 - SWAY
    assert np.abs(tracks[-1].place).max() <= 1.2 - SWAY


def test_recorded_paths_that_do_not_fit_the_room_name_the_room():
    with pytest.raises(ValueError, match=r"people.count = 9 .*recorded paths in 2.80 m.*enlarge room.size"):
        plan_tracks(0, [STRAIGHT] * 9, area=1.2, spacing=0.8, span=SPAN, widest=2.8)


def test_a_recorded_path_that_fits_stays_in_the_area():
    times = np.linspace(*SPAN, 50)
    plans = [plan_tracks(0, [STRAIGHT], area=3.0, spacing=0.8, span=SPAN, widest=widest) for widest in (None, 9.0)]
    np.testing.assert_array_equal(*(track.position(times) for (track,) in plans))


def test_a_recorded_path_too_long_for_the_area_names_its_keys():
    with pytest.raises(ValueError, match=r"people.motion.*people.area = 1 m.*people.motion.start") as error:
        plan_tracks(0, [STRAIGHT], area=1.0, spacing=0.5, span=SPAN)
    needed = float(str(error.value).split("set people.area to ")[1].split(" m")[0])
    plan_tracks(0, [STRAIGHT], area=needed, spacing=0.5, span=SPAN)  # the value in the message suffices


def test_a_recorded_path_too_long_for_the_room_names_its_keys():
    with pytest.raises(ValueError, match=r"people.motion: the recorded path extends over 5.00 m.*room.size") as error:
        plan_tracks(0, [STRAIGHT], area=1.0, spacing=0.5, span=SPAN, widest=1.5)
    grown = float(str(error.value).split("room.size by ")[1].split(" m")[0])
    plan_tracks(0, [STRAIGHT], area=1.0, spacing=0.5, span=SPAN, widest=1.5 + grown / 2)


def test_people_keep_the_centre_free():
    tracks = plan_tracks(3, [STAND, WALK, STAND], area=2.2, spacing=0.6, span=SPAN, around=0.9)
    times = np.arange(*SPAN, 0.01)
    for track in tracks:
        assert np.hypot(*track.position(times).T).min() >= 0.9
    free = plan_tracks(3, [STAND, WALK, STAND], area=2.2, spacing=0.6, span=SPAN)
    assert min(np.hypot(*track.position(times).T).min() for track in free) < 0.9
