from dataclasses import replace

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import (
    adult_spreads,
    child_mass_index,
    child_stature,
    draw_shape,
    fit_shape,
    is_child,
    measures,
)
from simharness.world.humans.shape import LIMITS, Shape


@pytest.fixture(scope="module")
def adults():
    """Shapes and measures of 160 adults."""
    shapes = [draw_shape(stream(7, "test", i)) for i in range(160)]
    return shapes, [measures(shape) for shape in shapes]


@pytest.fixture(scope="module")
def children():
    shapes = [draw_shape(stream(8, "test", i), child=True) for i in range(60)]
    return shapes, [measures(shape) for shape in shapes]


@pytest.mark.parametrize("gender", [0.0, 1.0])
@pytest.mark.parametrize("stature", [1.5, 1.68, 1.9])
def test_a_fitted_body_has_the_target_measures(gender, stature):
    targets = {"stature": stature, "bmi": 24.0, "upper_arm": 0.16 * stature, "thigh": 0.235 * stature}
    shape = fit_shape(Shape(gender=gender, muscle=0.3, weight=0.7), targets)
    body = make_body(shape)
    joints = body.joints(np.tile(np.eye(3, 4), (len(body.bones), 1, 1)))
    assert body.stature == pytest.approx(stature, abs=0.001)
    assert body.vertices[:, 2].max() - body.vertices[:, 2].min() == pytest.approx(stature, abs=0.008)  # in socks
    assert body.mass / body.stature**2 == pytest.approx(24.0, abs=0.05)
    for first, second, share in ((5, 7, 0.16), (6, 8, 0.16), (11, 13, 0.235), (12, 14, 0.235)):
        assert np.linalg.norm(joints[first] - joints[second]) == pytest.approx(share * stature, abs=0.002)


def test_unreachable_and_unknown_measures_are_refused():
    with pytest.raises(ValueError, match=r"no body has a stature of 3 .* nearest body has"):
        fit_shape(Shape(), {"stature": 3.0})
    with pytest.raises(ValueError, match="unknown body measure 'nose'; the measures are stature, bmi"):
        fit_shape(Shape(), {"nose": 0.06})


@pytest.mark.parametrize(
    ("field", "value"), [("age", 0.1), ("muscle", 1.2), ("gender", -0.1), ("height", float("nan")), ("thigh", 0.1)]
)
def test_an_impossible_shape_is_refused(field, value):
    with pytest.raises(ValueError, match=f"{field} must be from"):
        Shape(**{field: value})


@pytest.mark.parametrize("sex", adult_spreads())
@pytest.mark.parametrize("measure", ["stature", "bmi", "upper_arm", "forearm", "thigh", "knee"])
def test_drawn_adults_are_spread_as_published(adults, sex, measure):
    """Means and deviations agree within three standard errors; clipped tails allow another 10 % of the deviation."""
    values = np.array([m[measure] for s, m in zip(*adults, strict=True) if (s.gender > 0.5) == (sex == "female")])
    spread, count = adult_spreads()[sex][measure], len(values)
    assert 55 <= count <= 105
    assert values.mean() == pytest.approx(spread.mean, abs=3 * spread.deviation / np.sqrt(count))
    assert values.std(ddof=1) == pytest.approx(spread.deviation, rel=3 / np.sqrt(2 * count) + 0.1)


@pytest.mark.parametrize(("sex", "upper_arm", "forearm"), [("male", 0.1618, 0.1545), ("female", 0.1586, 0.1523)])
def test_arms_agree_with_another_source(adults, sex, upper_arm, forearm):
    """Nothing was fitted to de Leva (1996, table 4: students, between joints); surveys differ by about 4 %."""
    same_sex = [m for s, m in zip(*adults, strict=True) if (s.gender > 0.5) == (sex == "female")]
    for limb, share in (("upper_arm", upper_arm), ("forearm", forearm)):
        assert np.mean([m[limb] / m["stature"] for m in same_sex]) == pytest.approx(share, rel=0.04)


def test_limbs_correlate_with_stature_as_published(adults):
    """Within a sex limbs and stature are correlated, but not completely: sitting people differ less than standing."""
    for sex in adult_spreads():
        same_sex = [m for s, m in zip(*adults, strict=True) if (s.gender > 0.5) == (sex == "female")]
        for limb in ("upper_arm", "forearm", "thigh", "knee"):
            correlation = np.corrcoef([m["stature"] for m in same_sex], [m[limb] for m in same_sex])[0, 1]
            assert correlation == pytest.approx(adult_spreads()[sex][limb].correlation, abs=0.2)


def test_hips_are_as_high_as_published(adults):
    """Nothing was fitted to trochanterion height, ANSUR II: 0.901 +- 0.049 m of men, 0.845 +- 0.045 m of women."""
    for sex, mean, deviation in (("male", 0.9009, 0.0492), ("female", 0.8454, 0.0447)):
        same_sex = [m for s, m in zip(*adults, strict=True) if (s.gender > 0.5) == (sex == "female")]
        hips = np.array([m["knee"] + m["thigh"] for m in same_sex])
        assert hips.mean() == pytest.approx(mean, abs=0.015)
        assert hips.std() == pytest.approx(deviation, rel=0.25)


def test_drawn_children_follow_the_who_reference_in_stature_and_mass_index(children):
    shapes, measured = children
    for sex in adult_spreads():
        same_sex = [(s, m) for s, m in zip(shapes, measured, strict=True) if (s.gender > 0.5) == (sex == "female")]
        years = np.array([4 + 7 * (s.age - 0.215) / 0.2 for s, _ in same_sex])
        assert 5 <= years.min() <= years.max() <= 12
        scores = []
        for year, (_, m) in zip(years, same_sex, strict=True):
            spread = child_stature(sex, year)
            scores.append((m["stature"] - spread.mean) / spread.deviation)
            assert child_mass_index(sex, year, -2.6) - 0.1 < m["bmi"] < child_mass_index(sex, year, 2.6) + 0.1
        assert np.mean(scores) == pytest.approx(0, abs=3 / np.sqrt(len(scores)))
        assert np.std(scores) == pytest.approx(1, abs=3 / np.sqrt(2 * len(scores)))


def test_growth_curves_are_those_of_the_who():
    """Published: boys of 10 years 137.8 cm, standard deviation 6.4 cm; girls of 8 years 15.7 kg/m2 at the median."""
    assert child_stature("male", 10).mean == pytest.approx(1.378, abs=0.001)
    assert child_stature("male", 10).deviation == pytest.approx(0.064, abs=0.001)
    assert child_mass_index("female", 8, 0.0) == pytest.approx(15.68)


def test_children_have_the_proportions_of_children(adults, children):
    """Legs are shorter relative to stature, the more so the younger the child, and heads are larger."""
    legs = [(s.age, (m["knee"] + m["thigh"]) / m["stature"]) for s, m in zip(*children, strict=True)]
    grown = np.mean([(m["knee"] + m["thigh"]) / m["stature"] for m in adults[1]])
    assert np.mean([share for _, share in legs]) < grown - 0.01
    assert np.corrcoef(np.array(legs).T)[0, 1] > 0.3

    def head(shape):
        body = make_body(shape)
        return (body.vertices[:, 2].max() - body.heads[body.index("Head"), 2]) / body.stature

    assert np.mean([head(s) for s in children[0][:5]]) > 1.1 * np.mean([head(s) for s in adults[0][:5]])


def test_a_child_remains_a_child_when_the_share_of_children_grows():
    before = {i for i in range(200) if is_child(3, i, 0.2)}
    after = {i for i in range(200) if is_child(3, i, 0.5)}
    assert before < after
    assert 20 <= len(before) <= 60
    assert not any(is_child(3, i, 0.0) for i in range(200))
    assert all(is_child(3, i, 1.0) for i in range(200))


def test_equal_streams_draw_equal_people():
    assert draw_shape(stream(3, "a")) == draw_shape(stream(3, "a"))
    assert draw_shape(stream(3, "a")) != draw_shape(stream(4, "a"))


@pytest.mark.parametrize(("limb", "bones"), [("forearm", ("ForeArm", "Hand")), ("thigh", ("UpLeg", "Leg"))])
def test_a_longer_limb_is_longer_and_nothing_else(limb, bones):
    short, long = make_body(Shape()), make_body(replace(Shape(), **{limb: 1.2}))

    def lengths(body):
        return {
            bone: np.linalg.norm(body.heads[i] - body.heads[body.parents[i]]) for i, bone in enumerate(body.bones) if i
        }

    before, after = lengths(short), lengths(long)
    for side in ("Left", "Right"):
        changed = {f"{side}{bones[1]}"}
        if limb == "forearm":
            assert after[f"{side}Hand"] == pytest.approx(1.2 * before[f"{side}Hand"])
        for bone in set(before) - {f"{s}{bones[1]}" for s in ("Left", "Right")}:
            assert after[bone] == pytest.approx(before[bone], abs=1e-6), bone
        for bone in changed:
            assert after[bone] == pytest.approx(1.2 * before[bone], rel=1e-6)
    assert long.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    edges = short.faces[:, [0, 1]]
    grown = np.linalg.norm(np.diff(long.vertices[edges], axis=1), axis=2)
    old = np.linalg.norm(np.diff(short.vertices[edges], axis=1), axis=2)
    assert (grown - old).max() < 0.012  # the stretch is spread over the limb, no joint is torn
    assert LIMITS[limb][0] < 1.2 < LIMITS[limb][1]


def test_a_draw_without_a_body_is_moved_towards_the_mean():
    smallest = draw_shape(stream(2000000000022, "people", 3, "shape"))  # first 1.484 m, with a build that no body has
    assert 1.484 < measures(smallest)["stature"] < 1.60
