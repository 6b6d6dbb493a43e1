"""Work of a study on one trial: simulate, estimate, score and blame, or only what is not stored yet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import polars as pl

from simharness.scenario.sections.scenario import Scenario
from simharness.trial.archive import TrialArchive, pack_detected, pack_estimates, unpack_detected, unpack_estimates
from simharness.trial.run_trial import Known, run_trial
from simharness.trial.variant_result import VariantResult


@dataclass(frozen=True)
class StoredTrial:
    """Stored parts of a trial."""

    archive: TrialArchive = field(default_factory=TrialArchive)
    """Detections, and estimates by variant."""
    failures: Mapping[str, pl.DataFrame] = field(default_factory=dict)
    """Tables of failures by variant, where the code that makes them has not changed."""


@dataclass(frozen=True)
class TrialOutput:
    """Parts of a trial to be stored."""

    results: Mapping[str, VariantResult]
    """Results by variant."""
    archive: TrialArchive = field(default_factory=TrialArchive)
    """Detections if they were simulated in this run, and the estimates of these variants."""


def run_stored_trial(scenario: Scenario, variants: Sequence[str], stored: StoredTrial | None = None) -> TrialOutput:
    """Measure variants of the method in one trial, all on the same detections, in this process.

    Args:
        scenario: resolved, with its seed.
        variants: variants of the method.
        stored: stored parts of the trial. Without detections everything is simulated.

    Raises:
        ValueError: the scenario cannot be built at this seed.
        RunError: any error after that; the error is its cause.
    """
    stored = stored or StoredTrial()
    if stored.archive.detected:
        packed, detected = b"", unpack_detected(stored.archive.detected, scenario)
    else:  # packed before any method runs, so that none can change what is stored
        detected = run_trial(scenario, variants=variants, until="detect").detected
        packed = pack_detected(detected)
    estimates = {
        variant: unpack_estimates(content, detected)
        for variant, content in stored.archive.estimates.items()
        if variant in variants
    }
    failures = {variant: table for variant, table in stored.failures.items() if variant in estimates}
    result = run_trial(scenario, variants=variants, known=Known(detected, estimates, failures))
    archive = TrialArchive(
        packed,
        {
            variant: stored.archive.estimates[variant] if variant in estimates else pack_estimates(found)
            for variant, found in result.estimates.items()
        },
    )
    return TrialOutput(result.results, archive)
