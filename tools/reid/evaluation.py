"""Evaluation of a network on held-out people: after training, or again when the simulation has changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.networks.session import Session
from tools.reid import card, scores
from tools.reid.crops import Crops, Recipe
from tools.reid.metrics import Pairs, distributions
from tools.reid.plan import LOOK_ALIKE, Plan
from tools.reid.rendering import render_crops

_DIGITS = 4  # decimal places of the affinity


@dataclass(frozen=True)
class Evaluation:
    """Scores of a network on held-out people, as blocks of its card.

    Attributes:
        data: numbers of identities and crops.
        results: retrieval among all people of a site, and among those of a scene for every value of ``look_alike``.
        distances: distributions of the distances of pairs in scenes.
    """

    data: dict[str, object]
    results: dict[str, object]
    distances: dict[str, object]


def evaluate(
    session: Session, plan: Plan, *, cache: Path, workers: int = 1, log: Callable[[str], None] = print
) -> Evaluation:
    """Evaluate a network on the held-out people of a plan.

    Args:
        session: network, loaded from its file.
        plan: plan of its training.
        cache: folder of the rendered crops.
        workers: number of rendering processes.
        log: called with lines of progress.
    """
    sites = [render_crops(plan.held_out_job(site), cache, workers=workers) for site in range(plan.sites)]
    at_sites = scores.score_sites(session, sites)
    log(f"held-out people, network: {at_sites['network']}")
    log(f"held-out people, colour histograms: {at_sites['histogram_balanced']}")
    curve, pairs = {}, {}
    for value in LOOK_ALIKE:
        crops = render_crops(plan.curve_job(value), cache, workers=workers)
        curve[f"{value:g}"], pairs[f"{value:g}"] = scores.score_scenes(session, crops)
        log(f"look_alike {value:g}: {curve[f'{value:g}']}")
    sample = np.isin(sites[0].seed, [group.seed for group in plan.sample_job.groups])
    return Evaluation(
        data={"held_out": card.of_crops(Crops.joined(sites)), "held_out_sample": card.of_sample(sites[0][sample])},
        results={"held_out": at_sites, "look_alike": curve},
        distances={
            **card.bins(),
            "all": distributions(Pairs.joined(list(pairs.values()))),
            "look_alike": {value: distributions(each) for value, each in pairs.items()},
        },
    )


def evaluate_again(
    model: Path, *, cache: Path, workers: int = 1, command: str = "", log: Callable[[str], None] = print
) -> dict[str, object]:
    """Evaluate a trained network again, write the scores into its card and return the card.

    The model file is not changed, nor the parts of the card about the training: training crops, machine and time per
    crop. The affinity is part of the model file and is not changed either; it is fitted again and logged only.

    Args:
        model: ONNX file with its card beside it.
        cache: folder of the rendered crops.
        workers: number of rendering processes.
        command: command line of the evaluation, for the card.
        log: called with lines of progress.

    Raises:
        ValueError: the file or its card does not exist, or the card has no plan.
    """
    if not model.is_file():
        raise ValueError(f"no network file at {model}: correct the path")
    content: dict[str, Any] = card.read(model)
    plan = _plan(content, card.card_path(model))
    session = Session(model)
    validation = render_crops(plan.validation_job, cache, workers=workers)
    affinity = [round(value, _DIGITS) for value in scores.fit_affinity(session, validation)]
    in_card = [content["affinity"]["midpoint"], content["affinity"]["slope"]]
    log(f"midpoint and slope of the affinity: {affinity} fitted now, {in_card} in the card, which are kept")
    evaluation = evaluate(session, plan, cache=cache, workers=workers, log=log)
    entry = {"command": command, "affinity_midpoint_slope": affinity}
    new = _updated_card(content, entry, {"validation": card.of_crops(validation), **evaluation.data}, evaluation)
    card.write(model, new)
    log(f"updated {card.card_path(model)}")
    return new


def _updated_card(
    content: Mapping[str, Any], entry: Mapping[str, object], crops: Mapping[str, object], evaluation: Evaluation
) -> dict[str, object]:
    """Return a card with its evaluation replaced."""
    data = {**content["data"], **crops}
    data["plan"] = {**data["plan"], "recipe": asdict(Recipe())}  # recipe of the evaluation; training_recipe is kept
    blocks = {"judged": entry, "data": data, "results": {**content["results"], **evaluation.results}}
    new: dict[str, object] = {}
    for key, value in content.items():
        new[key] = blocks.get(key, value)
        if key == "command":
            new["judged"] = entry  # next to the command of the training
    return new | {"distances": evaluation.distances}


def _plan(content: Mapping[str, Any], path: Path) -> Plan:
    """Return the plan in a card."""
    try:
        plan = content["data"]["plan"]
        return Plan(**{field.name: plan[field.name] for field in fields(Plan)})
    except (KeyError, TypeError):
        raise ValueError(
            f"the card {path} has no training plan (data.plan): only networks made by python -m tools.reid can be "
            "evaluated again"
        ) from None
