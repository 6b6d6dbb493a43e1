"""Sphinx configuration: pages in Markdown, the API reference from the docstrings of both packages."""

from simharness.runtime.version import code_version

project = "simharness and mvpose"
author = "the contributors"
copyright = "the contributors, Apache-2.0"
release = version = code_version()

extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["build"]
html_theme = "furo"
html_title = "simharness and mvpose"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

apidoc_modules = [
    {
        "path": f"../{package}",
        "destination": f"api/{package}",
        "exclude_patterns": [f"../{package}/build/**"],
        "separate_modules": True,
        "module_first": True,
        "automodule_options": {"members", "show-inheritance"},
    }
    for package in ("mvpose", "simharness")
]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases: dict[str, str] = {}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# A reference that does not resolve is an error, because `make docs` runs with -W. Types in signatures of other projects
# and names of type aliases have no pages here.
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!(simharness|mvpose)\.).*")]
