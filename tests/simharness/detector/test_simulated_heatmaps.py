import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import Camera, Detections, Rig, preset
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.heatmaps import ASPECT, PADDING, Peaks, drop_outside_crops
from simharness.scenario.sections.detector_section import HeatmapHeadSection
from simharness.types.truth import KeypointError

SIZES = ("64x48", "96x72")


def peaks(m=6, *, seed=0, scores=None, contested=0.0, **head):
    """Return detections with keypoints anywhere in their boxes, a share of them with a rival."""
    rng = np.random.default_rng(seed)
    low, size = rng.uniform(-50, 800, (m, 2)), rng.uniform([40, 150], [200, 500], (m, 2))
    keypoints, others = low[:, None] + rng.random((2, m, 17, 2)) * size[:, None]
    scores = rng.uniform(0.1, 1.0, (m, 17)) if scores is None else np.full((m, 17), scores)
    others[rng.random((m, 17)) >= contested] = np.nan
    return Peaks(np.hstack([low, size]), keypoints, scores, others, HeatmapHeadSection(**{"size": "64x48", **head}))


class TestKeypoints:
    @pytest.mark.parametrize("size", SIZES)
    def test_detections_read_from_the_maps_are_the_original_ones(self, size):
        made = peaks(20, contested=0.3, size=size)
        maps = made.heatmaps()
        assert maps.values.shape == (20, 17, *(int(cells) for cells in size.split("x")))
        read = Detections.from_heatmaps(np.zeros(20, int), maps, boxes=made.boxes)
        np.testing.assert_allclose(read.keypoints, made.keypoints, atol=1e-3)
        np.testing.assert_allclose(read.scores, made.scores, atol=1e-5)

    @given(st.sampled_from(SIZES), st.floats(0.6, 4.0), st.floats(0.0, 1.0), st.floats(0.01, 1.0), st.integers(0, 1000))
    def test_the_strongest_mode_is_the_keypoint_for_any_head(self, size, width, floor, score, seed):
        made = peaks(2, seed=seed, scores=score, contested=0.5, size=size, width=width, floor=floor)
        maps = made.heatmaps()
        pixels, heights = maps.modes(3)
        np.testing.assert_allclose(pixels[:, :, 0], made.keypoints, atol=2e-3 * maps.stride.max())
        np.testing.assert_allclose(heights[:, :, 0], score, rtol=1e-3)
        assert (heights[:, :, 2] == 0).all()  # the floor has no separate mode
        assert ((heights[:, :, 1] > 0) <= np.isfinite(made.rivals[..., 0])).all()
        assert maps.values.max() <= score + 1e-6

    def test_crops_are_those_of_top_down_heads(self):
        head = HeatmapHeadSection(size="64x48")
        boxes = np.array([[100.0, 50, 60, 200], [10, 20, 300, 100], [400, 300, 0, 0]])
        nowhere = np.full((3, 17, 2), np.nan)
        maps = Peaks(boxes, nowhere, np.zeros((3, 17)), nowhere, head).heatmaps()
        size = maps.stride * [48, 64]
        corner = maps.origin - 0.5 * maps.stride
        np.testing.assert_allclose(corner + 0.5 * size, boxes[:, :2] + 0.5 * boxes[:, 2:])
        np.testing.assert_allclose(size[:, 0] / size[:, 1], ASPECT)
        np.testing.assert_allclose(size[0, 1], PADDING * 200)
        np.testing.assert_allclose(size[1, 0], PADDING * 300)
        assert (size[2] > 0).all()


class TestRivals:
    def test_the_second_mode_is_the_rival_with_the_rest_of_the_probability(self):
        """Where its peak is several cells away from the first, it is read as exactly as the first."""
        made = peaks(20, contested=1.0)
        maps = made.heatmaps()
        pixels, heights = maps.modes(2)
        far = np.linalg.norm((made.rivals - made.keypoints) / maps.stride[:, None], axis=-1) > 12
        far &= made.scores < 0.95
        assert far.sum() > 100
        expected = np.minimum(0.5 * made.scores, 1 - made.scores)
        np.testing.assert_allclose(heights[..., 1][far], expected[far], rtol=1e-3)
        np.testing.assert_allclose(pixels[..., 1, :][far], made.rivals[far], atol=0.01)

    def test_near_rivals_and_those_of_joints_with_score_one_have_no_peak(self):
        sure = peaks(20, contested=1.0, scores=1.0)
        near = peaks(20, contested=1.0, scores=0.6)
        near.rivals[:] = near.keypoints + 2.9 * 2.0 * near.heatmaps().stride[:, None] * [0, 1]
        for made in (sure, near, peaks(20, scores=0.6)):
            assert (made.heatmaps().modes(2)[1][..., 1] == 0).all()

    def test_rivals_limits_the_height_of_second_peaks(self):
        for most in (0.0, 0.2, 0.8):
            seconds = peaks(6, scores=0.5, contested=1.0, rivals=most).heatmaps().modes(2)[1][..., 1]
            assert (seconds <= most * 0.5 * 1.001).all()
            assert np.median(seconds) == pytest.approx(most * 0.5, rel=1e-3)


class TestAbsent:
    def test_absent_joints_stay_absent(self):
        made = peaks(6, contested=0.5, floor=0.2)
        made.keypoints[1, 3], made.scores[1, 3] = np.nan, 0.0
        made.keypoints[2], made.scores[2] = np.nan, 0.0
        maps = made.heatmaps()
        read = Detections.from_heatmaps(np.zeros(6, int), maps)
        assert (read.detected == (made.scores > 0)).all()
        assert (maps.values[1, 3] == 0).all()

    def test_the_floor_is_lower_than_a_faint_peak(self):
        for score, height in ((0.9, 0.05), (0.06, 0.03)):
            values = peaks(scores=score, floor=0.05).heatmaps().values
            assert np.median(values) == pytest.approx(height, rel=0.1)
            assert values.min() > 0.85 * height
            assert (np.diff(values, axis=-1) == 0).mean() < 0.01  # no plateaus, in which modes are slow to search
        assert np.median(peaks(floor=0.0).heatmaps().values) < 1e-6

    def test_a_head_sees_nothing_outside_its_crop(self):
        rng = np.random.default_rng(2)
        made = peaks(8)
        reach = PADDING * np.maximum(made.boxes[:, 3], made.boxes[:, 2] / ASPECT)[:, None] * [ASPECT, 1]
        center = made.boxes[:, :2] + 0.5 * made.boxes[:, 2:]
        made.keypoints[:] = center[:, None] + rng.uniform(-0.7, 0.7, (8, 17, 2)) * reach[:, None]
        inside = (np.abs(made.keypoints - center[:, None]) <= 0.5 * reach[:, None]).all(axis=-1)
        assert 0.2 < inside.mean() < 0.8
        read = Detections.from_heatmaps(np.zeros(8, int), made.heatmaps())
        assert (read.detected == inside).all()

        found = DetectionBlock.empty(2, 2, 2)
        found.present[:] = True
        found.keypoints[:], found.scores[:] = made.keypoints.reshape(2, 2, 2, 17, 2), 0.5
        found.boxes[:] = made.boxes.reshape(2, 2, 2, 4)
        found.keypoints[0, 0, 0], inside[0] = 1e4, False
        cut = drop_outside_crops(found)
        inside = inside.reshape(2, 2, 2, 17)
        assert ((cut.scores > 0) == inside).all()
        assert (np.isfinite(cut.keypoints[..., 0]) == inside).all()
        assert ((cut.error == KeypointError.ABSENT) == ~inside).all()
        assert (cut.present == inside.any(axis=-1)).all()
        assert not cut.present[0, 0, 0]
        assert found.present.all()

    def test_without_a_head_there_are_no_maps(self):
        with pytest.raises(ValueError, match=r'detector\.heatmaps\.size must be "64x48" or "96x72"'):
            peaks(size="none").heatmaps()

    def test_no_detections_have_no_maps(self):
        assert len(peaks(0).heatmaps()) == 0


def looking_in(bearings):
    """Return cameras that face the origin from 5 m, 1 m above the floor."""
    cameras = []
    for angle in bearings:
        forward = -np.array([np.cos(angle), np.sin(angle), 0])
        R = np.stack([np.cross(forward, [0, 0, 1.0]), [0, 0, -1.0], forward])
        K = np.array([[800.0, 0, 640], [0, 800, 480], [0, 0, 1]])
        cameras.append(Camera(K, R, -R @ (-5 * forward + [0, 0, 1.0]), size=(1280, 960)))
    return Rig(cameras)


def test_the_method_uses_rivals():
    """Left and right knee are exchanged in one view; its second peaks are at their true places."""
    rig = looking_in([0.0, 1.2, 2.6, 4.1])
    body = np.array(
        [[0, 0.12, 1.55], [0.03, 0.09, 1.59], [-0.03, 0.09, 1.59], [0.07, 0, 1.57], [-0.07, 0, 1.57]]
        + [[x, 0.05 * k, z] for k, (w, z) in enumerate([(0.17, 1.38), (0.22, 1.11), (0.24, 0.86)]) for x in (w, -w)]
        + [[x, 0.02, z] for w, z in [(0.09, 0.9), (0.1, 0.51), (0.1, 0.09)] for x in (w, -w)]
    )
    pixels = rig.project(body[None])[:, 0]
    low, high = pixels.min(axis=1) - 15, pixels.max(axis=1) + 15
    boxes, scores = np.hstack([low, high - low]), np.full((4, 17), 0.7)
    keypoints, rivals, none = pixels.copy(), np.full_like(pixels, np.nan), np.full_like(pixels, np.nan)
    knees = [13, 14]
    keypoints[1, knees], rivals[1, knees] = pixels[1, knees[::-1]], pixels[1, knees]
    spread = []
    for others in (none, rivals):
        maps = Peaks(boxes, keypoints, scores, others, HeatmapHeadSection(size="96x72")).heatmaps()
        detections = Detections(np.arange(4), keypoints, scores, boxes, np.full(4, 0.9), likelihoods=maps)
        found = preset("full").estimate(rig, detections)
        assert len(found.joints) == 1
        assert np.linalg.norm(found.joints[0] - body, axis=-1).max() < 0.02
        spread.append(np.trace(found.covariance[0, knees], axis1=1, axis2=2))
    assert (spread[1] < 0.9 * spread[0]).all()
