"""Films of cameras: what is in them, read back; and the page that shows them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from synthetic_recording import recording

from mvpose import Rig
from mvpose.recording import People
from mvpose.report.examined_recording import ExaminedRecording
from mvpose.report.films import write_films
from mvpose.report.palette import identity_color
from mvpose.report.recording_page import write_page

GREY = 90
SUFFIX = ".mp4"


def grey(rig, missing=()):
    """Pictures without anything, of which some frames are missing."""

    def pictures(view, frames):
        width, height = rig[view].size
        for frame in frames.tolist():
            yield None if frame in missing else np.full((height, width, 3), GREY, np.uint8)

    return pictures


def frames_of(path):
    reader = cv2.VideoCapture(str(path))
    found = []
    while True:
        good, picture = reader.read()
        if not good:
            return np.array(found), reader.get(cv2.CAP_PROP_FPS)
        found.append(picture[..., ::-1].astype(int))


@pytest.mark.slow
def test_people_are_drawn_where_they_are(tmp_path):
    rig, frames, people = recording(1, frames=5, cameras=3)
    done = []
    films = write_films(tmp_path, ExaminedRecording.of(people, rig, frames), grey(rig), progress=done.append)
    assert [film.address for film in films] == [f"films/cam{view}{SUFFIX}" for view in range(3)]
    assert sum(done) == 15
    color = np.array([int(identity_color(0)[k : k + 2], 16) for k in (1, 3, 5)])
    limb = 0.6 * color + 0.4 * GREY  # translucent
    for view, film in enumerate(films):
        pictures, rate = frames_of(tmp_path / film.address)
        assert len(pictures) == 5
        assert rate == pytest.approx(25.0, rel=0.01)
        scale = pictures.shape[2] / rig[view].size[0]
        for frame in (0, 4):
            knees, ankles = (rig[view].project(people.joints[frame, 0, [j, j + 1]]) for j in (13, 15))
            for x, y in 0.5 * (knees + ankles):  # the middle of a shank
                row, column = round(scale * y), round(scale * x)
                near = pictures[frame, row - 6 : row + 7, column - 6 : column + 7].reshape(-1, 3)
                assert np.abs(near - limb).max(axis=1).min() < 30
        assert np.median(np.abs(pictures - GREY)) < 6  # the picture itself, in the colours of the codec


def test_a_missing_picture_is_plain_ground(tmp_path):
    rig, frames, people = recording(1, frames=3, cameras=2)
    films = write_films(tmp_path, ExaminedRecording.of(people, rig, frames), grey(rig, missing=[1]))
    pictures, _ = frames_of(tmp_path / films[0].address)
    assert [round(float(np.median(each))) > 200 for each in pictures] == [False, True, False]


def test_names_of_cameras_are_safe_names_of_files(tmp_path):
    rig, frames, people = recording(1, frames=2, cameras=3)
    rig = Rig([replace(camera, name=name) for camera, name in zip(rig, ("../up", "a b", "a/b"), strict=True)])
    films = write_films(tmp_path, ExaminedRecording.of(people, rig, frames), grey(rig))
    assert [film.address for film in films] == [f"films/{name}{SUFFIX}" for name in ("_up", "a_b_1", "a_b_2")]
    assert [film.camera for film in films] == ["../up", "a b", "a/b"]


def test_nothing_is_printed(tmp_path, capfd):
    rig, frames, people = recording(1, frames=2, cameras=2)
    write_films(tmp_path, ExaminedRecording.of(people, rig, frames), grey(rig))
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize("somebody", [True, False])
def test_the_page_shows_the_films(tmp_path, somebody):
    rig, frames, people = recording(1, frames=2, cameras=2)
    if not somebody:
        people = People(people.times, np.zeros(0, int), people.joints[:, :0], people.scores[:, :0])
    write_page(tmp_path, name="a", people=people, rig=rig, frames=frames, moving=grey(rig))
    page = (tmp_path / "recording.html").read_text(encoding="utf-8")
    for name in ("cam0", "cam1"):
        assert (f'src="films/{name}{SUFFIX}" poster="data:image/jpeg;base64,' in page) == somebody
        assert (tmp_path / "films" / f"{name}{SUFFIX}").exists() == somebody
