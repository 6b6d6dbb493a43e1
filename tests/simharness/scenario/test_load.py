"""Scenario files: what is read, what is refused, and what the messages say."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.load import ScenarioError, fingerprint, load, read_plan
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps

SHIPPED = sorted((Path(__file__).parents[3] / "scenarios").glob("*.toml"))


@pytest.fixture
def scenario_file(tmp_path):
    def write(text: str, name: str = "room.toml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def refusal(path, **options) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(path, **options)
    return str(caught.value)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_scenario_loads_and_is_named_as_its_file(path):
    assert read_plan(path).base.name == path.stem


def test_scenarios_are_shipped():
    assert "quickstart" in {path.stem for path in SHIPPED}


class TestKeys:
    def test_an_unknown_key_names_file_key_nearest_and_the_section(self, scenario_file):
        path = scenario_file('name = "x"\n[people]\ncuont = 3')
        message = refusal(path)
        assert message.startswith(f"{path}: people.cuont is not a key; did you mean people.count?")
        assert (
            "[people] has activities, alike, area, around, assist, camouflage, children, count, group, hidden, "
            "look_alike, motion, passing, playback, push, spacing, traffic" in message
        )

    def test_a_key_of_another_section_is_found_there(self, scenario_file):
        assert "did you mean people.look_alike?" in refusal(scenario_file('name = "x"\nlook_alike = 1.0'))

    def test_a_key_like_no_other_gets_no_guess(self, scenario_file):
        message = refusal(scenario_file('name = "x"\nzzzzzz = 1'))
        assert "did you mean" not in message
        assert "a scenario has annotation, appearance, cameras" in message

    def test_every_mistake_of_a_file_is_named_at_once(self, scenario_file):
        message = refusal(scenario_file('name = "x"\nrat = 5\n[people]\ncount = -1\n[cameras]\nfov = 190'))
        assert len(message.splitlines()) == 1
        assert ".toml: 3 mistakes: (1) " in message
        for key in ("rate", "people.count", "cameras.fov"):
            assert key in message

    def test_a_missing_name_is_named(self, scenario_file):
        assert "name is missing" in refusal(scenario_file("seed = 1"))


class TestValues:
    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("[people]\ncount = -1", "people.count (number of people): expected greater than or equal to 0, got -1"),
            ('[people]\ncount = "4"', 'people.count (number of people): expected a valid integer, got "4"'),
            ("[people]\ncount = true", "people.count (number of people): expected a valid integer, got true"),
            ("[people]\ncount = 4.5", "got 4.5"),
            ("[cameras]\nfov = nan", "got NaN"),
            ("[cameras]\nsize = [640, 480.5]", "cameras.size[1]"),
            ('[people]\nactivities = ["walk", "fly"]', "people.activities[1]"),
            ('[rendering]\nrenderer = "opengl"', "expected 'auto', 'raster', 'gl' or 'rays', got \"opengl\""),
            ("people = 4", "expected a section [people] with keys activities"),
            ("duration = 2024-01-01", "duration"),
        ],
    )
    def test_a_wrong_value_names_file_key_expected_and_got(self, scenario_file, text, message):
        path = scenario_file('name = "x"\n' + text)
        refused = refusal(path)
        assert refused.startswith(f"{path}: ")
        assert message in refused
        assert "expected" in refused

    def test_an_integer_is_a_number(self, scenario_file):
        assert load(scenario_file('name = "x"\n[cameras]\nfov = 80')).cameras.fov == 80.0

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            (
                "[room]\nsize = [7, 5.5]",
                "room.size: expected 3 numbers (x, y, z in metres), got 2: [7, 5.5]; e.g. [7, 5.5, 3]",
            ),
            ("[room]\nsize = [7]", "got 1: [7]; e.g. [7, 8, 3]"),
            ("[room]\nsize = [7, 8, 3, 2]", "got 4: [7, 8, 3, 2]; e.g. [7, 8, 3]"),
            ("[cameras]\nsize = [640]", "cameras.size: expected 2 numbers (width, height in pixels"),
            ("[cameras]\npositions = [[1, 2, 3], [1, 2]]", "cameras.positions[1]: expected 3 numbers (x, y, z), got 2"),
            ("[cameras]\ndistortion = [-0.1, 0.02]", "got 2: [-0.1, 0.02]; e.g. [-0.1, 0.02, 0, 0, 0]"),
            ("[faults]\nswapped = [[1]]", "faults.swapped[0]: expected 2 numbers (camera, camera), got 1: [1]"),
            ("[detector.bias]\nhips = [0.1]", "3 numbers (forward, outward, up), got 1: [0.1]; e.g. [0.1, 0, 0]"),
        ],
    )
    def test_a_list_of_a_wrong_length_is_one_mistake_with_an_example(self, scenario_file, text, message):
        path = scenario_file('name = "x"\n' + text)
        refused = refusal(path)
        assert len(refused.splitlines()) == 1
        assert refused.startswith(f"{path}: ")
        assert message in refused

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ('[cameras]\nsize = "1920x1080"', 'expected [width, height], e.g. [1920, 1080], got "1920x1080"'),
            ('[cameras]\nsize = "large"', 'expected [width, height], e.g. [800, 600], got "large"'),
            ("[cameras]\nsize = 640", "expected [width, height], e.g. [800, 600], got 640"),
            ('[room]\nsize = "7 x 5.5 x 3"', "expected [x, y, z], e.g. [7, 5.5, 3], got"),
            ("[cameras]\naim = 1.0", "expected [x, y, z], e.g. [0, 0, 0.9], got 1.0"),
            ('[people]\nactivities = "walk"', 'expected a list, e.g. ["walk"], got "walk"'),
            ('variants = "full"', 'expected a list, e.g. ["full"], got "full"'),
            ("[cameras]\nheights = 1.5", "expected a list, e.g. [1.5], got 1.5"),
        ],
    )
    def test_a_value_that_is_not_a_list_is_one_mistake_with_an_example(self, scenario_file, text, message):
        refused = refusal(scenario_file('name = "x"\n' + text))
        assert len(refused.splitlines()) == 1
        assert message in refused

    @pytest.mark.parametrize(
        ("text", "near"),
        [
            ('[people]\nactivities = ["wlak"]', "walk"),
            ('[people]\nactivities = ["walk", "shakehands"]', "shake_hands"),
            ('[rendering]\nrenderer = "opengl"', "gl"),
            ('[cameras]\nlayout = "rings"', "ring"),
            ('[cameras]\nlayout = "preset"\npreset = "panoptik"', "panoptic"),
            ('[appearance]\nsource = "picture"', "pictures"),
            ('[detector.heatmaps]\nsize = "64x64"', "64x48"),
        ],
    )
    def test_a_misspelled_word_is_one_mistake_with_the_nearest(self, scenario_file, text, near):
        refused = refusal(scenario_file('name = "x"\n' + text))
        assert len(refused.splitlines()) == 1
        assert refused.endswith(f'; did you mean "{near}"?')

    def test_a_word_like_no_other_gets_no_guess(self, scenario_file):
        assert "did you mean" not in refusal(scenario_file('name = "x"\n[rendering]\nrenderer = "zzz"'))


class TestTooFew:
    """Lists that are too short are reported under the key that was written."""

    @pytest.mark.parametrize("key", ["variants", "method.variants", "people.activities"])
    def test_in_a_file(self, scenario_file, key):
        path = scenario_file(f'name = "x"\n{key} = []')
        message = refusal(path)
        assert message.startswith(f"{path}: {key} (")
        assert message.endswith(": expected at least one, got []")

    @pytest.mark.parametrize("key", ["variants", "method.variants"])
    @pytest.mark.parametrize("below", ["variants", "method.variants"])
    def test_over_a_file_with_the_same_key(self, scenario_file, key, below):
        base = scenario_file(f'name = "x"\n{below} = ["full"]')
        assert refusal(base, overrides=[f"{key}=[]"]).startswith(f"--set {key}=[]: {key} (")
        top = scenario_file(f'extends = "{base.name}"\nname = "y"\n{key} = []', "top.toml")
        assert refusal(top).startswith(f"{top}: {key} (")


class TestFiles:
    def test_a_syntax_error_names_file_and_line(self, scenario_file):
        path = scenario_file('name = "x"\n\n[people\ncount = 3')
        assert refusal(path).startswith(f"{path}, line 3, column ")

    def test_an_error_at_the_end_names_the_last_line(self, scenario_file):
        path = scenario_file('name = "x"\nseed =')
        assert refusal(path).startswith(f"{path}, line 2, column ")

    def test_a_missing_file_lists_what_is_beside_it(self, scenario_file):
        path = scenario_file('name = "x"', "kitchen.toml")
        message = refusal(path.with_name("kitchn.toml"))
        assert "no such file" in message
        assert f"did you mean {path}?" in message
        assert message.endswith(f"{path.parent} has kitchen.toml")

    def test_of_many_files_beside_it_those_named_like_it_are_listed(self, scenario_file, tmp_path):
        for number in range(30):
            scenario_file('name = "x"', f"unlike-{number}.toml")
        near = {scenario_file('name = "x"', f"kitchen{letter}.toml").name for letter in "abcde"}
        message = refusal(tmp_path / "kitchen.toml")
        listed, _, more = message.partition(" has ")[2].partition(" and ")
        assert more == "25 more"
        assert len(listed.split(", ")) == 10
        assert set(listed.split(", ")[:5]) == near

    @pytest.mark.parametrize("files", [0, 3, 30])
    @pytest.mark.parametrize("path", ["none.toml", ".", "../here", "../here/none.toml"])
    def test_the_folder_is_named_once(self, tmp_path, monkeypatch, path, files):
        (tmp_path / "here").mkdir()
        monkeypatch.chdir(tmp_path / "here")
        for number in range(files):
            Path(f"{number}.toml").touch()
        message = refusal(path)
        assert message.startswith(f"{path}: ")
        assert " . " not in message
        assert not message.endswith(" .")
        if path == "../here":
            assert message.count(path) == 1
        assert (f"{files - 10} more" in message) == (files > 10)

    def test_a_byte_order_mark_is_accepted(self, tmp_path):
        """Editors of Windows begin a file with one."""
        path = tmp_path / "x.toml"
        path.write_bytes(b'\xef\xbb\xbfname = "x"\n[people]\ncount = 3\n')
        assert load(path).people.count == 3
        path.write_bytes(b'\xef\xbb\xbfname = "x"\n[people\n')
        assert refusal(path).startswith(f"{path}, line 2, column ")

    def test_a_folder_is_not_a_scenario(self, tmp_path):
        assert "is a folder" in refusal(tmp_path)

    def test_a_binary_file_is_not_a_scenario(self, tmp_path):
        path = tmp_path / "x.toml"
        path.write_bytes(b"name = \xff\xfe")
        assert "UTF-8" in refusal(path)


class TestOverrides:
    @pytest.fixture
    def base(self, scenario_file):
        return scenario_file('name = "x"\nseed = 3\n[people]\ncount = 2')

    @pytest.mark.parametrize(
        ("override", "section", "key", "value"),
        [
            ("people.count=6", "people", "count", 6),
            ("people.area = 1.5", "people", "area", 1.5),
            ('people.activities=["talk", "walk"]', "people", "activities", ("talk", "walk")),
            ("cameras.size=[320, 240]", "cameras", "size", (320, 240)),
            ("rendering.renderer=gl", "rendering", "renderer", "gl"),
            ('rendering.renderer="gl"', "rendering", "renderer", "gl"),
        ],
    )
    def test_the_right_hand_side_is_typed(self, base, override, section, key, value):
        loaded = load(base, overrides=[override])
        assert getattr(getattr(loaded, section), key) == value

    def test_only_the_named_key_changes(self, base):
        assert load(base, overrides=["people.count=6"]) == load(base).model_copy(
            update={"people": PeopleSection(count=6)}
        )

    def test_the_last_of_two_counts(self, base):
        assert load(base, overrides=["people.count=6", "people.count=1"]).people.count == 1

    @pytest.mark.parametrize("override", ["people.cuont=6", "people.count=six", "people.count=-1"])
    def test_a_refused_override_is_the_place(self, base, override):
        assert refusal(base, overrides=[override]).startswith(f"--set {override}: people.c")

    def test_a_mistake_of_the_file_is_still_the_files(self, scenario_file):
        path = scenario_file('name = "x"\n[people]\narea = -1')
        assert refusal(path, overrides=["people.count=3"]).startswith(f"{path}: people.area")

    @pytest.mark.parametrize("override", ["people.count", "=3", "people..count=3", "people.activities=[walk]", "seed="])
    def test_what_is_not_key_and_value_is_refused(self, base, override):
        assert refusal(base, overrides=[override]).startswith(f"--set {override}: ")

    def test_a_value_is_not_a_section(self, base):
        assert "people.count is a value" in refusal(base, overrides=["people.count.x=3"])

    def test_seed_zero_is_a_seed(self, base):
        assert load(base).seed == 3
        assert load(base, seed=0).seed == 0

    def test_a_bad_seed_is_reported_with_its_option(self, base):
        assert refusal(base, seed=-1).startswith("--seed: seed")


class TestFingerprint:
    def test_equal_scenarios_have_equal_fingerprints_however_written(self, scenario_file):
        spelled_out = scenario_file('name = "x"\n[people]\ncount = 4\n[cameras]\nfov = 75', "a.toml")
        assert fingerprint(load(spelled_out)) == fingerprint(load(scenario_file('name = "x"', "b.toml")))

    @pytest.mark.parametrize(
        "override", ["seed=1", "people.count=3", "cameras.fov=74.999", "name=y", 'method.variants=["full"]']
    )
    def test_any_value_changes_it(self, scenario_file, override):
        path = scenario_file('name = "x"')
        assert fingerprint(load(path)) != fingerprint(load(path, overrides=[override]))

    def test_the_version_changes_it(self, monkeypatch):
        scenario = Scenario(name="x")
        before = fingerprint(scenario)
        monkeypatch.setattr("simharness.scenario.load.code_version", lambda: "999")
        assert fingerprint(scenario) != before


SCENARIOS = st.builds(
    Scenario,
    name=st.from_regex(r"[a-z0-9][a-z0-9_-]{0,99}", fullmatch=True),
    description=st.text(max_size=1000),
    seed=st.integers(0, 2**53 - 1),
    people=st.builds(PeopleSection, count=st.integers(0, 100)),
    cameras=st.builds(
        CamerasSection, fov=st.floats(1.0, 170.0, exclude_min=True, exclude_max=True), start=st.floats(-360.0, 360.0)
    ),
)


@given(scenario=SCENARIOS)
def test_what_is_written_is_read_back(tmp_path_factory, scenario):
    path = tmp_path_factory.mktemp("scenario") / "x.toml"
    path.write_text(dumps(scenario), encoding="utf-8", newline="\n")
    assert load(path) == scenario


class TestNamedFiles:
    """Files that a scenario names: recorded motion and calibration."""

    def test_those_of_a_file_are_relative_to_it_and_those_of_the_command_line_are_not(self, scenario_file):
        text = 'name = "x"\n[people]\nmotion = { file = "clips/a.bvh" }\n[cameras]\nlayout = "file"\nfile = "rig.json"'
        path = scenario_file(text)
        loaded = load(path, overrides=["cameras.file=elsewhere/rig.toml"])
        assert loaded.people.motion.file == str(path.parent / "clips/a.bvh")
        assert loaded.cameras.file == "elsewhere/rig.toml"
        assert load(path, folder=Path()).cameras.file == "rig.json"
        assert [file.name for file in load(path).files] == ["a.bvh", "rig.json"]

    def test_user_defined_estimators_are_files_or_modules(self, scenario_file):
        path = scenario_file(
            'name = "x"\nmethod.estimators = { custom = "in/custom.py:Custom", installed = "package.module:Installed" }'
        )
        expected = {"custom": f"{path.parent}/in/custom.py:Custom", "installed": "package.module:Installed"}
        loaded = load(path)
        assert loaded.method.estimators.places == expected
        assert load(path, folder=Path()).method.estimators.places["custom"] == "in/custom.py:Custom"
        more = load(
            path, overrides=['method.estimators.custom="other.py:Custom"', "method.estimators.more=third.py:make"]
        )
        assert more.method.estimators.places == expected | {"custom": "other.py:Custom", "more": "third.py:make"}
        path.write_text(dumps(more), encoding="utf-8")
        assert load(path, folder=Path()) == more != loaded

    def test_a_user_defined_estimator_changes_the_fingerprint(self, scenario_file):
        path = scenario_file('name = "x"\nmethod.estimators.custom = "custom.py:Custom"')
        missing = fingerprint(load(path))
        path.with_name("custom.py").write_text("1")
        first = fingerprint(load(path))
        path.with_name("custom.py").write_text("2")
        assert len({missing, first, fingerprint(load(path))}) == 3

    @pytest.mark.parametrize(
        ("written", "message"),
        [
            (
                'estimators.Custom = "custom.py:Custom"',
                "lowercase letters, digits, - and _; 'Custom' has other characters",
            ),
            ('estimators.custom = "custom.py"', "FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE; '"),
            ('estimators.custom = "custom.py:two words"', "is neither"),
            ("estimators.custom = 3", "method.estimators.custom: expected a valid string, got 3"),
            ('estimators = "custom.py:Custom"', "expected a section [method.estimators] with keys of your choice"),
        ],
    )
    def test_an_invalid_estimator_is_refused(self, scenario_file, written, message):
        path = scenario_file(f'name = "x"\n[method]\n{written}')
        assert message in refusal(path)
        assert refusal(path).startswith(f"{path}: method.estimators")

    def test_what_is_in_them_changes_the_fingerprint(self, scenario_file):
        path = scenario_file('name = "x"\n[people]\nmotion = { file = "a.bvh" }')
        clip = path.parent / "a.bvh"
        missing = fingerprint(load(path))
        clip.write_text("HIERARCHY")
        first = fingerprint(load(path))
        clip.write_text("HIERARCHY ROOT")
        assert len({missing, first, fingerprint(load(path))}) == 3

    def test_a_named_motion_is_played_by_everybody(self, scenario_file):
        path = scenario_file('name = "x"\n[people]\nmotion = { file = "a.bvh" }')
        assert load(path).people.activities == ("mocap",)
        mixed = load(path, overrides=['people.activities=["walk", "mocap"]'])
        assert mixed.people.activities == ("walk", "mocap")

    @pytest.mark.parametrize("text", ['activities = ["mocap"]', 'activities = ["walk"]\nmotion = { file = "a.bvh" }'])
    def test_a_motion_without_a_player_and_the_reverse_are_refused(self, scenario_file, text):
        assert "go together: give both or neither" in refusal(scenario_file(f'name = "x"\n[people]\n{text}'))

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("push = { impulse = 50 }", 'people.playback = "dynamic" with people.push.impulse above 0'),
            ('playback = "dynamic"\ncount = 3\npush = { impulse = 50, person = 3 }', "below people.count = 3, got 3"),
        ],
    )
    def test_a_push_that_nobody_would_feel_is_refused(self, scenario_file, text, expected):
        assert expected in refusal(scenario_file(f'name = "x"\n[people]\n{text}'))


def test_names_that_cannot_be_of_files_are_refused(scenario_file):
    for key in ("detector.profile", "cameras.rig", "extends"):
        for name in ("x" * 5000, "x" * 5000 + ".toml", "a\\u0000b"):
            message = refusal(scenario_file(f'name = "x"\n{key} = "{name}"'))
            assert len(message) <= 500
