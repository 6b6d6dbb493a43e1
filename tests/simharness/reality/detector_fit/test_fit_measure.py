"""Detectors with known parameters are measured: every value is recovered, and none is invented."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from filmed_people import narrowed

from mvpose import Detections
from simharness.detector.draws import PARENT
from simharness.detector.viewing_conditions import head_bearings
from simharness.reality.detector_fit.detector_measurement import (
    MeasuredValue,
    agreement,
    measure_detector,
    point_estimates,
)
from simharness.reality.detector_fit.frame_sums import frame_sums
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.profile import as_toml, settings
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS, DetectorSection

pytestmark = pytest.mark.slow

LIMB_KINDS = KINDS[3:]
EARS = [0.3, 0.1, 0.05, 0.05, 0.05, 0.08, 0.1, 0.6, 0.95, 0.97, 0.97, 0.8]
NOSE = [0.02, 0.02, 0.05, 0.05, 0.1, 0.3, 0.9, 0.3, 0.1, 0.05, 0.05, 0.02]

DROPPING = {
    "kind": "bottom-up",
    "keypoints": {
        "scatter": 0.3,
        "scatter_hidden": 1.5,
        "drop": {"visible": 0.03, "self_occluded": 0.1, "occluded": 0.3},
        "face": {"nose": NOSE, "eyes": NOSE, "ears": EARS},
    },
    "correlation": {"scatter_life": 0.3, "scatter_noise": 0.4, "scatter_near": 0.5},
    "boxes": {"missed": 0.05, "missed_hidden": [0.0, 0.1, 0.3, 0.5, 0.9], "duplicates": 0.1},
    "phantoms": {"rate": 0.4, "score": 0.6, "deviation": 0.5},
}
"""Joints and people that are not reported."""

ERRING = {
    "kind": "bottom-up",
    "keypoints": {
        "scatter": 0.3, "jitter": 0.05, "miss": 0.04, "inversion": 0.03, "swap": 0.06,
        "self_occluded": 1.5, "occluded": 2.0,
    },
    "scores": {
        "good": 0.85, "jitter": 0.7, "miss": 0.3, "inversion": 0.6, "swap": 0.5, "hidden": 0.8,
        "deviation": 0.3, "overconfident": 0.2, "underconfident": 0.05,
    },
}  # fmt: skip
"""Joints that are wrong."""

GUESSING = {
    "kind": "top-down",
    "keypoints": {"scatter": 0.3, "guess": {"self_occluded": 0.1, "occluded": 0.5, "outside": 0.6, "scatter": 1.0}},
    "scores": {"good": 0.85, "deviation": 0.3, "guess": 0.3, "outside": 0.6},
}
"""Joints that a top-down detector guesses."""

BY_KIND = {
    "kind": "bottom-up",
    "keypoints": {
        "scatter": 0.3, "jitter": 0.05, "jitter_mean": {"hips": 0.2, "shoulders": 0.2},
        "self_occluded": {"wrists": 5.0, "elbows": 5.0}, "scatter_hidden": {"hips": 2.0, "shoulders": 2.0},
    },
}  # fmt: skip
"""Hidden joints whose errors differ with the kind of joint."""

LASTING = {
    "keypoints": {"scatter": 0.3, "miss": 0.05, "drop": {"visible": 0.1, "self_occluded": 0.1, "occluded": 0.1}},
    "correlation": {"life": 0.2, "views": 0.3, "gross_views": 0.4, "limb": 0.4, "scatter_life": 0.3},
    "boxes": {"missed": 0.2, "missed_views": 0.4, "life": 0.2},
    "phantoms": {"rate": 0.3, "life": 0.4},
}
"""Errors that last, and that views and joints share."""


@pytest.fixture(scope="module")
def dropping(filmed):
    return measure_detector(filmed.sample(**DROPPING), resamples=100)


@pytest.fixture(scope="module")
def erring(filmed):
    return measure_detector(filmed.sample(**ERRING), resamples=100)


@pytest.fixture(scope="module")
def lasting(filmed):
    return measure_detector(filmed.sample(**LASTING), resamples=100)


def mean(measurement, key, kinds=LIMB_KINDS):
    return np.mean([measurement[f"{key}.{kind}"].value for kind in kinds])


def part(sample, frames):
    """Return the first frames of a sample."""
    return replace(
        sample,
        time=sample.time[:frames],
        reference=sample.reference[:frames],
        detections=sample.detections[:frames],
        measured=None if sample.measured is None else sample.measured[:frames],
    )


class TestDrops:
    @pytest.mark.parametrize(
        ("occlusion", "expected", "within"),
        [("visible", 0.03, 0.008), ("self_occluded", 0.1, 0.02), ("occluded", 0.3, 0.05)],
    )
    def test_shares_by_occlusion(self, dropping, occlusion, expected, within):
        """Of joints whose parent is reported, at capsules instead of bodies."""
        assert mean(dropping, f"keypoints.drop.{occlusion}") == pytest.approx(expected, abs=within)
        values = [dropping[f"keypoints.drop.{occlusion}.{kind}"] for kind in LIMB_KINDS]
        slack = 0.1 * expected  # visibility from capsules is no better
        assert sum(each.low - slack <= expected <= each.high + slack for each in values) >= 5  # of 6, at 95 %

    @pytest.mark.slow
    def test_shares_of_staged_bodies(self, filmed):
        """Where bodies show what hides what, shares of all limb joints together are exact."""
        sample = filmed.sample(staged=True, **DROPPING)
        found = frame_sums(label_joints(sample))
        for index, expected in enumerate((0.03, 0.1, 0.3)):
            n, k = (each[:, index, 3:].sum() for each in found.classes["drop"])
            assert k / n == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / n))

    @pytest.mark.slow
    @pytest.mark.parametrize("factors", [(0.25, 0.5), (0.9, 0.1)])
    def test_factors_of_joints_at_edges(self, filmed, factors):
        """Also where the shares of kinds of joint differ: elbows are hidden at edges more often than others."""
        names, kinds = ("self_occluded", "occluded"), {**dict.fromkeys(KINDS, 0.2), "elbows": 0.7, "wrists": 0.5}
        drop = {"self_occluded": kinds, "occluded": kinds, "edge": dict(zip(names, factors, strict=True))}
        found = point_estimates(filmed.sample(staged=True, keypoints={"drop": drop}))
        for name, factor in zip(names, factors, strict=True):
            assert found[f"keypoints.drop.edge.{name}"] == pytest.approx(factor, abs=0.06), name
            for kind in LIMB_KINDS:
                share = found[f"keypoints.drop.{name}.{kind}"]
                assert share == pytest.approx(kinds[kind], abs=0.04), (name, kind)

    @pytest.mark.slow
    @pytest.mark.parametrize(("growth", "within"), [(0.0, 1.0), (5.0, 1.5), (14.0, 2.0), (30.0, 6.0)])
    def test_growth_of_drops_with_depth(self, filmed, growth, within):
        drop = {"self_occluded": {**dict.fromkeys(KINDS, 0.2), "elbows": 0.4}, "depth": growth}
        found = point_estimates(filmed.sample(staged=True, keypoints={"drop": drop}))["keypoints.drop.depth"]
        assert found == pytest.approx(growth, abs=within)

    @pytest.mark.slow
    @pytest.mark.parametrize("error", ["inversion", "swap"])
    @pytest.mark.parametrize("factor", [0.1, 0.5])
    def test_factors_of_joints_that_nothing_else_hides(self, filmed, error, factor):
        """Also where the shares of kinds of joint differ: some kinds are hidden more often than others."""
        shares = {**dict.fromkeys(KINDS, 0.1), "wrists": 0.2}
        found = point_estimates(filmed.sample(staged=True, keypoints={error: shares, f"{error}_uncovered": factor}))
        assert found[f"keypoints.{error}_uncovered"] == pytest.approx(factor, abs=0.1)
        assert found[f"keypoints.{error}.wrists"] == pytest.approx(0.2, abs=0.04)

    def test_few_drops_say_nothing_about_edges(self, filmed):
        measured = measure_detector(part(filmed.sample(keypoints={"drop": {"self_occluded": 0.01}}), 20), resamples=5)
        assert not measured["keypoints.drop.edge.self_occluded"].known
        assert "edge" not in settings(measured, name="few")["keypoints"]["drop"]

    @pytest.mark.slow
    def test_joints_below_a_missing_one_do_not_count(self, filmed):
        """The same detections as of a top-down detector: wrists also fall with their elbows and shoulders."""
        sample = part(filmed.sample(**DROPPING), 80)
        tree, flat = (point_estimates(replace(sample, kind=kind)) for kind in ("bottom-up", "top-down"))
        for leaf, root in (("wrists", "shoulders"), ("ankles", "hips")):
            key = "keypoints.drop.visible"
            assert flat[f"{key}.{leaf}"] > tree[f"{key}.{leaf}"] + 0.02
            assert flat[f"{key}.{root}"] == tree[f"{key}.{root}"]

    def test_joints_at_risk_of_a_drop_have_a_parent(self, filmed):
        labels = label_joints(part(filmed.sample(**DROPPING), 20))
        reported = labels.association.scores > 0
        for joint, parent in ((j, PARENT[j]) for j in np.flatnonzero(PARENT >= 0)):
            assert not (labels.risk["drop"][..., joint] & ~reported[..., parent]).any()
            assert not (reported[..., joint] & ~reported[..., parent]).any()  # the simulated tree

    @pytest.mark.parametrize(("kind", "given", "joint", "side"), [("ears", EARS, 3, 1), ("nose", NOSE, 0, 1)])
    def test_shares_of_the_face_by_bearing(self, filmed, dropping, kind, given, joint, side):
        """Each is the mean of the given curve over the bearings of its bin."""
        bearing = side * np.degrees(head_bearings(filmed.sequence.joints, filmed.rig)) % 360
        curve = np.interp(bearing, np.arange(0, 361, 30), [*given, given[0]])
        bins = np.round(bearing / 15).astype(int) % 24
        expected = np.array([curve[bins == index].mean() for index in range(24)])
        found = np.array([dropping[f"keypoints.face.{kind}.{index}"].value for index in range(24)])
        assert np.abs(found - expected).mean() < 0.06
        assert np.abs(found - expected).max() < 0.2  # bearings of heads seen from behind are not exact
        assert np.corrcoef(found, expected)[0, 1] > 0.95
        assert joint in (0, 3)

    def test_people_hidden_by_others_are_missed(self, dropping):
        found = np.array([dropping[f"boxes.missed_hidden.{index}"].value for index in range(5)])
        np.testing.assert_allclose(found[:4], [0.0, 0.1, 0.3, 0.5], atol=0.15)
        assert (np.diff(found) > 0).all()
        assert dropping["boxes.missed"].value == pytest.approx(0.05, abs=0.015)

    @pytest.mark.slow
    def test_joints_beyond_the_border(self, filmed):
        """The detector reports joints up to 2 units beyond the border: nobody knows without the views beside."""
        narrow = narrowed(filmed, width=420)
        for border, within in ((2.0, 0.4), (0.0, 0.05)):
            found = point_estimates(narrow.sample(kind="bottom-up", keypoints={"scatter": 0.2, "border": border}))
            assert found["keypoints.border"] == pytest.approx(border, abs=within)

    @pytest.mark.parametrize(
        ("key", "expected", "within"),
        [
            ("boxes.duplicates", 0.1, 0.02),
            ("phantoms.rate", 0.4, 0.09),  # some look as if they showed somebody
            ("phantoms.score", 0.6, 0.02),
            ("phantoms.deviation", 0.5, 0.06),
            ("phantoms.life", 0.0, 0.02),
        ],
    )
    def test_people(self, dropping, key, expected, within):
        assert dropping[key].value == pytest.approx(expected, abs=within)

    def test_events_of_different_views_are_independent(self, dropping):
        """They are missed together less than by the mean rate, because views hide different people; a profile holds no
        correlation below 0.
        """
        assert -0.15 < dropping["boxes.missed_views"].value <= 0.02
        assert DetectorSection.model_validate(settings(dropping, name="fitted")).boxes.missed_views <= 0.02

    @pytest.mark.parametrize(
        ("key", "expected", "within"),
        [
            ("correlation.scatter_life", 0.3, 0.06),
            ("correlation.scatter_noise", 0.4, 0.12),  # the noise of predictions is drawn anew, too
            ("correlation.scatter_near", 0.5, 0.08),
            ("correlation.scatter_views", 0.0, 0.06),
        ],
    )
    def test_structure_of_scatter(self, dropping, key, expected, within):
        assert dropping[key].value == pytest.approx(expected, abs=within)

    def test_scatter_of_hidden_joints(self, dropping, erring):
        """A factor of 1.5; capsules take some visible joints for hidden ones, so less is seen."""
        assert mean(dropping, "keypoints.scatter") == pytest.approx(0.3, abs=0.03)
        assert 1.15 < mean(dropping, "keypoints.scatter_hidden") < 1.5
        values = [dropping[f"keypoints.scatter_hidden.{kind}"] for kind in LIMB_KINDS]
        assert 1.1 < np.mean([each.low for each in values]) < np.mean([each.high for each in values]) < 1.6
        assert min(each.low for each in values) > 1.0
        assert mean(erring, "keypoints.scatter_hidden") == pytest.approx(1.0, abs=0.05)


class TestClasses:
    @pytest.mark.parametrize(
        ("key", "expected", "within"),
        [
            ("keypoints.scatter", 0.3, 0.025),
            ("keypoints.jitter", 0.05, 0.01),
            ("keypoints.miss", 0.04, 0.01),
            ("keypoints.swap", 0.06, 0.015),  # by boxes from skeletons, another person may overlap more
            ("keypoints.inversion", 0.03, 0.008),
        ],
    )
    def test_shares_of_limb_joints(self, erring, key, expected, within):
        assert mean(erring, key) == pytest.approx(expected, abs=within)

    @pytest.mark.parametrize(
        ("key", "expected", "within"), [("keypoints.self_occluded", 1.5, 0.2), ("keypoints.occluded", 2.0, 0.25)]
    )
    def test_factors_of_hidden_joints(self, erring, key, expected, within):
        assert mean(erring, key) == pytest.approx(expected, abs=within)

    @pytest.mark.slow
    def test_hidden_joints_of_each_kind(self, filmed):
        """They differ as they should, but less: some visible joints are taken for hidden ones. Calibration mends it."""
        found = point_estimates(filmed.sample(staged=True, **BY_KIND))

        def of(key, *kinds):
            return np.mean([found[f"keypoints.{key}.{kind}"] for kind in kinds])

        assert 3.5 < of("self_occluded", "wrists", "elbows") < 5.5
        assert of("self_occluded", "knees", "ankles") == pytest.approx(1.1, abs=0.3)
        assert 1.3 < of("scatter_hidden", "shoulders", "hips") < 2.0
        assert of("scatter_hidden", "elbows", "wrists", "knees", "ankles") == pytest.approx(1.0, abs=0.1)
        assert 0.15 < of("jitter_mean", "shoulders", "hips") < 0.38
        assert of("jitter_mean", "elbows", "wrists", "knees", "ankles") == pytest.approx(0.5, abs=0.06)

    def test_nothing_is_dropped(self, erring):
        for occlusion in ("visible", "self_occluded", "occluded"):
            assert mean(erring, f"keypoints.drop.{occlusion}", KINDS) < 0.002

    @pytest.mark.parametrize(
        ("key", "expected", "within"),
        [
            ("good", 0.85, 0.01),
            ("jitter", 0.7, 0.02),
            ("miss", 0.3, 0.03),
            ("inversion", 0.6, 0.02),
            ("swap", 0.5, 0.03),
            ("hidden.good", 0.8, 0.02),
            ("hidden.miss", 0.8, 0.05),
            ("hidden.jitter", 0.8, 0.03),
            ("deviation", 0.3, 0.04),
            ("overconfident", 0.2, 0.1),  # good keypoints beside a wrong prediction look overconfident
            ("underconfident", 0.05, 0.02),
        ],
    )
    def test_scores_by_class_and_visibility(self, erring, key, expected, within):
        assert erring[f"scores.{key}"].value == pytest.approx(expected, abs=within)

    @pytest.mark.slow
    def test_misses_are_not_taken_for_inversions_and_swaps(self, filmed):
        """A fifth of all joints are misses, and some of them are near another joint by chance."""
        found = point_estimates(part(filmed.sample(keypoints={"scatter": 0.2, "miss": 0.2}), 100))
        for key in ("inversion", "swap"):
            assert np.mean([found[f"share.{key}.{kind}"] for kind in LIMB_KINDS]) < 0.01
        assert np.mean([found[f"share.miss.{kind}"] for kind in LIMB_KINDS]) == pytest.approx(0.2, abs=0.04)

    @pytest.mark.slow
    def test_a_perfect_detector_has_no_errors(self, filmed):
        found = measure_detector(part(filmed.sample(), 100), resamples=50)
        for kind in LIMB_KINDS:
            for key in ("swap", "inversion", "miss", "jitter"):
                assert not found[f"share.{key}.{kind}"].value > 0  # NaN where sides are never distinguishable
            assert found[f"keypoints.scatter.{kind}"].value <= 0.05
            assert found[f"share.drop.{kind}"].value < 0.002
        assert found["boxes.missed"].value == found["phantoms.rate"].value == found["boxes.duplicates"].value == 0
        assert not found["correlation.views"].known
        for key in ("keypoints.miss.knees", "boxes.missed", "boxes.duplicates"):
            assert found[key].value == 0
            assert 0 < found[key].high < 0.01, key  # an error without an occurrence may still be possible


class TestGuesses:
    @pytest.fixture(scope="class")
    @classmethod
    def guessing(cls, filmed):
        return point_estimates(narrowed(filmed, width=420).sample(**GUESSING))

    def test_nothing_is_dropped(self, guessing):
        for occlusion in ("visible", "self_occluded", "occluded"):
            assert np.mean([guessing[f"keypoints.drop.{occlusion}.{kind}"] for kind in KINDS]) < 0.005

    def test_gross_errors_of_hidden_joints_are_guesses(self, guessing):
        """Lower bounds: many guesses are right, and capsules take some visible joints for hidden ones."""
        occluded, self_occluded, visible = (
            np.mean([guessing[f"keypoints.{key}.{kind}"] for kind in LIMB_KINDS])
            for key in ("guess.occluded", "guess.self_occluded", "miss")
        )
        assert 0.1 < occluded < 0.5
        assert 0.005 < self_occluded < 0.1
        assert visible < 0.03  # some hidden joints are taken for visible ones, too

    def test_joints_outside_of_the_picture(self, guessing):
        found = np.mean([guessing[f"keypoints.guess.outside.{kind}"] for kind in LIMB_KINDS])
        assert found == pytest.approx(0.6, abs=0.05)
        assert guessing["scores.outside"] == pytest.approx(0.6, abs=0.08)
        assert "keypoints.border" not in guessing

    @pytest.mark.slow
    def test_errors_of_a_limb_do_not_depend_on_guesses(self, filmed):
        """Guesses of a limb are wrong together, because its pose is unusual; its other errors are independent here."""
        errors = {"scatter": 0.2, "miss": 0.06, "guess": {"self_occluded": 0.9, "occluded": 0.9}}
        found = point_estimates(filmed.sample(keypoints=errors, correlation={"gross_views": 0.3}))
        assert found["correlation.limb"] < 0.2

    def test_scores_of_guesses(self, guessing):
        assert np.mean([guessing[f"scores.guess.{kind}"] for kind in LIMB_KINDS]) == pytest.approx(0.3, abs=0.04)
        assert guessing["scores.good"] == pytest.approx(0.85, abs=0.01)


class TestDependence:
    @pytest.mark.parametrize(
        ("key", "expected", "within"),
        [
            ("correlation.life", 0.2, 0.06),
            ("correlation.views", 0.3, 0.12),
            ("correlation.gross_views", 0.4, 0.2),
            ("correlation.limb", 0.4, 0.12),
            ("correlation.scatter_life", 0.3, 0.06),
            ("correlation.scatter_noise", 0.0, 0.05),
            ("correlation.scatter_near", 0.0, 0.05),
            ("boxes.missed_views", 0.4, 0.25),
            ("boxes.life", 0.2, 0.12),
            ("phantoms.life", 0.4, 0.25),
        ],
    )
    def test_correlations_and_lives(self, lasting, key, expected, within):
        assert lasting[key].value == pytest.approx(expected, abs=within)

    def test_errors_of_single_frames_and_views(self, erring):
        assert erring["correlation.life"].value < 0.02
        assert erring["correlation.limb"].value < 0.03
        assert erring["correlation.gross_views"].value < 0.1
        # A jitter in one view moves the prediction in the others: a little correlation remains.
        assert erring["correlation.views"].value < 0.2

    def test_lasting_errors_have_wider_intervals(self, dropping, lasting):
        def width(measurement, kind):
            value = measurement[f"keypoints.drop.visible.{kind}"]
            return (value.high - value.low) * np.sqrt(value.count / value.value)

        assert np.mean([width(lasting, kind) / width(dropping, kind) for kind in LIMB_KINDS]) > 1.5


@pytest.mark.slow
def test_an_offset_that_all_views_share_is_not_seen(filmed):
    """The consensus has the bias of the detector: residuals stay small, whatever it is."""
    sample = part(filmed.sample(keypoints={"scatter": 0.2}), 60)
    biased = part(filmed.sample(keypoints={"scatter": 0.2}, bias={"hips": [0.0, 0.02, 0.05]}), 60)
    residuals = [label_joints(each).residual for each in (sample, biased)]
    hips = np.array(KIND_OF_JOINT) == KINDS.index("hips")
    one, other = (np.sqrt(np.nanmean(each[..., hips, :] ** 2)) for each in residuals)
    assert other == pytest.approx(one, rel=0.05)


def test_values_agree_within_the_interval_of_their_difference():
    one = MeasuredValue(0.10, 0.07, 0.14, 100)
    assert one.agrees(MeasuredValue(0.15, 0.12, 0.2, 100))  # 0.05 = the hypotenuse of 0.04 and 0.03
    assert not one.agrees(MeasuredValue(0.1501, 0.12, 0.2, 100))
    assert one.agrees(MeasuredValue(0.05, 0.0, 0.09, 100))
    assert MeasuredValue(0.15, 0.12, 0.2, 100).agrees(one)


@pytest.mark.slow
def test_two_draws_of_one_detector_agree_and_two_detectors_do_not(filmed, dropping, erring):
    again = measure_detector(filmed.sample(seed=7, **DROPPING), resamples=100)
    different, compared = agreement(dropping, again)
    assert compared > 90
    # Of independent values 5 % would differ; many are correlated, so up to a seventh may.
    assert len(different) <= 0.15 * compared, different
    different, compared = agreement(dropping, erring)
    assert len(different) > 0.3 * compared


@pytest.mark.slow
def test_people_who_are_not_measured_only_hide_others(filmed):
    """With one person measured, the shares are those of that person."""
    sample = part(filmed.sample(**DROPPING), 100)
    only = np.zeros(sample.reference.shape[:2], bool)
    only[:, 1] = True
    labels = label_joints(replace(sample, measured=only))
    for key in ("drop", "jitter", "miss"):
        assert not labels.risk[key][:, :, [0, 2]].any()
        assert labels.risk[key][:, :, 1].any()
    whole = label_joints(sample)
    np.testing.assert_array_equal(labels.occlusion[:, :, 1], whole.occlusion[:, :, 1])


def test_the_profile_contains_the_measured_values(dropping):
    bias = np.zeros((9, 3))
    bias[KINDS.index("hips")] = [0.01, 0.02, 0.03]
    text = as_toml(dropping, name="fitted", bias=bias, command="a command")
    profile = DetectorSection.model_validate(tomllib.loads(text))
    assert profile == DetectorSection.model_validate(settings(dropping, name="fitted", bias=bias))
    assert (profile.name, profile.kind) == ("fitted", "bottom-up")
    for kind in LIMB_KINDS:
        measured = dropping[f"keypoints.drop.occluded.{kind}"].value
        assert getattr(profile.keypoints.drop.occluded, kind) == pytest.approx(measured, abs=1e-4)
    expected = [dropping[f"keypoints.face.ears.{index}"].value for index in range(24)]
    assert profile.keypoints.face.ears == pytest.approx(expected, abs=1e-4)
    assert profile.keypoints.drop.visible.ears == 0.0  # face says it
    hidden = [dropping[f"boxes.missed_hidden.{index}"].value for index in range(5)]
    assert profile.boxes.missed_hidden == pytest.approx(hidden, abs=1e-4)
    assert profile.bias.hips == (0.01, 0.02, 0.03)
    assert profile.bias.nose == (0, 0, 0)
    for line in text.splitlines():
        assert len(line) <= 120 or line.startswith(tuple(KINDS))
        if line.startswith("knees = 0.") and "[" not in line:
            assert "; n = " in line
    assert "# Made by: a command" in text


def test_samples_without_people_or_detections_are_refused(filmed):
    sample = filmed.sample()
    unknown = replace(sample, reference=np.full(sample.reference.shape, np.nan))
    with pytest.raises(ValueError, match="expected people with known joints, got none in 200 frames"):
        measure_detector(unknown)
    blind = replace(part(sample, 5), detections=tuple(Detections.empty() for _ in range(5)))
    with pytest.raises(ValueError, match="no detection is near any of the known people"):
        measure_detector(blind)
