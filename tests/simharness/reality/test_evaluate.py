import io
import json

import numpy as np
import pytest
from rich.console import Console

from mvpose import COCO17, Camera, Detections, Estimate, Matching, Pipeline, Rig
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.evaluation import evaluate, print_evaluation
from simharness.reality.shelf import Shelf, read_shelf

# fmt: off
PERSON = np.array([
    [.1, 0, 1.6], [.08, .03, 1.64], [.08, -.03, 1.64], [0, .07, 1.62], [0, -.07, 1.62],
    [0, .2, 1.4], [0, -.2, 1.4], [0, .25, 1.1], [0, -.25, 1.1], [0, .25, .85], [0, -.25, .85],
    [0, .1, .95], [0, -.1, .95], [0, .1, .5], [0, -.1, .5], [0, .1, .08], [0, -.1, .08],
])
# fmt: on


class Fixed:
    """A method that answers the same people whatever it sees."""

    def __init__(self, people):
        self.people = np.asarray(people, float).reshape(-1, 17, 3)
        self.calls = 0

    def estimate(self, rig, detections):
        self.calls += 1
        timings = {"affinity": 0.001, "matching": 0.002, "reconstruction": 0.003, "total": 0.006}
        return Estimate(self.people, np.ones(self.people.shape[:2]), Matching(np.zeros(0)), timings=timings)


def small_shelf(head):
    """Three frames without detections: actors 1 and 2, then actor 1, then nobody annotated."""
    K, R = np.diag([500.0, 500.0, 1.0]), np.eye(3)
    rig = Rig([Camera(K, R, np.array([x, 0.0, 5.0]), size=(640, 480)) for x in (0.0, 1.0)])
    truth = np.full((3, 4, 14, 3), np.nan)
    truth[:2, 0] = coco17_to_shelf14(PERSON, head=head)
    truth[0, 1] = coco17_to_shelf14(PERSON + np.array([2, 0, 0]), head=head)
    return Shelf(rig, truth, (Detections.empty(COCO17),) * 3, np.arange(3))


@pytest.mark.parametrize("head", ["voxelpose", "2019"])
def test_scores_are_those_of_the_truth_that_is_there(head):
    methods = {"one": Fixed(PERSON), "both": Fixed([PERSON, PERSON + np.array([2, 0, 0])]), "none": Fixed([])}
    seen = []
    evaluation = evaluate(
        small_shelf(head), methods, head=head, progress=lambda done, total: seen.append((done, total))
    )
    assert seen == [(k, 9) for k in range(1, 10)]
    assert all(method.calls == 4 for method in methods.values())  # once more, to warm up
    summary = json.loads(json.dumps(evaluation.summary(), allow_nan=False))
    assert (summary["name"], summary["head"], summary["frames"], summary["frames_annotated"]) == (
        "shelf",
        head,
        3,
        2,
    )
    one, both, none = (summary["variants"][name] for name in methods)
    assert one["pcp_actors"] == [100.0, 0.0, None]
    assert (one["pcp"], one["precision"], one["recall"]) == (50.0, 1.0, 2 / 3)
    assert both["pcp_actors"] == [100.0, 100.0, None]
    # The frame that nobody annotated is not held against the method; the other one is.
    assert (both["precision"], both["recall"], both["ghosts_per_frame"]) == (0.75, 1.0, 0.5)
    assert both["mpjpe_mm"]["mean"] == pytest.approx(0, abs=1e-9)
    assert both["timings_ms"]["total"] == pytest.approx({"median": 6.0, "p99": 6.0})
    assert (none["pcp"], none["precision"], none["recall"]) == (0.0, None, 0.0)


def test_the_wrong_head_shows():
    evaluation = evaluate(small_shelf("2019"), {"one": Fixed(PERSON)}, head="voxelpose")
    assert evaluation.summary()["variants"]["one"]["mpjpe_mm"]["mean"] > 1


def test_bad_arguments():
    with pytest.raises(ValueError, match="'voxelpose' or '2019', got '2020'"):
        evaluate(small_shelf("2019"), {"one": Fixed(PERSON)}, head="2020")


def printed(evaluation):
    stream = io.StringIO()
    print_evaluation(evaluation, Console(file=stream, width=100))
    return stream.getvalue()


def test_the_print_names_the_head_and_the_paper_and_fits():
    text = printed(evaluate(small_shelf("2019"), {"full": Fixed(PERSON), "mine": Fixed([])}, head="2019"))
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    assert "head mapping 2019" in lines[0]
    rows = [line.split() for line in lines]
    assert ["1", *["100.0"] * 7, "98.8"] in rows
    assert ["2", *["0.0"] * 7, "94.1"] in rows
    assert ["3", *["–"] * 7, "97.8"] in rows
    assert ["average", *["50.0"] * 7, "96.9"] in rows
    assert ["average", *["0.0"] * 7] in rows  # no published number for a method of another name
    assert ["full", "100.0", "66.7", "0.00", "0.50", "0.0", "0.0", "0"] in rows
    assert ["mine", "–", "0.0", "0.00", "1.50", "–", "–", "0"] in rows
    assert ["full", "1.00", "(1.00)", "2.00", "(2.00)", "3.00", "(3.00)", "6.00", "(6.00)"] in rows


def test_variants_stand_in_one_table_with_the_papers_rows():
    text = printed(evaluate(small_shelf("2019"), {"no-matching": Fixed(PERSON), "mine": Fixed([])}, head="2019"))
    rows = [line.split() for line in text.splitlines()]
    first = rows.index(["no-matching", "100.0", "0.0", "–", "50.0"])
    assert rows[first + 1 : first + 3] == [
        ["paper", "98.1", "91.1", "92.8", "94.0"],
        ["mine", "0.0", "0.0", "–", "0.0"],
    ]


def test_detections_of_one_view_in_one_person_are_counted():
    class Mixed(Fixed):
        def estimate(self, rig, detections):
            answer = super().estimate(rig, detections)
            return Estimate(answer.joints, answer.scores, Matching([0, 0, 0, -1, -1]), timings=answer.timings)

    shelf = small_shelf("2019")
    seen = Detections.from_keypoints([0, 1, 1, 1, 1], np.ones((5, 17, 2)), np.ones((5, 17)))
    shelf = Shelf(shelf.rig, shelf.truth, (seen,) * 3, shelf.frames)
    evaluation = evaluate(shelf, {"mixed": Mixed(PERSON)}, head="2019")
    assert evaluation.summary()["variants"]["mixed"]["same_view_violations"] == 3  # one a frame


@pytest.mark.slow
def test_shelf_reaches_the_goal_with_geometry_alone(shared_data):
    """97.2 is what an oracle gets that knows every correspondence; the paper's full method reports 96.9."""
    methods = {name: Pipeline.preset(name) for name in ("full", "fast")}
    variants = evaluate(read_shelf(shared_data / "shelf"), methods).summary()["variants"]
    for name, scores in variants.items():
        assert scores["pcp"] >= 97.0, name
        assert scores["recall"] >= 0.99, name
        assert scores["mpjpe_mm"]["median"] < 48, name
        assert scores["same_view_violations"] == 0, name
    assert variants["full"]["pcp"] >= 97.2
