from typing import get_args

import numpy as np
import pytest

from mvpose import Rig
from mvpose.formats.calibration import panoptic, voxelpose
from simharness.scenario.sections.cameras_section import CamerasSection, Preset
from simharness.world.rigs.layouts import PRESETS, build_rig, preset_rig
from simharness.world.rigs.projection import check_lens


def test_a_scenario_can_name_every_preset():
    assert set(get_args(Preset)) == set(PRESETS)
    for name in PRESETS:
        assert len(build_rig(CamerasSection(layout="preset", preset=name))) >= 3


@pytest.mark.parametrize(
    ("name", "count", "size"), [("campus", 3, (360, 288)), ("shelf", 5, (1032, 776)), ("panoptic", 31, (1920, 1080))]
)
def test_published_rigs_have_their_cameras_and_sizes(name, count, size):
    rig = preset_rig(name)
    assert len(rig) == count
    for camera in rig:
        assert camera.size == size
        check_lens(camera)


@pytest.mark.parametrize(
    ("name", "indices"),
    [
        ("cmu0", {3, 6, 12, 13, 23}),
        ("cmu1", {1, 2, 3, 4, 6, 7, 10}),
        ("cmu2", {12, 16, 18, 19, 22, 23, 30}),
        ("cmu3", {10, 12, 16, 18}),
        ("cmu4", {6, 7, 10, 12}),
        ("panoptic3", {3, 6, 12}),
        ("panoptic4", {3, 6, 12, 13}),
        ("panoptic6", {3, 6, 10, 12, 13, 23}),
        ("panoptic7", {3, 6, 10, 12, 13, 16, 23}),
    ],
)
def test_the_panoptic_sets_are_those_of_the_papers(name, indices):
    assert {camera.name for camera in preset_rig(name)} == {f"00_{index:02d}" for index in indices}


def test_panoptic_cameras_surround_the_centre_above_the_floor():
    """The dome is 5.5 m across and every HD camera sees its middle, 1 m above the floor."""
    rig = preset_rig("panoptic")
    distance = np.linalg.norm(rig.centers - (0, 0, 1), axis=1)
    assert 2.2 < distance.min() < distance.max() < 3.9
    assert rig.centers[:, 2].min() > 0.7
    for camera in rig:
        assert camera.inside(camera.project((0.0, 0.0, 1.0)))
        assert camera.R[1, 2] < -0.5  # image y runs down the world


@pytest.mark.parametrize("name", ["shelf", "campus"])
def test_the_cameras_see_the_captured_middle_upright(name):
    for camera in preset_rig(name):
        assert camera.R[1, 2] < -0.8
        feet, head = camera.project([(0, 0, 0), (0, 0, 1.8)])
        assert camera.inside((feet + head) / 2)
        assert head[1] < feet[1]


@pytest.mark.parametrize(
    ("only", "message"),
    [
        (
            ("00_033", "00_06"),
            r"cameras\.only: the rig has no camera '00_033'; did you mean '00_03'\? its 5 cameras are 00_03,",
        ),
        (("00_03", "00_03"), r"cameras\.only: '00_03' is given more than once"),
        (("00_03",), r"cameras\.only: expected at least 2 cameras"),
    ],
)
def test_unknown_cameras_are_named(only, message):
    with pytest.raises(ValueError, match=message):
        preset_rig("cmu0", only=only)


def test_cameras_are_selected_in_the_given_order():
    rig = build_rig(CamerasSection(layout="preset", preset="shelf", only=("3", "0")))
    assert [camera.name for camera in rig] == ["3", "0"]


def test_an_unknown_rig_is_named():
    with pytest.raises(
        ValueError, match=r"cameras\.preset = 'cmu9' is no published rig; expected one of campus, shelf"
    ):
        preset_rig("cmu9")


@pytest.mark.parametrize(
    ("name", "file", "middle"),
    [
        ("shelf", "shelf/calibration_shelf.json", (0.45, -0.32, 0.0)),
        ("campus", "calibration_campus.json", (3.0, 4.5, 0.0)),
        ("panoptic", "panoptic/160906_band1/calibration_160906_band1.json", (0.0, 0.0, 0.0)),
    ],
)
def test_presets_project_as_the_published_calibration(shared_data, name, file, middle):
    """Within half a pixel of the published file, moved to our origin, for what is at least 2 m from the camera."""
    preset = preset_rig(name)
    if name == "panoptic":
        published = panoptic.read_calibration(shared_data / file)
    else:
        published = voxelpose.read_calibration(shared_data / file, size=preset[0].size)
    points = np.random.default_rng(0).uniform((-2, -2, 0), (2, 2, 2), (4000, 3))
    seen = 0
    for camera, published_camera in zip(preset, Rig(list(published)), strict=True):
        assert camera.name == published_camera.name
        pixels = published_camera.project(points + middle)
        clear = published_camera.inside(pixels) & (published_camera.depth(points + middle) > 2)
        clear &= np.linalg.norm(published_camera.center - middle - camera.center) < 1e-3
        back = np.linalg.norm(
            np.cross(published_camera.rays(pixels), points + middle - published_camera.center), axis=1
        )
        clear &= back < 1e-6  # a direction beyond the fold of the lens has a second, wrong pixel
        assert np.linalg.norm(camera.project(points) - pixels, axis=1)[clear].max() < 0.5
        seen += clear.sum()
    assert seen > 500 * len(preset)
