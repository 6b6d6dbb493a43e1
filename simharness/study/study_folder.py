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
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.files.input_files import read_bytes, read_json_object
from mvpose.files.message_text import one_line
from simharness.runtime.parquet_tables import table_of
from simharness.scenario.load import Study
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps_keys
from simharness.study.trial_store import parquet

_LARGEST = 2**32  # bytes of a table
TABLES = ("trials", "frames", "people", "failures")


@dataclass(frozen=True)
class Tables:
    """Tables of a study; their columns are listed in the docstring of this module."""

    trials: pl.DataFrame
    frames: pl.DataFrame
    people: pl.DataFrame
    failures: pl.DataFrame


@dataclass(frozen=True)
class Results:
    """Results of a study.

    Attributes:
        info: content of ``study.json``.
        trials: a row for each trial and variant.
        frames: a row for each trial, variant and frame.
        people: a row for each trial, variant, frame and true person.
        failures: a row for each failure.
        folder: the result folder.
    """

    info: Mapping[str, Any]
    trials: pl.DataFrame
    frames: pl.DataFrame
    people: pl.DataFrame
    failures: pl.DataFrame
    folder: Path

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
    try:
        info = read_json_object(files[0], what="the description of a study")
        tables = dict(zip(TABLES, map(_read_table, files[1:]), strict=True))
    except ValueError as error:
        raise ValueError(f"{folder}: cannot be read: {error}; run the study again to write the folder again") from None
    return Results(info, folder=folder, **tables)


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
    try:
        return table_of(content)
    except ValueError as error:
        raise ValueError(f"{file.name}: {error}") from None
