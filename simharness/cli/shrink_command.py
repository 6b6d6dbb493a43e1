"""``simharness shrink``: the smallest frame that fails, from a run, a scenario or a kept failure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.output_files import HTML, check_place
from mvpose.commands.programs import FOUND, note
from simharness.cli.program import PROGRAM, Overrides, Seed

if TYPE_CHECKING:
    from mvpose import Estimate
    from simharness.hunt.kept_failure import KeptFailure
    from simharness.scenario.sections.scenario import Scenario
    from simharness.types.recording import Recording


@dataclass(frozen=True)
class Checked:
    """What is checked of which variant."""

    variant: str | None = option(None, "Variant. [dim]\\[default: the first of the scenario][/]", metavar="VARIANT")
    property: list[str] | None = option(
        None,
        "What must not fail: [cyan]missed[/], [cyan]merged[/], [cyan]mirrored[/], or a function of yours: "
        "[cyan]mine.py:late[/]. Repeatable. [dim]\\[default: most][/]",
        metavar="PROPERTY",
    )
    rival: str | None = option(
        None, "Variant that should agree, for the property [cyan]disagree[/].", metavar="VARIANT"
    )


_OF_FRAMES = ("overrides", "seed", "frame", "variant", "property", "rival", "out")


@grouped()
def shrink(
    source: Annotated[
        Path, typer.Argument(help="Result folder of a run, a scenario, or a kept failure (TOML).", metavar="SOURCE")
    ],
    overrides: Overrides = None,
    seed: Seed = None,
    frame: int | None = option(
        None, "Frame, counted from 0. [dim]\\[default: the first that fails][/]", metavar="K", min=0
    ),
    out: Path = option(Path("results/failures"), "Folder in which the failure is kept.", metavar="FOLDER"),
    *,
    checked: Checked,
) -> None:
    """Shrink one frame that fails: the fewest people, cameras and detector errors that show it.

    Prints in words what fails and which errors it takes, and keeps the frame
    as a TOML file. A kept failure is replayed instead: exit code 1 where it
    still fails.
    """
    with PROGRAM.exit_on_error():
        from simharness.hunt.kept_failure import is_failure, read_failure

        if is_failure(source):
            if options := [name for name in _OF_FRAMES if given(name)]:
                raise ValueError(f"--{options[0].replace('overrides', 'set')}: a kept failure is replayed as it is")
            failure = read_failure(source)
            fails = failure.replay()[1]
            text = f"{failure.name} {'still fails' if fails else 'does not fail any more'}: {failure.text}"
        else:
            check_place(out / "failures.html", option="--out", mark=HTML)
            from scipy.stats import binomtest

            from simharness.hunt.shrinking import NOISE

            failure, path = _shrink(source, overrides or [], seed, frame, checked, out)
            ends = binomtest(failure.noise_failed, failure.noise_seeds).proportion_ci(method="wilson")
            share = f"{failure.noise_failed} of {failure.noise_seeds} ({ends.low:.0%} to {ends.high:.0%})"
            stage = f"Stage to blame: {failure.stage}. " if failure.stage else ""
            words = f"{failure.text}\n{stage}It fails again with {share} draws of {NOISE:g} px more noise."
            Console().print(words, highlight=False, markup=False)
            from simharness.outputs.hunt.page import write_failures_page

            fails, text = False, f"kept: {path}\npage: {write_failures_page(path.parent)}"
    Console().print(text, soft_wrap=True, highlight=False, markup=False)
    if fails:
        raise typer.Exit(FOUND)


def _shrink(
    source: Path, overrides: list[str], seed: int | None, frame: int | None, checked: Checked, out: Path
) -> "tuple[KeptFailure, Path]":
    import numpy as np

    from simharness.hunt.kept_failure import check_alone, first_violation, judge_of, keep, write_failure
    from simharness.hunt.properties import properties_of
    from simharness.trial.run_trial import with_variants

    variant, rival = checked.variant, checked.rival
    wanted = properties_of(checked.property, rival)
    scenario, recording, before = _recording(source, overrides, seed)
    chosen = variant or scenario.method.variants[0]
    check_alone(with_variants(scenario, [chosen]))
    about: dict[str, Any] = {"variant": chosen, "rival": rival or "", "estimators": scenario.method.estimators}
    judge = judge_of(**about)
    number, frozen, violation = first_violation(recording, judge, wanted, frame=frame)
    again = judge.variant.estimate(recording.rig, recording.detections[number])
    if chosen in before and not np.array_equal(again.joints, before[chosen][number].joints, equal_nan=True):
        note(f"frame {number}: {chosen} gives another answer now than in the run, which other code made")
    about["origin"] = f"{scenario.name}, seed {scenario.seed}, frame {number}"
    failure = keep(frozen, violation, judge, scenario=scenario.name, about=about)
    counts = [
        f"{len(getattr(frozen, key))} {key} to {len(getattr(failure, key))}" for key in ("people", "cameras", "errors")
    ]
    note(f"frame {number} of {scenario.name}: {', '.join(counts)}, in {judge.judged} estimates")
    return failure, write_failure(failure, out)


def _recording(
    source: Path, overrides: list[str], seed: int | None
) -> "tuple[Scenario, Recording, Mapping[str, Sequence[Estimate]]]":
    """Return the scenario, frames and estimates of a run; of a scenario, which is simulated, there are no estimates."""
    from simharness.scenario.load import load
    from simharness.trial.run_folder import is_run, read_run
    from simharness.trial.run_trial import run_trial
    from simharness.types.recording import Recording

    if is_run(source):
        if options := [name for name, value in (("--set", overrides), ("--seed", seed)) if value]:
            raise ValueError(f"{options[0]}: the scenario of a run cannot be changed; name the scenario instead")
        record = read_run(source)
        frames = Recording(record.time, record.rig, record.detections, record.truth)
        return record.scenario, frames, record.estimates
    from mvpose.commands.progress import reporter

    scenario = load(source, overrides=overrides, seed=seed)
    with reporter() as bars:
        return scenario, run_trial(scenario, until="detect", reporter=bars).recording, {}
