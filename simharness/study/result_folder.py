"""A study on disk: the folder that its results are in, and how it is read back.

`study.json`
    what was run and how: ``name``, ``description``, ``seeds``, ``variants``, ``factors`` (dotted keys),
    ``one_at_a_time``, ``settings`` and ``trials`` (how many), ``kept`` (trials that were finished before), ``run``,
    ``failed`` (a list of ``trial``, ``case``, ``factors``, ``seed``, ``variants``, ``error``: empty where all is
    there), ``damaged`` (entries of the store that were run again), ``seconds`` (of this run), ``command``,
    ``machine``, ``code`` (version), ``digests`` (of the code: simulation, method), ``versions`` (of packages).
`study.toml`
    the study as it was run.
`trials.parquet`
    a row for each trial and variant: ``trial`` (identity, the same for all variants), ``case``, ``varied``, ``seed``,
    ``variant``, a column for each factor, named by its key, one for each of
    :data:`simharness.scoring.catalogue.SCORES`, ``seconds``, and ``scenario``, the resolved scenario as JSON.
`frames.parquet`, `people.parquet`, `failures.parquet`
    ``trial``, ``variant``, and the columns of :class:`simharness.trial.variant_result.VariantResult`. Settings that
    make the same trial share its rows.
`report.html`
    for people.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from simharness.scenario.sections.scenario import Scenario
from simharness.study.trial_store import parquet

TABLES = ("trials", "frames", "people", "failures")


@dataclass(frozen=True)
class Tables:
    """The tables of a study, as above."""

    trials: pl.DataFrame
    frames: pl.DataFrame
    people: pl.DataFrame
    failures: pl.DataFrame


@dataclass(frozen=True)
class Results:
    """A study that was run.

    Attributes:
        info: what ``study.json`` says.
        trials: a row for each trial and variant.
        frames: a row for each of those and frame.
        people: a row for each of those, frame and true person.
        failures: a row for each failure.
        folder: where it lies.
    """

    info: Mapping[str, Any]
    trials: pl.DataFrame
    frames: pl.DataFrame
    people: pl.DataFrame
    failures: pl.DataFrame
    folder: Path

    def scenario_of(self, trial: str) -> Scenario:
        """The resolved scenario of a trial, its seed included.

        Raises:
            ValueError: the study has no such trial.
        """
        found = self.trials.filter(pl.col("trial") == trial)
        if found.is_empty():
            raise ValueError(f"{self.folder}: this study has no trial {trial}")
        return Scenario.model_validate_json(found["scenario"][0])


def write_study(folder: Path, info: Mapping[str, Any], tables: Tables, document: str) -> None:
    """Write the files of a study, all but the report, into an existing folder.

    Args:
        folder: that exists.
        info: for ``study.json``.
        tables: the rest.
        document: for ``study.toml``.
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
        ValueError: it is none, a file of it is missing, or one cannot be read.
    """
    folder = Path(folder)
    files = [folder / "study.json", *(folder / f"{name}.parquet" for name in TABLES)]
    if missing := [file.name for file in files if not file.is_file()]:
        raise ValueError(
            f"{folder}: not the folder of a study: it has no {', '.join(missing)}; simharness study makes one"
        )
    try:
        info = json.loads(files[0].read_text(encoding="utf-8"))
        tables = dict(zip(TABLES, map(_read_table, files[1:]), strict=True))
    except ValueError as error:
        raise ValueError(f"{folder}: cannot be read: {error}; run the study again to make it anew") from None
    return Results(info, folder=folder, **tables)


def _read_table(file: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(file)
    except pl.exceptions.PolarsError as error:
        raise ValueError(f"{file.name}: {error}") from None
