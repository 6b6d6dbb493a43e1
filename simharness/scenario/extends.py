"""``extends``: a scenario file over the one that it begins with, and the command line over both."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simharness.scenario.layers import Places, leaves, set_place
from simharness.scenario.named_files import locate_files
from simharness.scenario.overrides import overridden
from simharness.scenario.presets import layered
from simharness.scenario.toml_reader import ScenarioError, read_toml


@dataclass(frozen=True)
class Document:
    """What a scenario file says together with its bases, before presets are put under it.

    Attributes:
        path: of the file.
        data: its keys, those of its bases and of the command line; ``variants`` is ``method.variants``.
        places: who set a key last: a file, or the command line.
        folders: of the file and its bases, where presets are looked for.
    """

    path: Path
    data: dict[str, Any]
    places: Places
    folders: tuple[Path, ...]


def read_document(path: Path | str, *, overrides: Sequence[str] = (), folder: Path | None = None) -> Document:
    """Read a scenario file and the files that it extends.

    Args:
        path: of the file.
        overrides: as of :func:`simharness.scenario.load.load`.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        ScenarioError: a file that is missing or not TOML, files that extend each other, what is not KEY=VALUE.
    """
    path = Path(path)
    chain = _chain(path)
    data: dict[str, Any] = {}
    places: Places = {}
    for file, said in reversed(chain):
        locate_files(said, file.parent if folder is None or file is not path else folder)
        short = "variants" in said
        _take_variants(said, file)
        for key in leaves(said):
            set_place(places, key, str(file))
        if short:  # as it is written, for messages
            set_place(places, ("variants",), str(file))
        data = layered(data, said)
    data = overridden(data, overrides, places)
    return Document(path, data, places, tuple(dict.fromkeys(file.parent for file, _ in chain)))


def _chain(path: Path) -> list[tuple[Path, dict[str, Any]]]:
    """The file, its base, the base of that, ..., and what each says."""
    chain: list[tuple[Path, dict[str, Any]]] = []
    file: Path | None = path
    while file is not None:
        try:
            said = read_toml(file)
        except ScenarioError as error:
            raise ScenarioError(f"{chain[-1][0]}: extends: {error}" if chain else str(error)) from None
        chain.append((file, said))
        base = said.pop("extends", "")
        if not isinstance(base, str):
            got = json.dumps(base, default=str)
            raise ScenarioError(f"{file}: extends: expected the name of a scenario file, got {got}")
        file = file.parent / base if base else None
        if file is not None and file.resolve() in [each.resolve() for each, _ in chain]:
            names = " extends ".join(str(each) for each in [*(each for each, _ in chain), file])
            raise ScenarioError(f"{names}: files cannot extend each other in a circle; take one extends out")
    return chain


def _take_variants(said: dict[str, Any], file: Path) -> None:
    """Write ``variants`` as ``method.variants``, in place."""
    if "variants" not in said:
        return
    method = said.setdefault("method", {})
    if not isinstance(method, dict):
        return
    if "variants" in method:
        raise ScenarioError(f"{file}: variants and method.variants are the same; say one of them")
    method["variants"] = said.pop("variants")
