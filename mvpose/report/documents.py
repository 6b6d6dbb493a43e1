"""HTML pages and Markdown from templates."""

import importlib.metadata
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parent / "templates"
"""Templates of this package; those of other packages may extend ``page.html`` and include ``base.css``."""


def fill_template(template: str, /, *, folder: Path = TEMPLATES, **values: Any) -> str:
    """Return the text of a template filled with values. In pages every value is escaped except ``Markup``.

    Args:
        template: file name in ``folder``.
        folder: folder of the template; the files that it extends or includes are there or in :data:`TEMPLATES`.
        values: values by the names that the template uses; a missing name is an error.
    """
    return _templates(folder).get_template(template).render(values)


@cache
def _templates(folder: Path) -> jinja2.Environment:
    """Return the templates of a folder, of which each is compiled once."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, TEMPLATES]),
        autoescape=lambda name: not (name or "").endswith(".md"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def program_version() -> str:
    """Return the version of the installed distribution with this package; empty where none is installed."""
    for distribution in ("mvpose", "simharness"):  # an editable install of simharness holds mvpose
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    return ""
