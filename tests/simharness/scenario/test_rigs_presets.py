"""``[cameras] rig = NAME``: rigs that scenarios begin with."""

from pathlib import Path

import pytest

from simharness.scenario.layers import RIGS
from simharness.scenario.load import ScenarioError, load, load_study
from simharness.scenario.presets import summary_of
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.world.rigs.layouts import build_rig

SHIPPED = sorted(RIGS.shipped.glob("*.toml"))
CAMERAS = {
    "ring5": 5,
    "ring8": 8,
    "corners4": 4,
    "stereo-pairs": 6,
    "dome12": 12,
    "campus": 3,
    "shelf": 5,
    "panoptic": 5,
}


@pytest.fixture
def scenario(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "room.toml"
        path.write_text(f'name = "room"\n{text}', encoding="utf-8")
        return path

    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "mine.toml").write_text('# Mine.\nlayout = "arc"\ncount = 7\nfov = 50\n')
    return write


def test_the_rigs_that_ship_are_those_that_are_tested():
    assert {path.stem for path in SHIPPED} == set(CAMERAS)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_rig_can_be_built_and_says_what_it_is(path, scenario):
    cameras = load(scenario(f'[cameras]\nrig = "{path.stem}"')).cameras
    for room in [(8.0, 8.0, 3.0), None]:
        assert len(build_rig(cameras, room=room)) == CAMERAS[path.stem]
    assert 20 < len(summary_of(path)) < 100


def test_ring5_is_quickstarts_rig(scenario):
    quickstart = load(RIGS.shipped.parent / "quickstart.toml").cameras
    assert load(scenario('[cameras]\nrig = "ring5"')).cameras == quickstart


def test_there_is_no_rig_where_none_is_named(scenario):
    assert load(scenario("")).cameras == CamerasSection()
    assert load(scenario('[cameras]\nrig = ""\ncount = 4')).cameras == CamerasSection(count=4)


def test_other_keys_change_a_rig(scenario):
    cameras = load(scenario('[cameras]\nrig = "mine"\ncount = 3'), overrides=["cameras.height=1.5"]).cameras
    assert cameras == CamerasSection(layout="arc", count=3, fov=50.0, height=1.5)


def test_a_rig_may_begin_with_another_and_name_files_beside_it(scenario, tmp_path):
    (tmp_path / "rigs" / "other.toml").write_text('rig = "mine"\ncount = 2\n')
    assert load(scenario('[cameras]\nrig = "other"')).cameras == CamerasSection(layout="arc", count=2, fov=50.0)
    (tmp_path / "rigs" / "real.toml").write_text('layout = "file"\nfile = "calibration.json"\n')
    cameras = load(scenario('[cameras]\nrig = "real"')).cameras
    assert cameras.file == str(tmp_path / "rigs" / "calibration.json")


class TestCamerasThatWereWrittenOut:
    """They are a rig themselves: they make way for one that is named later, where keys beside a name change it."""

    WRITTEN = "[cameras]\ncount = 4\nheights = [1.0, 2.0]\n"

    def test_they_make_way_for_one_on_the_command_line(self, scenario):
        cameras = load(scenario(self.WRITTEN), overrides=["cameras.fov=60", "cameras.rig=mine"]).cameras
        assert cameras == CamerasSection(layout="arc", count=7, fov=60.0)

    def test_they_make_way_for_one_of_a_file_that_extends_them(self, scenario, tmp_path):
        scenario(self.WRITTEN)
        top = tmp_path / "top.toml"
        top.write_text('extends = "room.toml"\n[cameras]\nrig = "mine"\nfov = 60')
        assert load(top).cameras == CamerasSection(layout="arc", count=7, fov=60.0)

    def test_they_make_way_for_one_of_a_case(self, scenario):
        study = load_study(scenario(self.WRITTEN + '[cases.a]\n[cases.b]\ncameras.rig = "mine"'))
        assert [setting.scenario.cameras for setting in study.settings] == [
            CamerasSection(count=4, heights=(1.0, 2.0)),
            CamerasSection(layout="arc", count=7, fov=50.0),
        ]

    def test_they_would_change_all_rigs_of_a_sweep(self, scenario):
        path = scenario(self.WRITTEN + '[sweep]\ncameras.rig = ["mine", "dome12"]')
        with pytest.raises(ScenarioError, match="has the keys count, heights, which would change every rig"):
            load_study(path)
        path = scenario('[cameras]\nrig = "ring5"\nfov = 60\n[sweep]\ncameras.rig = ["mine", "dome12"]')
        assert [(s.scenario.cameras.count, s.scenario.cameras.fov) for s in load_study(path).settings] == [
            (7, 60.0),
            (12, 60.0),
        ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('rig = "dome13"', r'cameras\.rig = "dome13": no such rig; expected one of .*mine.*Did you mean dome12\?'),
        ('rig = "none.toml"', "none.toml: no such file"),
        ("rig = 3", "cameras.rig: expected the name of a rig, got 3"),
        ('rgi = "dome12"', r"cameras\.rgi is not a key; did you mean cameras\.rig\?"),
    ],
)
def test_mistakes_are_named(scenario, text, message):
    with pytest.raises(ScenarioError, match=message):
        load(scenario(f"[cameras]\n{text}"))


def test_mistakes_in_a_rig_name_its_file(scenario, tmp_path):
    path = tmp_path / "rigs" / "mine.toml"
    path.write_text("cuont = 2\n")
    with pytest.raises(ScenarioError) as caught:
        load(scenario('[cameras]\nrig = "mine"'))
    assert str(caught.value).startswith(f"{path}: cameras.cuont is not a key; did you mean cameras.count?")
    path.write_text('rig = "mine"\n')
    with pytest.raises(ScenarioError, match=r"mine\.toml: begins with .* which begins with it"):
        load(scenario('[cameras]\nrig = "mine"'))
