"""Scenario file of a study as it was run: its bases and the command line are part of it."""

from __future__ import annotations

from typing import Any

from simharness.scenario.study_definition import Study
from simharness.scenario.toml_files import dumps_keys


def document(study: Study) -> str:
    """Return a scenario file of the same study, for :func:`simharness.scenario.study_definition.load_study`.

    The keys of all its bases are written out. Rigs and detector profiles are written by name; other files are relative
    to the folder in which the study was started.
    """
    keys = {key: value for key, value in study.data.items() if key not in ("seed", "seeds", "method")}
    head: dict[str, Any] = {"name": study.name, "seeds": list(study.seeds), "variants": list(study.variants)}
    if estimators := study.base.method.estimators.places:
        keys["method"] = {"estimators": estimators}
    return dumps_keys({**head, **keys})
