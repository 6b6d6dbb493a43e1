from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.layers import PROFILES
from simharness.scenario.load import ScenarioError, load
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import KINDS, DetectorSection, KeypointsSection
from simharness.scenario.toml_files import dumps


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "detectors").mkdir()
    (tmp_path / "detectors" / "mine.toml").write_text('name = "mine"\n[keypoints]\nscatter = 0.25\nmiss = 0.1\n')
    return tmp_path


def scenario(folder, text) -> Path:
    path = folder / "scene.toml"
    path.write_text(f'name = "scene"\n{text}')
    return path


def test_a_scenario_begins_with_the_typical_detector(folder):
    assert load(scenario(folder, "")).detector == read_profile("typical")
    assert load(scenario(folder, '[detector]\nprofile = "poor"')).detector == read_profile("poor")


def test_what_a_scenario_says_goes_over_its_profile(folder):
    text = '[detector]\nprofile = "mine"\n[detector.keypoints]\nmiss = { hips = 0.5 }\njitter = 0.2'
    detector = load(scenario(folder, text)).detector
    assert detector.name == "mine, changed"
    assert detector.keypoints.scatter.by_joint() == (0.25,) * 17
    assert detector.keypoints.miss.hips == 0.5
    assert detector.keypoints.miss.knees == 0.1
    assert detector.keypoints.jitter.by_joint() == (0.2,) * 17


def test_profiles_are_found_beside_the_scenario_by_path_and_on_the_command_line(folder):
    assert load(scenario(folder, '[detector]\nprofile = "mine"')).detector.name == "mine"
    assert load(scenario(folder, '[detector]\nprofile = "detectors/mine.toml"')).detector.name == "mine"
    assert load(scenario(folder, ""), overrides=["detector.profile=mine"]).detector.name == "mine"
    assert read_profile("mine", folder=folder).keypoints.miss.nose == 0.1


def test_a_profile_may_begin_with_another(folder):
    (folder / "detectors" / "other.toml").write_text('profile = "mine"\nname = "other"\n[keypoints]\nmiss = 0.3\n')
    other = read_profile("other", folder=folder)
    assert (other.name, other.keypoints.scatter.nose, other.keypoints.miss.nose) == ("other", 0.25, 0.3)
    (folder / "detectors" / "mine.toml").write_text('profile = "other"\n')
    with pytest.raises(ScenarioError, match=r"mine\.toml: begins with .* which begins with it"):
        read_profile("mine", folder=folder)


def test_a_scenario_that_was_written_out_needs_no_profile(folder, tmp_path_factory):
    whole = load(scenario(folder, '[detector]\nprofile = "mine"\n[detector.boxes]\nmissed = 0.2'))
    path = tmp_path_factory.mktemp("elsewhere") / "scene.toml"
    path.write_text(dumps(whole))
    assert load(path) == whole


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('profile = "typicl"', "no such profile; expected one of .*typical.*Did you mean typical"),
        ('profile = "none.toml"', "none.toml: no such file"),
        ("profile = 3", "expected the name of a detector profile, got 3"),
        ("[detector.keypoints.miss]\ntoes = 0.1", r"detector\.keypoints\.miss\.toes is not a key.*has ankles"),
        ("[detector.keypoints]\nmiss = 1.5", "detector.keypoints.miss.nose.*less than or equal to 1, got 1.5"),
        ("phantoms = 0.1", r"expected a section \[detector.phantoms\]"),
    ],
)
def test_mistakes_are_named(folder, text, message):
    with pytest.raises(ScenarioError, match=message):
        load(scenario(folder, f"[detector]\n{text}"))


def test_mistakes_in_a_profile_name_its_file(folder):
    (folder / "detectors" / "mine.toml").write_text("[boxes]\nmised = 0.1\n")
    with pytest.raises(ScenarioError, match=r"detectors/mine\.toml: detector\.boxes\.mised is not a key; did you mean"):
        load(scenario(folder, '[detector]\nprofile = "mine"'))


@pytest.mark.parametrize("path", sorted(PROFILES.shipped.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_profile_is_named_as_its_file(path):
    assert read_profile(path.stem).name == path.stem


def test_without_settings_a_detector_is_perfect():
    assert read_profile("perfect") == DetectorSection()


@given(st.floats(0, 1), st.sampled_from(KINDS))
def test_a_number_is_meant_for_all_joints(share, kind):
    assert getattr(KeypointsSection.model_validate({"miss": share}).miss, kind) == share


def test_a_date_in_the_place_of_text_or_a_number_is_read_as_text(tmp_path):
    (tmp_path / "mine.toml").write_text("name = 2020-01-01\n")
    assert read_profile("mine.toml", folder=tmp_path).name == "2020-01-01"
    (tmp_path / "mine.toml").write_text('name = "x"\n[keypoints]\nquality = 2020-01-01\n')
    with pytest.raises(ScenarioError, match=r"quality .*expected .*got"):
        read_profile("mine.toml", folder=tmp_path)
