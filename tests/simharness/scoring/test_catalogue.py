import pytest

from mvpose import COCO17
from simharness.scoring.catalogue import AP_MM, HEADLINE, PCK_MM, SCORES
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.joint_errors import SHARE
from simharness.scoring.pcp import GROUPS


def test_every_score_is_described():
    for key, info in SCORES.items():
        assert info.key == key
        assert info.title
        assert 10 < len(info.about) < 120, key
        assert info.better in ("higher", "lower")
        assert 0 <= info.digits <= 3
    titles = [info.title for info in SCORES.values()]
    assert len(set(titles)) == len(titles)


def test_keys_end_in_the_unit():
    for key, info in SCORES.items():
        assert key.endswith("_mm") == (info.unit == "mm"), key
        assert key.endswith("_ms") == (info.unit == "ms"), key
        assert key.endswith("_px") == (info.unit == "px"), key


@pytest.mark.parametrize("unit", ["%", "mm", "mm/s", "px", "ms", "per frame", "/min"])
def test_scores_that_are_read_beside_each_other_have_as_many_digits(unit):
    (_,) = {info.digits for info in SCORES.values() if info.unit == unit}


def test_higher_is_better_for_percentages_alone():
    low_shares = {"phantoms_admitted", "blame_detection", "blame_matching", "blame_reconstruction", "blame_method"}
    for key, info in SCORES.items():
        assert (info.better == "higher") == (info.unit == "%" and key not in low_shares), key


def test_the_headline_is_among_the_scores():
    assert set(HEADLINE) < set(SCORES)


def test_every_class_of_failures_has_a_score():
    kinds = [key.removeprefix("failures_") for key in SCORES if key.startswith("failures_")]
    assert kinds == [kind.value for kind in FailureKind]


def test_every_limit_has_a_score():
    assert [key for key in SCORES if key.startswith("ap")] == [f"ap{limit}" for limit in AP_MM]
    assert {f"pck{limit}" for limit in PCK_MM} < set(SCORES)
    assert all(f"{limit} mm" in SCORES[f"ap{limit}"].about for limit in AP_MM)
    assert all(f"{limit} mm" in SCORES[f"pck{limit}"].about for limit in PCK_MM)
    assert SCORES["coverage_90"].target == 100.0 * SHARE


def test_groups_and_joints_have_scores_in_their_order():
    assert [key for key in SCORES if key.startswith("pcp_")][: len(GROUPS)] == [f"pcp_{group}" for group in GROUPS]
    joints = [key for key in SCORES if key.startswith("mpjpe_") and "median" not in key and "tracked" not in key]
    assert joints == ["mpjpe_mm", *(f"mpjpe_{joint}_mm" for joint in COCO17.joints)]
