import numpy as np
import pytest
from people import STANDING, ring

from mvpose import COCO17, Detections, Rig
from mvpose.heatmaps import Heatmaps
from mvpose.rays import viewing_rays
from mvpose.reconstruction import PictorialStructure
from mvpose.reconstruction.pictorial import rescore

STRIDE, WIDTH = 4.0, 2.0  # pixels a cell; deviation of a blob in cells


def blobs(pixels, heights, *, cells=64):
    """Heat maps with Gaussian blobs at pixels (m, J, B, 2) of the given heights (m, J, B), cropped around each pose."""
    origin = np.nanmin(pixels, axis=(1, 2)) - 20.0
    stride = np.maximum((np.nanmax(pixels, axis=(1, 2)) + 20.0 - origin) / (cells - 1), STRIDE)
    grid = np.arange(cells)
    at = (pixels - origin[:, None, None]) / stride[:, None, None]
    across = np.exp(-0.5 * ((grid - at[..., 0, None]) / WIDTH) ** 2)
    down = np.exp(-0.5 * ((grid - at[..., 1, None]) / WIDTH) ** 2)
    values = (heights[..., None, None] * down[..., :, None] * across[..., None, :]).max(axis=2)
    return Heatmaps(values.astype(np.float32), origin, stride)


def reconstruct(rig, maps, method=None):
    rays = viewing_rays(rig, Detections.from_heatmaps(np.arange(len(rig)), maps))
    return (method or PictorialStructure())(rays, np.zeros(len(rig), int), COCO17).joints[0]


@pytest.mark.parametrize("distortion", [None, [-0.2, 0.05, 0.001, -0.001, 0.0]])
def test_clean_maps_give_the_pose_below_the_size_of_a_cell(distortion):
    """A cell is 16 mm wide at four metres; the prior pulls an average adult by a few millimetres."""
    rig = ring(5, distortion=distortion)
    maps = blobs(rig.project(STANDING)[:, :, None], np.full((5, 17, 1), 0.9))
    assert np.linalg.norm(reconstruct(rig, maps) - STANDING, axis=1).max() < 0.015


def test_the_second_mode_is_chosen_by_other_views_and_the_bone_prior():
    """Two of four views confidently exchange the wrists; keypoints alone cannot resolve this."""
    rig = Rig(list(ring(7))[:4])
    truth = rig.project(STANDING)
    wrong = truth.copy()
    wrong[:2, 9] = truth[:2, 10]
    heights = np.stack([np.full((4, 17), 0.8), np.zeros((4, 17))], axis=-1)
    heights[:2, 9] = 0.9, 0.6  # the wrong place is the higher peak
    maps = blobs(np.stack([wrong, truth], axis=2), heights)
    assert np.linalg.norm(reconstruct(rig, maps)[9] - STANDING[9]) < 0.03
    detections = Detections.from_heatmaps(np.arange(4), maps)
    bare = Detections.from_keypoints(np.arange(4), detections.keypoints, detections.scores)
    joints = PictorialStructure()(viewing_rays(rig, bare), np.zeros(4, int), COCO17).joints[0]
    scores = PictorialStructure()(viewing_rays(rig, bare), np.zeros(4, int), COCO17).scores[0]
    assert np.linalg.norm(joints[9] - STANDING[9]) > 0.1 or scores[9] < 0.7 * scores[10]


def test_a_map_without_the_joint_has_the_likelihood_of_the_floor():
    rig = ring(4)
    maps = blobs(rig.project(STANDING)[:, :, None], np.full((4, 17, 1), 1.0))
    values = maps.values.copy()
    values[1, 9] = 0.0
    values[1, 9, 2, 3] = 0.3  # all it has is far away
    maps = Heatmaps(values, maps.origin, maps.stride)
    rays = viewing_rays(rig, Detections.from_heatmaps(np.arange(4), maps))
    modes = rays.modes
    states, unary = np.array([[STANDING[9]]] * 17), np.zeros((17, 1))
    rescore(
        states,
        unary,
        np.ones(17, int),
        np.zeros(4, int),
        0,
        modes.weights.transpose(1, 0, 2).copy(),
        (modes.values, modes.row, modes.grid, modes.cameras),
        0.01,
    )
    assert unary[9, 0] == pytest.approx(3 * np.log(1.01) + np.log(0.01), abs=0.19)  # a bilinear peak is up to 6 % low
    assert unary[10, 0] < -10  # the left wrist is not where the right one is
    assert np.linalg.norm(reconstruct(rig, maps)[9] - STANDING[9]) < 0.02


def test_proposals_are_sorted_by_the_heat_maps():
    rig = ring(3)
    maps = blobs(rig.project(STANDING)[:, :, None], np.full((3, 17, 1), 0.9))
    modes = viewing_rays(rig, Detections.from_heatmaps(np.arange(3), maps)).modes
    away = np.array([0.4, 0.0, 0.1, 0.05])
    states = STANDING[:, None] + away[:, None] * [0.0, 1.0, 0.0]
    unary = np.zeros((17, 4))
    weights, maps = modes.weights.transpose(1, 0, 2).copy(), (modes.values, modes.row, modes.grid, modes.cameras)
    rescore(states, unary, np.full(17, 4), np.zeros(3, int), 0, weights, maps, 0.01)
    np.testing.assert_allclose(states[:, 0], STANDING)
    assert (np.diff(unary, axis=1) <= 0).all()
    assert (unary[:, 0] > unary[:, 1]).all()
