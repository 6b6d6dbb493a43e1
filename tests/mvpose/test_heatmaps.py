from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import crowd, detect, ring

from mvpose import COCO17, SHELF14, Detections, Pipeline
from mvpose.heatmaps import Heatmaps


def blobs(*peaks, shape=(24, 32), deviation=2.0):
    """Gaussians of (column, row, height) in cells, (h, w)."""
    rows, columns = np.indices(shape)
    result = np.zeros(shape)
    for column, row, height in peaks:
        d2 = (columns - column) ** 2 + (rows - row) ** 2
        result = np.maximum(result, height * np.exp(-0.5 * d2 / deviation**2))
    return result


def single(values, *, origin=(0.0, 0.0), stride=(1.0, 1.0)):
    return Heatmaps(np.asarray(values)[None, None], [origin], [stride])


def by_hand(values, column, row):
    """Bilinear interpolation of a map that is zero outside."""
    padded = np.pad(values, 1)
    column, row = column + 1, row + 1
    if not (0 <= column < padded.shape[1] - 1 and 0 <= row < padded.shape[0] - 1):
        return 0.0
    c, r = int(column), int(row)
    x, y = column - c, row - r
    top = (1 - x) * padded[r, c] + x * padded[r, c + 1]
    return (1 - y) * top + y * ((1 - x) * padded[r + 1, c] + x * padded[r + 1, c + 1])


@given(
    st.floats(3.0, 28.0), st.floats(3.0, 20.0), st.floats(0.6, 4.0), st.floats(0.05, 1.0), st.sampled_from([1.0, 4.0])
)
def test_the_centre_of_a_gaussian_is_found_within_a_thousandth_of_a_cell(column, row, deviation, height, stride):
    values = blobs((column, row, height), deviation=deviation)
    pixels, heights = single(values, origin=(-7.25, 310.5), stride=(stride, 2 * stride)).modes(3)
    cells = (pixels[0, 0, 0] - [-7.25, 310.5]) / [stride, 2 * stride]
    np.testing.assert_allclose(cells, [column, row], atol=1e-3)
    assert heights[0, 0, 0] == pytest.approx(height, rel=1e-3)
    assert np.isnan(pixels[0, 0, 1:]).all()
    assert (heights[0, 0, 1:] == 0).all()


def test_two_blobs_are_two_modes_strongest_first():
    maps = single(blobs((8.3, 6.6, 0.4), (22.8, 15.1, 0.9)))
    pixels, heights = maps.modes(2)
    np.testing.assert_allclose(pixels[0, 0], [[22.8, 15.1], [8.3, 6.6]], atol=0.01)
    np.testing.assert_allclose(heights[0, 0], [0.9, 0.4], rtol=1e-3)
    np.testing.assert_allclose(maps.modes(1)[0][0, 0], [[22.8, 15.1]], atol=0.01)


@pytest.mark.parametrize("most", [1, 2, 5, 9])
def test_the_strongest_of_many_modes_are_kept(most):
    heights = np.random.default_rng(3).permutation(np.linspace(0.2, 1.0, 6))
    peaks = [(5.0 * k + 3, 4.0 + 12 * (k % 2), height) for k, height in enumerate(heights)]
    pixels, found = single(blobs(*peaks, deviation=1.0)).modes(most)
    order = np.argsort(-heights)[:most]
    np.testing.assert_allclose(found[0, 0, : len(order)], heights[order], rtol=1e-3)
    np.testing.assert_allclose(pixels[0, 0, : len(order)], np.array(peaks)[order, :2], atol=0.02)
    assert (found[0, 0, len(order) :] == 0).all()


def test_every_map_has_its_own_modes_and_grid():
    values = np.zeros((2, 2, 24, 32))
    values[0, 1], values[1, 0] = blobs((10, 5, 1.0)), blobs((20, 9, 0.5))
    pixels, heights = Heatmaps(values, [[100, 200], [0, 0]], [[4, 4], [2, 3]]).modes(1)
    np.testing.assert_allclose(heights[:, :, 0], [[0, 1], [0.5, 0]], atol=1e-6)
    np.testing.assert_allclose(pixels[0, 1, 0], [140, 220], atol=1e-3)
    np.testing.assert_allclose(pixels[1, 0, 0], [40, 27], atol=1e-3)
    assert np.isnan(pixels[[0, 1], [0, 1]]).all()


def test_an_empty_map_has_no_mode_and_a_constant_map_has_one():
    assert (single(np.zeros((5, 7))).modes(2)[1] == 0).all()
    pixels, heights = single(np.full((5, 7), 0.5)).modes(2)
    np.testing.assert_allclose(pixels[0, 0, 0], [3, 2])
    assert heights[0, 0].tolist() == [0.5, 0]
    pixels, heights = single([[0.25]]).modes(1)
    assert (pixels[0, 0, 0].tolist(), heights[0, 0].tolist()) == ([0, 0], [0.25])


# A peak between cells, saturated blobs (one not convex), and a ledge on a slope, which is no maximum.
PLATEAUS = {
    "pair": ([[0, 0, 0, 0], [0, 1, 1, 0], [0, 0, 0, 0]], [[1.5, 1.0]]),
    "square": ([[0.1, 0.1, 0.1, 0], [0.1, 1, 1, 0], [0.1, 1, 1, 0]], [[1.5, 1.5]]),
    "horseshoe": ([[1, 0, 1], [1, 0, 1], [1, 1, 1]], [[1.0, 8 / 7]]),
    "diagonals": ([[0, 0, 1], [0, 1, 0], [1, 0, 1]], [[1.25, 1.25]]),
    "ledge": ([[0.5, 0.5, 0.5, 1], [0.5, 0.5, 0.25, 0], [0, 0, 0, 0]], [[3.0, 0.0]]),
    "two": ([[1, 1, 0.5, 1, 1]], [[0.5, 0.0], [3.5, 0.0]]),
}


@pytest.mark.parametrize("name", PLATEAUS)
def test_a_plateau_counts_once(name):
    values, centres = PLATEAUS[name]
    pixels, heights = single(values).modes(6)
    found = np.isfinite(pixels[0, 0, :, 0])
    assert found.sum() == len(centres)
    assert (heights[0, 0, found] >= 1).all()
    np.testing.assert_allclose(pixels[0, 0, found], centres, atol=0.35)  # parabolas at its rim pull a little


@pytest.mark.parametrize(("column", "row"), [(0.0, 10.0), (31.0, 10.0), (12.0, 0.0), (12.0, 23.0), (31.0, 23.0)])
def test_a_peak_at_the_border_stays_in_the_map(column, row):
    for off in (-0.4, 0.0, 0.4, 5.0):
        beyond = (column + off * (column == 31), row + off * (row == 23))
        pixels, heights = single(blobs((*beyond, 1.0))).modes(1)
        assert heights[0, 0, 0] > 0
        np.testing.assert_allclose(pixels[0, 0, 0], [column, row], atol=0.01)


@given(st.integers(0, 10_000))
def test_modes_are_the_local_maxima(seed):
    rng = np.random.default_rng(seed)
    values = rng.random((1, 1, 7, 9)).astype(np.float32)  # no two are equal
    padded = np.pad(values[0, 0], 1, constant_values=-1)
    around = [padded[1 + r : 8 + r, 1 + c : 10 + c] for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]
    rows, columns = np.nonzero(values[0, 0] > np.max(around, axis=0))
    pixels, heights = Heatmaps(values, [[0, 0]], [[1, 1]]).modes(20)
    count = len(rows)
    assert (heights[0, 0] > 0).sum() == count
    assert (np.diff(heights[0, 0]) <= 0).all()
    off = np.abs(pixels[0, 0, :count, None] - np.column_stack([columns, rows])).max(axis=2)
    which = off.argmin(axis=1)
    assert sorted(which) == list(range(count))
    assert (off.min(axis=1) <= 0.5).all()
    rise = heights[0, 0, :count] / values[0, 0, rows[which], columns[which]]
    assert (rise > 1 - 1e-6).all()
    assert (rise < 2.2).all()  # of a parabola that is level on one side and falls to a twentieth on the other, twice


@given(st.integers(0, 10_000))
def test_sampling_is_bilinear_and_fades_to_zero(seed):
    rng = np.random.default_rng(seed)
    values = rng.random((2, 3, 4, 6)).astype(np.float32)
    origin, stride = rng.uniform(-50, 50, (2, 2)), rng.uniform(0.5, 8, (2, 2))
    maps = Heatmaps(values, origin, stride)
    cells = rng.uniform([-2, -2], [7, 5], (2, 3, 2, 2, 2))
    cells[0, 0, 0] = np.round(cells[0, 0, 0])  # on a centre
    pixels = origin[:, None, None, None] + stride[:, None, None, None] * cells
    expected = [
        [[[by_hand(values[d, j], *cells[d, j, a, b]) for b in (0, 1)] for a in (0, 1)] for j in range(3)]
        for d in range(2)
    ]
    np.testing.assert_allclose(maps.sample(pixels), expected, atol=1e-6)
    assert maps.sample(pixels[:, :, 0, 0]).shape == (2, 3)


def test_heights_at_nan_and_far_away_are_zero():
    maps = single(np.ones((3, 3)))
    pixels = [[[[np.nan, 1], [np.inf, 1], [1e300, -1e300], [1, 1e9], [1, 1]]]]
    assert maps.sample(pixels).tolist() == [[[0, 0, 0, 0, 1]]]


def test_the_height_of_a_mode_is_near_the_sample_there():
    maps = single(blobs((12.3, 9.8, 0.8), deviation=3.0), stride=(4, 4))
    pixels, heights = maps.modes(1)
    assert maps.sample(pixels)[0, 0, 0] == pytest.approx(heights[0, 0, 0], rel=0.03)


def test_detections_from_heat_maps_carry_them():
    values = np.zeros((2, 17, 24, 32))
    truth = np.random.default_rng(0).uniform([4, 4], [27, 19], (2, 17, 2))
    for d in range(2):
        for j in range(17):
            values[d, j] = blobs((*truth[d, j], 1.2 if j == 0 else 0.7))
    values[1, 3] = 0
    maps = Heatmaps(values, [[10, 20], [300, 40]], [[4, 4], [3, 3]])
    detections = Detections.from_heatmaps([0, 1], maps)
    assert detections.likelihoods is maps
    assert np.argwhere(~detections.detected).tolist() == [[1, 3]]
    expected = np.array([[[10, 20]], [[300, 40]]]) + np.array([[[4, 4]], [[3, 3]]]) * truth
    seen = detections.detected
    np.testing.assert_allclose(detections.keypoints[seen], expected[seen], atol=0.01)
    np.testing.assert_allclose(detections.scores[0, :2], [1.0, 0.7], rtol=1e-3)  # heights, 1 at most
    low, high = expected[0].min(axis=0), expected[0].max(axis=0)
    np.testing.assert_allclose(detections.boxes[0], [*low, *(high - low)], atol=0.02)
    boxes = [[0, 0, 50, 80], [5, 5, 20, 40]]
    assert Detections.from_heatmaps([0, 1], maps, boxes=boxes).boxes.tolist() == boxes


def test_invalid_heat_maps_are_refused():
    good = np.ones((2, 17, 4, 4))
    with pytest.raises(ValueError, match=r"heat map values must be \(m, J, h, w\), got \(2, 17, 4\)"):
        Heatmaps(good[..., 0], np.zeros((2, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"heat map origin must be \(2, 2\), got \(3, 2\)"):
        Heatmaps(good, np.zeros((3, 2)), np.ones((2, 2)))
    for wrong in (-0.1 * good, 255 * good, np.nan * good, np.inf * good, 1e300 * good):
        with pytest.raises(ValueError, match="between 0 and a peak of about 1"):
            Heatmaps(wrong, np.zeros((2, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="at least one cell"):
        Heatmaps(good[:, :, :0], np.zeros((2, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="origin must be finite"):
        Heatmaps(good, [[0, 0], [np.nan, 0]], np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"stride must be positive pixels per cell, got \[4\.0, 0\.0\] of detection 1"):
        Heatmaps(good, np.zeros((2, 2)), [[4, 4], [4, 0]])
    maps = Heatmaps(good, np.zeros((2, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"pixels must be \(2, 17, \.\.\., 2\)"):
        maps.sample(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="at least 1 mode"):
        maps.modes(0)
    with pytest.raises(ValueError, match=r"heat maps must be \(3, 17\)"):
        Detections.from_heatmaps([0, 0, 1], maps)
    with pytest.raises(ValueError, match=r"heat maps must be \(2, 14\)"):
        Detections.from_heatmaps([0, 1], maps, skeleton=SHELF14)
    with pytest.raises(ValueError, match=r"heatmaps must be .*Heatmaps, got ndarray"):
        Detections.from_heatmaps([0, 1], good)
    with pytest.raises(ValueError, match=r"likelihoods must be .*Heatmaps, got ndarray"):
        Detections([0], np.ones((1, 17, 2)), np.ones((1, 17)), np.zeros((1, 4)), [1], COCO17, likelihoods=good)


def test_no_detections_have_no_maps():
    maps = Heatmaps(np.zeros((0, 17, 4, 4)), np.zeros((0, 2)), np.zeros((0, 2)))
    assert len(Detections.from_heatmaps([], maps)) == 0


def test_a_missing_keypoint_overrides_its_heat_map():
    rig, people = ring(4), crowd(2)
    detections, _ = detect(rig, people)
    values = np.tile(blobs((8.0, 12.0, 0.9), shape=(24, 16)), (len(detections), 17, 1, 1))
    maps = Heatmaps(values, detections.keypoints[:, 9] - [8.0, 12.0], np.ones((len(detections), 2)))  # all peak at it
    scores = detections.scores.copy()
    scores[:, 9] = 0.0
    seen = replace(detections, likelihoods=maps)
    missing = replace(seen, scores=scores)
    assert np.isfinite(Pipeline().estimate(rig, seen).joints[:, 9]).all()
    assert np.isnan(Pipeline().estimate(rig, missing).joints[:, 9]).all()
