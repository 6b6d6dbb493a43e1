"""HTML pages from templates, and Markdown fragments of the texts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parent / "templates"


def fill_template(template: str, /, *, folder: Path = TEMPLATES, **values: Any) -> str:
    """Return the text of a template filled with values. Every value is escaped except ``Markup``.

    Args:
        template: file name in ``folder``.
        folder: folder of the template and of the files that it includes.
        values: values by the names that the template uses; a missing name is an error.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


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
