"""Which trials a study is made of, and where a store keeps them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.study_definition import Setting, Study
from simharness.trial.identity import entry_identity, estimator_code, trial_identity


@dataclass(frozen=True)
class PlannedTrial:
    """A trial of a study.

    Attributes:
        setting: of the study.
        seed: that the setting is run at.
        scenario: resolved, at that seed.
        trial: its identity. Two settings may amount to the same trial.
        entries: the identity of each variant's entry.
    """

    setting: Setting
    seed: int
    scenario: Scenario
    trial: str
    entries: Mapping[str, str]


def plan(study: Study) -> list[PlannedTrial]:
    """All trials of a study: every setting at the first seed, then at the second, for half a study is of use then."""
    places = study.base.method.estimators.places
    own = {variant: estimator_code(places[variant]) if variant in places else "" for variant in study.variants}
    return [_planned(study, setting, seed, own) for seed in study.seeds for setting in study.settings]


def _planned(study: Study, setting: Setting, seed: int, own: Mapping[str, str]) -> PlannedTrial:
    scenario = study.at(setting, seed)
    trial = trial_identity(scenario)
    entries = {variant: entry_identity(trial, variant, code) for variant, code in own.items()}
    return PlannedTrial(setting, seed, scenario, trial, entries)
