"""Sphinx configuration: pages in Markdown, the API reference from the docstrings of both packages."""

import functools
import importlib
from collections import defaultdict
from typing import Any, ClassVar

from sphinx.addnodes import pending_xref
from sphinx.transforms.post_transforms import SphinxPostTransform

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

# Rooms that nobody imports who uses or extends the packages; their docstrings are read in the code.
INTERNAL = {
    "mvpose": ("build", "cli", "report"),
    "simharness": (
        "capture",
        "cli",
        "outputs/figures",
        "outputs/planning",
        "outputs/study",
        "outputs/validation",
        "runtime",
        "world/humans",
        "world/motion/activities",
        "world/motion/interactions",
        "world/motion/mocap",
        "world/motion/poses",
        "world/scene",
    ),
}

apidoc_modules = [
    {
        "path": f"../{package}",
        "destination": f"api/{package}",
        "exclude_patterns": [f"../{package}/{room}" for room in rooms],
        "separate_modules": False,
        "module_first": True,
        "automodule_options": {"members", "show-inheritance"},
    }
    for package, rooms in INTERNAL.items()
]
autodoc_member_order = "bysource"
toc_object_entries = False  # modules are enough in the contents beside a page, which every page repeats
autodoc_typehints = "signature"
autodoc_use_type_comments = False  # nobody writes them; looking for them parses every function again
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
    ("py:class", r".*\w+ByJoint\[.*|.*\.ByJoint\[.*"),  # values of generics, which are written as pydantic names them
    ("py:exc", r"(tomllib\.)?[A-Z]\w+"),  # exceptions of Python
]
suppress_warnings = ["ref.python"]  # a short name in a signature that two modules have


def _skip_namesakes(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what has a section already.

    That is a public name of simharness, which has its section in its module; a function in its package where its module
    has the same name; and a generic with values, which pydantic adds to the module.
    """
    if "[" in name:
        return True
    module = app.env.temp_data.get("autodoc:module")
    origin = getattr(obj, "__module__", None)
    elsewhere = module != origin and (module == "simharness" or origin == f"{module}.{name}")
    return True if elsewhere else None


def _internal(app: Any, env: Any, node: Any, contnode: Any) -> Any:
    """Return the text of a reference to something that exists, but has no page; None for all others."""
    target, module = node.get("reftarget", ""), node.get("py:module") or ""
    if node.get("refdomain") != "py":
        return None
    scopes = [module.rsplit(".", depth)[0] for depth in range(module.count(".") + 1)] if module else []
    names = [target, *(f"{scope}.{target}" for scope in scopes), f"{module}.{node.get('py:class')}.{target}"]
    return contnode if any(_exists(name) for name in names if name.startswith(("mvpose.", "simharness."))) else None


@functools.cache
def _exists(name: str) -> bool:
    """Return whether a dotted name of the packages is a module, or a name in one."""
    module, rest = name, []
    while module:
        try:
            found = importlib.import_module(module)
        except ImportError:
            module, _, last = module.rpartition(".")
            rest.insert(0, last)
            continue
        for each in rest:
            fields = getattr(found, "__annotations__", {}) | getattr(found, "__dataclass_fields__", {})
            if each in fields and not hasattr(found, each):
                return True
            if not hasattr(found, each):
                return False
            found = getattr(found, each)
        return True
    return False


class ShortNames(SphinxPostTransform):
    """Give types in signatures their full names, and leave those of other projects as text.

    Sphinx would look for each by the ends of the names of all objects: half of the time of the whole site.
    """

    default_priority = 5  # before Sphinx resolves references
    _full_names: ClassVar[dict[str, list[str]]] = {}

    def run(self, **_: Any) -> None:
        """Change the references of one page."""
        if not self._full_names:
            names = defaultdict(list)
            for name in self.env.domains.python_domain.objects:
                names[name.rpartition(".")[2]].append(name)
            self._full_names.update(names)
        for node in list(self.document.findall(pending_xref)):
            if node.get("refdomain") != "py" or not node.get("refspecific"):
                continue
            known = self._full_names.get(node["reftarget"].rpartition(".")[2], [])
            if len(known) == 1:
                node["reftarget"], node["refspecific"] = known[0], False
            elif not known and node.get("reftype") in ("class", "obj"):
                node.replace_self(node.children)


def setup(app: Any) -> None:
    """Connect the handlers."""
    app.add_post_transform(ShortNames)
    app.connect("autodoc-skip-member", _skip_namesakes)
    app.connect("missing-reference", _internal)
