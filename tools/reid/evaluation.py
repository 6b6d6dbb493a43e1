"""Judging a network on people who are held out: after its training, or again when the simulation has changed."""

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
from tools.reid.plan import DIALS, Plan
from tools.reid.rendering import rendered

_DIGITS = 4  # of the affinity


@dataclass(frozen=True)
class Judgement:
    """What a card says of a network on people who are held out, block by block.

    Attributes:
        data: how many crops, of whom.
        results: retrieval among all at a site, and among those of a scene at each value of the dial.
        distances: of pairs in scenes.
    """

    data: dict[str, object]
    results: dict[str, object]
    distances: dict[str, object]


def judged(
    session: Session, plan: Plan, *, cache: Path, workers: int = 1, say: Callable[[str], None] = print
) -> Judgement:
    """Judge a network.

    Args:
        session: the network, opened as anyone opens it.
        plan: whose people are held out.
        cache: folder of the rendered crops.
        workers: processes that render.
        say: called with a line of progress now and then.
    """
    strangers = [rendered(plan.held_out_order(site), cache, workers=workers) for site in range(plan.sites)]
    found = scores.held_out(session, strangers)
    say(f"held out: {found['network']}")
    say(f"by colours alone: {found['histogram_balanced']}")
    curve, met = {}, {}
    for dial in DIALS:
        alike = rendered(plan.curve_order(dial), cache, workers=workers)
        curve[f"{dial:g}"], met[f"{dial:g}"] = scores.in_scenes(session, alike)
        say(f"look_alike {dial:g}: {curve[f'{dial:g}']}")
    few = np.isin(strangers[0].seed, [group.seed for group in plan.sample_order.groups])
    return Judgement(
        data={
            "held_out": card.of_crops(Crops.joined(strangers)),
            "held_out_sample": card.of_sample(strangers[0][few]),
        },
        results={"held_out": found, "look_alike": curve},
        distances={
            **card.bins(),
            "all": distributions(Pairs.joined(list(met.values()))),
            "look_alike": {dial: distributions(pairs) for dial, pairs in met.items()},
        },
    )


def judge(
    model: Path, *, cache: Path, workers: int = 1, command: str = "", say: Callable[[str], None] = print
) -> dict[str, object]:
    """Judge a trained network again, write that into its card and return the card.

    The file stays as it is, and so does all that the card says of its training: of the training crops, of the machine
    and the time a crop took there. The affinity stays, too, for the file itself states it; it is only compared.

    Args:
        model: the ONNX file; its card lies beside it.
        cache: folder of the rendered crops.
        workers: processes that render.
        command: that judged, for the card.
        say: called with a line of progress now and then.

    Raises:
        ValueError: there is no such file or no card of it, or the card states no plan.
    """
    if not model.is_file():
        raise ValueError(f"no network at {model}: correct the path")
    content: dict[str, Any] = card.read(model)
    plan = _plan(content, card.card_path(model))
    session = Session(model)
    validation = rendered(plan.validation_order, cache, workers=workers)
    again = [round(value, _DIGITS) for value in scores.scale(session, validation)]
    stated = [content["affinity"]["midpoint"], content["affinity"]["slope"]]
    say(f"midpoint and slope of the affinity: {again} now, {stated} in the card, which stay")
    judgement = judged(session, plan, cache=cache, workers=workers, say=say)
    account = {"command": command, "affinity_midpoint_slope": again}
    new = _with_judgement(content, account, {"validation": card.of_crops(validation), **judgement.data}, judgement)
    card.write(model, new)
    say(f"{card.card_path(model)} is written anew")
    return new


def _with_judgement(
    content: Mapping[str, Any], account: Mapping[str, object], crops: Mapping[str, object], judgement: Judgement
) -> dict[str, object]:
    """The card with its judgement in place of the former one."""
    data = {**content["data"], **crops}
    data["plan"] = {**data["plan"], "recipe": asdict(Recipe())}  # of the crops judged by; the training's is beside it
    blocks = {"judged": account, "data": data, "results": {**content["results"], **judgement.results}}
    new: dict[str, object] = {}
    for key, value in content.items():
        new[key] = blocks.get(key, value)
        if key == "command":
            new["judged"] = account  # beside that of the training
    return new | {"distances": judgement.distances}


def _plan(content: Mapping[str, Any], path: Path) -> Plan:
    """The plan that a card states."""
    try:
        stated = content["data"]["plan"]
        return Plan(**{field.name: stated[field.name] for field in fields(Plan)})
    except (KeyError, TypeError):
        raise ValueError(
            f"{path} states no plan (data.plan) of a training: judged again are networks of python -m tools.reid"
        ) from None
