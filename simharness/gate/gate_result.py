"""What a check came to."""

from __future__ import annotations

from dataclasses import dataclass

from simharness.gate.compare import Comparison
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate import Gate


@dataclass(frozen=True)
class FailedCase:
    """A trial that could not be run.

    Attributes:
        case: its case.
        seed: its seed.
        error: what went wrong.
    """

    case: str
    seed: int
    error: str


@dataclass(frozen=True)
class GateResult:
    """A suite that was run and compared with its baseline.

    Attributes:
        suite: its name.
        variants: of the method.
        gate: tolerances and level.
        comparison: of all scores with the baseline's.
        failed: trials that could not be run.
        trials: how many there are, a setting at a seed each.
        worst: the trial to look at: one that could not be run, else one that lost most, else that of the lowest PCP.
        command: runs that trial.
        seconds: how long the suite took.
    """

    suite: str
    variants: tuple[str, ...]
    gate: Gate
    comparison: Comparison
    failed: tuple[FailedCase, ...]
    trials: int
    worst: TrialKey
    command: str
    seconds: float

    @property
    def passed(self) -> bool:
        """Nothing got worse, and every trial ran."""
        return not self.failed and not self.comparison.with_verdict("worse")

    @property
    def verdict(self) -> str:
        """What it comes to, in a few words."""
        worse = len(self.comparison.with_verdict("worse"))
        said = [
            f"{worse} regression{'s' * (worse > 1)}" if worse else "",
            f"{len(self.failed)} of {self.trials} trials could not be run" if self.failed else "",
        ]
        verdict = ", ".join(filter(None, said)) or "no regression"
        if undecided := self.comparison.undecided:
            seeds = max(change.n for change in undecided)
            losses = f"{len(undecided)} loss{'es' * (len(undecided) > 1)} beyond tolerance"
            verdict += f", but {losses} that {seeds} seeds are too few to judge"
        return verdict

    @property
    def worst_description(self) -> str:
        """What the command is of."""
        why = "lost most" if self.comparison.with_verdict("worse") else "has the lowest PCP"
        return f"the trial that {'could not be run' if self.failed else why}: {self.worst}"
