"""``simharness study`` and ``merge``: many trials, stored as they finish."""

import contextlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.text import Text

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.programs import FAILED, note
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import say
from simharness.cli.program import PROGRAM, BlameSeeds, Overrides, ScenarioFile, Workers

if TYPE_CHECKING:
    import polars as pl

    from simharness.cli.score_tables import ScoreTable
    from simharness.outputs.study.curves import Loss
    from simharness.study.study_folder import Results

_LISTED = 10  # failed trials that are listed
_SHORT_KEY = 16  # letters of a factor that stay on one line
_IDENTITIES = ("hota", "idf1", "id_switches", "switches_per_minute")


@dataclass(frozen=True)
class Running:
    """How and where the trials of a study run, and where the results appear."""

    workers: Workers = 1
    scheduler: str | None = option(None, "Run on a Dask cluster: [cyan]tcp://host:8786[/].", metavar="ADDRESS")
    shard: str | None = option(
        None,
        "Run only part I of N, for several machines: [cyan]1/3[/]; then [cyan]merge[/] their stores.",
        metavar="I/N",
    )
    store: Path | None = option(
        None,
        "Folder of finished trials, which are not run again. [dim]\\[default: store, in --out][/]",
        metavar="FOLDER",
        file_okay=False,
    )
    out: Path = option(
        Path("results/studies"),
        "Folder in which the study gets a folder with its name.",
        metavar="FOLDER",
        file_okay=False,
    )


@grouped()
def study(
    file: ScenarioFile,
    overrides: Overrides = None,
    seeds: int | None = option(None, "Number of seeds, instead of the file's.", metavar="N", min=1),
    variant: list[str] | None = option(
        None, "A preset such as [cyan]fast[/], instead of the file's variants. Repeatable.", metavar="VARIANT"
    ),
    blame: BlameSeeds = 0,
    yes: bool = option(False, "Run even a study of more than 10,000 trials.", "--yes"),
    *,
    running: Running,
) -> None:
    """Run a study: a scenario with every combination of its swept values, at every seed.

    Finished trials are stored and not run again, so that an interrupted study
    resumes where it stopped. The results appear, when all trials are finished,
    in a folder NAME: report.html for people, Parquet tables for programs.
    """
    with PROGRAM.exit_on_error(), _stopping():
        from simharness.scenario.load import LIMIT, load_study

        limits = None if yes else LIMIT
        loaded = load_study(file, overrides=overrides or (), seeds=seeds, variants=variant or None, limit=limits)
        if yes and loaded.plan.most_trials <= LIMIT:
            note(f"--yes has no effect: the study has no more than {LIMIT:,} trials")
        part = _part(running.shard)
        if part is not None and blame:
            raise ValueError("--blame: is made of all parts: give it without --shard, when their stores are merged")
        if part is not None and running.store is not None and given("out"):
            raise ValueError(
                "--out: a part of a study has no results, only trials, which go to --store; give one of them"
            )
        if running.scheduler is not None and given("workers") and not blame:
            raise ValueError("--workers: the cluster of --scheduler has its own; give one of them")
        from simharness.study.study_run import run_shard, run_study

        where: dict[str, Any] = {"workers": running.workers, "scheduler": running.scheduler}
        if part is not None:
            kept_in = running.store or running.out / "store"
            with reporter() as bars:
                tally = run_shard(loaded, part, store=kept_in, **where, reporter=bars)
            info: dict[str, Any] = {**vars(tally), "failed": [vars(each) for each in tally.failed]}
            say(_counts(info, f"part {running.shard}"))
            say(f"store: {kept_in}")
            say("after all parts: simharness merge STORE... --into STORE, then the same study without --shard")
        else:
            command = PROGRAM.command_line()
            with reporter() as bars:
                results = run_study(
                    loaded, out=running.out, store=running.store, **where, reporter=bars, command=command
                )
            info = dict(results.info)
            if len(results.trials):
                for table in _tables(results):
                    table.print_to(Console())
            say(_counts(info, loaded.name))
            _report(results, blame=blame, workers=running.workers)
    if info["failed"]:
        raise typer.Exit(FAILED)


def merge(
    stores: Annotated[list[Path], typer.Argument(help="Stores of finished trials.", metavar="STORE...")],
    into: Annotated[Path, typer.Option(metavar="STORE", help="The store to which they are copied.", file_okay=False)],
) -> None:
    """Merge the stores of a study that ran in parts (study --shard) on several machines."""
    with PROGRAM.exit_on_error(), _stopping():
        from simharness.study.trial_store import merge as merge_stores

        merged = merge_stores(stores, into)
        say(f"{merged.copied} entries copied into {into}, {merged.present} were already there")
        if merged.damaged:
            say(f"{len(merged.damaged)} are damaged and were skipped:", err=True)
            for damaged in merged.damaged[:_LISTED]:
                say(f"  {damaged}", err=True)


@contextlib.contextmanager
def _stopping() -> Iterator[None]:
    """Report in one message why a study stopped early."""
    from mvpose.commands.errors import RunError

    try:
        yield
    except RunError as error:
        Console(stderr=True).print(Text.assemble(("the study stopped: ", "bold red"), str(error)), soft_wrap=True)
        raise typer.Exit(FAILED) from None


def _part(shard: str | None) -> tuple[int, int] | None:
    if shard is None:
        return None
    if not (match := re.fullmatch(r"(\d+)/(\d+)", shard)):
        raise ValueError(f"--shard {shard}: expected I/N, for example --shard 1/8")
    return int(match[1]), int(match[2])


def _tables(results: "Results") -> "list[ScoreTable]":
    """Return the answer of a study: what its factors cost, or where it has none the mean scores.

    Variants that track people have another table.
    """
    import polars as pl

    from simharness.outputs.study.tables import tracks_people
    from simharness.scoring.catalogue import HEADLINE
    from simharness.study.factors import factors_by_case

    tracked = results.trials.filter(pl.col("hota").is_not_null().any().over("variant"))
    if any(factors_by_case(results).values()):
        tables = [_losses(results, "pcp")]
        if tracks_people(results.trials):
            tables.append(_losses(results, "hota"))
        return tables
    tables = [_table(results, results.info["name"], results.trials, HEADLINE)]
    if tracks_people(results.trials):
        tables.append(_table(results, "identities, within 0.5 m", tracked, _IDENTITIES))
    return tables


def _losses(results: "Results", score: str) -> "ScoreTable":
    """Return what every factor costs: the score at its best and worst value, and where five points are lost."""
    from simharness.cli.score_tables import ScoreTable
    from simharness.outputs.study.curves import losses
    from simharness.runtime.number_text import fixed, short
    from simharness.scoring.catalogue import SCORES
    from simharness.study.factors import LOST, factors_by_case

    info = SCORES[score]
    by_case = factors_by_case(results)
    cases = [case for case in by_case if case]
    rows = []
    for case, swept in by_case.items():
        for factor in swept:
            for loss in losses(factor, results.info["variants"], score):
                ends = (
                    f"{fixed(at.mean, info.digits)} at {short(where)}"
                    for at, where in ((loss.at_best, loss.best), (loss.at_worst, loss.worst))
                )
                key = factor.key if len(factor.key) <= _SHORT_KEY else factor.key.replace(".", ".\n")
                rows.append((*((case,) if cases else ()), key, loss.variant, *ends, _lost_at(loss, factor.values)))
    labels = (*(("case",) if cases else ()), "factor", "variant")
    headings = ("best", "worst", f"{LOST:g} points are lost\n(95 % interval)")
    title = f"{results.info['name']}: {info.title}, {info.unit}, along each factor"
    return ScoreTable(title, labels, headings, _without_repeats(rows, len(labels) - 1))


def _lost_at(loss: "Loss", values: Sequence[Any]) -> str:
    """Return where points are lost, with its interval."""
    from simharness.runtime.number_text import short

    point = loss.point
    if point is None:
        return "–"
    low, high = (None if end is None else short(end, 3) for end in (point.low, point.high))
    least, most = (short(end, 3) for end in (values[0], values[-1]))
    if point.value is None:
        nowhere = f"not from {least} to {most}"
        near = low if loss.rising else high
        return f"{nowhere}\n({'from' if loss.rising else 'up to'} {near})" if near else nowhere
    where = f"{'above' if loss.rising else 'below'} {short(point.value, 3)}"
    return f"{where} ({low or f'≤{least}'} to {high or f'≥{most}'})"


def _without_repeats(rows: Sequence[Sequence[str]], labels: int) -> list[list[str]]:
    """Return rows whose first labels are empty where they repeat those of the row above."""
    result, above = [], [""] * labels
    for row in rows:
        same = [list(row[: k + 1]) == above[: k + 1] for k in range(labels)]
        result.append([*("" if repeated else label for label, repeated in zip(row, same, strict=False)), *row[labels:]])
        above = list(row[:labels])
    return result


def _table(results: "Results", title: str, trials: "pl.DataFrame", scores: Sequence[str]) -> "ScoreTable":
    """Return mean scores with intervals over seeds, a row for each variant; with one factor, for each setting."""
    import polars as pl

    from simharness.cli.score_tables import ScoreTable, mean_cell
    from simharness.outputs.study.tables import by_seed
    from simharness.scoring.catalogue import SCORES

    factors = results.info["factors"] if len(results.info["factors"]) == 1 else []
    keys = [*(("case",) if any(results.trials["case"]) else ()), *factors, "variant"]
    lines = []
    for group in trials.select(keys).unique(maintain_order=True).iter_rows():
        rows = trials.filter(*(pl.col(key).eq_missing(value) for key, value in zip(keys, group, strict=True)))
        cells = [mean_cell(list(by_seed(rows, score).values()), SCORES[score]) for score in scores]
        lines.append((*("–" if value is None else str(value) for value in group), *cells))
    headings = [f"{SCORES[score].title}\n{SCORES[score].unit}" for score in scores]
    return ScoreTable(title, [key.replace(".", ".\n") for key in keys], headings, lines)


def _counts(info: dict[str, Any], what: str) -> str:
    """Return the numbers of kept, run and failed trials as text, and the failed trials."""
    trials = "1 trial" if info["trials"] == 1 else f"{info['trials']} trials"
    lines = [
        f"{what}: {trials}: {info['kept']} kept from before, {info['run']} run, "
        f"{info['trials'] - info['kept'] - info['run']} failed, {info['seconds']:.1f} s"
    ]
    if damaged := info["damaged"]:
        lines.append(f"{len(damaged)} damaged entries of the store were run again: {', '.join(damaged[:_LISTED])}")
    failed: Sequence[dict[str, Any]] = info["failed"]
    for each in failed[:_LISTED]:
        about = [each["case"], *(f"{key} = {value}" for key, value in each["factors"].items()), f"seed {each['seed']}"]
        lines.append(f"failed: {', '.join(filter(None, about))}: {each['error']}")
    if len(failed) > _LISTED:
        lines.append(f"and {len(failed) - _LISTED} more failed, see study.json")
    return "\n".join(lines)


def _report(results: "Results", *, blame: int, workers: int) -> None:
    if not len(results.trials):
        return
    if blame:
        blame_results(results, seeds=blame, workers=workers)
    from simharness.outputs.study.page import write_report
    from simharness.outputs.study.worst_frames import SHOWN

    with failing(), reporter() as bars, bars.stage("report", SHOWN) as advance:
        page = write_report(results, progress=advance)
    say(f"report: {page}")


def blame_results(results: "Results", *, seeds: int, workers: int = 1) -> None:
    """Find what cost a study its score, write it into its folder, and print it."""
    from simharness.cli.blame_command import print_blame
    from simharness.outputs.study.curves import blame_study
    from simharness.study.causes.blame_text import write_blame

    with reporter() as bars:
        found = blame_study(results, seeds=seeds, workers=workers, reporter=bars)
    write_blame(found, results.folder)
    print_blame(found, Console())
