import colorsys
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.face_colors import PALETTES, name_at
from simharness.world.humans.population import draw_sex, draw_shape
from simharness.world.humans.wardrobe import (
    HAIR_STYLES,
    LOWER_GARMENTS,
    PATTERNS,
    UNIFORM_CHOICES,
    UNIFORM_COLORS,
    UNIFORM_NUMBERS,
    camouflaged,
    draw_look,
    draw_looks,
)

INDIVIDUAL = ("skin", "hair", "lips", "eyes", "volume", "hair_style", "beard", "bald", "expression")
INDIVIDUAL += ("glasses", "frame_color", "mask", "mask_color")


def distance(a, b):
    """Return the difference of two looks: the sum of colour and number differences, and 1 for every other choice."""
    colors = sum(np.abs(np.subtract(getattr(a, key), getattr(b, key))).sum() for key in UNIFORM_COLORS)
    numbers = sum(abs(getattr(a, key) - getattr(b, key)) for key in UNIFORM_NUMBERS)
    return colors + numbers + sum(getattr(a, key) != getattr(b, key) for key in UNIFORM_CHOICES)


def test_few_people_of_one_scene_have_tops_of_one_colour():
    """Places of the golden ratio are never close: of four people no more than two share even the commonest colour."""
    for seed in range(30):
        places = (stream(seed, "people", "hue").random() + np.arange(4) * (5**0.5 - 1) / 2) % 1
        names = [name_at(PALETTES["tops"], place) for place in places]
        assert max(map(names.count, names)) <= 2
        assert len({look.top for look in draw_looks(seed, 8)}) == 8


@pytest.mark.parametrize("kind", ["tops", "trousers", "shoes", "frames", "hats", "bags", "masks"])
def test_colours_are_drawn_by_their_shares(kind):
    colors = PALETTES[kind]
    names = [name_at(colors, place) for place in (np.arange(10_000) + 0.5) / 10_000]
    assert sum(share for _, share in colors.values()) == pytest.approx(100)
    for name, (_, share) in colors.items():
        assert 100 * names.count(name) / len(names) == pytest.approx(share, abs=0.1)


def test_tops_have_the_published_shares_and_saturated_ones_are_rare():
    """Black, white and red of 14,221 tops: arXiv 1904.07460. Saturation and value as in HSV."""
    share = {name: part for name, (_, part) in PALETTES["tops"].items()}
    published = {("black", "charcoal"): 3581, ("white", "cream"): 3264, ("red", "burgundy", "pink"): 1870}
    for names, count in published.items():
        assert sum(share[name] for name in names) == pytest.approx(100 * count / 14_221, abs=0.1)
    looks = [look for seed in range(60) for look in draw_looks(seed, 5)]
    hsv = np.array([colorsys.rgb_to_hsv(*look.top) for look in looks])
    assert np.mean((hsv[:, 1] > 0.5) & (hsv[:, 2] > 0.4)) < 0.15


@pytest.mark.parametrize("look_alike", [0.0, 0.4, 1.0])
def test_looks_depend_on_the_seed_and_not_on_the_number_of_people(look_alike):
    assert draw_looks(0, 3, look_alike=look_alike) == draw_looks(0, 5, look_alike=look_alike)[:3]
    assert draw_looks(0, 3, look_alike=look_alike) != draw_looks(1, 3, look_alike=look_alike)
    assert draw_looks(0, 0, look_alike=look_alike) == ()


@pytest.mark.parametrize("seed", range(4))
def test_any_two_looks_come_closer_as_look_alike_grows(seed):
    looks = [draw_looks(seed, 5, look_alike=share) for share in np.linspace(0, 1, 9)]
    for a, b in combinations(range(5), 2):
        apart = np.array([distance(scene[a], scene[b]) for scene in looks])
        assert (np.diff(apart) <= 1e-12).all()
        assert apart[0] > 0.5
        assert apart[-1] < 1e-12


def test_at_one_all_wear_one_uniform_and_keep_skin_and_hair():
    before, after = draw_looks(2, 6), draw_looks(2, 6, look_alike=1.0)
    for key in (*UNIFORM_COLORS, *UNIFORM_NUMBERS, *UNIFORM_CHOICES):
        values = [getattr(look, key) for look in after]
        assert all(value == pytest.approx(values[0]) for value in values), key
    for a, b in zip(before, after, strict=True):
        assert [getattr(a, key) for key in INDIVIDUAL] == [getattr(b, key) for key in INDIVIDUAL]
    assert len({look.skin for look in after}) == 6
    assert set(INDIVIDUAL) | set(UNIFORM_COLORS) | set(UNIFORM_NUMBERS) | set(UNIFORM_CHOICES) == set(vars(after[0]))


def test_colours_change_linearly_to_those_of_the_uniform():
    start, half, end = (np.array([look.top for look in draw_looks(3, 4, look_alike=share)]) for share in (0, 0.5, 1))
    np.testing.assert_allclose(half, (start + end) / 2)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_camouflage_mixes_the_colour_of_the_walls_into_clothes_alone(share):
    walls = (0.2, 0.9, 0.4)
    for look in draw_looks(2, 6):
        dressed = camouflaged(look, walls, share)
        for key in UNIFORM_COLORS:
            expected = (1 - share) * np.array(getattr(look, key)) + share * np.array(walls)
            np.testing.assert_allclose(getattr(dressed, key), expected)
        assert {k: v for k, v in vars(dressed).items() if k not in UNIFORM_COLORS} == {
            k: v for k, v in vars(look).items() if k not in UNIFORM_COLORS
        }


def test_every_cut_and_pattern_is_drawn():
    looks = [look for seed in range(40) for look in draw_looks(seed, 5)]
    assert {look.lower_garment for look in looks} == set(LOWER_GARMENTS)
    assert {look.hair_style for look in looks} == set(HAIR_STYLES)
    patterned = [look.top_pattern for look in looks]
    assert set(patterned) == set(PATTERNS)
    assert 0.2 < np.mean([pattern != "plain" for pattern in patterned]) < 0.7


def test_the_accent_colour_differs_from_the_colour_of_the_top():
    for seed in range(100):
        look = draw_look(stream(seed, "test"))
        assert abs(sum(look.accent) - sum(look.top)) / 3 > 0.1


def test_skirts_are_worn_by_women_only():
    """The look is drawn for the sex that the body will have, from the stream of the body."""
    for seed in range(30):
        for i, look in enumerate(draw_looks(seed, 4)):
            key = (seed, "people", i, "shape")
            sex = draw_sex(stream(*key))
            if look.lower_garment in ("skirt", "dress"):
                assert sex == "female"
            if seed < 3:
                assert (draw_shape(stream(*key)).gender > 0.5) == (sex == "female")
                assert (draw_shape(stream(*key), child=True).gender > 0.5) == (sex == "female")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("sleeves", "huge"),
        ("legs", ""),
        ("top", (2.0, 0, 0)),
        ("volume", -1.0),
        ("fit", 1.5),
        ("repeats", 7),
        ("lower_garment", "kilt"),
        ("top_pattern", "dots"),
        ("hat", "crown"),
        ("bag", "trunk"),
    ],
)
def test_an_impossible_look_is_refused(key, value):
    with pytest.raises(ValueError, match=f"look: {key} must be"):
        replace(draw_look(stream(0, "test")), **{key: value})


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_look_alike_out_of_range_is_refused(share):
    with pytest.raises(ValueError, match="look_alike must be from 0 to 1"):
        draw_looks(0, 2, look_alike=share)


def test_look_alike_can_be_limited_to_the_first_people():
    free, some, all_ = (draw_looks(3, 4, look_alike=share, alike=n) for share, n in ((0.0, 0), (1.0, 2), (1.0, 0)))
    assert some[:2] == all_[:2]
    assert some[2:] == free[2:]
    assert some[0].top == some[1].top != some[2].top
