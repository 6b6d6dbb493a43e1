from __future__ import annotations

import numpy as np
import pytest

from mvpose.report.overlay import BoxTag, Overlay, legend, mosaic, readable_on, rooms_in_grid, text_mask
from mvpose.report.palette import COCO17_LIMBS, INK, OUTLINE, PAPER, TRUTH, UNMATCHED, css, person_color, plain_face
from mvpose.skeleton import COCO17

BLACK = np.zeros((600, 800, 3), np.uint8)
WHITE = (255, 255, 255)


def line(width, ends, *, rgb=BLACK, **changes):
    return Overlay(rgb, **changes).skeleton(ends, color=WHITE, edges=[(0, 1)], width=width, dots=0).rgb


@pytest.mark.parametrize("width", [1.0, 1.5, 2.25, 8.0])
@pytest.mark.parametrize("y", [300.0, 300.25, 300.5])
def test_a_line_covers_its_width_centred_on_its_pixels(width, y):
    column = line(width, [(100.0, y), (700.0, y)])[:, 400, 0] / 255
    assert column.sum() == pytest.approx(width, abs=0.26)  # masks are drawn four times as large
    assert (column * np.arange(600)).sum() / column.sum() == pytest.approx(y, abs=0.2)


def test_widths_grow_with_the_picture():
    large = line(3.0, [(100.0, 600.0), (1500.0, 600.0)], rgb=np.zeros((1200, 1600, 3), np.uint8))
    assert large[:, 800, 0].sum() / 255 == pytest.approx(6.0, abs=0.26)
    fixed = line(3.0, [(100.0, 600.0), (1500.0, 600.0)], rgb=np.zeros((1200, 1600, 3), np.uint8), scale=1.0)
    assert fixed[:, 800, 0].sum() / 255 == pytest.approx(3.0, abs=0.26)


def test_a_dot_covers_a_disc_at_its_pixel():
    rgb = Overlay(BLACK).skeleton([(123.4, 234.6)], color=WHITE, edges=[], dots=6.0).rgb[..., 0] / 255
    rows, columns = np.indices(rgb.shape)
    assert rgb.sum() == pytest.approx(np.pi * 36, rel=0.06)
    assert (rgb * columns).sum() / rgb.sum() == pytest.approx(123.4, abs=0.13)
    assert (rgb * rows).sum() / rgb.sum() == pytest.approx(234.6, abs=0.13)


def test_missing_joints_and_their_limbs_are_left_out():
    joints = np.full((17, 2), np.nan)
    joints[[5, 6]] = [(100, 100), (200, 100)]
    alone = Overlay(BLACK).skeleton(joints[[5, 6]], color=WHITE, edges=[(0, 1)]).rgb
    np.testing.assert_array_equal(Overlay(BLACK).skeleton(joints, color=WHITE).rgb, alone)
    assert alone.any()
    assert not Overlay(BLACK).skeleton(np.full((17, 2), np.nan), color=WHITE).rgb.any()


def test_translucent_limbs_are_even_where_they_cross():
    cross = [(300, 300), (500, 300), (400, 200), (400, 400)]
    rgb = Overlay(BLACK).skeleton(cross, color=WHITE, edges=[(0, 1), (2, 3)], width=10, dots=0, opacity=0.5).rgb
    assert rgb[300, 400, 0] == rgb[300, 350, 0] == rgb[250, 400, 0] == 128


def test_the_given_picture_is_not_drawn_on():
    picture = BLACK.copy()
    Overlay(picture).box((10, 10, 100, 100), color=WHITE, label="person 1")
    assert not picture.any()


@pytest.mark.parametrize("where", [(-1e9, 50.0), (1e9, 1e9), (900.0, 300.0)])
def test_what_is_off_the_picture_does_no_harm(where):
    rgb = Overlay(BLACK).skeleton([where, (400.0, 300.0)], color=WHITE, edges=[(0, 1)]).rgb
    assert rgb[300, 400].all()
    assert not Overlay(BLACK).skeleton([where], color=WHITE, edges=[]).rgb.any()


@pytest.mark.parametrize("box", [(5, 2, 60, 90), (780, 590, 200, 100), (-50, -50, 60, 60)])
def test_tags_stay_on_the_picture(box):
    bare, tagged = (Overlay(BLACK).box(box, color=(0, 119, 187), label=text).rgb for text in ("", "person 12"))
    rows, columns = np.nonzero((bare != tagged).any(axis=-1))
    height, width = text_mask("person 12", 15).shape
    assert np.ptp(rows) + 1 >= height
    assert np.ptp(columns) + 1 >= width


def test_a_box_without_a_number_is_not_drawn():
    assert not Overlay(BLACK).box((np.nan, 2, 3, 4), color=WHITE).rgb.any()


def test_an_outline_surrounds_a_pale_line_on_a_pale_ground():
    pale = np.full((600, 800, 3), 250, np.uint8)
    drawn = Overlay(pale).skeleton([(100, 300), (700, 300)], color=TRUTH, edges=[(0, 1)], width=2, dots=0, outline=2)
    column = drawn.rgb[:, 400, 0].astype(int)
    assert column[300] > 240
    assert column[297:304].min() < 100


def test_people_are_drawn_with_every_joint_and_symmetrically():
    assert {joint for edge in COCO17_LIMBS for joint in edge} == set(range(17))
    edges = {frozenset(edge) for edge in COCO17_LIMBS}
    assert {frozenset(COCO17.mirror[joint] for joint in edge) for edge in edges} == edges


def test_text_is_drawn_whole():
    assert text_mask("Ag", 20).shape[0] == text_mask("", 20).shape[0] == text_mask("ÅgÅ", 20).shape[0]
    wide, narrow = text_mask("cam0 at 0.5 s", 20), text_mask("cam0", 20)
    assert wide.shape[1] > narrow.shape[1] > 20
    assert narrow.max() == 1.0
    assert not text_mask("", 20).any()


def linear(color):
    return np.power(np.array(color) / 255, 2.2)


# Machado, Oliveira and Fernandes, "A physiologically-based model for simulation of color vision deficiency", 2009.
SIGHT = {
    "usual": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}


@pytest.mark.parametrize("sight", SIGHT)
def test_the_first_six_people_differ_to_every_eye(sight):
    import cv2

    colors = np.array([person_color(p) for p in range(6)] + [UNMATCHED])
    seen = np.clip(linear(colors) @ np.transpose(SIGHT[sight]), 0, 1) ** (1 / 2.2)
    lab = cv2.cvtColor(seen[None].astype(np.float32), cv2.COLOR_RGB2LAB)[0]
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=-1)[np.triu_indices(len(lab), 1)]
    assert apart.min() > 15  # CIE76; about 2.3 is just noticeable


def test_colours_repeat_and_no_person_is_grey():
    assert person_color(0) == person_color(8) != person_color(1)
    assert person_color(-1) == UNMATCHED
    assert css((0, 119, 187)) == "#0077bb"
    assert readable_on(TRUTH) == INK
    assert readable_on(OUTLINE) == PAPER


def test_a_mosaic_holds_every_picture_untouched():
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 256, (120, 160, 3), np.uint8) for _ in range(5)]
    sheet = mosaic(pictures, [f"cam{k}" for k in range(5)])
    corners = [
        [c for c in np.argwhere((sheet == p[0, 0]).all(-1)) if (sheet[c[0] : c[0] + 120, c[1] : c[1] + 160] == p).all()]
        for p in pictures
    ]
    assert [len(matches) for matches in corners] == [1] * 5
    places = np.array([matches[0] for matches in corners])
    assert len(set(places[:3, 0])) == 1 < len(set(places[:, 0]))  # three above, two below
    assert (places[3:, 1] == places[:2, 1]).all()
    assert (sheet[: places[0, 0], places[0, 1] : places[0, 1] + 60] < 120).any()  # the title stands above


def test_mosaic_columns():
    tile = np.zeros((60, 80, 3), np.uint8)
    assert mosaic([tile] * 3, ["a", "b", "c"], columns=3).shape[1] > 240
    assert mosaic([tile] * 3, ["a", "b", "c"], columns=1).shape[1] < 100


@pytest.mark.parametrize("count", range(1, 13))
def test_the_rooms_of_a_grid_are_those_of_the_mosaic(count):
    tile = np.zeros((60, 80, 3), np.uint8)
    size = mosaic([tile] * count, [""] * count).shape
    full = rooms_in_grid(count)
    assert mosaic([tile] * full, [""] * full, columns=int(np.ceil(np.sqrt(count)))).shape == size


def test_mosaic_fits_smaller_pictures_into_its_tiles_without_stretching_them():
    large, small = np.full((120, 160, 3), 10, np.uint8), np.full((30, 20, 3), 200, np.uint8)
    sheet = mosaic([large, small], ["a", "b"])
    assert sheet.shape == mosaic([large, large], ["a", "b"]).shape
    rows, columns = np.nonzero((sheet == 200).all(axis=2))
    assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (120, 80)


@pytest.mark.parametrize(
    ("pictures", "titles", "message"),
    [([], [], "got 0 pictures and 0 titles"), ([BLACK], [], "got 1 pictures and 0 titles")],
)
def test_bad_mosaics_are_refused(pictures, titles, message):
    with pytest.raises(ValueError, match=message):
        mosaic(pictures, titles)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(800, 600), (320, 240), (1600, 1200)])
def test_a_legend_fits_its_picture(size):
    entries = [
        ("skeleton", TRUTH, "truth"),
        ("limbs", person_color(1), "estimate, reprojected into the view"),
        ("box", UNMATCHED, "phantom"),
        ("none", INK, "frame 12"),
    ]
    picture = legend(entries, size=size, title="quickstart")
    assert picture.shape == (size[1], size[0], 3)
    border = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
    assert (border == np.array(PAPER)).all()
    assert (picture == np.array(person_color(1))).all(-1).sum() == 0  # translucent: mixed with the paper
    assert (np.abs(picture.astype(int) - UNMATCHED).max(-1) < 8).any()


def patches(rgb, colors):
    """Return which pixels have each colour."""
    return [np.abs(rgb.astype(int) - color).max(axis=-1) < 30 for color in colors]


def test_tags_of_people_who_stand_side_by_side_do_not_hide_each_other():
    colors = [(250, 0, 0), (0, 250, 0), (0, 0, 250)]
    boxes = [(300.0 + 4 * k, 200.0, 90.0, 250.0) for k in range(3)]
    alone = [patches(Overlay(BLACK).tags([BoxTag("7", boxes[0], color)]).rgb, [color])[0].sum() for color in colors]
    tags = [BoxTag("7", box, color) for box, color in zip(boxes, colors, strict=True)]
    together = [patch.sum() for patch in patches(Overlay(BLACK).tags(tags).rgb, colors)]
    assert together == alone
    drawn_over = Overlay(BLACK)
    for tag in tags:
        drawn_over.tag(tag.text, at=tag.box[:2], color=tag.color)
    assert patches(drawn_over.rgb, colors)[0].sum() < alone[0]  # as they were before


def test_tags_stay_within_the_picture():
    corner = Overlay(BLACK).tags([BoxTag("person 12", (760.0, -5.0, 80.0, 700.0), (250, 0, 0))]).rgb
    inside = Overlay(BLACK).tags([BoxTag("person 12", (300.0, 200.0, 80.0, 300.0), (250, 0, 0))]).rgb
    assert patches(corner, [(250, 0, 0)])[0].sum() == patches(inside, [(250, 0, 0)])[0].sum()
    assert not Overlay(BLACK).tags([BoxTag("1", (np.nan,) * 4, (250, 0, 0))]).rgb.any()


def test_a_small_face_has_one_dot_and_a_large_one_all():
    joints = np.full((17, 2), 300.0)
    joints[:5] = [(100, 100), (103, 97), (97, 97), (108, 99), (92, 99)]
    assert np.isfinite(plain_face(joints, least=30)).all(axis=1)[:5].tolist() == [True, False, False, False, False]
    assert np.isfinite(plain_face(joints, least=16)).all()
    np.testing.assert_array_equal(plain_face(joints, least=30)[5:], joints[5:])
    assert np.isfinite(joints).all()  # the given joints stay
