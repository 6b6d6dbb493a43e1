"""Truth in the pictures as arrays: peaks of heat maps, visibility equal to the truth of the trial."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import COCO17
from mvpose.heatmaps import Heatmaps
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.outputs.benchmark.picture_truth import STRIDE, WIDTH, heatmaps
from simharness.outputs.benchmark.submission import read_exact
from simharness.types.views import Visibility

SIZE = (322, 241)
INSIDE = st.tuples(st.floats(12.0, 308.0), st.floats(12.0, 228.0))


def located(values):
    """Return the place of the highest peak in pixels: the vertex of the parabola through logarithms of three cells."""
    row, column = np.unravel_index(values.argmax(), values.shape)
    logs = np.log(values[row - 1 : row + 2, column - 1 : column + 2].astype(float))
    offsets = [0.5 * (a - c) / (a - 2 * b + c) for a, b, c in (logs[1], logs[:, 1])]
    return STRIDE * (np.array([column, row]) + offsets) + (STRIDE - 1) / 2


@given(INSIDE)
def test_the_peak_of_one_person_is_at_the_keypoint(place):
    (values,) = heatmaps(np.array([[place]]), SIZE)
    assert values.shape == (61, 81)  # cells that hold every pixel
    np.testing.assert_allclose(located(values), place, atol=0.15 * STRIDE)  # of rounding to bytes
    assert values.max() >= 255 * np.exp(-0.25 / WIDTH**2) - 0.5  # the nearest cell is half a cell away at most


@given(st.lists(INSIDE, min_size=1, max_size=4))
def test_maps_of_several_people_are_the_highest_of_each(places):
    together = heatmaps(np.array(places)[:, None], SIZE)
    alone = [heatmaps(np.array([[place]]), SIZE) for place in places]
    np.testing.assert_array_equal(together, np.max(alone, axis=0))


def test_joints_that_are_not_in_the_picture_have_no_peak():
    pixels = np.array([[[100.0, 50.0], [np.nan, np.nan]]])
    values = heatmaps(pixels, SIZE)
    assert values[0].max() > 240
    assert not values[1].any()
    assert not heatmaps(np.zeros((0, 2, 2)), SIZE).any()


@pytest.fixture(scope="module")
def exported(trial, tmp_path_factory):
    plan = ExportPlan(
        tmp_path_factory.mktemp("truth") / "tiny", every=2, pictures=False, also=frozenset({"visibility", "heatmaps"})
    )
    return export_sequence(trial.scenario, plan)


def test_visibility_is_that_of_the_truth(exported):
    truth = read_exact(exported / "exact.npz").truth
    with np.load(exported / "visibility.npz") as file:
        assert file["frames"].tolist() == [0, 2]
        assert file["cameras"].tolist() == ["00_00", "00_01", "00_02"]
        assert file["joints"].tolist() == list(COCO17.joints)
        assert [Visibility[name.upper()].value for name in file["states"]] == list(range(len(file["states"])))
        for key in ("visibility", "pixels", "boxes"):
            np.testing.assert_array_equal(file[key], [getattr(each, key) for each in truth])
        assert set(np.unique(file["visibility"])) >= {Visibility.VISIBLE, Visibility.SELF_OCCLUDED}


def test_a_keypoint_in_the_picture_is_high_in_its_map(exported):
    lowest = np.exp(-0.25 / WIDTH**2) - 0.01  # between cells
    with np.load(exported / "visibility.npz") as file:
        frames, cameras, pixels, states = (file[key] for key in ("frames", "cameras", "pixels", "visibility"))
    for row, frame in enumerate(frames):
        for view, camera in enumerate(cameras):
            with np.load(exported / "heatmaps" / camera / f"{camera}_{frame:08d}.npz") as file:
                maps = Heatmaps(file["values"][None] / 255.0, file["origin"][None], file["stride"][None])
            inside = states[row, view] != Visibility.OUTSIDE
            heights = maps.sample(pixels[row, view].transpose(1, 0, 2)[None])[0].T
            whole = inside & (np.abs(pixels[row, view] - (159.5, 119.5)) < (155, 115)).all(axis=-1)
            assert whole.sum() > 20
            assert heights[whole].min() > lowest
            empty = ~inside.any(axis=0)
            assert not maps.values[0, empty].any()
