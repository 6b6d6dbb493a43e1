import io
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rich.console import Console

from simharness.reality.annotation_errors import AnnotationModel
from simharness.reality.detector_fit.annotation_fit import AnnotationFit
from simharness.reality.detector_fit.detector_measurement import MeasuredValue, measure_detector
from simharness.reality.detector_fit.fit_table import (
    plot_comparison,
    print_agreement,
    print_annotation,
    print_measurement,
)
from simharness.scenario.sections.detector_section import KINDS


@pytest.fixture(scope="module")
def measured(filmed):
    return measure_detector(filmed.sample(keypoints={"scatter": 0.3, "miss": 0.1}), resamples=50)


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
    assert nose.count("–") == 7  # six intervals, and inversions, which are unknown
    assert "-0 " not in text


def test_tables_fit_80_columns_without_cut_cells(measured):
    console = Console(file=io.StringIO(), width=80)
    print_measurement(measured, console)
    text = console.file.getvalue()
    assert "…" not in text
    row = next(line.split() for line in text.splitlines() if line.startswith("wrists"))
    share = measured["share.miss.wrists"]
    assert row[5] == f"{100 * share.value:.1f}"  # after the joint, n, drops, swaps and inversions
    assert max(map(len, text.splitlines())) <= 80


def test_differing_parameters_are_listed(measured):
    other = replace(measured, values={**measured.values, "boxes.missed": MeasuredValue(0.9, 0.8, 1.0, 10)})
    assert "parameters agree" in printed(print_agreement, measured, measured)
    assert "boxes.missed" not in printed(print_agreement, measured, measured)
    assert "boxes.missed" in printed(print_agreement, measured, other)


def test_unknown_values_are_null_in_json(measured):
    summary = json.loads(json.dumps(measured.summary(), allow_nan=False))
    assert summary["figures"]["keypoints.inversion.nose"]["value"] is None  # it has no counterpart
    miss = summary["figures"]["keypoints.miss.knees"]
    assert miss["low"] <= miss["value"] <= miss["high"]
    assert summary["frames"] == 200


@pytest.mark.slow
def test_the_plot_shows_both(measured, tmp_path):
    plot_comparison([measured, replace(measured, name="another")], tmp_path / "both.png")
    picture = cv2.imread(str(tmp_path / "both.png")).astype(int)
    for blue_green_red in ([196, 130, 59], [58, 100, 217]):
        assert (np.abs(picture - blue_green_red).max(axis=-1) < 10).sum() > 500
    with pytest.raises(ValueError, match=r"--figure .*cannot be written"):
        plot_comparison([measured], tmp_path / "nowhere" / "c.png")


def test_the_annotation_is_printed_by_actor_in_millimetres():
    shift = np.zeros((2, 14, 3))
    shift[1, :, 2] = 0.03
    bias = np.zeros((9, 3))
    bias[KINDS.index("hips")] = 0.0, 0.01, 0.045
    annotation = AnnotationModel(shift, np.full((2, 14), 0.02), 0.5, 0.3)
    text = printed(print_annotation, AnnotationFit(annotation, bias, np.full((2, 14), 100.0)))
    rows = [line.split() for line in text.splitlines()]
    assert ["0", "0", "20"] in rows
    assert ["1", "30", "20"] in rows
    assert "memory of 0.5 s" in text
    assert "hips 45 mm up" in text


def test_joints_of_the_face_are_printed_by_bearing(measured):
    values = {f"keypoints.face.ears.{index}": MeasuredValue(index / 100, 0, 1, 10) for index in range(24)}
    text = printed(print_measurement, replace(measured, values={**measured.values, **values}))
    by_bearing = text[text.index("by bearing") :].splitlines()
    ears = next(line.split() for line in by_bearing if line.startswith("ears"))
    assert ears == ["ears", *map(str, range(0, 24, 2))]
