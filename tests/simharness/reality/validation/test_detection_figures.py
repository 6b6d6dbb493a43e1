"""Measurements of detections, of recordings in which they are known."""

from dataclasses import replace

import numpy as np
import pytest
from turning_people import joints_of, walkers

from mvpose import Detections
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.recording_file import read_recording
from simharness.reality.validation.detection_figures import BONES, bone_variation, measure_detections, shown_people
from simharness.reality.validation.passes import annotated


def changed(recording, change):
    """The recording with ``change(view, points, scores)`` made in place to the detections of each frame."""
    frames = []
    for each in recording.detections:
        points, scores = each.keypoints.copy(), each.scores.copy()
        change(each.view, points, scores)
        frames.append(Detections.from_keypoints(each.view, points, scores))
    return replace(recording, detections=tuple(frames))


@pytest.fixture(scope="module")
def exact():
    return walkers(frames=10, people=2, cameras=4)


def test_exact_detections_triangulate_to_the_truth(exact):
    shown = shown_people(exact)
    np.testing.assert_allclose(shown.triangulated, joints_of(10, 2), atol=1e-6)
    assert shown.association.detected.all()


def test_exact_detections_have_nothing_missing(exact):
    values = measure_detections(exact).values()
    assert values["detected"] == 1.0
    assert values["phantoms"] == values["ears"] == values["affinity.same"] == 0.0
    assert all(values[key] == 0.0 for key in values if key.startswith("missing."))
    assert np.isnan(values["tree.wrist|elbow"])
    assert all(values[f"bones.{bone}"] < 1e-3 for bone in BONES)
    assert values["score.q50"] == pytest.approx(0.9)


def test_missing_children_of_missing_parents_are_counted(exact):
    def drop(view, points, scores):
        scores[:, 7] = 0.0  # every left elbow
        scores[view == 1, 9] = 0.0  # left wrists of one of four views
        scores[:, 14] = 0.0  # right knees, with their ankles
        scores[:, 16] = 0.0

    values = measure_detections(changed(exact, drop)).values()
    assert values["tree.wrist|elbow"] == pytest.approx(1 / 4)
    assert values["tree.ankle|knee"] == 1.0
    assert values["missing.elbows"] == pytest.approx(1 / 2)
    assert values["missing.wrists"] == pytest.approx(1 / 8)


def test_ears_of_one_view_are_ears_in_fewer_than_two(exact):
    def hide(view, points, scores):
        scores[view > 0, 3] = 0.0  # left ears are reported by one view, right ears by all

    assert measure_detections(changed(exact, hide)).values()["ears"] == pytest.approx(1 / 2)


def test_one_view_without_a_person_counts_as_not_detected(exact):
    frames = [replace(each, scores=np.where((each.view == 2)[:, None], 0.0, each.scores)) for each in exact.detections]
    assert measure_detections(replace(exact, detections=tuple(frames))).values()["detected"] == pytest.approx(3 / 4)


def test_people_at_one_place_are_ambiguous(exact):
    apart = measure_detections(exact).values()["affinity.different"]
    joints = joints_of(10, 2)
    joints[:, 1] = joints[:, 0] + [0.05, 0.05, 0.0]
    frames = []
    for of_frame in joints:
        pixels = exact.rig.project(of_frame)
        view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
        frames.append(Detections.from_keypoints(view, pixels[view, person], np.full((len(view), 17), 0.9)))
    near = replace(exact, truth=coco17_to_shelf14(joints), detections=tuple(frames))
    assert apart < 0.05
    assert measure_detections(near).values()["affinity.different"] == 1.0


def test_only_another_person_hides_joints():
    shown = shown_people(walkers(frames=4, people=2, cameras=4))
    assert shown.behind.any()
    assert not (shown.behind & ~shown.inside).any()
    assert measure_detections(walkers(frames=4, people=1, cameras=4)).values()["behind"] == 0.0


class TestBones:
    def test_normal_noise_has_its_standard_deviation(self):
        lengths = 400 + np.random.default_rng(0).normal(scale=[10.0, 20.0, 30.0, 5.0], size=(4000, 3, 2, 4))
        np.testing.assert_allclose(bone_variation(lengths), [10.0, 20.0, 30.0, 5.0], rtol=0.05)

    def test_people_of_other_sizes_do_not_vary(self):
        lengths = np.broadcast_to(np.arange(1.0, 7.0).reshape(1, 3, 2, 1) * 100, (50, 3, 2, 4))
        np.testing.assert_array_equal(bone_variation(lengths), 0.0)

    def test_gross_errors_of_a_few_frames_hardly_count(self):
        lengths = 400 + np.random.default_rng(0).normal(scale=10.0, size=(1000, 1, 2, 4))
        lengths[:50] += 500.0
        np.testing.assert_allclose(bone_variation(lengths), 10.0, rtol=0.15)

    def test_people_who_are_never_seen_are_left_out(self):
        lengths = 400 + np.random.default_rng(0).normal(scale=10.0, size=(1000, 2, 2, 4))
        lengths[:, 1] = np.nan
        np.testing.assert_array_equal(bone_variation(lengths), bone_variation(lengths[:, :1]))
        assert np.isnan(bone_variation(np.full((5, 2, 2, 4), np.nan))).all()


@pytest.mark.slow
def test_shelf_has_the_measured_facts(shared_data):
    """Shelf's detections: bottom-up tree, ears, bones and ambiguity, as measured independently."""
    values = measure_detections(annotated(read_recording("shelf", shared_data / "shelf"))).values()
    assert all(values[key] == 1.0 for key in values if key.startswith("tree."))
    bones = [values[f"bones.{bone}"] for bone in BONES]
    assert bones == pytest.approx([17, 14, 24, 9], abs=0.6)
    assert [values[f"true_bones.{bone}"] for bone in BONES] == pytest.approx([21, 22, 30, 21], abs=0.6)
    assert values["ears"] == pytest.approx(0.006, abs=0.002)
    assert values["behind"] == pytest.approx(0.086, abs=0.01)
    assert values["affinity.different"] == pytest.approx(0.21, abs=0.02)
