"""Result folder of a study: its files, written and read.

`study.json`
    description of the study and of the run: ``name``, ``description``, ``seeds``, ``variants``, ``factors`` (dotted
    keys), ``one_at_a_time``, ``settings`` and ``trials`` (numbers), ``kept`` (number of trials that were finished
    before), ``run`` (number of trials that were run), ``failed`` (a list of ``trial``, ``case``, ``factors``, ``seed``,
    ``variants``, ``error``; empty if no trial failed), ``damaged`` (entries of the store that were run again),
    ``seconds`` (duration of this run), ``command``, ``machine``, ``code`` (version), ``digests`` (of the code:
    simulation, method, scores, failures), ``versions`` (of packages).
`study.toml`
    the study as it was run, with the keys of its bases.
`trials.parquet`
    a row for each trial and variant: ``trial`` (identity, the same for all variants), ``case``, ``varied``, ``seed``,
    ``variant``, a column for each factor, named by its key, one for each of
    :data:`simharness.scoring.catalogue.SCORES`, ``seconds``, and ``scenario``, the resolved scenario as JSON.
`frames.parquet`, `people.parquet`, `failures.parquet`
    ``trial``, ``variant``, and the columns of :class:`simharness.trial.variant_result.VariantResult`. Settings that
    make the same trial share its rows.
`report.html`
    the report.

The tables are made from the entries of its store.

The plan of a study has its trials, and the identities under which a store keeps them.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.files.input_files import read_bytes, read_json_object
from mvpose.files.message_text import one_line, prefixed
from mvpose.presets import TRACKING, without_repair
from simharness.runtime.parquet_tables import table_of
from simharness.scenario.load import Setting, Study, Value
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps_keys
from simharness.scoring.catalogue import SCORES
from simharness.study.trial_store import Entry, parquet
from simharness.trial.identity import entry_identity, estimator_code, trial_identity


@dataclass(frozen=True)
class PlannedTrial:
    """A trial of a study."""

    setting: Setting
    """Setting of the study."""
    seed: int
    """Seed of the trial."""
    scenario: Scenario
    """Resolved scenario at that seed."""
    trial: str
    """Identity of the trial. Several settings may resolve to the same trial."""
    entries: Mapping[str, str]
    """Identity of the entry of each variant."""


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


_LARGEST = 2**32  # bytes of a table
TABLES = ("trials", "frames", "people", "failures")


@dataclass(frozen=True)
class Tables:
    """Tables of a study; their columns are listed in the docstring of this module."""

    trials: pl.DataFrame
    """a row for each trial and variant."""
    frames: pl.DataFrame
    """a row for each trial, variant and frame."""
    people: pl.DataFrame
    """a row for each trial, variant, frame and true person."""
    failures: pl.DataFrame
    """a row for each failure."""


@dataclass(frozen=True, kw_only=True)
class Results(Tables):
    """Results of a study."""

    info: Mapping[str, Any]
    """Content of ``study.json``."""
    folder: Path
    """The result folder."""

    def scenario_of(self, trial: str) -> Scenario:
        """Return the resolved scenario of a trial, with its seed.

        Raises:
            ValueError: the study has no such trial, or its scenario is damaged.
        """
        rows = self.trials.filter(pl.col("trial") == trial)
        if rows.is_empty():
            raise ValueError(f"{self.folder}: this study has no trial {trial}")
        try:
            return Scenario.model_validate_json(rows["scenario"][0])
        except ValueError as error:
            why = one_line(str(error), 200)
            raise ValueError(f"{self.folder}: the scenario of trial {trial} cannot be read: {why}") from None


def write_study(folder: Path, info: Mapping[str, Any], tables: Tables, document: str) -> None:
    """Write the files of a study, all but the report, into an existing folder.

    Args:
        folder: an existing folder.
        info: content of ``study.json``.
        tables: the tables.
        document: content of ``study.toml``.
    """
    (folder / "study.json").write_text(
        json.dumps(info, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
    )
    (folder / "study.toml").write_text(document, encoding="utf-8")
    for name in TABLES:
        (folder / f"{name}.parquet").write_bytes(parquet(getattr(tables, name)))


def read_study(folder: Path | str) -> Results:
    """Read the folder of a study.

    Raises:
        ValueError: a file is missing or cannot be read.
    """
    folder = Path(folder)
    files = [folder / "study.json", *(folder / f"{name}.parquet" for name in TABLES)]
    if missing := [file.name for file in files if not file.is_file()]:
        raise ValueError(
            f"{folder}: not the result folder of a study: missing {', '.join(missing)}; give a folder that simharness "
            "study wrote"
        )
    with prefixed(f"{folder}: cannot be read", "; run the study again to write the folder again"):
        info = read_json_object(files[0], what="the description of a study")
        tables = dict(zip(TABLES, map(_read_table, files[1:]), strict=True))
    return Results(info=info, folder=folder, **tables)


def document(study: Study) -> str:
    """Return a scenario file of the same study, for :func:`simharness.scenario.load.load_study`.

    The keys of all its bases are written out. Rigs and detector profiles are written by name; other files are relative
    to the folder in which the study was started.
    """
    keys = {key: value for key, value in study.data.items() if key not in ("seed", "seeds", "method")}
    head: dict[str, Any] = {"name": study.name, "seeds": list(study.seeds), "variants": list(study.variants)}
    if estimators := study.base.method.estimators.places:
        keys["method"] = {"estimators": estimators}
    return dumps_keys({**head, **keys})


def _read_table(file: Path) -> pl.DataFrame:
    content = read_bytes(file, what="a table of a study", most=_LARGEST)
    with prefixed(file.name):
        return table_of(content)


_FIRST = {"trial": pl.String, "case": pl.String, "varied": pl.String, "seed": pl.Int64, "variant": pl.String}


def tables(rows: Sequence[tuple[PlannedTrial, Entry]], factors: Sequence[str]) -> Tables:
    """Return the tables of a study.

    Args:
        rows: trials of the study, each with the stored result of one variant, in the order of the table.
        factors: swept keys.
    """
    entries = {(entry.trial, entry.variant): entry for _, entry in rows}  # several settings may share a trial
    return Tables(
        _trials(rows, factors), *(_joined(entries.values(), name) for name in ("frames", "people", "failures"))
    )


def _trials(rows: Sequence[tuple[PlannedTrial, Entry]], factors: Sequence[str]) -> pl.DataFrame:
    texts: dict[str, str] = {}
    for planned, _ in rows:
        texts.setdefault(planned.trial, planned.scenario.model_dump_json())
    head = [(each.trial, each.setting.case, each.setting.varied, each.seed, entry.variant) for each, entry in rows]
    columns = pl.DataFrame(head, _FIRST, orient="row").to_dict()
    for factor in factors:
        columns[factor] = factor_column([planned.setting.factors[factor] for planned, _ in rows])
    for score in SCORES:
        columns[score] = pl.Series([entry.result.scores.get(score) for _, entry in rows], dtype=pl.Float64)
    columns["seconds"] = pl.Series([entry.seconds for _, entry in rows], dtype=pl.Float64)
    columns["scenario"] = pl.Series([texts[planned.trial] for planned, _ in rows], dtype=pl.String)
    return pl.DataFrame(columns)


def factor_column(values: Sequence[Value]) -> pl.Series:
    """Return the values of a factor as a column of booleans, integers, numbers or text.

    Values of another or of mixed types are written as JSON text. A missing value is null.
    """
    known = [value for value in values if value is not None]
    for kinds, dtype in (((bool,), pl.Boolean), ((int,), pl.Int64), ((int, float), pl.Float64), ((str,), pl.String)):
        if known and all(type(value) in kinds for value in known):
            return pl.Series(values, dtype=dtype, strict=False)
    texts = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
    return pl.Series(texts, dtype=pl.String)


def _joined(entries: Iterable[Entry], name: str) -> pl.DataFrame:
    """Return one table of all entries joined, each row with its trial and variant."""
    parts = [
        getattr(entry.result, name).select(
            pl.lit(entry.trial).alias("trial"), pl.lit(entry.variant).alias("variant"), pl.all()
        )
        for entry in entries
    ]
    empty = pl.DataFrame(schema={"trial": pl.String, "variant": pl.String})
    return pl.concat(parts, how="vertical_relaxed") if parts else empty
