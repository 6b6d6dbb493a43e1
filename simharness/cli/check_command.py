"""``simharness check``: the regression gate."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.output_files import check_place, write_text
from mvpose.commands.programs import BAD_INPUT, FOUND
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import plain_table, say
from simharness.cli.program import PROGRAM, Workers

if TYPE_CHECKING:
    from rich.table import Table

    from simharness.gate.baseline import Measurement
    from simharness.gate.compare import FailedCase, GateResult, Verdict
    from simharness.scenario.load import Study

_OF_SUITES = ("baseline", "junit", "summary", "update_baseline", "accept_better", "workers")
_LISTED = 8  # changes of each kind: a bug that breaks everything breaks a hundred scores
_MARKS = {
    "--baseline": b'"fingerprint"',
    "--junit": b'"simharness check"',
    "--summary": b", compared with the baseline",
}
_STYLES: "dict[Verdict, str]" = {"worse": "red", "unexpected": "yellow", "better": "green"}


@grouped()
def check(
    suite: Annotated[
        Path,
        typer.Argument(
            help="The suite: a scenario file, or the name of a shipped one: [cyan]ci[/]; or a folder of kept failures.",
            metavar="SUITE",
        ),
    ],
    baseline: Path | None = option(
        None,
        "Committed scores to compare with, which --update-baseline writes; by default those that ship with the suite.",
        metavar="FILE",
        dir_okay=False,
    ),
    junit: Path | None = option(None, "Write a JUnit report (XML) to this file.", metavar="FILE", dir_okay=False),
    summary: Path | None = option(None, "Write a summary (Markdown) to this file.", metavar="FILE", dir_okay=False),
    update_baseline: bool = option(
        False, "Measure the suite and write the file of --baseline, instead of comparing with it.", "--update-baseline"
    ),
    accept_better: bool = option(False, "Let improvements beyond their bounds pass in this run.", "--accept-better"),
    workers: Workers = 1,
) -> None:
    r"""Gate for CI: run a suite, compare it with a baseline, and exit with code 1 where it got worse.

    Worse is a significant loss in a score that is larger than its tolerance
    (section \[gate] of the suite), or a growth of the time per frame relative
    to a reference kernel. An improvement larger than its bound fails as well
    until it is accepted, because the suite may have become easier. Trials that
    could not be run also fail the check. Of a folder of kept failures all are
    replayed: those with mended = true must not fail again.
    """
    with PROGRAM.exit_on_error():
        if suite.is_dir():
            _replay(suite)
            return
        from simharness.scenario.load import load_study

        reports = {option: path for option, path in (("--junit", junit), ("--summary", summary)) if path is not None}
        if update_baseline and reports:
            raise ValueError(
                f"{next(iter(reports))}: cannot be combined with --update-baseline, which compares nothing; "
                "remove one of them"
            )
        if update_baseline and accept_better:
            raise ValueError("--accept-better: --update-baseline accepts every change; remove one of them")
        if update_baseline and baseline is None:
            raise ValueError("--update-baseline: expected --baseline FILE, where the scores are written")
        for option, path in ({"--baseline": baseline} if update_baseline and baseline else reports).items():
            check_place(path, option=option, mark=_MARKS[option])
        study = load_study(suite)
        if update_baseline and baseline:
            _update(study, baseline, workers)
            return
        from simharness.gate.suite import baseline_of, kept_trials, shipped_baseline
        from simharness.gate.suite import check as check_suite

        before = baseline_of(study, baseline or shipped_baseline(study))
        with kept_trials(study, baseline or Path(f"{study.name}.json")) as store:
            with failing(), reporter() as bars:
                result = check_suite(
                    study, before, workers=workers, accept_better=accept_better, reporter=bars, store=store
                )
            _print(result)
            unwritten = _write(result, reports)
    if not result.passed:
        raise typer.Exit(FOUND)
    if unwritten:
        raise typer.Exit(BAD_INPUT)


def _replay(folder: Path) -> None:
    """Replay the kept failures of a folder, and print what became of each."""
    if options := [name.replace("_", "-") for name in _OF_SUITES if given(name)]:
        raise ValueError(f"--{options[0]}: kept failures are replayed as they are; leave it out")
    from simharness.hunt.kept_failure import failures_in

    again = False
    for failure in failures_in(folder):
        fails = failure.replay()[1]
        again |= fails and failure.mended
        state = {
            (True, True): ("fails again", "red"),
            (True, False): ("fails, as known", ""),
            (False, True): ("is right", "green"),
            (False, False): ("does not fail any more: set mended = true in its file", "yellow"),
        }[fails, failure.mended]
        say(Text.assemble(failure.name, ": ", state))
    if again:
        raise typer.Exit(FOUND)


def _write(result: "GateResult", reports: Mapping[str, Path]) -> bool:
    """Write the reports independently of each other; return whether one could not be written, after a message."""
    from simharness.gate.gate_reports import junit, markdown

    unwritten = False
    for flag, path in reports.items():
        try:
            write_text({"--junit": junit, "--summary": markdown}[flag](result), path, option=flag)
        except ValueError as error:
            unwritten = True
            say(f"error: {error}", err=True)
    return unwritten


def _update(study: "Study", path: Path, workers: int) -> None:
    """Measure a suite and write its scores as the baseline."""
    from simharness.gate.baseline import write_baseline
    from simharness.gate.score_tests import require_seeds
    from simharness.gate.suite import kept_trials, run_suite

    require_seeds(study)
    with kept_trials(study, path) as store:
        with failing(), reporter() as bars:
            done = run_suite(study, workers=workers, reporter=bars, store=store)
        if done.failed:
            say(f"{_list_failed(done.failed)}\n{path} was not written, because it would lack these trials", err=True)
            raise typer.Exit(FOUND)
        measured = done.measurement(study)
        write_baseline(measured, path)
    say(f"{path}: {len(measured.scores)} results of the suite {measured.suite} ({measured.fingerprint})")
    _print_power(measured, study)


def _print_power(measured: "Measurement", study: "Study") -> None:
    """Print which changes the suite can show, and how many seeds smaller or larger ones need."""
    from simharness.gate.power import POWER, WISHED, even_changes, power_of, power_rows

    title = f"Changes that {len(study.seeds)} seeds show in {100 * POWER:.0f} % of runs, if they vary as the score does"
    columns = ("whole\nsuite", "one\ncase", *(f"seeds for\n{wish} tolerances" for wish in WISHED))
    table = plain_table(title, ("score", "variant"), columns, padding=(0, 1, 0, 0))
    for row in power_rows(power_of(measured, study.gate)):
        table.add_row(*row)
    Console().print(table)
    say(even_changes(measured, study.gate))


def _print(check: "GateResult") -> None:
    """Print the result of a check."""
    from simharness.gate.gate_reports import sentence

    verdict = Text(check.verdict, "bold green" if check.passed else "bold red")
    say(Text.assemble((check.suite, "bold"), ": ", verdict, f", {check.trials} trials in {check.seconds:.0f} s"))
    if check.failed:
        say(_list_failed(check.failed))
    for kind, style in _STYLES.items():
        changes = check.comparison.with_verdict(kind)
        for change in changes[:_LISTED]:
            say(Text.assemble((f"{kind:<6}", style), " ", sentence(change)))
        if len(changes) > _LISTED:
            say(Text(f"{kind:<6} and {len(changes) - _LISTED} more", style))
    if check.advice:
        say(check.advice)
    for variant in check.variants:
        Console().print("", _table(check, variant))
    say(f"\n{check.worst_description}\n  {check.command}")


def _table(check: "GateResult", variant: str) -> Table:
    """Return the scores of a variant over the whole suite."""
    from simharness.gate.gate_reports import allowed, difference, number, title

    columns = ("now", "baseline", "difference\n(95 % interval)", "allowed")
    table = plain_table(variant, ("score",), columns, padding=(0, 1, 0, 0))
    for change in check.comparison.changes_of(variant):
        name = Text(title(change.score))
        if change.verdict in _STYLES:
            name.append(f"\n  {change.verdict}", _STYLES[change.verdict])
        table.add_row(
            name,
            number(change.score, change.after),
            number(change.score, change.before),
            difference(change).replace(" (", "\n("),  # in one line the table is wider than 80 columns
            allowed(change),
        )
    return table


def _list_failed(failed: "Sequence[FailedCase]") -> str:
    lines = [f"failed {each.case}, seed {each.seed}: {each.error}" for each in failed[:_LISTED]]
    more = [f"failed and {len(failed) - _LISTED} more"] if len(failed) > _LISTED else []
    return "\n".join([*lines, *more])
