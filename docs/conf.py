"""Sphinx configuration: pages in Markdown, the API reference from the docstrings of both packages."""

from typing import Any

from simharness.runtime.version import code_version

project = "simharness and mvpose"
author = "the contributors"
copyright = "the contributors, Apache-2.0"
release = version = code_version()

extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["api/*/modules.rst"]
html_theme = "furo"
html_title = "simharness and mvpose"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

apidoc_modules = [
    {
        "path": f"../{package}",
        "destination": f"api/{package}",
        "exclude_patterns": [f"../{package}/build/**"],
        "separate_modules": False,
        "module_first": True,
        "automodule_options": {"members", "show-inheritance"},
    }
    for package in ("mvpose", "simharness")
]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# A reference that does not resolve is an error, because `make docs` runs with -W.
nitpicky = True
nitpick_ignore_regex = [
    (
        "py:(class|obj)",
        r"(?!(simharness|mvpose)\.).*",
    ),  # types in signatures: of other projects, and aliases by short names
    ("py:(class|obj)", r".*\.(_\w+|\w+_co|Result|Perform|Move|Terms)"),  # private aliases and type variables
    ("py:exc", r"(tomllib\.)?[A-Z]\w+"),  # exceptions of Python
]
suppress_warnings = ["ref.python"]  # a short name in a signature that two modules have


def _skip_namesakes(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave a function out of its package where its module has the same name: the section of the module has it."""
    module = app.env.temp_data.get("autodoc:module")
    origin = getattr(obj, "__module__", None)
    return True if module != origin and origin == f"{module}.{name}" else None


def setup(app: Any) -> None:
    """Connect the handlers."""
    app.connect("autodoc-skip-member", _skip_namesakes)
