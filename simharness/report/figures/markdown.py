"""Pieces of texts in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """The lines of a table: a column of names, then columns of numbers."""
    yield f"| {' | '.join(heads)} |"
    yield f"|{'|'.join([':--', *['--:'] * (len(heads) - 1)])}|"
    yield from (f"| {' | '.join(row)} |" for row in rows)


def duration(seconds: float) -> str:
    """A time to read, in minutes from a minute and a half on."""
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"


def origin(provenance: Mapping[str, Any]) -> str:
    """A sentence on the code, the libraries and the machine that a result comes from.

    Args:
        provenance: as :func:`simharness.trial.provenance.provenance` makes it.
    """
    made = ", ".join(f"{name} {digest[:8]}" for name, digest in provenance["digests"].items())
    versions = ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    machine = provenance["machine"]
    return f"Code {provenance['code']} ({made}) with {versions}; {machine['processor']}, {machine['cpus']} cores."
