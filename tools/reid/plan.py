"""Plan of a training run: crops to render and epochs, for the full network and for a quick test."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tools.reid.crops import Recipe
from tools.reid.identities import groups
from tools.reid.rendering import RenderJob

LOOK_ALIKE = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Values of ``look_alike`` in the evaluation."""

# Half of the training groups wear distinct clothes; from the others the network learns features other than clothes.
_TRAINING_LOOK_ALIKE = (0.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0)


_AT_A_SITE = 10  # training groups per site
_AT_A_VALIDATION_SITE, _AT_A_SCENE_SITE = 5, 5  # groups per site of the affinity and of the look_alike curve
_SAMPLE = 10  # groups in the sample

# In training the sensors differ by more and by less than in the evaluation, and people are occluded a little more.
_TRAINING = Recipe(casts=(0.5, 1.5), most_hidden=0.6)
_SCENES = Recipe(moments=2)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Size of a training run.

    Attributes:
        seed: seed of people, pictures and training.
        training, validation, held_out: numbers of groups of four people each.
        sites: number of sites; all held-out people are filmed once at each.
        curve: number of groups of the look_alike curve, each dressed at all values of ``LOOK_ALIKE``.
        curve_size: number of people in such a group.
        epochs: number of passes over all training crops.
    """

    seed: int = 0
    training: int = 1000
    validation: int = 40
    held_out: int = 75
    sites: int = 4
    curve: int = 25
    curve_size: int = 12
    epochs: int = 33

    @classmethod
    def quick(cls, *, seed: int = 0) -> Plan:
        """Return a minimal plan, which tests that the whole run works."""
        return cls(seed=seed, training=6, validation=3, held_out=3, sites=1, curve=1, curve_size=4, epochs=4)

    @property
    def training_job(self) -> RenderJob:
        """Crops for training."""
        people = groups(
            "training", self.seed, self.training, size=4, look_alike=_TRAINING_LOOK_ALIKE, at_a_site=_AT_A_SITE
        )
        return RenderJob(people, _TRAINING)

    @property
    def validation_job(self) -> RenderJob:
        """Crops for the fit of the affinity, of people dressed somewhat alike, as is usual in real scenes."""
        people = groups(
            "validation",
            self.seed,
            self.validation,
            size=4,
            look_alike=(0.0, 0.25, 0.5),
            at_a_site=_AT_A_VALIDATION_SITE,
        )
        return RenderJob(people, Recipe())

    def held_out_job(self, site: int) -> RenderJob:
        """Return the crops of all held-out people, in distinct clothes, at one site and one moment each."""
        people = groups("held-out", self.seed, self.held_out, size=4)
        return RenderJob(tuple(replace(group, site=people[0].site + site) for group in people), Recipe(moments=1))

    @property
    def sample_job(self) -> RenderJob:
        """Crops of the first groups at the first of those sites: few, so that they can be rendered again quickly."""
        whole = self.held_out_job(0)
        return replace(whole, groups=whole.groups[:_SAMPLE])

    def curve_job(self, look_alike: float) -> RenderJob:
        """Return the crops of scenes of held-out people with one value of ``look_alike``."""
        people = groups(
            "held-out",
            self.seed,
            self.curve,
            size=self.curve_size,
            look_alike=(look_alike,),
            at_a_site=_AT_A_SCENE_SITE,
        )
        return RenderJob(people, _SCENES)
