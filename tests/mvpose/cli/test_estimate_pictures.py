"""``mvpose estimate --pictures``: pictures and films on the page, with detections of another program."""

import json

import cv2
import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim
from mvpose.formats.pictures import is_cut, open_pictures, uncut
from mvpose.report.film_file import FilmFile

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


@pytest.mark.slow
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
    by_name, remark = named.numbered_for([10, 12])
    assert remark == ""
    assert [np.median(by_name.picture(number)) for number in (10, 12, 16)] == [40, 80, 160]
    assert by_name.picture(11) is None
    in_order, remark = named.numbered_for([300, 301, 302, 303])
    assert "4 pictures with the numbers 10 to 16 are taken in order for frames 300 to 303" in remark
    assert [np.median(each) for each in in_order.some([301, 303])] == [80, 160]
    assert np.median(source.numbered_for([1])[0].picture(3)) == 160
    assert source.picture(4) is None


def test_lost_pictures_are_plain_ground_and_counted(tmp_path):
    for number in (*range(9), 10, 11):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((96, 128, 3), 5 + number, np.uint8))
    source, remark = open_pictures(tmp_path).numbered_for(list(range(12)))
    assert "1 of frames 0 to 11 have none" in remark
    cv2.imwrite(str(tmp_path / "10.png"), np.zeros((128, 128, 3), np.uint8))  # another camera's
    found = [None if each is None else np.median(each) for each in source.some([8, 9, 10, 11])]
    assert found == [13, None, None, 16]


class TestPicturesOfAnotherRecording:
    """Pictures that cannot be those of the detections: people would be drawn into wrong pictures."""

    @pytest.fixture
    def other(self, tmp_path):
        def other(count=FRAMES, size=(128, 96), first=0, video=False):
            for name in NAMES:
                (tmp_path / "other").mkdir(exist_ok=True)
                pictures = [np.full((size[1], size[0], 3), 40 + number, np.uint8) for number in range(count)]
                if video:
                    with FilmFile(tmp_path / "other" / f"{name}.mp4", 50.0) as film:
                        for each in pictures:
                            film.add(each)
                    continue
                (tmp_path / "other" / name).mkdir(exist_ok=True)
                for number, each in enumerate(pictures):
                    cv2.imwrite(str(tmp_path / "other" / name / f"{first + number}.png"), each)
            return tmp_path / "other"

        return other

    @pytest.mark.parametrize(
        ("about", "message"),
        [
            ({"count": 2}, "has 2 pictures with the numbers 0 to 1, and the detections have 4 frames"),
            ({"count": 9, "first": 100}, "has 9 pictures with the numbers 100 to 108"),
            ({"size": (128, 72)}, "pictures of 128 x 72 pixels, but camera cam0 has 1280 x 960"),
            ({"size": (128, 72), "video": True}, "pictures of 128 x 72 pixels, but camera cam0 has 1280 x 960"),
        ],
    )
    def test_it_is_refused_before_the_estimation(self, lab, tmp_path, other, about, message):
        result = estimate(lab, tmp_path / "out", "--pictures", other(**about))
        assert result.exit_code == 2
        assert message in result.stderr.splitlines()[-1]
        assert not (tmp_path / "out").exists()

    def test_a_video_that_is_too_short_is_refused(self, tmp_path, other):
        source = open_pictures(other(count=20, video=True) / "cam0.mp4")
        assert source.numbered_for(list(range(22)))[0] is source  # headers are often wrong by so much
        with pytest.raises(ValueError, match="has 20 pictures, and the detections have 601 frames"):
            source.numbered_for(list(range(601)))

    @pytest.mark.slow
    def test_more_pictures_than_frames_are_noted(self, lab, tmp_path, other):
        result = estimate(lab, tmp_path / "out", "--pictures", other(count=30), "--no-films")
        assert result.exit_code == 0
        assert "cam0: has 30 pictures for frames 0 to 3; check that they are of this recording" in result.stderr

    @pytest.mark.slow
    def test_the_rate_is_that_of_the_videos(self, lab, tmp_path, other):
        words = ["estimate", lab / "Calib.toml", lab / "openpose", "--out", tmp_path / "out", "--method", "fast"]
        words += ["--pictures", other(video=True), "--no-films"]
        assert CliRunner().invoke(app, list(map(str, words))).exit_code == 0
        assert json.loads((tmp_path / "out" / "inputs.json").read_text())["fps"] == 50


@pytest.mark.slow
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


@pytest.mark.slow
def test_pictures_that_codecs_cut_are_not_scaled(lab, tmp_path):
    assert is_cut((1080, 1920), (1088, 1920))
    assert not any(is_cut(size, (1088, 1920)) for size in ((1088, 1920), (1072, 1920), (1096, 1920), (544, 960)))
    picture = np.random.default_rng(0).integers(0, 255, (40, 30, 3), np.uint8)
    assert (uncut(picture, (32, 48))[:40, :30] == picture).all()
    assert uncut(picture, (60, 80)) is picture
    for name in NAMES:
        (tmp_path / "cut" / name).mkdir(parents=True)
        for frame in range(FRAMES):
            cv2.imwrite(str(tmp_path / "cut" / name / f"{frame}.png"), np.full((946, 1280, 3), 200, np.uint8))
    result = estimate(lab, tmp_path / "out", "--pictures", tmp_path / "cut", "--frames", "0:1")
    assert result.exit_code == 0, result.output
    assert "cam0 1280 x 946 instead of 1280 x 960 pixels are taken as cut at the right and the bottom" in result.stderr
    film = next(open_pictures(tmp_path / "out" / "films" / "cam0.mp4").pictures())
    bright = np.median(film, axis=(1, 2)) > 100
    assert abs(bright.sum() / len(film) - 946 / 960) < 2 / len(film)
