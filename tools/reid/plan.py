"""What a run renders and how long it learns: the whole one, and a toy."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tools.reid.crops import Recipe
from tools.reid.identities import groups
from tools.reid.rendering import Order

DIALS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Values of ``look_alike`` of the curve."""

# Half of the training people are dressed as it comes; the others learn what is left when clothes tell little.
_TRAINING_DIALS = (0.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0)


_AT_A_SITE = 10  # training groups
_SAMPLE = 10  # groups

# Cameras of training differ by less and by more than the usual, and people are hidden a little more.
_TRAINING = Recipe(casts=(0.5, 1.5), most_hidden=0.6)
_SCENES = Recipe(moments=2)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much of everything.

    Attributes:
        seed: of the run: of people, pictures and training.
        training, validation, held_out: groups of four people each.
        sites: where all who are held out are filmed, once at each.
        curve: groups of ``curve_size`` people, each dressed at every one of ``DIALS``.
        epochs: times that training goes over all crops.
    """

    seed: int = 0
    training: int = 640
    validation: int = 40
    held_out: int = 75
    sites: int = 4
    curve: int = 25
    curve_size: int = 12
    epochs: int = 24

    @classmethod
    def quick(cls, *, seed: int = 0) -> Plan:
        """A toy that shows that all of it runs."""
        return cls(seed=seed, training=6, validation=3, held_out=3, sites=1, curve=1, curve_size=4, epochs=4)

    @property
    def training_order(self) -> Order:
        """Crops to learn from."""
        people = groups("training", self.seed, self.training, size=4, look_alike=_TRAINING_DIALS, at_a_site=_AT_A_SITE)
        return Order(people, _TRAINING)

    @property
    def validation_order(self) -> Order:
        """Crops that the sigmoid's scale is taken from, of people who are somewhat alike: no scene is a catwalk."""
        return Order(groups("validation", self.seed, self.validation, size=4, look_alike=(0.0, 0.25, 0.5)), Recipe())

    def held_out_order(self, site: int) -> Order:
        """Crops of distinctly dressed people, all at one site, at one moment each."""
        people = groups("held-out", self.seed, self.held_out, size=4)
        return Order(tuple(replace(group, site=people[0].site + site) for group in people), Recipe(moments=1))

    @property
    def sample_order(self) -> Order:
        """A few of the crops at the first of those sites, soon rendered again."""
        whole = self.held_out_order(0)
        return replace(whole, groups=whole.groups[:_SAMPLE])

    def curve_order(self, dial: float) -> Order:
        """Crops of the same people of some scenes, the more alike the higher the dial."""
        return Order(groups("held-out", self.seed, self.curve, size=self.curve_size, look_alike=(dial,)), _SCENES)
