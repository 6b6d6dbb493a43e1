"""Card of a trained network: training data, settings and scores, in a JSON file and in the metadata of the model."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from mvpose.networks.card import Card
from tools.reid import site_sensors
from tools.reid.crops import SIZE, Crops, Recipe
from tools.reid.metrics import HIDDEN_EDGES, QUANTILES, VIEW_EDGES
from tools.reid.plan import Plan

NAME = "simharness re-ID"
PREFIX = "simharness."
"""Prefix of the keys of ``metadata_props`` that :class:`mvpose.networks.card.Card` does not read."""


def card_path(model: Path) -> Path:
    """Return the path of the card of a model file, beside it."""
    return model.with_suffix(".json")


def write_metadata(model: Path, *, midpoint: float, slope: float, plan: Plan, command: str) -> None:
    """Write the input format, the affinity, the plan and the command into the metadata of a model file."""
    import onnx

    network = onnx.load(model)
    card = Card(name=NAME, size=SIZE[::-1], midpoint=round(midpoint, 4), slope=round(slope, 4))
    # Default values are written too, so that other programs that read the file need not know them.
    entries = card.to_metadata() | {
        "mvpose.mean": json.dumps(card.mean),
        "mvpose.std": json.dumps(card.std),
        f"{PREFIX}plan": json.dumps(asdict(plan)),
        f"{PREFIX}command": command,
    }
    onnx.helper.set_model_props(network, entries)
    onnx.save(network, model)


def write(model: Path, content: Mapping[str, object]) -> None:
    """Write the card of a model as JSON."""
    text = json.dumps(content, indent=1)
    text = re.sub(r"\[[^][{}]*\]", lambda row: " ".join(row[0].split()), text)  # lists of numbers on one line
    card_path(model).write_text(text + "\n", encoding="utf-8")


def read(model: Path) -> dict[str, object]:
    """Read the card of a model.

    Raises:
        ValueError: the card does not exist, or belongs to another model file.
    """
    path = card_path(model)
    if not path.is_file():
        raise ValueError(f"no card at {path}: copy it from the source of {model.name}, or train again")
    content: dict[str, object] = json.loads(path.read_text(encoding="utf-8"))
    if content.get("sha256") != digest(model):
        raise ValueError(f"{path} is the card of another file, not of {model.name}: use both from the same training")
    return content


def digest(model: Path) -> str:
    """Return the SHA-256 of a model file."""
    return hashlib.sha256(model.read_bytes()).hexdigest()


def of_plan(plan: Plan) -> dict[str, object]:
    """Return the entries of a plan and of the parameters of its crops."""
    return {
        **asdict(plan),
        "training_recipe": asdict(plan.training_job.recipe),
        "recipe": asdict(Recipe()),
        "sensor": site_sensors.SENSOR_SPREAD.model_dump(exclude_defaults=True),
        "sensor_profiles": site_sensors.PROFILES,
    }


def of_crops(crops: Crops) -> dict[str, object]:
    """Return numbers and ranges that describe crops: identities, crops, seeds, hidden joints, box height."""
    return {
        "identities": len({*zip(crops.seed.tolist(), crops.person.tolist(), strict=True)}),
        "crops": len(crops),
        "group_seeds": [int(crops.seed.min()), int(crops.seed.max())],
        "hidden_mean": round(float(crops.hidden.mean()), 4),
        "box_height_median_px": round(float(sorted(crops.height.tolist())[len(crops) // 2]), 1),
    }


def of_sample(crops: Crops) -> dict[str, object]:
    """Describe a sample of crops, with their mean colour, so that a later rendering can be compared."""
    return {**of_crops(crops), "mean_color": [round(float(level), 2) for level in crops.images.mean(axis=(0, 1, 2))]}


def bins() -> dict[str, object]:
    """Return the edges of the bins of the distance distributions."""
    return {
        "pairs": "crops of one moment in two views",
        "view_difference_degrees": VIEW_EDGES,
        "hidden_share_of_the_joints_of_the_worse_crop": HIDDEN_EDGES,
        "quantiles": QUANTILES,
    }


def machine(threads: int) -> dict[str, object]:
    """Return the machine and the software versions of a training."""
    import torch

    cuda = torch.cuda.get_device_name(0) if torch.cuda.is_available() else None
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": threads,
        "cuda": cuda,
        "python": platform.python_version(),
        "torch": torch.__version__,
    }


def _processor() -> str:
    """Return the name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
