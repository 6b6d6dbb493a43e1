import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, detect, look_at, ring

from mvpose import COCO17, Detections, Rig
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Noise, Triangulation
from mvpose.reconstruction.triangulation import propose


def rays_of(rig, pixels, scores=None):
    scores = np.full(pixels.shape[:2], 0.9) if scores is None else scores
    return viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), pixels, scores))


@given(st.integers(2, 7), st.floats(-1, 1), st.floats(-1, 1))
def test_exact_pixels_give_the_exact_point(views, x, y):
    rig = ring(views, distortion=[-0.2, 0.05, 0, 0, 0])
    people = (STANDING + [x, y, 0])[None]
    rays = viewing_rays(rig, detect(rig, people, shuffle=False)[0])
    joints, scores, _ = Triangulation()(rays, COCO17)
    np.testing.assert_allclose(joints, people[0], atol=1e-4)
    assert (scores > 0.8).all()


def test_a_wrong_view_is_left_out_not_averaged_in():
    rig = ring(5)
    pixels = rig.project(STANDING)
    pixels[2, 9] += [150, -80]
    joints, scores, _ = Triangulation()(rays_of(rig, pixels), COCO17)
    assert np.linalg.norm(joints - STANDING, axis=1).max() < 2e-3
    assert scores[9] == pytest.approx(0.8 * scores[10], rel=0.02)  # four views of five vouch for it


def test_a_joint_of_one_view_is_missing_not_invented():
    rig = ring(4)
    pixels, scores = rig.project(STANDING), np.full((4, 17), 0.9)
    scores[1:, 9] = 0
    scores[:, 10] = 0
    joints, scores, covariance = Triangulation()(rays_of(rig, pixels, scores), COCO17)
    assert np.isnan(joints[[9, 10]]).all()
    assert (scores[[9, 10]] == 0).all()
    assert np.isnan(covariance[[9, 10]]).all()
    assert np.isfinite(np.delete(joints, [9, 10], axis=0)).all()


def test_every_pair_of_views_proposes_and_so_do_all_together():
    rig = ring(5)
    proposals = propose(rays_of(rig, rig.project(STANDING)), Noise().sigmas(COCO17), Noise())
    assert (proposals.count == 5 * 4 // 2 + 1).all()
    valid = np.arange(proposals.states.shape[1]) < proposals.count[:, None]
    np.testing.assert_allclose(proposals.states[valid], np.repeat(STANDING, 11, axis=0), atol=1e-8)
    np.testing.assert_allclose(proposals.unary[valid], 5 * np.log(0.9 + Noise().floor), atol=1e-6)


def test_rays_that_meet_behind_the_cameras_propose_nothing():
    rig = Rig([look_at([4, y, 1], [0, y, 1]) for y in (-0.5, 0.5)])  # side by side; image right is world +y
    pixels = rig.project(STANDING)
    pixels[:, 9] = [
        [100, 480],
        [1180, 480],
    ]  # the left camera sees the wrist on its left, the right on its right
    proposals = propose(rays_of(rig, pixels), Noise().sigmas(COCO17), Noise())
    assert proposals.count[9] == 0
    assert (np.delete(proposals.count, 9) == 1).all()


def test_covariance_is_long_along_the_line_of_sight_and_short_across():
    near = ring(12, radius=5.0)
    rig = type(near)([near[0], near[1]])  # two cameras 30 degrees apart: depth is worst known
    _, _, covariance = Triangulation()(rays_of(rig, rig.project(STANDING)), COCO17)
    values, vectors = np.linalg.eigh(covariance[11])
    sight = STANDING[11] - rig.centers.mean(axis=0)
    assert abs(vectors[:, 2] @ sight) / np.linalg.norm(sight) > 0.99
    assert values[2] > 5 * values[1] > 0
