"""HTML pages from templates, and Markdown fragments of the texts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mvpose.report import documents

TEMPLATES = Path(__file__).parent / "templates"


def fill_template(template: str, /, *, folder: Path = TEMPLATES, **values: Any) -> str:
    """Return a filled template of this package or of ``folder``; see :func:`mvpose.report.documents.fill_template`."""
    return documents.fill_template(template, folder=folder, program="simharness", **values)


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Return the lines of a Markdown table: a left-aligned column of names, then right-aligned columns of numbers."""
    yield f"| {' | '.join(heads)} |"
    yield f"|{'|'.join([':--', *['--:'] * (len(heads) - 1)])}|"
    yield from (f"| {' | '.join(row)} |" for row in rows)


def provenance_sentence(provenance: Mapping[str, Any]) -> str:
    """Return a sentence with the code, the libraries and the machine that made a result.

    Args:
        provenance: keys of :func:`simharness.trial.provenance.provenance`.
    """
    digests = ", ".join(f"{name} {digest[:8]}" for name, digest in provenance["digests"].items())
    versions = ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    machine = provenance["machine"]
    return f"Code {provenance['code']} ({digests}) with {versions}; {machine['processor']}, {machine['cpus']} cores."
