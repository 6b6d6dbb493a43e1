"""Shape parameters of a human body."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "gender": (0.0, 1.0),
        "age": (0.2, 1.0),
        "muscle": (0.0, 1.0),
        "weight": (-0.5, 2.5),
        "height": (0.0, 1.0),
        "proportions": (0.0, 1.0),
        **dict.fromkeys(("upper_arm", "forearm", "thigh", "shank"), (0.6, 1.6)),
    }
)
"""Least and greatest value of every shape parameter."""


@dataclass(frozen=True)
class Shape:
    """Body shape: the phenotypes of the ``anny`` body model and length factors of the limbs.

    Attributes:
        gender: 0 male to 1 female.
        age: 0.25 is a child of five years, 0.44 a child of twelve, 2/3 a young adult, 1 an old adult.
        muscle: 0 least, 0.5 average, 1 most.
        weight: 0 least, 0.5 average, 1 the heaviest body of anny's artists. Their people are lean, so extrapolation up
            to 2.5 is allowed.
        height: 0 to 1, not in metres; :func:`simharness.world.humans.population.fit_shape` finds it for a stature.
        proportions: 0 ideal to 1 uncommon.
        upper_arm, forearm, thigh, shank: factors on the limb lengths of anny.

    Raises:
        ValueError: a value is out of its range in ``LIMITS``.
    """

    gender: float = 0.5
    age: float = 0.7
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.4
    proportions: float = 0.5
    upper_arm: float = 1.0
    forearm: float = 1.0
    thigh: float = 1.0
    shank: float = 1.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            low, high = LIMITS[entry.name]
            value = float(getattr(self, entry.name))
            if not low <= value <= high:
                raise ValueError(f"shape: {entry.name} must be from {low:g} to {high:g}, got {value:.4g}")
            object.__setattr__(self, entry.name, value)
