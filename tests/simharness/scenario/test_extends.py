"""``extends``: a scenario file over another."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.layers import merge
from simharness.scenario.load import ScenarioError, load
from simharness.scenario.sections.scenario import Scenario


@pytest.fixture
def write(tmp_path):
    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


def refusal(path, **options) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(path, **options)
    return str(caught.value)


def test_what_a_file_says_goes_over_its_base_key_by_key(write):
    write("base.toml", 'name = "base"\nrate = 5\n[people]\ncount = 3\narea = 1.5\nactivities = ["walk", "wave"]')
    path = write("top.toml", 'extends = "base.toml"\nname = "top"\n[people]\ncount = 2\nactivities = ["run"]')
    loaded = load(path)
    assert (loaded.name, loaded.rate, loaded.people.count, loaded.people.area) == ("top", 5.0, 2, 1.5)
    assert loaded.people.activities == ("run",)  # lists are replaced


def test_a_file_that_says_nothing_else_is_its_base(write):
    base = write("base.toml", 'name = "base"\nseed = 4\n[people]\ncount = 3\n[detector.keypoints]\nmiss = 0.2')
    assert load(write("top.toml", 'extends = "base.toml"')) == load(base)


def test_bases_have_bases(write):
    write("a.toml", 'name = "a"\nseed = 1\nrate = 1\nduration = 1')
    write("b.toml", 'extends = "a.toml"\nseed = 2\nrate = 2')
    top = load(write("c.toml", 'extends = "b.toml"\nseed = 3'))
    assert (top.seed, top.rate, top.duration) == (3, 2.0, 1.0)
    assert load(write("c.toml", 'extends = "b.toml"\nseed = 3'), overrides=["rate=9"]).rate == 9.0


def test_a_number_for_all_joints_gives_way_joint_by_joint(write):
    write("base.toml", 'name = "base"\n[detector.keypoints]\nmiss = 0.2')
    miss = load(
        write("top.toml", 'extends = "base.toml"\n[detector.keypoints.miss]\nhips = 0.5')
    ).detector.keypoints.miss
    assert (miss.hips, miss.knees) == (0.5, 0.2)


def test_files_and_presets_of_a_base_are_beside_it(write, tmp_path):
    write("lab/detectors/mine.toml", 'name = "mine"\n[keypoints]\nscatter = 0.25')
    write("lab/wide.toml", 'layout = "ring"\ncount = 9')
    write("lab/base.toml", 'name = "b"\n[cameras]\nrig = "wide.toml"\n[detector]\nprofile = "mine"\nonnx = "head.onnx"')
    top = load(write("top.toml", 'extends = "lab/base.toml"\n[appearance]\nnetwork = "reid.onnx"'))
    assert top.detector.keypoints.scatter.nose == 0.25
    assert top.detector.onnx == str(tmp_path / "lab" / "head.onnx")
    assert top.appearance.network == str(tmp_path / "reid.onnx")
    assert top.cameras.count == 9


def test_variants_are_those_of_the_last_who_says(write):
    write("base.toml", 'name = "base"\n[method]\nvariants = ["full"]')
    assert load(write("top.toml", 'extends = "base.toml"\nvariants = ["fast"]')).method.variants == ("fast",)
    assert load(write("top.toml", 'extends = "base.toml"'), overrides=['variants=["fast"]']).method.variants == (
        "fast",
    )
    twice = write("twice.toml", 'name = "t"\nvariants = ["fast"]\n[method]\nvariants = ["full"]')
    assert refusal(twice) == f"{twice}: variants and method.variants are the same key; remove one of them"


class TestMistakes:
    def test_the_file_is_named_that_makes_them(self, write):
        base = write("base.toml", 'name = "base"\n[people]\ncuont = 2\ncount = -1\narea = -1')
        top = write("top.toml", 'extends = "base.toml"\n[people]\ncount = 2\n[cameras]\nfov = 400')
        message = refusal(top)
        head, first, second, third = re.split(r"; \([23]\) |\(1\) ", message)
        assert head == f"{base.parent}/: 3 mistakes: "
        assert [each.partition(": ")[0] for each in (first, second, third)] == [base.name, base.name, top.name]
        assert {key for key in ("area", "cuont") if key in first + second} == {"area", "cuont"}
        assert "fov" in third

    def test_of_keys_that_do_not_go_together_the_last_is_named(self, write):
        write("base.toml", 'name = "base"\n[people]\nactivities = ["walk"]\ncount = 2')
        top = write("top.toml", 'extends = "base.toml"\n[people]\nactivities = ["mocap"]')
        assert refusal(top).startswith(f"{top}: people: ")

    @pytest.mark.parametrize("length", [1, 2, 3])
    def test_circles_are_refused_with_the_whole_chain(self, write, length):
        for index in range(length):
            path = write(f"{index}.toml", f'name = "x"\nextends = "{(index + 1) % length}.toml"')
        chain = [path.parent / f"{index % length}.toml" for index in range(length + 1)]
        assert refusal(chain[0]).startswith(" extends ".join(map(str, chain)) + ": ")

    def test_a_missing_base_names_the_place_and_what_is_near(self, write):
        near = write("quick.toml", 'name = "quick"')
        top = write("top.toml", 'extends = "quik.toml"')
        message = refusal(top)
        assert message.startswith(f"{top}: extends: {near.parent / 'quik.toml'}: no such file")
        assert f"did you mean {near}?" in message

    def test_what_is_no_file_name_is_refused(self, write):
        assert "extends: expected a scenario file or the name of a shipped one, got 3" in refusal(
            write("a.toml", "extends = 3")
        )
        assert "extends cannot be set" in refusal(write("a.toml", 'name = "a"'), overrides=["extends=b.toml"])


KEYS = [("a",), ("b", "a"), ("b", "b"), ("c", "a", "a"), ("c", "a", "b")]
SETTINGS = st.dictionaries(st.sampled_from(KEYS), st.integers() | st.lists(st.integers(), max_size=2))


def as_sections(settings):
    data: dict = {}
    for *sections, key in settings:
        section = data
        for name in sections:
            section = section.setdefault(name, {})
        section[key] = settings[*sections, key]
    return data


@given(base=SETTINGS, changes=SETTINGS)
def test_settings_are_merged_like_dictionaries_of_dotted_keys(base, changes):
    before = as_sections(base)
    assert merge(before, as_sections(changes)) == as_sections(base | changes)
    assert before == as_sections(base)  # it is left as it is


def test_a_scenario_without_extends_is_as_before(write):
    text = 'name = "a"\n[sensor]\nprofile = "perfect"\n[detector]\nprofile = "perfect"'
    assert load(write("a.toml", text)) == Scenario(name="a")
