"""``mvpose estimate --pictures``: pictures and films on the page, with detections of another program."""

import cv2
import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim
from mvpose.formats.pictures import open_pictures

NAMES = ["cam0", "cam1", "cam2", "cam3"]
FRAMES = 4


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Files of two people in four frames, and grey pictures whose brightness is the number of the frame."""
    folder = tmp_path_factory.mktemp("pictured")
    rig, _, pixels = filmed(frames=FRAMES)
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    write_openpose(folder / "openpose", NAMES, pixels)
    for name in NAMES:
        (folder / "pictures" / name).mkdir(parents=True)
        for frame in range(FRAMES):
            cv2.imwrite(
                str(folder / "pictures" / name / f"{frame}.png"), np.full((96, 128, 3), 40 + 40 * frame, np.uint8)
            )
    return folder


def estimate(lab, out, *options):
    words = ["estimate", lab / "Calib.toml", lab / "openpose", "--out", out, "--fps", 25, "--method", "fast", *options]
    return CliRunner().invoke(app, list(map(str, words)))


def test_films_show_the_pictures_of_the_frames(lab, tmp_path):
    result = estimate(lab, tmp_path / "out", "--pictures", lab / "pictures", "--frames", "1:3")
    assert result.exit_code == 0, result.output
    films = sorted((tmp_path / "out" / "films").iterdir())
    assert [film.stem for film in films] == NAMES
    brightness = [float(np.median(picture)) for picture in open_pictures(films[0]).pictures()]
    np.testing.assert_allclose(brightness, [80, 120, 160], atol=6)
    page = (tmp_path / "out" / "recording.html").read_text(encoding="utf-8")
    assert page.count("<video ") == 4


def test_pictures_have_the_numbers_of_the_frames(lab, tmp_path):
    """Files called 10, 12, 14, 16 are those of the frames 10, 12, 14, 16; others are taken in order."""
    source = open_pictures(lab / "pictures" / "cam0")
    for row, file in enumerate(sorted((lab / "pictures" / "cam0").iterdir())):
        (tmp_path / f"cam0_{10 + 2 * row}.png").write_bytes(file.read_bytes())
    named = open_pictures(tmp_path)
    for number, brightness in ((10, 40), (12, 80), (16, 160)):
        assert np.median(named.numbered_for([10, 12]).picture(number)) == brightness
    assert named.numbered_for([10]).picture(11) is None
    assert named.numbered_for([0, 1]) == named
    assert [np.median(each) for each in named.some([1, 3])] == [80, 160]
    assert np.median(source.numbered_for([1]).picture(3)) == 160
    assert source.picture(4) is None


def test_films_may_be_left_out(lab, tmp_path):
    result = estimate(lab, tmp_path / "out", "--pictures", lab / "pictures", "--no-films")
    assert result.exit_code == 0, result.output
    assert not (tmp_path / "out" / "films").exists()
    assert "data:image/jpeg" in (tmp_path / "out" / "recording.html").read_text(encoding="utf-8")


def test_pictures_of_other_cameras_are_refused_before_the_estimation(lab, tmp_path):
    result = estimate(lab, tmp_path / "out", "--pictures", lab / "pictures" / "cam1")
    assert result.exit_code == 2
    last = result.stderr.splitlines()[-1]
    assert last.startswith("error: no pictures for the camera cam0, cam2, cam3")
    assert not (tmp_path / "out").exists()
