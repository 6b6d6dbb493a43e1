"""What makes one adult's body differ from another's."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Shape:
    """Phenotypes of an adult in anny's units.

    Attributes:
        gender: 0 male to 1 female.
        age: 2/3 a young adult to 1 an old one.
        muscle, weight: 0 least, 0.5 average, 1 most.
        height: 0 to 1; not metres, see :func:`simharness.humans.population.with_stature`.
        proportions: 0 ideal to 1 uncommon.
    """

    gender: float = 0.5
    age: float = 0.7
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.4
    proportions: float = 0.5

    def __post_init__(self) -> None:
        for entry in fields(self):
            low = 2 / 3 - 1e-9 if entry.name == "age" else 0.0
            value = float(getattr(self, entry.name))
            if not low <= value <= 1:
                raise ValueError(f"shape: {entry.name} must be from {low:.3g} to 1 for an adult, got {value:.4g}")
            object.__setattr__(self, entry.name, value)
