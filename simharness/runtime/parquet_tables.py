"""Parquet tables of files that may be damaged."""

import io

import polars as pl

from mvpose.files.message_text import one_line


def table_of(content: bytes) -> pl.DataFrame:
    """Return the table of a Parquet file.

    Raises:
        ValueError: no Parquet file, or a damaged one.
    """
    try:
        return pl.read_parquet(io.BytesIO(content), use_pyarrow=False)
    except (Exception, pl.exceptions.PanicException) as error:  # the reader panics on some damaged files
        raise ValueError(f"no Parquet table, or a damaged one: {one_line(str(error), 120)}") from None
