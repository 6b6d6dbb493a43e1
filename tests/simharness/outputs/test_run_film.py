"""Film of a run: its frames, its size and speed, its legend, and the estimates in it."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.outputs.run.pictures import encode_mp4, filmed_frames

RED, GREEN, BLUE = ((220, 30, 30), (30, 200, 30), (30, 30, 220))


def decoded(mp4, folder):
    """Return the pictures and the rate of an MP4 file."""
    path = folder / "film.mp4"
    path.write_bytes(mp4)
    video = cv2.VideoCapture(str(path))
    rate, pictures = video.get(cv2.CAP_PROP_FPS), []
    while True:
        read, bgr = video.read()
        if not read:
            return pictures, rate
        pictures.append(bgr[..., ::-1])


@given(st.integers(1, 100_000))
def test_the_frames_of_a_film_are_evenly_spaced_and_few(count):
    frames = filmed_frames(count)
    assert frames[0] == 0
    assert 0 < len(frames) <= 60
    assert len(set(np.diff(frames))) <= 1
    assert frames == list(range(count)) or len(frames) > 30  # no more frames are left out than necessary


def test_a_film_keeps_its_pictures_its_size_and_its_rate(tmp_path):
    shown = [np.full((61, 81, 3), color, np.uint8) for color in (RED, GREEN, BLUE)]
    pictures, rate = decoded(encode_mp4(shown, rate=5.0), tmp_path)
    assert rate == pytest.approx(5.0)
    assert [picture.shape for picture in pictures] == [(60, 80, 3)] * 3
    for picture, color in zip(pictures, (RED, GREEN, BLUE), strict=True):
        assert np.abs(picture[30, 40].astype(int) - color).max() < 25


def test_a_film_is_vp9_in_mp4():
    mp4 = encode_mp4([np.zeros((60, 80, 3), np.uint8)], rate=1.0)
    assert mp4[4:8] == b"ftyp"
    assert b"vp09" in mp4


def test_no_film_without_pyav(monkeypatch):
    monkeypatch.setattr("mvpose.report.film_file.has_pyav", lambda: False)
    assert encode_mp4([np.zeros((60, 80, 3), np.uint8)], rate=1.0) is None
