import io
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rich.console import Console

from simharness.reality.detector_fit.measure import MeasuredValue, measure
from simharness.reality.detector_fit.plot import plot_comparison
from simharness.reality.detector_fit.table import print_agreement, print_measurement
from simharness.scenario.sections.detector import KINDS, Detector


@pytest.fixture(scope="module")
def measured(twin):
    config = Detector.model_validate({"keypoints": {"scatter": 0.3, "miss": 0.1}})
    return measure(twin.detected(config), resamples=50)


def printed(show, *given):
    console = Console(file=io.StringIO(), width=160)
    show(*given, console)
    return console.file.getvalue()


def test_the_table_has_every_kind_of_joint_with_its_interval(measured):
    text = printed(print_measurement, measured)
    classes = text[: text.index("Not reported")]
    value = measured["share.miss.wrists"]
    for kind in KINDS:
        assert sum(line.startswith(kind) for line in classes.splitlines()) == 1
    row = next(line for line in classes.splitlines() if line.startswith("wrists"))
    assert f"{100 * value.value:.1f}  {100 * value.low:.1f}–{100 * value.high:.1f}" in row
    nose = next(line for line in classes.splitlines() if line.startswith("nose"))
    assert nose.count("–") == 6  # the interval of drops, and five unknown values
    assert "-0 " not in text


def test_differing_parameters_are_listed(measured):
    other = replace(measured, values={**measured.values, "boxes.missed": MeasuredValue(0.9, 0.8, 1.0, 10)})
    assert "parameters agree" in printed(print_agreement, measured, measured)
    assert "boxes.missed" not in printed(print_agreement, measured, measured)
    assert "boxes.missed" in printed(print_agreement, measured, other)


def test_unknown_values_are_null_in_json(measured):
    summary = json.loads(json.dumps(measured.summary(), allow_nan=False))
    assert summary["figures"]["keypoints.miss.nose"]["value"] is None
    miss = summary["figures"]["keypoints.miss.knees"]
    assert miss["low"] <= miss["value"] <= miss["high"]
    assert summary["frames"] == 300


def test_the_plot_shows_both(measured, tmp_path):
    plot_comparison([measured, replace(measured, name="another")], tmp_path / "a.png")
    plot_comparison([measured], tmp_path / "b.png")
    one, both = (cv2.imread(str(tmp_path / name)).astype(int) for name in ("b.png", "a.png"))
    orange = [int((np.abs(image - [58, 100, 217]).max(axis=-1) < 10).sum()) for image in (one, both)]
    assert orange[0] == 0
    assert orange[1] > 500
    with pytest.raises(ValueError, match=r"--figure .*cannot be written"):
        plot_comparison([measured], tmp_path / "nowhere" / "c.png")
