"""Synthetic study: result tables in the format of a real study, with known numbers."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.catalogue import SCORES
from simharness.scoring.stage_blame import FAILURE_SCHEMA
from simharness.scoring.tracking.identity_figures import IDENTITY_SCORES
from simharness.study.study_folder import Results
from simharness.types.random_streams import stream

FRAMES, PEOPLE = 5, 2
KINDS = ("missed", "split", "merged", "displaced_joint")
STAGES = ("detection", "matching", "reconstruction")


def pcp_of(variant: str, factors: dict[str, Any], seed: int, slope: float = 5.0) -> float:
    """Return the PCP of the synthetic study: linear in every number, with offsets for seed and variant."""
    numbers = [value for value in factors.values() if isinstance(value, int | float)]
    return 60.0 + slope * sum(numbers) + 0.5 * (seed % 3) - (4.0 if variant != "full" else 0.0)


def make_study(
    folder: Path,
    *,
    factors: dict[str, list[Any]] | None = None,
    seeds: int = 4,
    variants: tuple[str, ...] = ("full", "fast"),
    cases: tuple[str, ...] = ("",),
    one_at_a_time: bool = False,
    slope: float = 5.0,
    failed: tuple[dict[str, Any], ...] = (),
    **info: Any,
) -> Results:
    """Return a study of a grid, or of one factor at a time, where each factor's first value is the base.

    Only variants whose names begin with ``track`` have scores of identities.
    """
    factors = {"cameras.count": [2, 3, 5]} if factors is None else factors
    keys = list(factors)
    if one_at_a_time:
        base = {key: values[0] for key, values in factors.items()}
        settings = [("", base)] + [(key, base | {key: value}) for key in keys for value in factors[key][1:]]
    else:
        settings = [("", dict(zip(keys, values, strict=True))) for values in itertools.product(*factors.values())]
    trials, frames, people, failures = [], [], [], []
    for number, (case, (varied, setting), seed) in enumerate(itertools.product(cases, settings, range(seeds))):
        trial = f"{number:032x}"
        scenario = Scenario(name="made", seed=seed).model_dump_json()
        for variant in variants:
            rng = stream(seed, "made study", variant, number)
            scores: dict[str, float | None] = {
                key: float(stream(seed, "made scores", variant, number, key).uniform(1, 2)) for key in SCORES
            }
            if not variant.startswith("track"):
                scores |= dict.fromkeys(IDENTITY_SCORES)
            scores["pcp"] = pcp_of(variant, setting, seed, slope)
            trials.append(
                {"trial": trial, "case": case, "varied": varied, "seed": seed, "variant": variant}
                | setting
                | scores
                | {"seconds": 1.0, "scenario": scenario}
            )
            for frame in range(FRAMES):
                key = {"trial": trial, "variant": variant, "frame": frame}
                missed, ghosts = int(rng.random() < 0.2), int(rng.random() < 0.1)
                frames.append(
                    key
                    | {"people": PEOPLE, "estimates": PEOPLE - missed, "found": PEOPLE - missed, "missed": missed}
                    | {"ghosts": ghosts, "pcp": 90.0, "mpjpe_mm": 20.0}
                    | {"time_ms": float(rng.gamma(4.0, 3.0))}
                )
                for person in range(PEOPLE):
                    error = None if missed and person == 0 else float(rng.uniform(10, 40))
                    people.append(key | {"person": person, "found": error is not None, "error_mm": error})
                if ghosts:
                    ghost = {"person": -1, "kind": "ghost", "stage": "detection", "matching_alone": False}
                    failures.append(key | ghost | {"joints": [], "error_mm": None})
                if missed:
                    kind, stage = KINDS[int(rng.integers(4))], STAGES[int(rng.integers(3))]
                    alone = bool(rng.random() < 0.5)
                    failures.append(
                        key
                        | {"person": 0, "kind": kind, "stage": stage, "matching_alone": alone}
                        | {"joints": ["nose"], "error_mm": None}
                    )
    schema = {"trial": pl.String, "variant": pl.String, **FAILURE_SCHEMA}
    known = {
        "name": "made",
        "description": "A synthetic study",
        "code": "0.1.0",
        "seeds": list(range(seeds)),
        "variants": list(variants),
        "factors": keys,
        "one_at_a_time": one_at_a_time,
        "command": "simharness study made.toml",
        "machine": {"system": "Linux", "processor": "x86_64", "cpus": 2},
        "seconds": 100.0,
        "kept": 0,
        "versions": {"numpy": np.__version__},
        "digests": {"simulation": "0" * 32, "method": "1" * 32},
        "failed": list(failed),
        "trials": len(settings) * len(cases) * seeds + len(failed),
        "settings": len(settings) * len(cases),
    }
    return Results(
        info=known | info,
        trials=pl.DataFrame(trials, infer_schema_length=None),
        frames=pl.DataFrame(frames, infer_schema_length=None),
        people=pl.DataFrame(people, infer_schema_length=None),
        failures=pl.DataFrame(failures, schema=schema),
        folder=folder,
    )
