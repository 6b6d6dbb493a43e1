import io
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from simharness.report.run.film import animate, animated_frames


@given(st.integers(1, 100_000))
def test_the_frames_of_a_film_are_evenly_spaced_and_few(count):
    frames = animated_frames(count)
    assert frames[0] == 0
    assert 0 < len(frames) <= 60
    assert len(set(np.diff(frames))) <= 1
    assert frames == list(range(count)) or len(frames) > 30  # no more frames are left out than necessary


def test_the_film_plays_every_view_in_real_time():
    """Two cameras: the first shows red and then blue, the second is always green."""
    red, green, blue = (
        np.full((60, 80, 3), color, np.uint8) for color in ((220, 30, 30), (30, 200, 30), (30, 30, 220))
    )
    record = SimpleNamespace(rig=[SimpleNamespace(name="a"), SimpleNamespace(name="b")], time=np.arange(9) * 0.05)
    film = animate({4: np.stack([blue, green]), 0: np.stack([red, green])}, record)
    with Image.open(io.BytesIO(film.webp)) as picture:
        assert picture.n_frames == 2
        seen = []
        for frame in range(2):
            picture.seek(frame)
            pixels = np.asarray(picture.convert("RGB"), float)
            seen.append([pixels[40, 40].argmax(), pixels[40, -40].argmax()])
            assert picture.info["duration"] == 200
    assert seen == [[0, 1], [2, 1]]
    assert film.caption.startswith("2 of 9 frames")
    assert film.uri.startswith("data:image/webp;base64,")
