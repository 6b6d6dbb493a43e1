"""Detector profiles: files of [detector] settings that scenarios begin with, ``scenarios/detectors/*.toml``.

A profile may begin with another one, too: ``profile = "typical"`` in its first lines.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from simharness.scenario.detector import KINDS, Detector
from simharness.scenario.mistakes import explain
from simharness.scenario.reading import ScenarioError, read_toml

DEFAULT = "typical"
"""The profile of a scenario file that names none."""

SHIPPED = Path(__file__).parents[2] / "scenarios" / "detectors"
"""Where the profiles are that come with the project."""


def read_profile(name: str, *, folder: Path | None = None) -> Detector:
    """Read a profile.

    Args:
        name: of one that comes with the project ("typical"), or a TOML file's, relative to ``folder``.
        folder: where profiles are looked for first.

    Raises:
        ScenarioError: there is none, or it says something that a detector has not.
    """
    return Detector.model_validate_json(json.dumps(_settings(name, folder or Path())), strict=True)


def take_profile(data: dict[str, Any], folder: Path, places: Mapping[tuple[str, ...], str]) -> None:
    """Put the profile that a scenario names under its [detector] section, in place.

    A scenario that says all of a detector, a name among it, begins with none: it is one that was written out.

    Args:
        data: of the scenario file.
        folder: of that file.
        places: who set a key where the file did not, for messages.

    Raises:
        ScenarioError: as :func:`read_profile`.
    """
    said = data.get("detector", {})
    if not isinstance(said, dict) or ("name" in said and "profile" not in said):
        return
    name = said.pop("profile", DEFAULT)
    if not isinstance(name, str):
        place = places.get(("detector", "profile"), "detector.profile")
        raise ScenarioError(f"{place}: expected the name of a detector profile, got {json.dumps(name, default=str)}")
    settings = _settings(name, folder)
    if said:
        settings["name"] = f"{settings.get('name', name)}, changed"
    data["detector"] = _over(settings, said)


def _settings(name: str, folder: Path | None, *, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    path = _find(name, folder)
    if path in above:
        raise ScenarioError(f"{path}: begins with profile {name!r}, which begins with it; take one of them out")
    settings = read_toml(path)
    if isinstance(begins := settings.pop("profile", None), str):
        settings = _over(_settings(begins, path.parent, above=(*above, path)), settings)
    try:
        Detector.model_validate_json(json.dumps(settings, default=str), strict=True)
    except ValidationError as error:
        mistakes: list[Any] = [{**mistake, "loc": ("detector", *mistake["loc"])} for mistake in error.errors()]
        lines = [explain(mistake, {}, str(path)) for mistake in mistakes]
        raise ScenarioError("\n".join(dict.fromkeys(lines))) from None
    return settings


def _find(name: str, folder: Path | None) -> Path:
    """The file of a profile: beside the profile or in ``detectors`` beside the scenario that names it, or shipped."""
    folder = folder or Path()
    if name.endswith(".toml"):
        return folder / name
    places = [folder if folder.name == "detectors" else folder / "detectors", SHIPPED]
    for place in places:
        if (place / f"{name}.toml").is_file():
            return place / f"{name}.toml"
    known = sorted({file.stem for place in places for file in place.glob("*.toml")})
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {near[0]}?" if near else ""
    raise ScenarioError(
        f"detector.profile = {name!r}: no such profile; there are {', '.join(known) or 'none'}, or name a file "
        f"that ends in .toml.{hint}"
    )


def _over(base: Any, said: Any) -> Any:
    """What is said over what was: sections key by key, and a number for all joints gives way joint by joint."""
    if not isinstance(said, dict):
        return said
    if isinstance(base, int | float):
        base = dict.fromkeys(KINDS, base)
    if not isinstance(base, dict):
        return said
    return {**base, **{key: _over(base.get(key), value) for key, value in said.items()}}
