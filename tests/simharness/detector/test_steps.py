"""Registered steps: a new error of the detector is one function and one registration."""

from dataclasses import fields, replace

import numpy as np
import pytest
from worlds import world

from simharness.detector import steps
from simharness.detector.detect import detect
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.error_classes import MIRROR
from simharness.detector.steps import Context, StepStage, registered_steps, step
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.section import Section
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility


@pytest.fixture
def registry(monkeypatch):
    """The registry with all shipped steps; what a test adds is removed afterwards."""
    registered_steps()
    monkeypatch.setattr(steps, "REGISTRY", dict(steps.REGISTRY))
    return steps.REGISTRY


def run(where, *, seed=3, **sections):
    return detect(where.sequence, where.views, where.rig, DetectorSection.model_validate(sections), seed=seed)


def keypoints(frames):
    return np.concatenate([frame.detections.keypoints for frame in frames])


def test_steps_run_in_the_order_of_their_stages():
    names = [each.name for each in registered_steps()]
    shipped = ["keypoints", "scores", "people", "phantoms", "decoys", "crops", "delivery"]
    assert [name for name in names if name in shipped] == shipped
    stages = [each.stage for each in registered_steps()]
    assert stages == sorted(stages)


def test_the_order_does_not_depend_on_the_order_of_imports(registry):
    names = [each.name for each in registered_steps()]
    backwards = dict(reversed(registry.items()))
    registry.clear()
    registry.update(backwards)
    assert [each.name for each in registered_steps()] == names


def test_every_section_of_the_detector_is_read_by_a_step():
    sections = {name for name, value in DetectorSection() if isinstance(value, Section)}
    assert sections == {section for each in registered_steps() for section in each.sections}


def test_a_registered_step_acts_on_all_detections(registry):
    @step("quantisation", stage=StepStage.DETECTIONS)
    def quantise(block: DetectionBlock, context: Context) -> DetectionBlock:
        return replace(block, keypoints=np.round(block.keypoints))

    where, sections = world(frames=10), {"keypoints": {"scatter": 0.3}, "phantoms": {"rate": 1.0}}
    rounded = run(where, **sections)
    registry.pop("quantisation")
    plain = run(where, **sections)
    assert any((frame.truth.person < 0).any() for frame in plain)
    np.testing.assert_array_equal(keypoints(rounded), np.round(keypoints(plain)))


def test_a_step_that_draws_leaves_the_draws_of_all_others_alone(registry):
    """Every third person, about, is reported with left and right exchanged."""

    @step("mirrored people", stage=StepStage.KEYPOINTS)
    def mirror(block: DetectionBlock, context: Context) -> DetectionBlock:
        people = block.present.shape[2]
        flipped = context.draws.uniform("mirrored people", shape=(len(context.rig), people)) < 1 / 3
        exchanged = block.keypoints[..., MIRROR, :]
        error = np.where(np.arange(17) == MIRROR, block.error, np.int8(KeypointError.INVERSION))
        return replace(
            block,
            keypoints=np.where(flipped[..., None, None], exchanged, block.keypoints),
            error=np.where(flipped[..., None], error, block.error),
        )

    where, sections = world(frames=40), {"keypoints": {"scatter": 0.3}, "scores": {"inversion": 0.5}}
    changed = run(where, **sections)
    registry.pop("mirrored people")
    plain = run(where, **sections)
    flips = 0
    for after, before in zip(changed, plain, strict=True):
        for view in range(3):
            for person in range(2):
                row, old = (
                    np.flatnonzero((each.detections.view == view) & (each.truth.person == person))[0]
                    for each in (after, before)
                )
                got, expected = after.detections.keypoints[row], before.detections.keypoints[old]
                flipped = (after.truth.error[row] == KeypointError.INVERSION).any()
                flips += flipped
                np.testing.assert_array_equal(got, expected[MIRROR] if flipped else expected)
                # Scores come later, so they follow the error of the step.
                assert after.detections.scores[row, 5] == (0.5 if flipped else 1.0)
    assert 0.2 < flips / 240 < 0.5


def test_without_steps_detections_are_perfect(registry):
    registry.clear()
    seen = np.full((5, 3, 2, 17), Visibility.SELF_OCCLUDED)
    seen[..., 16] = Visibility.OUTSIDE
    where = world(frames=5, visibility=seen)
    context = Context(where.sequence, where.views, where.rig, DetectorSection(), None)
    block = DetectionBlock.of_people(where.views)
    for each in registered_steps():
        block = each.apply(block, context)
    assert block.present.all()
    np.testing.assert_array_equal(block.keypoints[..., :16, :], where.views.pixels[..., :16, :])
    assert np.isnan(block.keypoints[..., 16, :]).all()
    assert (block.scores == (np.arange(17) < 16)).all()
    assert ((block.error == KeypointError.ABSENT) == (np.arange(17) == 16)).all()


def test_steps_do_not_change_the_block_they_get():
    where = world(frames=20, together=True)
    sections = {
        "keypoints": {"scatter": 0.4, "miss": 0.1, "drop": {"visible": 0.1}},
        "scores": {"good": 0.8, "deviation": 0.3},
        "boxes": {"missed": 0.1, "merged": 0.3, "split": 0.2, "duplicates": 0.2, "jitter": 0.1},
        "phantoms": {"rate": 1.0},
        "heatmaps": {"size": "64x48"},
    }
    config = DetectorSection.model_validate(sections)
    context = Context(where.sequence, where.views, where.rig, config, steps.KeyedDraws(1, where.sequence.time, 3))
    block = DetectionBlock.of_people(where.views)
    for each in registered_steps():
        before = {field.name: getattr(block, field.name).copy() for field in fields(block)}
        after = each.apply(block, context)
        for name, values in before.items():
            np.testing.assert_array_equal(getattr(block, name), values, f"{each.name} changed {name}")
        block = after


def test_a_name_can_be_registered_once(registry):
    with pytest.raises(ValueError, match="detector step 'keypoints' is registered twice; choose another name"):
        step("keypoints", stage=StepStage.KEYPOINTS)


def test_an_unknown_section_is_refused_with_the_nearest_name():
    with pytest.raises(ValueError, match=r"'new': expected sections of \[detector\].*got 'phantom'; did you mean 'ph"):
        step("new", stage=StepStage.DETECTIONS, sections=("phantom",))
    assert "new" not in steps.REGISTRY
