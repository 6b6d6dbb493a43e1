"""Tables of a study, made from the entries of a store."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import polars as pl

from simharness.scenario.load import Value
from simharness.scoring.catalogue import SCORES
from simharness.study.study_folder import Tables
from simharness.study.study_plan import PlannedTrial
from simharness.study.trial_store import Entry

_FIRST = ("trial", "case", "varied", "seed", "variant")


def tables(rows: Sequence[tuple[PlannedTrial, Entry]], factors: Sequence[str]) -> Tables:
    """Return the tables of a study.

    Args:
        rows: trials of the study, each with the stored result of one variant, in the order of the table.
        factors: swept keys.
    """
    entries = {(entry.trial, entry.variant): entry for _, entry in rows}  # several settings may share a trial
    return Tables(
        _trials(rows, factors),
        *(_joined(entries.values(), name) for name in ("frames", "people", "failures")),
    )


def _trials(rows: Sequence[tuple[PlannedTrial, Entry]], factors: Sequence[str]) -> pl.DataFrame:
    texts: dict[str, str] = {}
    for planned, _ in rows:
        texts.setdefault(planned.trial, planned.scenario.model_dump_json())
    columns: dict[str, pl.Series] = {}
    for key in _FIRST:
        values: list[Any] = [
            {
                "trial": planned.trial,
                "case": planned.setting.case,
                "varied": planned.setting.varied,
                "seed": planned.seed,
                "variant": entry.variant,
            }[key]
            for planned, entry in rows
        ]
        columns[key] = pl.Series(values, dtype=pl.Int64 if key == "seed" else pl.String)
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
