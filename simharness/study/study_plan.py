"""Plan of a study: its trials, and the identities under which a store keeps them."""

from collections.abc import Mapping
from dataclasses import dataclass

from mvpose.presets import TRACKING, without_repair
from simharness.scenario.load import Setting, Study
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.identity import entry_identity, estimator_code, trial_identity


@dataclass(frozen=True)
class PlannedTrial:
    """A trial of a study.

    Attributes:
        setting: setting of the study.
        seed: seed of the trial.
        scenario: resolved scenario at that seed.
        trial: identity of the trial. Several settings may resolve to the same trial.
        entries: identity of the entry of each variant.
    """

    setting: Setting
    seed: int
    scenario: Scenario
    trial: str
    entries: Mapping[str, str]


def plan(study: Study) -> list[PlannedTrial]:
    """Return all trials of a study, seed by seed, so that an interrupted study has all settings at its first seeds."""
    places = study.base.method.estimators.places
    codes = {variant: estimator_code(places[variant]) if variant in places else "" for variant in study.variants}
    return [_planned(study, setting, seed, codes) for seed in study.seeds for setting in study.settings]


def _planned(study: Study, setting: Setting, seed: int, codes: Mapping[str, str]) -> PlannedTrial:
    scenario = study.at(setting, seed)
    trial = trial_identity(scenario)
    lag = scenario.method.lag
    entries = {
        variant: entry_identity(trial, variant, code, lag=lag if without_repair(variant) in TRACKING else None)
        for variant, code in codes.items()
    }
    return PlannedTrial(setting, seed, scenario, trial, entries)
