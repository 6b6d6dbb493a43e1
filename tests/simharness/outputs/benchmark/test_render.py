"""Files of ``simharness render``."""

import cv2
import numpy as np
import pytest

from simharness.outputs.benchmark.render import RenderPlan, render
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import Scenario

pytestmark = pytest.mark.slow


def tiny(**sections) -> Scenario:
    defaults = {
        "people": PeopleSection(count=2, activities=("wave", "talk")),
        "cameras": CamerasSection(count=2, size=(160, 120)),
        "clutter": ClutterSection(boxes=1),
    }
    return Scenario(name="tiny", seed=5, duration=0.3, rate=10.0, **{**defaults, **sections})


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return render(tiny(), RenderPlan(), out=tmp_path_factory.mktemp("plain"))


def test_a_picture_for_every_camera_and_frame_and_a_mosaic(plain):
    names = sorted(str(path.relative_to(plain)) for path in plain.rglob("*.png"))
    assert names == [f"{camera}/000{k}.png" for camera in ("cam0", "cam1", "mosaic") for k in range(3)]
    pictures = [cv2.imread(str(plain / "cam0" / f"000{k}.png")) for k in range(3)]
    assert all(picture.shape == (120, 160, 3) for picture in pictures)
    assert pictures[0].std() > 10
    assert (pictures[0] != pictures[2]).any()
    assert cv2.imread(str(plain / "mosaic" / "0000.png")).shape[1] > 320
    assert [path.name for path in plain.parent.iterdir()] == ["tiny"]


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["truth", "detections", "estimates"])
def test_each_layer_changes_the_picture(plain, tmp_path, layer):
    folder = render(tiny(), RenderPlan(overlay=frozenset({layer}), every=2), out=tmp_path)
    assert sorted(path.name for path in (folder / "cam0").iterdir()) == ["0000.png", "0002.png"]
    drawn, bare = (cv2.imread(str(each / "cam0" / "0000.png")).astype(int) for each in (folder, plain))
    changed = (np.abs(drawn - bare).max(axis=2) > 20).mean()
    assert 0.003 < changed < 0.5


@pytest.mark.slow
def test_a_film_holds_every_frame(plain, tmp_path):
    folder = render(tiny(), RenderPlan(video=True), out=tmp_path)
    assert sorted(path.name for path in folder.glob("*.*")) == [".written", "cam0.mp4", "cam1.mp4", "mosaic.mp4"]
    film = cv2.VideoCapture(str(folder / "cam0.mp4"))
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(10.0)
    frames = []
    while True:
        good, frame = film.read()
        if not good:
            break
        frames.append(frame)
    assert len(frames) == 3
    still = cv2.imread(str(plain / "cam0" / "0001.png")).astype(int)
    assert np.abs(frames[1] - still).mean() < 12


@pytest.mark.slow
def test_a_dead_camera_is_black(tmp_path):
    folder = render(
        tiny(faults=FaultsSection(dead=(1,))), RenderPlan(every=3, overlay=frozenset({"truth"})), out=tmp_path
    )
    assert not cv2.imread(str(folder / "cam1" / "0000.png")).any()
    assert cv2.imread(str(folder / "cam0" / "0000.png")).any()


@pytest.mark.slow
def test_channels_are_written_beside_the_pictures(tmp_path):
    folder = render(tiny(), RenderPlan(channels=frozenset({"depth", "ids", "parts"}), every=3), out=tmp_path)
    depth, ids, parts = (
        cv2.imread(str(folder / "cam0" / f"0000.{name}.png"), cv2.IMREAD_UNCHANGED)
        for name in ("depth", "ids", "parts")
    )
    assert (depth.dtype, ids.dtype, parts.dtype) == (np.uint16, np.uint8, np.uint8)
    assert depth.shape == ids.shape == parts.shape == (120, 160)
    people = (ids > 0) & (ids < 255)
    assert {1, 2} <= set(np.unique(ids)) <= {0, 1, 2, 255}
    np.testing.assert_array_equal(parts > 0, people)
    assert len(np.unique(parts[people])) > 8
    assert 500 < np.median(depth[people]) < 8000  # millimetres, in a room
    assert depth[ids == 255].max() < 12000


def test_bad_requests_are_refused():
    with pytest.raises(ValueError, match="--overlay: unknown ghosts; expected any of truth, detections, estimates"):
        RenderPlan(overlay=frozenset({"ghosts", "truth"}))
    with pytest.raises(ValueError, match="--also needs pictures, not --video"):
        RenderPlan(video=True, channels=frozenset({"depth"}))
    with pytest.raises(ValueError, match="--every must be 1 or more, got 0"):
        RenderPlan(every=0)
