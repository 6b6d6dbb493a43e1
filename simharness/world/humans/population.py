"""Random body shapes whose stature, limb lengths and weight follow published anthropometry.

Adults: ANSUR II, Gordon et al., "2012 Anthropometric Survey of U.S. Army Personnel: Methods and Summary Statistics",
NATICK/TR-15/007, 2014, 4082 men and 1986 women. ANSUR measures lengths between landmarks on bones; the body model
measures between joint centres. Thighs (trochanterion to lateral femoral epicondyle), knee heights (epicondyle) and
forearms (radiale to stylion) are used unchanged, because those landmarks are level with the joints within a
centimetre. The shoulder joint lies 10.4 % of the length from acromion to radiale below the acromion, and the elbow
joint 4.3 % above the radiale (de Leva, "Joint center longitudinal positions computed from a selected subset of
Chandler's data", J. Biomechanics 29, 1996). The mean body mass index is mean weight over mean stature squared; its
deviation is that of weight at a given stature.

Children: WHO growth reference for 5 to 19 years, de Onis et al., Bulletin of the WHO 85, 2007.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import parse_toml
from mvpose.skeleton import COCO17
from simharness.types.random_streams import stream
from simharness.world.humans.body import body_model
from simharness.world.humans.shape import LIMITS, Shape

_UPPER_ARM = 1 - 0.104 - 0.043  # shoulder joint to elbow joint, as a fraction of acromion to radiale


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and correlation with stature of a body measure."""

    mean: float
    deviation: float
    correlation: float = 0.0


YEARS = (5.0, 12.0)
"""Least and greatest age of children, years."""

_KNOTS = np.linspace(*YEARS, 8)  # years, of the measures of children


@cache
def _tables() -> dict[str, Any]:
    return parse_toml((Path(__file__).parent / "data" / "anthropometry.toml").read_text(encoding="utf-8"))


@cache
def adult_spreads() -> Mapping[str, Mapping[str, Spread]]:
    """Return the measures of adults by sex, in metres, bmi in kg/m2; "knee" is the height of the knee over the sole."""
    scales = {"upper_arm": _UPPER_ARM}
    return {
        sex: {
            name: Spread(mean * scales.get(name, 1.0), deviation * scales.get(name, 1.0), correlation)
            for name, (mean, deviation, correlation) in measures.items()
        }
        for sex, measures in _tables()["adults"].items()
    }


def child_stature(sex: str, years: float) -> Spread:
    """Return the distribution of stature of children: ``sex`` "male" or "female", age 5 to 12 years."""
    median, variation = (float(np.interp(years, _KNOTS, row)) for row in _tables()["children"][sex]["stature"])
    return Spread(median, median * variation, 1.0)


def child_mass_index(sex: str, years: float, score: float) -> float:
    """Return the body mass index, kg/m2, at ``score`` standard deviations from the median of a sex and age."""
    power, median, variation = (float(np.interp(years, _KNOTS, row)) for row in _tables()["children"][sex]["bmi"])
    return float(median * (1 + power * variation * score) ** (1 / power))


_CUTOFF = 2.5  # standard deviations at which the normal distributions are clipped
_ATHLETES = 0.25  # fraction of people with much muscle; with medium muscle anny's weight parameter changes mass least
_ENDS = {
    "upper_arm": ("left_shoulder", "left_elbow"),
    "forearm": ("left_elbow", "left_wrist"),
    "thigh": ("left_hip", "left_knee"),
    "knee": ("left_knee", "left_ankle"),
}
# For every measure: the shape parameter with the largest effect on it.
_PARAMETER = {"stature": "height", "bmi": "weight"} | {name: name for name in ("upper_arm", "forearm", "thigh")}
_PARAMETER |= {"knee": "shank"}
_UNITS = {"bmi": 50.0}  # kg/m2 that count as much as a metre
_TOLERANCE, _ROUNDS = 2e-4, 25


def is_child(seed: int, person: int, share: float) -> bool:
    """Return whether a person is a child when a ``share`` (0 to 1) of people are children.

    A person who is a child remains one when the share grows.
    """
    return bool(stream(seed, "people", person, "child").random() < share)


def draw_sex(rng: np.random.Generator) -> str:
    """Draw the sex, "male" or "female". :func:`draw_shape` draws it first, so an equal stream gives the same sex."""
    return "female" if rng.random() < 0.5 else "male"


def draw_shape(rng: np.random.Generator, *, child: bool = False) -> Shape:
    """Draw the shape of an adult of any age or of a child of 5 to 12 years; both sexes are equally likely.

    Limb lengths of adults follow the published measures. Children have the limb lengths of anny, except that their
    arms are the same fraction of stature as in adults.

    Raises:
        ValueError: no body has the drawn measures, even after they were moved towards the mean.
    """
    sex = draw_sex(rng)
    years, shade, build = rng.random(3).tolist()
    score = np.clip(rng.normal(size=10), -_CUTOFF, _CUTOFF)
    muscle_offset = 0.04 * float(score[8])
    shape = Shape(
        gender=float(np.clip((0.95 if sex == "female" else 0.05) + 0.05 * score[7], 0, 1)),
        proportions=float(0.2 + 0.6 * shade),
    )
    if child:
        age = YEARS[0] + (YEARS[1] - YEARS[0]) * years
        # anny's age parameter, calibrated on the WHO reference, goes from 0.215 at four years to 0.415 at eleven.
        shape = replace(shape, age=0.215 + 0.2 * (age - 4) / 7, muscle=0.3 + muscle_offset, height=0.3)
    else:
        shape = replace(shape, age=2 / 3 + 0.25 * years, muscle=(0.31 if build > _ATHLETES else 0.77) + muscle_offset)
    # Measures are drawn independently given stature, so about one draw in a hundred has no body (it would have almost
    # no trunk or no flesh). Then all measures except stature are moved towards the mean. For about one draw in a
    # thousand stature is below that of any body and is moved too.
    for stature_scale, other_scale in ((1.0, 1.0), (1.0, 0.6), (1.0, 0.3), (0.6, 0.3), (0.3, 0.3)):
        scaled = score * np.where(np.arange(len(score)) == 0, stature_scale, other_scale)
        try:
            return fit_shape(shape, _child_measures(sex, age, scaled) if child else _adult_measures(sex, scaled))
        except ValueError as error:
            failure = error
    raise failure


def _adult_measures(sex: str, score: Floats) -> dict[str, float]:
    """Return measures of an adult from standard normal scores, in the order of :func:`adult_spreads`.

    The first score is that of stature; each other score is the part of its measure that is independent of stature.
    """
    return {
        name: float(s.mean + s.deviation * (s.correlation * score[0] + np.sqrt(1 - s.correlation**2) * each))
        for each, (name, s) in zip(score, adult_spreads()[sex].items(), strict=False)
    }


def _child_measures(sex: str, age: float, score: Floats) -> dict[str, float]:
    """Return measures of a child from the standard normal scores of stature and body mass index."""
    spread, adult = child_stature(sex, age), adult_spreads()[sex]
    stature = float(spread.mean + spread.deviation * score[0])
    arms = {limb: adult[limb].mean * stature / adult["stature"].mean for limb in ("upper_arm", "forearm")}
    return {"stature": stature, "bmi": child_mass_index(sex, age, float(score[1]))} | arms


def measures(shape: Shape) -> dict[str, float]:
    """Return the measures of a body in metres: stature, upper_arm, forearm, thigh, knee (height), and bmi in kg/m2.

    Limb lengths are distances between COCO-17 joints.
    """
    model = body_model()
    vertices, _ = model.rest_of_shape(shape)
    joints = model.joints(vertices)
    result = {
        name: float(np.linalg.norm(np.subtract(*(joints[COCO17.index(end)] for end in ends))))
        for name, ends in _ENDS.items()
    }
    result["knee"] += float(joints[COCO17.index("left_ankle"), 2])
    result["stature"] = model.stature(vertices)
    result["bmi"] = model.mass(vertices) / result["stature"] ** 2
    return result


def fit_shape(shape: Shape, targets: Mapping[str, float]) -> Shape:
    """Return the shape with height, weight and limb lengths changed so that its body has the target measures.

    Args:
        shape: initial shape; its other parameters are kept.
        targets: value of some of the measures that :func:`measures` returns.

    Raises:
        ValueError: an unknown measure, or no body within the ranges of :class:`Shape` has these measures.
    """
    unknown = [name for name in targets if name not in _PARAMETER]
    if unknown:
        raise ValueError(f"unknown body measure {unknown[0]!r}; the measures are {', '.join(_PARAMETER)}")
    keys, units = [_PARAMETER[name] for name in targets], np.array([_UNITS.get(name, 1.0) for name in targets])
    target = np.array(list(targets.values())) / units

    def evaluate(parameters: Floats) -> tuple[Shape, Floats]:
        candidate = replace(shape, **dict(zip(keys, parameters.tolist(), strict=True)))
        values = measures(candidate)
        return candidate, np.array([values[name] for name in targets]) / units

    rows = [list(_PARAMETER).index(name) for name in targets]
    jacobian = _jacobian()[np.ix_(rows, rows)].copy()
    low, high = np.array([LIMITS[key] for key in keys]).T
    parameters = np.array([getattr(shape, key) for key in keys])
    candidate, measured = evaluate(parameters)
    for _ in range(_ROUNDS):  # Broyden's method
        residual = target - measured
        if np.abs(residual).max() < _TOLERANCE:
            return candidate
        step = np.clip(parameters + np.clip(np.linalg.solve(jacobian, residual), -0.5, 0.5), low, high) - parameters
        if not step.any():
            break
        candidate, after = evaluate(parameters + step)
        jacobian += np.outer(after - measured - jacobian @ step, step) / (step @ step)
        parameters, measured = parameters + step, after
    worst = int(np.abs(target - measured).argmax())
    raise ValueError(
        f"no body has a {list(targets)[worst]} of {(target * units)[worst]:.4g} together with the other requested "
        f"measures; the nearest body has {(measured * units)[worst]:.4g}"
    )


@cache
def _jacobian() -> Floats:
    """Return the derivatives of the measures by their ``_PARAMETER`` at an average body, (6, 6), in ``_UNITS``."""
    shape = Shape(age=0.6, muscle=0.33, weight=0.8, height=0.3)
    units = np.array([_UNITS.get(name, 1.0) for name in _PARAMETER])
    columns = []
    for key in _PARAMETER.values():
        ends = [measures(replace(shape, **{key: getattr(shape, key) + step})) for step in (-0.05, 0.05)]
        columns.append([(ends[1][name] - ends[0][name]) / 0.1 for name in _PARAMETER])
    return np.array(columns).T / units[:, None]
