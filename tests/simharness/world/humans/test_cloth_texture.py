from dataclasses import replace

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import Part, make_body
from simharness.world.humans.cloth_texture import BAND, LENGTH, WHITE, WIDTH, picture
from simharness.world.humans.clothing import Garment, dress, garments, paint
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import PATTERNS, draw_look


@pytest.fixture(scope="module")
def body():
    return make_body(Shape())


def look_with(**changes):
    look = draw_look(stream(1, "test"))
    plain = {"below": "trousers", "hair_style": "short", "top_pattern": "plain", "bottom_pattern": "plain"}
    return replace(look, **(plain | {"top": (0.8, 0.2, 0.1), "accent": (0.1, 0.1, 0.4)} | changes))


def sample(coat):
    """Colour of every face at its middle: the nearest pixel of the texture times the colour of the face."""
    height, width = coat.texture.shape[:2]
    u, v = coat.uv.mean(1).T
    column, row = (np.floor(u * width).astype(int) % width), np.floor(v * height).astype(int) % height
    return coat.colors * coat.texture[row, column] / 255


@pytest.mark.parametrize("pattern", sorted(set(PATTERNS) - {"plain"}))
def test_patterned_cloth_shows_both_colours_about_alike(body, pattern):
    look = look_with(top_pattern=pattern)
    shown = sample(paint(body, look))[garments(body, look) == Garment.TOP]
    near = [(np.abs(shown - color).max(1) < 0.05).mean() for color in (look.top, look.accent)]
    assert min(near) > (0.1 if pattern != "blocks" else 0.05)  # of checks half is between; blocks leave the shoulders
    assert pattern == "checks" or sum(near) > 0.75


def test_what_is_plain_keeps_its_colour(body):
    look = look_with(top_pattern="stripes")
    coat, plain = paint(body, look), paint(body, look_with())
    others = garments(body, look) != Garment.TOP
    np.testing.assert_array_equal(sample(coat)[others], plain.colors[others])


def test_stripes_are_level_and_as_wide_as_their_number_has_it(body):
    """Down the middle of the front the colour changes twice in a repeat, wherever across the body one looks."""
    look = look_with(top_pattern="stripes", repeats=18)
    coat, height = paint(body, look), body.vertices[body.faces].mean(1)
    front = (body.part == Part.TORSO) & (height[:, 0] > 0.02) & (garments(body, look) == Garment.TOP)
    dark = np.abs(sample(coat) - look.accent).max(1) < 0.05
    bands = (height[front, 2] / (1.05 / 18)) % 1
    phase = np.angle(np.exp(2j * np.pi * bands[dark[front]]).mean())
    spread = np.abs(np.exp(2j * np.pi * bands[dark[front]]).mean())
    assert spread > 0.55  # of half a period, evenly filled, 2 / pi
    light = np.angle(np.exp(2j * np.pi * bands[~dark[front]]).mean())
    assert abs(abs(np.angle(np.exp(1j * (phase - light)))) - np.pi) < 0.4


@pytest.mark.parametrize("below", ["trousers", "dress", "coat"])
def test_no_face_goes_the_long_way_around_nor_out_of_its_cloth(body, below):
    look = look_with(top_pattern="checks", bottom_pattern="stripes", below=below)
    dressed = dress(body, look)
    uv, worn = paint(dressed, look).uv, garments(dressed, look)
    assert np.isfinite(uv).all()
    # Near the neck and the crotch a face may see the axis that it goes around within itself.
    assert np.percentile(np.ptp(uv[..., 0], axis=1), 99.5) < 0.12
    rows = 2 * BAND + WHITE
    for garment, low, high in ((Garment.TOP, 0, BAND), (Garment.TROUSERS, BAND, 2 * BAND)):
        mine = uv[worn == garment, :, 1] * rows
        if below != "dress" or garment == Garment.TOP:  # under a dress there is nothing else
            assert low + 1 < mine.min() < mine.max() < high - 1
    assert (uv[(worn == Garment.NONE) | (worn == Garment.HAIR), :, 1] * rows > 2 * BAND + 2).all()


def test_patterns_close_around_trunk_arms_and_legs():
    """A multiple of six repeats: at a whole, a third and a half of the way around the picture is where it began."""
    texture = picture(look_with(top_pattern="checks", repeats=18))[:BAND].astype(int)
    for way in (1, 3, 2):
        shift = WIDTH / way
        moved = np.stack(
            [np.interp(np.arange(WIDTH) + shift, np.arange(2 * WIDTH), np.tile(row, 2)) for row in texture[..., 0]]
        )
        assert np.abs(moved - texture[..., 0]).mean() < 12  # a third of 256 pixels falls between two


def test_metres_are_metres(body):
    """Where cloth is upright, a metre of it is a metre of the picture."""
    look = look_with(top_pattern="stripes")
    uv = paint(body, look).uv
    trunk = (body.part == Part.TORSO) & (garments(body, look) == Garment.TOP)
    corners = body.vertices[body.faces[trunk]][..., 2]
    down = uv[trunk][..., 1] * (2 * BAND + WHITE) / BAND * LENGTH
    np.testing.assert_allclose(corners + down, (corners + down).mean(), atol=1e-4)


def test_a_coat_is_buttoned_in_front(body):
    look = look_with(below="coat", sleeves="long")
    dressed = dress(body, look)
    coat = paint(dressed, look)
    texture = coat.texture[:BAND].astype(float) / 255
    dark = texture.mean(2).min(0) < 0.6 * np.mean(look.top)
    assert 2 <= dark.sum() <= 6
    assert dark[0]
    assert dark[-1]
    arms = (dressed.part == Part.ARM) & (garments(dressed, look) == Garment.TOP)
    assert np.abs(coat.uv[arms][..., 0] - 0.5).max() < 0.3  # no seam on the sleeves
    assert picture(look_with()) is None
