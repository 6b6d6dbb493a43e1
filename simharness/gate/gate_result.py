"""Result of a gate check."""

from __future__ import annotations

from dataclasses import dataclass

from simharness.gate.compare import Change, Comparison
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection


@dataclass(frozen=True)
class FailedCase:
    """Case at a seed that could not be run.

    Attributes:
        case: name of the setting, :func:`simharness.gate.trial_command.setting_name`.
        seed: seed.
        error: message of the error.
    """

    case: str
    seed: int
    error: str


@dataclass(frozen=True)
class GateResult:
    """Result of a gate check: comparison of a suite with its baseline.

    Attributes:
        suite: name of the suite.
        variants: variants of the method.
        gate: tolerances and level.
        comparison: changes of all scores from the baseline.
        failed: trials that could not be run.
        trials: number of trials; a trial is a setting at a seed.
        worst: trial to inspect first: one that could not be run, else the one with the largest loss, else the one with
            the lowest PCP.
        command: command line that runs this trial.
        seconds: duration of the run.
        accept_better: whether unexpected improvements fail nothing.
    """

    suite: str
    variants: tuple[str, ...]
    gate: GateSection
    comparison: Comparison
    failed: tuple[FailedCase, ...]
    trials: int
    worst: TrialKey
    command: str
    seconds: float
    accept_better: bool = False

    @property
    def passed(self) -> bool:
        """Whether no score got worse or, unless that is accepted, unexpectedly better, and every trial ran."""
        return not (self.failed or self.comparison.with_verdict("worse") or self.refused)

    @property
    def refused(self) -> tuple[Change, ...]:
        """Unexpected improvements that nobody has accepted."""
        return () if self.accept_better else self.comparison.with_verdict("unexpected")

    @property
    def advice(self) -> str:
        """What unexpected improvements mean and how to accept them; empty where there are none to accept."""
        if not self.refused:
            return ""
        return (
            "Unexpected improvements fail the check: either the method became better, or what it is tested with became "
            "easier. If the change is meant to do that, accept them with --accept-better for this run, or write a new "
            "baseline with --update-baseline."
        )

    @property
    def verdict(self) -> str:
        """Summary in a few words."""
        worse, unexpected = (len(self.comparison.with_verdict(kind)) for kind in ("worse", "unexpected"))
        improvements = f"{unexpected} unexpected improvement{'s' * (unexpected > 1)}" if unexpected else ""
        parts = [
            f"{worse} regression{'s' * (worse > 1)}" if worse else "",
            "" if self.accept_better else improvements,
            f"{len(self.failed)} of {self.trials} trials could not be run" if self.failed else "",
        ]
        verdict = ", ".join(filter(None, parts)) or "no regression"
        if self.accept_better and improvements:
            verdict += f", {improvements} accepted"
        if undecided := self.comparison.undecided:
            seeds = max(change.n for change in undecided)
            losses = f"{len(undecided)} loss{'es' * (len(undecided) > 1)} beyond tolerance"
            verdict += f", but {losses} that {seeds} seeds are too few to judge"
        return verdict

    @property
    def worst_description(self) -> str:
        """Description of the worst trial, which the command runs."""
        why = "lost most" if self.comparison.with_verdict("worse") else "has the lowest PCP"
        return f"the trial that {'could not be run' if self.failed else why}: {self.worst}"
