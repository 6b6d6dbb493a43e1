"""Pages from templates: what is text stays text, and a name that a template needs must be given."""

from __future__ import annotations

from typing import Any

import jinja2


def fill(template: str, /, **values: Any) -> str:
    """The page that a template of this package makes of values; markup is only what is ``Markup``."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("simharness.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)
