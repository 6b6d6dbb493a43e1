"""Appearance in the matching of tracklets."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import film, walk
from people import ring

from mvpose.calibration.tracklet_matching import evidence_of_looks, mean_looks
from mvpose.calibration.tracklets import link

RIG = ring(3)
PERIOD = 0.1


def tracklets_of(looks, people):
    """Tracklets of two walkers in three views, whose detections have the looks (2, D) of their person with noise."""
    frames, person = film(RIG, walk(2, frames=12, seed=1), noise=2.0)
    rng = np.random.default_rng(0)
    described = [
        replace(each, descriptors=looks[who] + 0.02 * rng.standard_normal((len(who), looks.shape[1])))
        for each, who in zip(frames, person, strict=True)
    ]
    found = link(RIG, described, period=PERIOD)
    assert len(found) == 6
    keypoints = {
        each.keypoints[i].tobytes(): who[i] for each, who in zip(frames, person, strict=True) for i in range(len(who))
    }
    people[:] = [keypoints[found.keypoints[row].tobytes()] for row in found.starts[:-1]]
    return found


@pytest.fixture
def people():
    return [0] * 6


def apart_of(found):
    return found.views[:, None] == found.views


def test_looks_speak_for_one_person_and_against_two(people):
    found = tracklets_of(np.eye(8)[:2], people)
    evidence = evidence_of_looks(found, apart_of(found))
    same, other_view = np.equal.outer(people, people), ~apart_of(found)
    assert (evidence[same & other_view] > 5).all()
    assert (evidence[~same & other_view] < -2).all()
    np.testing.assert_allclose(evidence, evidence.T)


def test_uniforms_are_no_evidence(people):
    found = tracklets_of(np.ones((2, 8)), people)
    assert np.abs(evidence_of_looks(found, apart_of(found))).max() < 1


def test_detections_without_descriptors_are_no_evidence(people):
    found = tracklets_of(np.eye(8)[:2], people)
    blank = found.descriptors.copy()
    blank[found.tracklet == 2] = np.nan
    evidence = evidence_of_looks(replace(found, descriptors=blank), apart_of(found))
    assert not evidence[2].any()
    assert evidence[0].any()
    assert not evidence_of_looks(replace(found, descriptors=None), apart_of(found)).any()


def test_mean_looks_do_not_depend_on_the_length_of_descriptors(people):
    found = tracklets_of(np.eye(8)[:2], people)
    longer = replace(found, descriptors=3.0 * found.descriptors)
    np.testing.assert_allclose(mean_looks(longer)[0], mean_looks(found)[0])
