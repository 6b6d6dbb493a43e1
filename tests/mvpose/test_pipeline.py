import copy
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from people import crowd, detect, ring
from scipy.optimize import linear_sum_assignment

import mvpose
from mvpose import Camera, Detections, Pipeline, Rig
from mvpose.affinity import AppearanceAffinity, EpipolarAffinity, GeometricAffinity
from mvpose.heatmaps import Heatmaps
from mvpose.presets import PRESETS
from mvpose.reconstruction import Noise, UnmatchedPictorialStructure


def errors(estimate, people):
    """Largest joint error of each true person and the estimate assigned to it, metres."""
    distance = np.linalg.norm(estimate.joints[:, None] - people[None], axis=3).max(axis=2)
    estimated, true = linear_sum_assignment(distance)
    return distance[estimated, true]


def described(detections, person, *, noise=0.1, seed=0):
    """Add descriptors: a random direction per person, and noise in every detection."""
    rng = np.random.default_rng(seed)
    looks = rng.standard_normal((person.max() + 1, 64))
    descriptors = looks[person] + noise * rng.standard_normal((len(person), 64))
    return replace(detections, descriptors=descriptors)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(("views", "count"), [(2, 1), (3, 2), (5, 4), (8, 6)])
def test_all_people_are_found_at_their_positions(preset, views, count):
    rig = Rig(list(ring(max(views, 5)))[:views])  # two cameras that face each other cannot triangulate
    people = crowd(count)
    detections, person = detect(rig, people)
    estimate = mvpose.preset(preset).estimate(rig, described(detections, person))
    assert len(estimate) == count
    assert errors(estimate, people).max() < (1e-3 if preset in ("fast", "no-3dps") else 0.04)  # bones pull a little
    labels = estimate.matching.labels
    np.testing.assert_array_equal(labels[:, None] == labels, person[:, None] == person)


def test_noise_of_three_pixels_causes_errors_of_centimetres():
    rig, people = ring(5), crowd(4)
    detections, _ = detect(rig, people, noise=3.0)
    assert errors(Pipeline().estimate(rig, detections), people).max() < 0.06


def test_phantoms_give_no_people():
    rig, people = ring(5), crowd(2)
    detections, person = detect(rig, people)
    phantom = np.full((1, 17, 2), 200.0) + 60 * np.random.default_rng(0).standard_normal((17, 2))
    with_phantom = Detections.from_keypoints(
        [*detections.view, 3], np.concatenate([detections.keypoints, phantom]), np.full((len(person) + 1, 17), 0.9)
    )
    estimate = Pipeline().estimate(rig, with_phantom)
    assert len(estimate) == 2
    assert estimate.matching.labels[-1] == -1


def test_results_do_not_depend_on_detection_order_or_world_frame():
    rig, people = ring(4), crowd(3)
    detections, _ = detect(rig, people, noise=2.0)
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    shift = np.array([30.0, -12.0, 5.0])
    moved = Rig([Camera(c.K, c.R @ turn.T, c.t - c.R @ turn.T @ shift, c.distortion, c.size) for c in rig])
    order = np.random.default_rng(1).permutation(len(detections))
    shuffled = Detections.from_keypoints(detections.view[order], detections.keypoints[order], detections.scores[order])
    here, there = Pipeline().estimate(rig, detections), Pipeline().estimate(moved, shuffled)
    assert errors(there, here.joints @ turn.T + shift).max() < 1e-6
    assert len(here) == len(there) == 3


@pytest.mark.parametrize("view", [[], [0], [0, 0, 0]])
def test_nothing_to_match_gives_no_people(view):
    keypoints = np.random.default_rng(0).uniform(0, 600, (len(view), 17, 2))
    estimate = Pipeline().estimate(ring(3), Detections.from_keypoints(view, keypoints, np.ones((len(view), 17))))
    assert estimate.joints.shape == (0, 17, 3)
    assert (estimate.matching.labels == -1).all()


def test_appearance_decides_where_geometry_cannot():
    """Two people at one place, each seen by two of four views: geometry merges them."""
    rig, people = ring(4), crowd(1)
    detections, _ = detect(rig, people, shuffle=False)
    person = np.array([0, 0, 1, 1])
    seen = described(detections, person)
    assert len(mvpose.preset("geometry").estimate(rig, seen)) == 1
    labels = mvpose.preset("full").estimate(rig, seen).matching.labels
    assert labels.tolist() == mvpose.preset("appearance").estimate(rig, seen).matching.labels.tolist() == [0, 0, 1, 1]


def test_appearance_alone_needs_descriptors():
    detections, _ = detect(ring(3), crowd(1))
    with pytest.raises(ValueError, match="descriptors"):
        mvpose.preset("appearance").estimate(ring(3), detections)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_person_reported_twice_is_one_person(preset):
    rig, people = ring(5), crowd(2)
    detections, person = detect(rig, people, noise=2.0)
    twice = np.concatenate([np.arange(len(person))] * 2)
    keypoints = detections.keypoints[twice] + np.random.default_rng(1).normal(0, 0.5, (len(twice), 17, 2))
    again = Detections.from_keypoints(detections.view[twice], keypoints, detections.scores[twice])
    estimate = mvpose.preset(preset).estimate(rig, described(again, person[twice]))
    assert len(estimate) == 2
    assert errors(estimate, people).max() < 0.06
    assert (np.bincount(estimate.matching.labels + 1)[1:] == 5).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_a_repeated_face_loses_no_joint(preset):
    rig, people = ring(4), crowd(2)
    detections, person = detect(rig, people, noise=2.0)
    twice = np.concatenate([np.arange(len(person))] * 2)
    scores = 0.9 * np.ones((len(twice), 17))
    scores[len(person) :] = [0.97] * 5 + [0.0] * 12
    again = Detections.from_keypoints(detections.view[twice], detections.keypoints[twice], scores)
    estimate = mvpose.preset(preset).estimate(rig, described(again, person[twice]))
    assert len(estimate) == 2
    assert errors(estimate, people).max() < 0.06


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, lambda each: pickle.loads(pickle.dumps(each))])
def test_copies_are_frozen(copied):
    rig, people = ring(3), crowd(2)
    detections, person = detect(rig, people)
    maps = Heatmaps(np.ones((len(person), 17, 2, 2)), np.zeros((len(person), 2)), np.ones((len(person), 2)))
    detections = replace(described(detections, person), likelihoods=maps)
    estimate = Pipeline().estimate(rig, detections)
    for each, names in (
        (rig[0], "K R t distortion"),
        (copied(rig)[0], "K R t distortion"),
        (detections, "view keypoints scores boxes box_scores descriptors"),
        (maps, "values origin stride"),
        (estimate, "joints scores covariance"),
        (estimate.matching, "labels"),
    ):
        other = copied(each)
        assert type(other) is type(each)
        for name in names.split():
            np.testing.assert_array_equal(getattr(other, name), getattr(each, name))
            assert not getattr(other, name).flags.writeable
    again = Pipeline().estimate(copied(rig), copied(detections))
    np.testing.assert_array_equal(again.joints, estimate.joints)


def test_estimating_in_threads_gives_the_same():
    rig, people = ring(5), crowd(4)
    detections, person = detect(rig, people, noise=3.0)
    detections, pipeline = described(detections, person), Pipeline()
    alone = pipeline.estimate(rig, detections).joints
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: pipeline.estimate(rig, detections).joints, range(40)))
    assert all(np.array_equal(joints, alone) for joints in found)


@pytest.mark.parametrize("swapped", [lambda rig, detections: (detections, rig), lambda rig, found: (list(rig), found)])
def test_an_argument_that_is_not_a_rig_is_refused(swapped):
    rig = ring(3)
    with pytest.raises(ValueError, match=r"expected a mvpose\.Rig, got (Detections|list): estimate\(rig, detections\)"):
        Pipeline().estimate(*swapped(rig, detect(rig, crowd(1))[0]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GeometricAffinity(midpoint=np.nan), "midpoint of the geometric affinity must be above 0 and finite"),
        (lambda: GeometricAffinity(slope=0.0), "slope of the geometric affinity must be above 0"),
        (lambda: GeometricAffinity(threshold=-1.0), "threshold of the geometric affinity must be above 0, got -1"),
        (lambda: EpipolarAffinity(nearest=-0.1), "nearest of the epipolar affinity must be 0 or more"),
        (lambda: AppearanceAffinity(slope=-0.1), "slope of the appearance affinity must be above 0"),
        (lambda: Noise(floor=0.0), "floor of the noise model must be above 0"),
        (lambda: Noise(area=0.0, definition=0.0), "no detector is exact"),
        (lambda: UnmatchedPictorialStructure(reach=np.nan), "reach of the unmatched pictorial structure must be"),
    ],
)
def test_invalid_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_timings_add_up_and_the_estimate_is_complete():
    rig = ring(5)
    estimate = Pipeline().estimate(rig, detect(rig, crowd(2))[0])
    stages = {"affinity", "matching", "reconstruction"}
    assert set(estimate.timings) == stages | {"total"}
    assert sum(estimate.timings[s] for s in stages) == pytest.approx(estimate.timings["total"])
    assert estimate.scores.shape == (2, 17)
    assert estimate.covariance.shape == (2, 17, 3, 3)
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0


def test_an_unknown_preset_lists_the_known_ones():
    with pytest.raises(ValueError, match="full, appearance, geometry, hungarian, no-3dps, no-matching, fast"):
        mvpose.preset("best")


def test_the_method_stands_alone():
    """Importing mvpose must import neither the simulator nor a renderer."""
    strangers = ("simharness", "mujoco", "pyrender", "cv2", "polars")
    code = f"import sys, mvpose; print(*(m for m in {strangers} if m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() == []


def test_people_without_a_joint_are_left_out():
    """Two detections of equal looks without a common joint, and a person: the person alone has a place."""
    rig = ring(3)
    seen, _ = detect(rig, crowd(1))
    keypoints, scores = np.full((2, 17, 2), 400.0), np.zeros((2, 17))
    scores[0, 0] = scores[1, 5] = 0.9
    both = Detections.from_keypoints(
        np.append(seen.view, [0, 1]),
        np.append(seen.keypoints, keypoints, axis=0),
        np.append(seen.scores, scores, axis=0),
    )
    looks = np.repeat(np.eye(2), [len(seen), 2], axis=0)
    estimate = mvpose.preset("appearance").estimate(rig, replace(both, descriptors=looks))
    assert estimate.matching.labels.tolist() == [0] * len(seen) + [-1, -1]
    assert np.isfinite(estimate.joints).all()
    assert len(estimate) == 1
