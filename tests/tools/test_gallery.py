"""The catalogue names scenes, cameras and frames that exist; pictures are small; sheets are in order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from simharness.scenario.load import load
from simharness.world.rigs.layouts import build_rig
from tools.gallery.__main__ import index, small_jpeg
from tools.gallery.catalogue import COMPARISON, GALLERY, GalleryPicture, read_catalogue
from tools.gallery.sheet import comparison_sheet

MOST_PIXELS = (1032, 776)


@pytest.mark.parametrize("catalogue", [GALLERY, COMPARISON])
def test_every_picture_is_of_a_camera_and_a_frame_of_its_scene(catalogue: Path) -> None:
    for picture in read_catalogue(catalogue):
        scenario = load(picture.scenario)
        rig = build_rig(scenario.cameras, seed=scenario.seed, room=scenario.room.size)
        assert 0 <= picture.frame < scenario.frames, picture
        assert 0 <= picture.camera < len(rig), picture
        assert all(size <= most for size, most in zip(rig[picture.camera].size, MOST_PIXELS, strict=True)), picture


def test_the_gallery_has_thirteen_scenes_of_which_two_show_detections_and_estimates() -> None:
    pictures = read_catalogue()
    assert len({picture.scene for picture in pictures}) == 13
    assert sum({"detections", "estimates"} <= set(picture.layers) for picture in pictures) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('scene = "shelf"\ncamera = 0\nframe = 0\ntext = ""\nlayer = []', "unknown keys layer"),
        ('scene = "shelf"\ncamera = 0\nframe = 0\ntext = ""\nlayers = ["depth"]', "unknown layers depth"),
        ('scene = "nowhere"\ncamera = 0\nframe = 0\ntext = ""', "has no file"),
    ],
)
def test_a_mistake_in_a_catalogue_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "pictures.toml"
    path.write_text(f"[[pictures]]\n{text}\n")
    with pytest.raises(ValueError, match=message):
        read_catalogue(path)


def test_a_picture_has_the_best_quality_that_is_small_enough() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
    best = small_jpeg(rgb, most=10**6)
    smaller = small_jpeg(rgb, most=len(best) - 1)
    assert len(smaller) < len(best)
    assert len(small_jpeg(rgb, most=len(smaller))) == len(smaller)


def test_before_is_left_of_after() -> None:
    before, after = (np.full((90, 120, 3), shade, np.uint8) for shade in (40, 200))
    sheet = comparison_sheet([("room", before, after), ("hall", before, after)], width=400)
    assert sheet.shape[1] == 400
    for row in (0.25, 0.75):
        line = sheet[round(row * sheet.shape[0]), :, 0]
        assert line[100] == 40
        assert line[300] == 200
    with pytest.raises(ValueError, match="pictures of one size"):
        comparison_sheet([("room", before, after[:-2])], width=400)


def test_the_index_names_file_and_command_of_each_picture() -> None:
    text = index([GalleryPicture("shop", 3, 2, "Customers.", ("truth", "estimates"))])
    assert "![Customers.](shop-3.jpg)" in text
    assert "    simharness render tools/gallery/scenes/shop.toml --overlay truth,estimates" in text
