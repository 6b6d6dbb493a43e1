"""Default scales of the affinities: they hold for any resolution and any number of people and views."""

import numpy as np
import pytest
from gathering import labels, noisy, pairwise_f1, people_in_a_room, rig_around

from mvpose import Detections, Pipeline
from mvpose.affinity import EpipolarAffinity, FusedAffinity, GeometricAffinity

AFFINITIES = [GeometricAffinity(), EpipolarAffinity(), FusedAffinity()]
SIZES = [(360, 288), (1280, 960), (1032, 776), (3840, 2160)]


@pytest.mark.parametrize("affinity", AFFINITIES, ids=lambda a: type(a).__name__)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("views", "people"), [(2, 3), (3, 4), (5, 8), (12, 12)])
def test_results_do_not_depend_on_resolution(affinity, size, views, people):
    rig = rig_around(views, size=size)
    f1 = []
    for seed in range(3):
        detections, person = noisy(rig, people_in_a_room(people, seed=seed), seed=seed)
        f1.append(pairwise_f1(labels(rig, detections, affinity), person, detections.view))
    assert np.mean(f1) > 0.97


@pytest.mark.parametrize("affinity", AFFINITIES[:2], ids=lambda a: type(a).__name__)
@pytest.mark.parametrize(("views", "people"), [(2, 1), (3, 1), (31, 1), (5, 15), (8, 30), (31, 10), (31, 30)])
def test_from_one_person_to_thirty_and_two_views_to_31(affinity, views, people):
    rig = rig_around(views, radius=5.0 if people < 20 else 7.0)
    detections, person = noisy(rig, people_in_a_room(people, half=2.0 if people < 20 else 3.5))
    assert pairwise_f1(labels(rig, detections, affinity), person, detections.view) > 0.97


@pytest.mark.parametrize("affinity", AFFINITIES, ids=lambda a: type(a).__name__)
@pytest.mark.parametrize("views", [2, 3, 4, 5])
@pytest.mark.parametrize("size", SIZES)
def test_one_person_alone_is_one_person(affinity, views, size):
    rig = rig_around(views, size=size)
    for seed in range(5):
        detections, _ = noisy(rig, people_in_a_room(1, seed=seed), seed=seed)
        assert (labels(rig, detections, affinity) == 0).all()


@pytest.mark.parametrize("affinity", AFFINITIES, ids=lambda a: type(a).__name__)
def test_an_empty_view_is_allowed(affinity):
    rig = rig_around(4)
    detections, person = noisy(rig, people_in_a_room(3))
    kept = detections.view != 1
    some = Detections.from_keypoints(detections.view[kept], detections.keypoints[kept], detections.scores[kept])
    assert pairwise_f1(labels(rig, some, affinity), person[kept], some.view) == 1


@pytest.mark.parametrize("affinity", AFFINITIES, ids=lambda a: type(a).__name__)
def test_detections_of_a_single_view_give_no_people(affinity):
    rig = rig_around(4)
    detections, _ = noisy(rig, people_in_a_room(5))
    kept = detections.view == 2
    one_view = Detections.from_keypoints(detections.view[kept], detections.keypoints[kept], detections.scores[kept])
    assert (labels(rig, one_view, affinity) == -1).all()
    assert labels(rig, Detections.empty(), affinity).shape == (0,)


@pytest.mark.parametrize("affinity", AFFINITIES, ids=lambda a: type(a).__name__)
@pytest.mark.parametrize(("views", "people"), [(2, 1), (5, 1), (3, 3)])
def test_the_whole_method_finds_them(affinity, views, people):
    rig, true = rig_around(views), people_in_a_room(people)
    detections, person = noisy(rig, true, pixels=2.0, missed=0.0)
    estimate = Pipeline(affinity=affinity).estimate(rig, detections)
    assert len(estimate) == people
    np.testing.assert_array_equal(
        estimate.matching.labels[:, None] == estimate.matching.labels, person[:, None] == person
    )


def test_people_half_a_metre_apart_are_separated():
    """Neighbours are half a metre apart; keypoints have the noise of human annotators."""
    rig = rig_around(5)
    f1 = []
    for seed in range(4):
        detections, person = noisy(rig, people_in_a_room(8, half=1.2, gap=0.5, seed=seed), seed=seed, pixels=8.0)
        f1.append(pairwise_f1(labels(rig, detections), person, detections.view))
    assert np.mean(f1) > 0.97


@pytest.mark.parametrize("scale", ["midpoint", "slope", "threshold", "saturation"])
def test_both_geometric_cues_have_the_same_scales(scale):
    """A person who fills 300 of 1000 pixels is seen at 175 pixels per metre."""
    assert getattr(EpipolarAffinity(), scale) == pytest.approx(175 * getattr(GeometricAffinity(), scale), rel=0.02)
