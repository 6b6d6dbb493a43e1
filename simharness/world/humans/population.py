"""Draw people whose statures, limbs and weights follow published anthropometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17
from simharness.types.random_streams import stream
from simharness.world.humans.anthropometry import ADULTS, YEARS, child_mass_index, child_stature
from simharness.world.humans.body import body_model
from simharness.world.humans.shape import LIMITS, Shape

_SPREAD = 2.5  # standard deviations at which the tails are cut
_ATHLETES = 0.25  # share of people whom muscle makes heavy; between them and the others anny's weight tells least
_ENDS = {
    "upper_arm": ("left_shoulder", "left_elbow"),
    "forearm": ("left_elbow", "left_wrist"),
    "thigh": ("left_hip", "left_knee"),
    "knee": ("left_knee", "left_ankle"),
}
# Of every measure the property of the shape that sets it most.
_SETS = {
    "stature": "height",
    "bmi": "weight",
    "upper_arm": "upper_arm",
    "forearm": "forearm",
    "thigh": "thigh",
    "knee": "shank",
}
_UNITS = {"bmi": 50.0}  # kg/m2 that weigh as much as a metre
_EXACT, _ROUNDS = 2e-4, 25


def is_child(seed: int, person: int, share: float) -> bool:
    """Whether a person is a child where a ``share`` (0 to 1) of people are; who is one stays so with a larger share."""
    return bool(stream(seed, "people", person, "child").random() < share)


def draw_sex(rng: np.random.Generator) -> str:
    """The sex, "male" or "female", that :func:`draw_shape` draws first from an equal stream."""
    return "female" if rng.random() < 0.5 else "male"


def draw_shape(rng: np.random.Generator, *, child: bool = False) -> Shape:
    """Draw a person, of either sex alike: an adult of any age, or a child of 5 to 12 years.

    Limbs of adults follow the published ones; those of children are as anny has them, but for the arms, which have
    the share of stature that they have in adults.
    """
    sex = draw_sex(rng)
    years, shade, build = rng.random(3).tolist()
    score = np.clip(rng.normal(size=10), -_SPREAD, _SPREAD)
    spare = 0.04 * float(score[8])
    shape = Shape(
        gender=float(np.clip((0.95 if sex == "female" else 0.05) + 0.05 * score[7], 0, 1)),
        proportions=float(0.2 + 0.6 * shade),
    )
    if child:
        age = YEARS[0] + (YEARS[1] - YEARS[0]) * years
        # From four to eleven years anny's ages of children, calibrated on the WHO's, go from 0.215 to 0.415.
        shape = replace(shape, age=0.215 + 0.2 * (age - 4) / 7, muscle=0.3 + spare, height=0.3)
    else:
        shape = replace(shape, age=2 / 3 + 0.25 * years, muscle=(0.31 if build > _ATHLETES else 0.77) + spare)
    # Measures are drawn apart, so for one draw in a hundred there is no such body, with hardly any trunk or flesh: all
    # but stature is then drawn nearer to the mean; and stature too for one in a thousand, smaller than bodies come.
    for tall, share in ((1.0, 1.0), (1.0, 0.6), (1.0, 0.3), (0.6, 0.3), (0.3, 0.3)):
        own = score * np.where(np.arange(len(score)) == 0, tall, share)
        try:
            return fitted(shape, _child_measures(sex, age, own) if child else _adult_measures(sex, own))
        except ValueError as error:
            failure = error
    raise failure


def _adult_measures(sex: str, score: Floats) -> dict[str, float]:
    """Measures of an adult by deviations from the mean: the first that of stature, then what each has of its own."""
    return {
        name: float(
            spread.mean + spread.deviation * (spread.correlation * score[0] + np.sqrt(1 - spread.correlation**2) * own)
        )
        for own, (name, spread) in zip(score, ADULTS[sex].items(), strict=False)
    }


def _child_measures(sex: str, age: float, score: Floats) -> dict[str, float]:
    """Measures of a child by deviations of stature and mass index from the mean."""
    spread, adult = child_stature(sex, age), ADULTS[sex]
    stature = float(spread.mean + spread.deviation * score[0])
    arms = {limb: adult[limb].mean * stature / adult["stature"].mean for limb in ("upper_arm", "forearm")}
    return {"stature": stature, "bmi": child_mass_index(sex, age, float(score[1]))} | arms


def measures(shape: Shape) -> dict[str, float]:
    """Measures of a body: stature, bmi (kg/m2), upper_arm, forearm, thigh, and knee, its height; metres.

    Limbs are those between the joints of COCO-17 in a stretched pose.
    """
    model = body_model()
    vertices, _ = model.figure(shape)
    joints = model.joints(vertices)
    result = {
        name: float(np.linalg.norm(np.subtract(*(joints[COCO17.index(end)] for end in ends))))
        for name, ends in _ENDS.items()
    }
    result["knee"] += float(joints[COCO17.index("left_ankle"), 2])
    result["stature"] = model.stature(vertices)
    result["bmi"] = model.mass(vertices) / result["stature"] ** 2
    return result


def fitted(shape: Shape, targets: Mapping[str, float]) -> Shape:
    """The same shape with what it takes of height, weight and stretches of limbs to have these measures.

    Args:
        shape: what to begin with.
        targets: some of the measures that :func:`measures` names.

    Raises:
        ValueError: a measure that there is not, or one that no body within the ranges of :class:`Shape` has.
    """
    unknown = [name for name in targets if name not in _SETS]
    if unknown:
        raise ValueError(f"there is no measure {unknown[0]!r} of a body; there are {', '.join(_SETS)}")
    keys, units = [_SETS[name] for name in targets], np.array([_UNITS.get(name, 1.0) for name in targets])
    wanted = np.array(list(targets.values())) / units

    def reached(place: Floats) -> tuple[Shape, Floats]:
        made = replace(shape, **dict(zip(keys, place.tolist(), strict=True)))
        found = measures(made)
        return made, np.array([found[name] for name in targets]) / units

    rows = [list(_SETS).index(name) for name in targets]
    slopes = _slopes()[np.ix_(rows, rows)].copy()
    low, high = np.array([LIMITS[key] for key in keys]).T
    place = np.array([getattr(shape, key) for key in keys])
    made, found = reached(place)
    for _ in range(_ROUNDS):  # Broyden's method
        miss = wanted - found
        if np.abs(miss).max() < _EXACT:
            return made
        step = np.clip(place + np.clip(np.linalg.solve(slopes, miss), -0.5, 0.5), low, high) - place
        if not step.any():
            break
        made, after = reached(place + step)
        slopes += np.outer(after - found - slopes @ step, step) / (step @ step)
        place, found = place + step, after
    worst = int(np.abs(wanted - found).argmax())
    raise ValueError(
        f"no body has a {list(targets)[worst]} of {(wanted * units)[worst]:.4g} with the other measures asked for; "
        f"the nearest found has {(found * units)[worst]:.4g}"
    )


@cache
def _slopes() -> Floats:
    """How the measures of an average body change with what sets them, (6, 6) as ``_SETS``, in ``_UNITS``."""
    shape = Shape(age=0.6, muscle=0.33, weight=0.8, height=0.3)
    units = np.array([_UNITS.get(name, 1.0) for name in _SETS])
    columns = []
    for key in _SETS.values():
        ends = [measures(replace(shape, **{key: getattr(shape, key) + step})) for step in (-0.05, 0.05)]
        columns.append([(ends[1][name] - ends[0][name]) / 0.1 for name in _SETS])
    return np.array(columns).T / units[:, None]
