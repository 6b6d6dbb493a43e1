"""Tracklets and their matching over seconds, with rigs that are far off."""

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import ring

from mvpose import Detections
from mvpose.calibration import gather
from mvpose.calibration.sightings import sightings_of
from mvpose.calibration.tracklet_matching import RigUncertainty, corrected, match_tracklets
from mvpose.calibration.tracklets import keypoint_sigma, link
from mvpose.skeleton import COCO17

RIG = ring(4)
JOINTS = walk(3, frames=40)
PERIOD = 0.1


@pytest.fixture(scope="module")
def filmed():
    return film(RIG, JOINTS)


def whose(filmed):
    """The true person of each keypoint, by its frame and its first coordinate."""
    return {
        (number, x): person
        for number, (frame, people) in enumerate(zip(*filmed, strict=True))
        for keypoints, person in zip(frame.keypoints, people, strict=True)
        for x in keypoints[:, 0]
    }


def true_people(sightings, filmed):
    """The set of true people in each person of the sightings."""
    known = whose(filmed)
    groups = {}
    for frame, x, person in zip(sightings.frame, sightings.pixels[:, 0], sightings.person, strict=True):
        groups.setdefault(person, set()).add(known[frame, x])
    return list(groups.values())


def test_a_tracklet_shows_one_person(filmed):
    tracklets = link(RIG, filmed[0], period=PERIOD)
    assert len(tracklets.tracklet) == sum(map(len, filmed[0]))
    alone = sightings_of(tracklets, np.arange(len(tracklets)))
    assert all(len(people) == 1 for people in true_people(alone, filmed))
    # People walk in circles and pass each other a few times in each view; nobody is cut into many pieces.
    assert len(tracklets) < 4 * 3 * 6


def test_tracklets_end_where_two_people_cannot_be_told_apart():
    """Two detections that are equally near both candidates start new tracklets."""
    body = ring(2).project(walk(1, frames=1)[0])[0, 0]
    shift = [[-60, 60], [-5, 5], [-60, 60]]

    def frame(k):
        keypoints = [body + [x, 0] for x in shift[k]]
        return Detections.from_keypoints([0, 0], keypoints, np.full((2, 17), 0.9))

    tracklets = link(ring(2), [frame(k) for k in range(3)], period=1.0)  # too long for a link by itself
    assert len(tracklets) == 6
    far = [Detections.from_keypoints([0, 0], [body - [400, 0], body + [400, 0]], np.full((2, 17), 0.9))] * 3
    assert len(link(ring(2), far, period=0.1)) == 2


def test_velocities_are_those_of_a_constant_motion():
    body = ring(2).project(walk(1, frames=1)[0])[0, 0]
    frames = [Detections.from_keypoints([0], [body + [3.0 * k, -1.0 * k]], np.full((1, 17), 0.9)) for k in range(12)]
    tracklets = link(ring(2), frames, period=0.05)
    np.testing.assert_allclose(tracklets.velocity, np.broadcast_to([60.0, -20.0], (12, 17, 2)), rtol=1e-9)


@pytest.mark.parametrize(("degrees", "metres"), [(0, 0), (2, 0.2), (4, 0.4)])
def test_people_are_matched_with_a_rig_that_is_far_off(filmed, degrees, metres):
    sightings = gather(disturbed(RIG, degrees, metres, seed=3), filmed[0], period=PERIOD)
    assert all(len(people) == 1 for people in true_people(sightings, filmed))
    assert sightings.shared.mean() > 0.95


def test_the_result_does_not_depend_on_the_order_of_detections(filmed):
    rng = np.random.default_rng(0)
    shuffled = [each.select(rng.permutation(len(each))) for each in filmed[0]]
    one, other = (gather(RIG, frames, period=PERIOD) for frames in (filmed[0], shuffled))

    def pairs(s):
        order = np.lexsort((s.joint, s.pixels[:, 0], s.view, s.frame))
        return s.pixels[order], s.person[order]

    np.testing.assert_array_equal(pairs(one)[0], pairs(other)[0])
    a, b = pairs(one)[1], pairs(other)[1]
    assert len(np.unique(a)) == len(np.unique(b)) == len(np.unique(np.stack([a, b]), axis=1).T)


def test_views_that_see_other_people_share_nobody():
    """Two pairs of views, each pair in front of other people."""
    frames, _ = film(RIG, JOINTS, only=[{0}, {0}, {1, 2}, {1, 2}])
    sightings = gather(RIG, frames, period=PERIOD)
    groups = {p: set(sightings.view[sightings.person == p]) for p in np.unique(sightings.person)}
    assert all(views <= {0, 1} or views <= {2, 3} for views in groups.values())


def test_the_correction_found_on_the_way_makes_lines_of_sight_meet(filmed):
    """With one camera off, matching finds its relative error up to the freedom of the whole rig."""
    wrong = disturbed(RIG, 2, 0.2, seed=4, views=[2])
    tracklets = link(RIG, filmed[0], period=PERIOD)
    found = match_tracklets(wrong, tracklets, RigUncertainty(np.radians(1.5), 0.1)).rig

    def error(rig):
        """Median distance of true points from their epipolar lines in view 2, pixels."""
        pixels = np.insert(RIG.project(JOINTS[::10].reshape(-1, 3)), 2, 1.0, axis=-1)
        lines = np.einsum("aij,anj->ani", rig.F[[0, 1, 3], 2], pixels[[0, 1, 3]])
        return np.median(np.abs((lines * pixels[2]).sum(axis=-1)) / np.linalg.norm(lines[..., :2], axis=-1))

    assert error(wrong) > 15.0
    assert error(found) < 3.0


def test_corrections_turn_about_the_centre():
    camera = RIG[1]
    turned = corrected(camera, np.array([0.0, 0.0, 0.1]), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(turned.center, camera.center + [1, 2, 3], atol=1e-12)
    direction, expected = turned.rays([100.0, 200.0]), camera.rays([100.0, 200.0])
    c, s = np.cos(0.1), np.sin(0.1)
    np.testing.assert_allclose(direction, [[c, -s, 0], [s, c, 0], [0, 0, 1]] @ expected, atol=1e-12)


def test_sigmas_are_those_of_the_noise_model():
    """A person of the size of an adult, at 100 pixels for a metre, has 100 times the noise in metres."""
    rig = ring(2, radius=8.0, height=1.0, focal=800.0)
    pixels = rig.project(walk(1, frames=1, still=True, radius=0.0)[0])[:1, 0]
    _, sigma = keypoint_sigma(pixels, np.ones((1, 17)), COCO17)
    expected = 100.0 * np.hypot(0.70 * np.array(COCO17.sigmas), 0.02)
    np.testing.assert_allclose(sigma[0], np.hypot(expected, 1.0), rtol=0.35)
    _, half = keypoint_sigma(pixels, np.full((1, 17), 0.5), COCO17)
    np.testing.assert_allclose(half, 2 * sigma)


def test_nothing_to_match_is_no_error():
    assert len(gather(RIG, [], period=PERIOD)) == 0
    assert len(gather(RIG, [Detections.empty()] * 3, period=PERIOD)) == 0


@pytest.mark.parametrize(
    ("frames", "period", "text"),
    [
        ([Detections.from_keypoints([9], np.zeros((1, 17, 2)), np.ones((1, 17)))], 0.1, "view 9"),
        ([Detections.empty()], 0.0, "period"),
    ],
)
def test_bad_input_is_refused(frames, period, text):
    with pytest.raises(ValueError, match=text):
        gather(RIG, frames, period=period)
