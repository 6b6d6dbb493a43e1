import tomllib
from dataclasses import replace

import numpy as np
import pytest

from mvpose import Detections
from simharness.reality.detector_fit.fit import agreement, fit, twin_of, write_profile
from simharness.reality.detector_fit.measure import MeasuredValue, measure
from simharness.reality.detector_fit.profile import settings
from simharness.reality.detector_fit.sample import of_shelf
from simharness.reality.shelf import read_shelf
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector import KINDS, Detector

ALONE = {
    "keypoints": {
        "scatter": 0.4,
        "jitter": 0.15,
        "miss": 0.1,
        "inversion": 0.08,
        "swap": 0.1,
        "stray": 0.3,
        "drop": {"visible": 0.05, "self_occluded": 0.3, "occluded": 0.6},
        "self_occluded": 1.5,
        "occluded": 2.0,
    },
    "bias": {"hips": [0.01, 0.02, 0.03], "wrists": [0.0, -0.02, 0.01]},
    "scores": {
        "good": 0.85, "jitter": 0.7, "miss": 0.3, "inversion": 0.6, "swap": 0.5, "hidden": 0.8,
        "deviation": 0.4, "overconfident": 0.3, "underconfident": 0.1,
    },
    "boxes": {"missed": 0.1, "duplicates": 0.1},
    "phantoms": {"rate": 0.4, "score": 0.6, "deviation": 0.5},
}  # fmt: skip

TOGETHER = {
    "keypoints": {
        "scatter": 0.3,
        "jitter": 0.2,
        "miss": 0.15,
        "drop": {"visible": 0.2, "self_occluded": 0.2, "occluded": 0.2},
    },
    "correlation": {"life": 0.2, "views": 0.3, "limb": 0.4, "scatter_life": 0.3, "scatter_views": 0.4},
    "boxes": {"missed": 0.2, "missed_views": 0.4, "life": 0.3},
    "scores": ALONE["scores"],
    "phantoms": {"rate": 0.3, "life": 0.4},
}

LIMB_KINDS = KINDS[3:]


@pytest.fixture(scope="module")
def alone(twin):
    return measure(twin.detected(Detector.model_validate(ALONE), seed=1), resamples=100)


@pytest.fixture(scope="module")
def together(twin):
    return measure(twin.detected(Detector.model_validate(TOGETHER), seed=1), resamples=100)


def mean(measurement, key, kinds=LIMB_KINDS):
    return np.mean([measurement[f"{key}.{kind}"].value for kind in kinds])


@pytest.mark.parametrize(
    ("key", "expected", "within"),
    [
        ("keypoints.drop.visible", 0.05, 0.015),
        ("keypoints.drop.self_occluded", 0.3, 0.03),
        ("keypoints.drop.occluded", 0.6, 0.06),
        ("keypoints.swap", 0.1, 0.025),  # by boxes from skeletons, another person may overlap more
        ("keypoints.inversion", 0.08, 0.01),
        ("keypoints.miss", 0.1, 0.01),
        ("keypoints.jitter", 0.15, 0.015),
        ("keypoints.scatter", 0.4, 0.015),
    ],
)
def test_parameters_of_joints_are_recovered(alone, key, expected, within):
    assert mean(alone, key) == pytest.approx(expected, abs=within)


@pytest.mark.parametrize(
    ("key", "expected", "within"),
    [
        ("keypoints.stray", 0.3, 0.06),
        ("keypoints.self_occluded", 1.5, 0.2),
        ("keypoints.occluded", 2.0, 0.35),
        ("scores.good", 0.85, 0.01),
        ("scores.jitter", 0.7, 0.02),
        ("scores.miss", 0.3, 0.03),
        ("scores.inversion", 0.6, 0.03),
        ("scores.swap", 0.5, 0.04),
        ("scores.hidden", 0.8, 0.03),
        ("scores.deviation", 0.4, 0.05),
        ("scores.overconfident", 0.3, 0.05),
        ("scores.underconfident", 0.1, 0.03),
        ("boxes.missed", 0.1, 0.02),
        ("boxes.duplicates", 0.1, 0.02),
        ("phantoms.rate", 0.4, 0.07),
        ("phantoms.score", 0.6, 0.02),
        ("phantoms.deviation", 0.5, 0.06),
        ("bias.forward.hips", 0.01, 0.003),
        ("bias.outward.hips", 0.02, 0.003),
        ("bias.up.hips", 0.03, 0.003),
        ("bias.outward.wrists", -0.02, 0.003),
        ("bias.up.knees", 0.0, 0.003),
        # Frames and views are independent.
        ("correlation.life", 0.0, 0.02),
        ("correlation.views", 0.0, 0.04),
        ("correlation.limb", 0.0, 0.1),
        ("correlation.scatter_life", 0.0, 0.02),
        ("correlation.scatter_views", 0.0, 0.03),
    ],
)
def test_other_parameters_are_recovered(alone, key, expected, within):
    assert alone[key].value == pytest.approx(expected, abs=within)


@pytest.mark.parametrize(
    ("key", "expected", "within"),
    [
        ("correlation.life", 0.2, 0.04),
        ("correlation.views", 0.3, 0.1),
        ("correlation.limb", 0.4, 0.1),
        ("correlation.scatter_life", 0.3, 0.05),
        ("correlation.scatter_views", 0.4, 0.05),
        ("boxes.missed_views", 0.4, 0.2),
        ("boxes.life", 0.3, 0.15),
        ("phantoms.life", 0.4, 0.25),
    ],
)
def test_correlations_and_lives_are_recovered(together, key, expected, within):
    assert together[key].value == pytest.approx(expected, abs=within)


def test_lasting_errors_have_wider_intervals(alone, together):
    def width(measurement, kind):
        value = measurement[f"keypoints.jitter.{kind}"]
        return (value.high - value.low) * np.sqrt(value.count / value.value)

    assert np.mean([width(together, kind) / width(alone, kind) for kind in LIMB_KINDS]) > 1.5


def test_a_perfect_detector_has_no_errors(twin):
    found = measure(twin.detected(Detector()), resamples=50)
    for kind in LIMB_KINDS:
        for key in ("swap", "inversion", "miss", "jitter"):
            assert found[f"share.{key}.{kind}"].value == 0
        assert found[f"keypoints.scatter.{kind}"].value <= 0.05
        assert found[f"share.drop.{kind}"].value < 0.002
    assert found["boxes.missed"].value == found["phantoms.rate"].value == found["boxes.duplicates"].value == 0
    assert not found["correlation.views"].known
    never = found["keypoints.miss.knees"]  # an error without an occurrence may still be possible
    assert never.value == 0
    assert 0 < never.high < 0.01


def test_misses_are_not_taken_for_inversions_and_swaps(twin):
    """Half of all joints are misses, and some of them are near another joint by chance."""
    config = Detector.model_validate({"keypoints": {"scatter": 0.2, "miss": 0.5}})
    found = measure(twin.detected(config), resamples=10)
    assert mean(found, "share.inversion") < 0.004
    assert mean(found, "share.swap") < 0.004
    assert mean(found, "share.miss") == pytest.approx(0.5, abs=0.03)  # some near the border count as jitter


def test_values_agree_within_the_interval_of_their_difference():
    one = MeasuredValue(0.10, 0.07, 0.14, 100)
    assert one.agrees(MeasuredValue(0.15, 0.12, 0.2, 100))  # 0.05 = the hypotenuse of 0.04 and 0.03
    assert not one.agrees(MeasuredValue(0.1501, 0.12, 0.2, 100))
    assert one.agrees(MeasuredValue(0.05, 0.0, 0.09, 100))
    assert MeasuredValue(0.15, 0.12, 0.2, 100).agrees(one)


def test_the_profile_contains_the_measured_values(twin, tmp_path):
    sample = twin.detected(Detector.model_validate(ALONE), seed=1)
    fitted = fit(sample, name="fitted", command="a command", resamples=50)
    write_profile(fitted, tmp_path / "fitted.toml")
    data = tomllib.loads((tmp_path / "fitted.toml").read_text())
    profile = Detector.model_validate(data)
    assert profile == fitted.profile == Detector.model_validate(settings(fitted.real, name="fitted"))
    assert profile.name == "fitted"
    assert profile.keypoints.miss.wrists == pytest.approx(fitted.real["keypoints.miss.wrists"].value, abs=1e-4)
    assert profile.keypoints.drop.occluded.nose == pytest.approx(
        fitted.real["keypoints.drop.occluded.nose"].value, abs=1e-4
    )
    assert profile.keypoints.jitter.nose == profile.keypoints.jitter.shoulders  # the stand-in
    assert profile.scores.hidden == pytest.approx(0.8, abs=0.03)
    assert profile.boxes.missed == pytest.approx(0.1, abs=0.02)
    assert profile.bias.hips[2] == pytest.approx(0.03, abs=0.003)
    assert profile.bias.nose == (0, 0, 0)
    for line in fitted.text.splitlines():
        assert len(line) <= 120
        if line.startswith("knees = "):
            assert "; n = " in line
    with pytest.raises(ValueError, match=r"--out .*nowhere.*: cannot be written: No such file or directory"):
        write_profile(fitted, tmp_path / "nowhere" / "fitted.toml")


def test_samples_without_people_or_detections_are_refused(twin):
    sample = twin.detected(Detector())
    unknown = replace(sample, reference=np.full(sample.reference.shape, np.nan))
    with pytest.raises(ValueError, match="expected people with known joints, got none in 300 frames"):
        measure(unknown)
    blind = replace(sample, detections=tuple(Detections.empty() for _ in sample.detections))
    with pytest.raises(ValueError, match="no detection is near any of the known people"):
        measure(blind)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_profile_measured_on_its_own_simulation_is_recovered(twin, seed):
    """Round trip without real data: measure, simulate with the measured profile, measure again."""
    first = fit(twin.detected(Detector.model_validate(TOGETHER), seed=seed), resamples=200)
    again = measure(twin.detected(first.profile, seed=seed + 10), resamples=200)
    different, compared = agreement(first.real, again)
    assert compared > 90
    # Of independent values 5 % would differ; many are correlated, so up to a tenth may.
    assert len(different) <= 0.1 * compared, different


def test_different_profiles_disagree(alone, together):
    """The round trip can fail."""
    different, compared = agreement(alone, together)
    assert len(different) > 0.3 * compared


@pytest.fixture(scope="module")
def shelf(shared_data):
    return of_shelf(read_shelf(shared_data / "shelf"))


@pytest.fixture(scope="module")
def fitted(shelf):
    return fit(shelf)


def settings_of(detector):
    """Return all parameters of a detector by dotted key."""
    flat = {}

    def take(path, value):
        if isinstance(value, dict):
            for key, each in value.items():
                take((*path, key), each)
        elif isinstance(value, list | tuple):
            for index, each in enumerate(value):
                take((*path, str(index)), each)
        else:
            flat[".".join(path)] = value

    take((), detector.model_dump())
    return flat


class TestShelf:
    def test_a_real_detector_does_not_report_hidden_joints(self, fitted):
        for kind in ("nose", "eyes", "ears"):
            visible, self_occluded = (
                fitted.real[f"keypoints.drop.{occlusion}.{kind}"] for occlusion in ("visible", "self_occluded")
            )
            assert visible.high < 0.1
            assert self_occluded.low > 0.5
        assert fitted.real["keypoints.drop.occluded.wrists"].low > fitted.real["keypoints.drop.visible.wrists"].high
        assert fitted.real["keypoints.drop.visible.shoulders"].high < 0.03

    def test_the_shipped_profile_is_reproduced(self, fitted):
        """Made by `simharness fit-detector shelf FOLDER --out scenarios/detectors/openpose-shelf.toml`."""
        shipped = settings_of(read_profile("openpose-shelf"))
        made = settings_of(fitted.profile)
        assert shipped.keys() == made.keys()
        for key, value in made.items():  # except the last digit, because sums differ between machines
            assert shipped[key] == (pytest.approx(value, abs=2e-3) if isinstance(value, float) else value), key

    def test_its_hips_are_higher_than_those_of_the_truth(self, fitted):
        assert 0.03 < fitted.real["bias.up.hips"].low < fitted.real["bias.up.hips"].high < 0.06

    @pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
    def test_its_simulated_twin_agrees(self, shelf, fitted, seed):
        """Round trip on the rig of Shelf: four people, as many known as in Shelf, 12 s.

        Each value is compared with the interval of the difference of both (95 %, so 1 of 20 may differ by chance, and
        they come in bunches): at least nine of ten must agree.
        """
        different, compared = agreement(fitted.real, twin_of(fitted, shelf, seed=seed))
        assert compared > 100
        assert len(different) <= 0.1 * compared, different
