"""Pages from templates: what is text stays text, and a name that a template needs must be given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parents[1] / "templates"


def fill(template: str, /, *, folder: Path = TEMPLATES, **values: Any) -> str:
    """Return the text of a template filled with values. Every value is escaped except ``Markup``.

    Args:
        template: file name in ``folder``.
        folder: where templates and the files that they include are.
        values: by the names that the template uses.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)
