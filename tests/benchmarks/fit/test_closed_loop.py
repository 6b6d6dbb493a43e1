"""Closed loop of the fit: a known detector and annotation, fitted again."""

import json

import numpy as np
import pytest

from benchmarks.fit.__main__ import main
from benchmarks.fit.loop import truth_bones
from benchmarks.fit.others import out_of_sample
from benchmarks.fit.recordings import ANNOTATION, DETECTOR, RIGS, known_recording
from benchmarks.fit.sensitivity import CONSTANTS, _times
from benchmarks.fit.table import inside, tables
from simharness.reality.detector_fit import inference


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """One draw with three cameras."""
    folder = tmp_path_factory.mktemp("fit")
    words = [str(folder), "--draws", "1", "--cameras", "3", "--truth", "annotated"]
    assert main(words) == 0
    return folder, words


@pytest.mark.slow
def test_what_is_fitted_is_what_is_true(loop):
    """Scatter within an eighth, most parameters inside of their intervals, bones of the twin as the recorded ones."""
    (file,) = loop[0].glob("*.json")
    found = json.loads(file.read_text())
    scatter = [each for key, each in found["values"].items() if key.startswith("keypoints.scatter.")]
    assert np.mean([each["fitted"] / each["true"] for each in scatter]) == pytest.approx(1.0, abs=0.12)
    assert np.mean([inside(each) for each in found["values"].values()]) > 0.7
    recorded, twin = np.array(found["bones"])
    assert twin.mean() / recorded.mean() == pytest.approx(1.0, abs=0.15)
    true, fitted = (np.array(each)[:, :12] for each in found["annotation"]["deviation"])
    assert fitted.mean() == pytest.approx(true.mean(), rel=0.2)
    assert fitted.min() > 0.3 * true.min()


@pytest.mark.slow
def test_finished_draws_are_not_repeated(loop, capsys):
    folder, words = loop
    (file,) = folder.glob("*.json")
    before = file.stat().st_mtime_ns
    assert main(words) == 0
    assert file.stat().st_mtime_ns == before
    assert "3 cameras, annotated: 1 draws" in capsys.readouterr().out


@pytest.mark.slow
def test_recordings_are_of_the_known_detector_and_annotation():
    exact, annotated = (known_recording(4, annotated=each, draw=0) for each in (False, True))
    assert len(exact.recording.rig) == 4 == len(RIGS[4])
    assert exact.recording.kind == DETECTOR.kind
    assert (exact.annotation.deviation == 0).all()
    assert np.median(annotated.annotation.deviation) == pytest.approx(ANNOTATION.random, rel=0.2)
    assert truth_bones(exact.recording.truth).mean() < 0.004 < truth_bones(annotated.recording.truth).mean()
    for one, other in zip(exact.recording.detections, annotated.recording.detections, strict=True):
        np.testing.assert_array_equal(one.keypoints, other.keypoints)


def draw(fitted):
    values = {"true": 0.4, "fitted": fitted, "low": 0.39, "high": 0.5, "measured": 0.2, "n": 100, "prior": False}
    return {
        "cameras": 3,
        "annotated": True,
        "values": {"keypoints.scatter.hips": values, "keypoints.scatter.nose": {**values, "fitted": 99.0}},
        "annotation": {"deviation": [[[0.02] * 14], [[0.03] * 14]], "life": [0.5, 0.4], "noise": [0.2, 0.1]},
        "bones": [[0.02] * 8, [0.03] * 8],
        "truth bones": [[0.04] * 8, [0.02] * 8],
    }


def test_the_table_has_bias_and_coverage_of_limbs():
    lines = list(tables([draw(0.5), draw(0.7)]))
    (row,) = (line.split() for line in lines if line.startswith("keypoints.scatter"))
    assert row[1:] == ["0.400", "0.200", "0.600", "+0.2000", "0.2236", "100%", "0%", "0%"]
    assert any("forearm: 20.0 mm, of the twin 30.0, ratio 1.50" in line for line in lines)
    assert any("random part 20.0, fitted 30.0, bias +10.0" in line for line in lines)


@pytest.mark.parametrize(("low", "high", "expected"), [(0.3, 0.5, 1.0), (0.41, 0.5, 0.0)])
def test_inside(low, high, expected):
    assert inside({"true": 0.4, "fitted": 0.45, "low": low, "high": high}) == expected
    assert np.isnan(inside({"true": 0.4, "fitted": 0.45, "low": np.nan, "high": high}))


@pytest.mark.parametrize(("deviations", "expected"), [(1.6, 1.0), (1.7, 0.0)])
def test_inside_at_another_level(deviations, expected):
    """A 90 % interval reaches 1.645 deviations far; one of 95 % 1.96."""
    values = {
        "true": 0.4 * np.exp(0.3 * deviations),
        "fitted": 0.4,
        "low": 0.4 / np.exp(0.588),
        "high": 0.4 * np.exp(0.588),
    }
    assert inside(values, level=0.9) == expected
    assert inside(values) == 1.0


@pytest.mark.slow
def test_other_detectors_are_predicted_out_of_sample():
    header, row = out_of_sample(["poor"])
    name, fitted, _, _, shipped, *_ = row.split()
    assert "shipped" in header
    assert name == "poor"
    assert 0 < float(fitted) < 9
    assert 0 < float(shipped) < 9


def test_constants_of_the_sensitivity_are_those_of_the_inference():
    assert all(hasattr(inference, name) for name in CONSTANTS)
    assert _times({"a": (1.0, 2.0), "b": 3}, 2.0) == {"a": (2.0, 4.0), "b": 6.0}


def test_a_value_that_was_rounded_to_zero_has_an_interval():
    values = {"true": 0.0, "fitted": 0.0, "low": 1e-10, "high": 3e-7}
    assert inside(values, level=0.9) == 1.0
    assert inside({**values, "true": 1e-3}, level=0.9) == 0.0
