"""Page of a run: its arithmetic, and its safety against markup in a scenario."""

import re
from copy import deepcopy

import numpy as np
import pytest

from mvpose import Detections, Estimate, Matching
from simharness.outputs.run.headline import scored_columns
from simharness.outputs.run.page import joint_errors, person_errors, render
from simharness.outputs.run.result_folder import score_table
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import score_variant
from simharness.scoring.score_summary import summarize
from simharness.trial.run_folder import Record
from simharness.types.recording import Recording
from simharness.types.truth import Truth
from simharness.world.rigs.layouts import build_rig

FRAMES = 4


def make_record(*, people: int = 3, lost: bool = True, absent: int | None = None, **scenario) -> Record:
    """Return a run with estimates in another order than the people, person p with an error of (p + 1) cm.

    Person 0 is missed in frame 2 unless ``lost`` is false; person ``absent`` is there in the first frame alone.
    """
    rng = np.random.default_rng(0)
    rig = build_rig(CamerasSection(count=2))
    truth, estimates, detections = [], [], []
    for frame in range(FRAMES):
        joints = rng.uniform(-0.2, 0.2, (people, 17, 3)) + [1.0, 0, 1.0] * np.arange(people)[:, None, None]
        found = [p for p in reversed(range(people)) if not (lost and frame == 2 and p == 0)]
        if absent is not None and frame:
            joints[absent] = np.nan
            found.remove(absent)
        offset = np.zeros((people, 1, 3))
        offset[:, 0, 1] = 0.01 * (np.arange(people) + 1)
        pixels = rig.project(joints)
        detections.append(Detections.empty())
        truth.append(
            Truth(
                joints=joints,
                pixels=pixels,
                visibility=np.zeros(pixels.shape[:3], np.int8),
                boxes=np.zeros((2, people, 4)),
                person=np.zeros(0, np.int64),
                error=np.zeros((0, 17), np.int8),
            )
        )
        answer = (joints + offset)[found].reshape(-1, 17, 3)
        estimates.append(Estimate(answer, np.ones(answer.shape[:2]), Matching(np.zeros(0, np.int64))))
    time = np.arange(FRAMES) / 10
    scores = {"full": score_variant(Recording(time, rig, tuple(detections), tuple(truth)), estimates)}
    settings = Scenario(name="made", people=PeopleSection(count=people), **scenario)
    return Record(
        scenario=settings,
        rig=rig,
        time=time,
        detections=tuple(detections),
        truth=tuple(truth),
        estimates={"full": tuple(estimates)},
        scores=score_table(scores),
        summary=summarize("made", scores, frames=FRAMES, seeds=1, seed=0, fingerprint="0" * 10),
    )


def test_errors_are_those_of_the_right_person():
    expected = np.tile([10.0, 20.0, 30.0], (FRAMES, 1))
    expected[2, 0] = np.nan
    record = make_record()
    np.testing.assert_allclose(person_errors(record.scores, "full"), expected, atol=1e-9)
    np.testing.assert_allclose(joint_errors(record, "full"), np.repeat(expected, 17), atol=1e-9)


@pytest.mark.parametrize("people", [0, 1])
def test_a_page_of_few_people(people):
    page = render(make_record(people=people, lost=False))
    assert page.startswith("<!doctype html>")
    assert page.count("<svg") == (5 if people else 2)
    assert "nan" not in page.lower().replace("nanum", "")


def test_the_numbers_of_the_page_are_those_of_the_summary():
    page = render(make_record())
    assert "91.7" in page  # recall: 11 of 12
    assert "0.250" in page  # missed a frame
    assert "75.0" in page  # person 0 was found in 3 of 4 frames


@pytest.mark.slow
def test_every_score_that_a_variant_has_is_on_the_page():
    record = make_record()
    one, other = deepcopy(record.summary["variants"]["full"]), {"scores": {"jitter_mm": 0.5}}
    one["scores"] = {"pcp": 12.34, "jitter_mm": None, "ankle": 1.0}
    columns = scored_columns({"variants": {"full": one, "other": other}})
    assert [column.title for column in columns] == ["PCP", "Jitter"]  # keys of no known score are left out
    assert [[column.number(scores) for column in columns] for scores in (one, other)] == [["12.3", "–"], ["–", "0.5"]]
    record.summary["variants"]["full"] = one
    assert '<th scope="row">PCP, %</th><td>12.3</td><td class="words">correct body parts' in render(record)
    assert "All scores" not in render(make_record())


@pytest.mark.slow
def test_nobody_misses_people_who_are_absent():
    record = make_record(absent=1)
    assert np.isnan(joint_errors(record, "full")).sum() == 17  # those of person 0 in frame 2
    assert len(joint_errors(record, "full")) == 17 * (FRAMES * 3 - 3)
    found = dict(re.findall(r"</span>(person \d)</th><td>[^<]*</td><td>([^<]*)</td>", render(record)))
    assert found == {"person 0": "75.0", "person 1": "100.0", "person 2": "100.0"}


def test_text_of_the_user_is_escaped():
    page = render(make_record(description="<script>alert(1)</script> & more"))
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_objects_of_kinds_and_of_files_are_counted():
    clutter = {"boxes": 2, "objects": ("sofa.obj",)}
    page = render(make_record(clutter=clutter, decoys={"posters": 1}))
    assert "<dt>objects</dt><dd>4</dd>" in page
