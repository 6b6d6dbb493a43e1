"""Takes of a recording, and their re-enactment by simulated bodies."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from turning_people import walkers

from mvpose import Rig
from mvpose.recording import People
from simharness.reality.filmed_recording import cut_takes, film, floor_height
from simharness.reality.people_tracks import LIMB_JOINTS, present
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.views import Visibility

SHIFT = np.array([0.0, 0.0, -0.14])


def people_of(joints):
    return People(np.arange(len(joints)) / 25.0, np.arange(joints.shape[1]), joints)


def present_people(present):
    """Return tracks (F, P) of people who stand at the origin where they are present."""
    joints = np.where(np.asarray(present, bool)[..., None, None], np.zeros((17, 3)), np.nan)
    return people_of(joints)


def recording_of(frames):
    """Return a recording of some frame numbers, at 25 Hz."""
    return replace(walkers(frames=len(frames), people=1), frames=np.asarray(frames))


@pytest.mark.parametrize("seed", range(8))
def test_takes_cover_frames_with_people_once_and_no_gaps(seed):
    """People come and go at random, and stay for a second or longer."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(40, 400, 3)
    frames = np.concatenate([1000 * part + np.arange(length) for part, length in enumerate(lengths)])
    present = np.zeros((len(frames), 3), bool)
    starts = np.cumsum([0, *lengths])
    for person in range(3):
        for start, stop in itertools.pairwise(starts):
            first = rng.integers(start, stop - 30)
            present[first : rng.integers(first + 30, stop + 1), person] = True
    recording, people = recording_of(frames), present_people(present)
    takes = cut_takes(recording, people)
    times = np.zeros(len(frames), int)
    for take in takes:
        times[take.rows.start : take.rows.stop] += 1
        assert (np.diff(frames[take.rows.start : take.rows.stop]) == 1).all()
        assert len(take.rows) <= 100  # 4 s
        for person in range(3):
            assert (person in take.people) == (present[take.rows.start : take.rows.stop, person].mean() >= 0.5)
    assert times.max() == 1
    assert (times[present.any(axis=1)] == 1).mean() > 0.97
    # Cuts are where people come and go: few are filmed where they are not.
    shown = np.zeros_like(present)
    for take in takes:
        shown[take.rows.start : take.rows.stop, list(take.people)] = True
    assert (shown != present).mean() < 0.1


def test_people_who_stay_are_in_all_takes():
    takes = cut_takes(recording_of(range(250)), present_people(np.ones((250, 2))))
    assert [(take.rows.start, take.rows.stop) for take in takes] == [(0, 83), (83, 167), (167, 250)]
    assert {take.people for take in takes} == {(0, 1)}


def test_cuts_are_where_somebody_leaves():
    present = np.ones((90, 2), bool)
    present[50:, 1] = False
    takes = cut_takes(recording_of(range(90)), present_people(present))
    assert [(take.rows.start, take.rows.stop, take.people) for take in takes] == [(0, 50, (0, 1)), (50, 90, (0,))]


def test_frames_without_people_belong_to_no_take():
    present = np.zeros((120, 1), bool)
    present[40:80] = True
    (take,) = cut_takes(recording_of(range(120)), present_people(present))
    assert take.rows == range(40, 80)


def test_the_floor_is_below_standing_people_and_not_below_raised_feet(filmed):
    joints = filmed.sequence.joints + SHIFT
    people = people_of(joints)
    assert floor_height(people) == pytest.approx(-0.14, abs=0.04)
    jumping = joints.copy()
    jumping[: len(joints) // 4] += [0, 0, 0.5]
    assert floor_height(people_of(jumping)) == pytest.approx(floor_height(people), abs=0.03)


@pytest.fixture(scope="module")
def recording(reenacted):
    return reenacted.recording


@pytest.fixture(scope="module")
def people(reenacted):
    return reenacted.people


@pytest.fixture(scope="module")
def made(reenacted):
    return reenacted.film


def test_bodies_are_within_centimetres_of_the_people(made, people):
    np.testing.assert_array_equal(made.sequence.present, present(people))
    away = np.linalg.norm(made.joints - people.joints, axis=-1)[..., LIMB_JOINTS]
    np.testing.assert_array_equal(np.isnan(away).all(axis=-1), ~present(people))
    away = away[present(people)]
    assert np.median(away) < 0.02
    assert np.quantile(away, 0.95) < 0.07


def test_pictures_are_those_of_the_recording(filmed, made, recording, people):
    """Boxes and visibility are those of the people, although bodies and clothes are others."""
    rows, actor = recording.frames, people.ids
    pixels = np.stack([camera.project(made.joints) for camera in recording.rig], axis=1)
    shown = np.isfinite(made.views.pixels) & np.isfinite(pixels)
    np.testing.assert_allclose(made.views.pixels[shown], pixels[shown], atol=0.01)
    assert len(made.rig) == len(recording.rig)
    true, twin = filmed.views.boxes[rows][:, :, actor], made.views.boxes
    both = (true[..., 2] > 0) & (twin[..., 2] > 0)
    assert both[:30].mean() > 0.9
    ratio = np.sqrt(twin[both, 2:].prod(axis=-1) / true[both, 2:].prod(axis=-1))
    assert np.median(ratio) == pytest.approx(1.0, abs=0.06)
    same = (filmed.views.visibility[rows][:, :, actor] == made.views.visibility)[:30]
    assert same[..., LIMB_JOINTS].mean() > 0.85


def test_absent_people_are_in_no_picture(made, recording):
    assert (made.views.visibility[30:, :, 2] == Visibility.OUTSIDE).all()
    assert (made.views.boxes[30:, :, 2] == 0).all()
    found = made.detected(DetectorSection(), seed=0)
    assert len(found) == len(recording)
    assert max(np.bincount(each.view).max() for each in found[30:]) == 2
    assert max(np.bincount(each.view).max() for each in found[:30]) == 3


@pytest.mark.slow
def test_the_height_of_the_floor_does_not_matter(made, recording, people):
    """Worlds whose floor is at z = -0.14 m have the same pictures."""
    rig = Rig([replace(camera, t=camera.t - camera.R @ SHIFT) for camera in recording.rig])
    low = film(replace(recording, rig=rig), replace(people, joints=people.joints + SHIFT), seed=0)
    assert low.floor == pytest.approx(made.floor - 0.14)
    np.testing.assert_allclose(low.joints, made.joints + SHIFT, atol=1e-6)
    np.testing.assert_allclose(low.views.pixels, made.views.pixels, atol=1e-3)
    assert (low.views.visibility == made.views.visibility).mean() > 0.999


@pytest.mark.slow
def test_films_are_those_of_their_seed(made, recording, people):
    again, other = (film(recording, people, seed=seed) for seed in (0, 1))
    np.testing.assert_array_equal(again.views.pixels, made.views.pixels)
    np.testing.assert_array_equal(again.views.visibility, made.views.visibility)
    assert (other.views.boxes != made.views.boxes).any()  # other bodies
    away = np.linalg.norm(other.joints - made.joints, axis=-1)[..., LIMB_JOINTS]
    assert np.nanmedian(away) < 0.03  # in the same places


def test_recordings_without_people_are_refused(recording, people):
    with pytest.raises(ValueError, match="expected people who stay for a second or longer, got none"):
        film(recording, replace(people, joints=np.full_like(people.joints, np.nan)), seed=0)
