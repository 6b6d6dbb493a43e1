from dataclasses import replace

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import BAND, LENGTH, WHITE, WIDTH, Garment, dress, garments, paint, texture_image
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import PATTERNS, draw_look


@pytest.fixture(scope="module")
def body():
    return make_body(Shape())


def look_with(**changes):
    look = draw_look(stream(1, "test"))
    plain = {"lower_garment": "trousers", "hair_style": "short", "top_pattern": "plain", "bottom_pattern": "plain"}
    return replace(look, **(plain | {"top": (0.8, 0.2, 0.1), "accent": (0.1, 0.1, 0.4)} | changes))


def sample(surface):
    """Return the colour of every face at its centre: the nearest pixel of the texture times the colour of the face."""
    height, width = surface.texture.shape[:2]
    u, v = surface.uv.mean(1).T
    column, row = (np.floor(u * width).astype(int) % width), np.floor(v * height).astype(int) % height
    return surface.colors * surface.texture[row, column] / 255


@pytest.mark.parametrize("pattern", sorted(set(PATTERNS) - {"plain"}))
def test_patterned_cloth_shows_both_colours(body, pattern):
    look = look_with(top_pattern=pattern)
    shown = sample(paint(body, look))[garments(body, look) == Garment.TOP]
    near = [(np.abs(shown - color).max(1) < 0.05).mean() for color in (look.top, look.accent)]
    # Half of a check pattern is a mixture of both colours; blocks leave out the shoulders.
    assert min(near) > (0.1 if pattern != "blocks" else 0.05)
    assert pattern == "checks" or sum(near) > 0.75


def test_plain_faces_keep_their_colour(body):
    look = look_with(top_pattern="stripes")
    surface, plain = paint(body, look), paint(body, look_with())
    others = garments(body, look) != Garment.TOP
    np.testing.assert_array_equal(sample(surface)[others], plain.colors[others])


def test_stripes_are_horizontal_and_have_the_width_of_their_repeats(body):
    """On the front the colour depends on height alone, with two stripes per repeat."""
    look = look_with(top_pattern="stripes", repeats=18)
    surface, height = paint(body, look), body.vertices[body.faces].mean(1)
    front = (body.part == FacePart.TORSO) & (height[:, 0] > 0.02) & (garments(body, look) == Garment.TOP)
    dark = np.abs(sample(surface) - look.accent).max(1) < 0.05
    bands = (height[front, 2] / (1.05 / 18)) % 1
    phase = np.angle(np.exp(2j * np.pi * bands[dark[front]]).mean())
    spread = np.abs(np.exp(2j * np.pi * bands[dark[front]]).mean())
    assert spread > 0.55  # 2 / pi for an evenly filled half period
    light = np.angle(np.exp(2j * np.pi * bands[~dark[front]]).mean())
    assert abs(abs(np.angle(np.exp(1j * (phase - light)))) - np.pi) < 0.4


@pytest.mark.parametrize("lower_garment", ["trousers", "dress", "coat"])
def test_faces_stay_in_their_band_and_do_not_wrap_around_the_texture(body, lower_garment):
    look = look_with(top_pattern="checks", bottom_pattern="stripes", lower_garment=lower_garment)
    dressed = dress(body, look)
    uv, worn = paint(dressed, look).uv, garments(dressed, look)
    assert np.isfinite(uv).all()
    # Near the neck and the crotch the axis of the texture may go through a face.
    assert np.percentile(np.ptp(uv[..., 0], axis=1), 99.5) < 0.12
    rows = 2 * BAND + WHITE
    for garment, low, high in ((Garment.TOP, 0, BAND), (Garment.TROUSERS, BAND, 2 * BAND)):
        used = uv[worn == garment, :, 1] * rows
        if lower_garment != "dress" or garment == Garment.TOP:  # there are no trousers under a dress
            assert low + 1 < used.min() < used.max() < high - 1
    assert (uv[(worn == Garment.NONE) | (worn == Garment.HAIR), :, 1] * rows > 2 * BAND + 2).all()


def test_patterns_close_around_trunk_arms_and_legs():
    """With a multiple of six repeats, the texture is periodic over its whole, a third and a half of its width."""
    texture = texture_image(look_with(top_pattern="checks", repeats=18))[:BAND].astype(int)
    for parts in (1, 3, 2):
        shift = WIDTH / parts
        moved = np.stack(
            [np.interp(np.arange(WIDTH) + shift, np.arange(2 * WIDTH), np.tile(row, 2)) for row in texture[..., 0]]
        )
        assert np.abs(moved - texture[..., 0]).mean() < 12  # a third of 256 pixels is not a whole number of pixels


def test_the_vertical_axis_of_the_texture_is_in_metres(body):
    """On the trunk a metre of height is a metre of the texture."""
    look = look_with(top_pattern="stripes")
    uv = paint(body, look).uv
    trunk = (body.part == FacePart.TORSO) & (garments(body, look) == Garment.TOP)
    corners = body.vertices[body.faces[trunk]][..., 2]
    down = uv[trunk][..., 1] * (2 * BAND + WHITE) / BAND * LENGTH
    np.testing.assert_allclose(corners + down, (corners + down).mean(), atol=1e-4)


def test_a_coat_has_a_dark_line_in_front(body):
    look = look_with(lower_garment="coat", sleeves="long")
    dressed = dress(body, look)
    surface = paint(dressed, look)
    texture = surface.texture[:BAND].astype(float) / 255
    dark = texture.mean(2).min(0) < 0.6 * np.mean(look.top)
    assert 2 <= dark.sum() <= 6
    assert dark[0]
    assert dark[-1]
    arms = (dressed.part == FacePart.ARM) & (garments(dressed, look) == Garment.TOP)
    assert np.abs(surface.uv[arms][..., 0] - 0.5).max() < 0.3  # no such line on the sleeves
    assert texture_image(look_with()) is None
