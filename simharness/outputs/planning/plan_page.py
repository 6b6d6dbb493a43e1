"""Page of a plan, and the preview of a room before any search, each as one self-contained HTML file."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose.files.atomic_files import write_atomic
from mvpose.report.documents import fill_template
from simharness.outputs import TEMPLATES
from simharness.outputs.planning.plan_plots import buying_curve, place_map, rig_bars, room_from_above, room_from_side
from simharness.planning.candidates import candidates_in, places_in
from simharness.planning.plan_result import RigPlan, sentences
from simharness.planning.planned_room import Room
from simharness.planning.rig_file import write_rig
from simharness.runtime.version import code_version

_SPACING, _LEVELS = 0.4, 0.5  # metres between the drawn places
_KEY = (
    "Green: where people will be. Grey: obstacles with their heights. Yellow: doors, where no camera hangs. "
    "Orange: cameras with their horizontal fields of view and heights; violet: those that hang already."
)
_KEY_OF_PLACES = (
    "Blue dots: where cameras may hang. Green: where people will be. Grey: obstacles with their heights. "
    "Yellow: doors, where no camera hangs."
)


def write_plan(plan: RigPlan, folder: Path, *, command: str = "") -> Path:
    """Write ``planned.toml``, ``plan.json`` and ``plan.html``; return the page.

    Args:
        plan: the plan.
        folder: folder of the files.
        command: command line of this program, for the page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_rig(plan.rig, plan.room, folder / "planned.toml", comments=sentences(plan)[:1])
    write_atomic(folder / "plan.json", (json.dumps(plan.to_json(), indent=1, allow_nan=False) + "\n").encode())
    page = folder / "plan.html"
    write_atomic(page, render_plan(plan, command=command).encode())
    return page


def write_preview(room: Room, folder: Path) -> Path:
    """Write ``preview.html``, the room with the places for cameras; return it.

    Raises:
        ValueError: no place to hang a camera.
    """
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "preview.html"
    write_atomic(page, render_preview(room).encode())
    return page


def render_preview(room: Room) -> str:
    """Return the page of a room before any search.

    Raises:
        ValueError: no place to hang a camera.
    """
    places = np.array([place for _, place in places_in(room, spacing=_SPACING, levels=_LEVELS)])
    found = len(candidates_in(room))
    lenses = ", ".join(f"{each.name} ({each.fov[0]:.0f}°)" for each in room.lenses if not each.turned)
    return fill_template(
        "plan.html",
        folder=TEMPLATES,
        program="simharness",
        name=room.name,
        code=code_version(),
        title=f"{room.name}: the room",
        sentences=[
            f"Places on {len(room.mounts)} walls, ceilings and areas for tripods give {found} cameras to choose from, "
            f"with the lenses {lenses}."
        ],
        facts=_facts(room),
        cards=[],
        key=_KEY_OF_PLACES,
        above=Markup(room_from_above(room, places=places, cameras=room.fixed)),
        sides=[
            Markup(room_from_side(f"side{axis}", room, axis=axis, places=places, cameras=room.fixed)) for axis in (0, 1)
        ],
        cameras=[],
        command="",
    )


def render_plan(plan: RigPlan, *, command: str = "") -> str:
    """Return the page of a plan."""
    room, target = plan.room, plan.room.keys.target
    scenes = f"on the same {plan.simulated_scenes} simulated scenes" if plan.best.simulated else "not simulated"
    shown = plan.prediction
    return fill_template(
        "plan.html",
        folder=TEMPLATES,
        program="simharness",
        name=room.name,
        code=code_version(),
        title=f"{room.name}: a plan of {len(plan.rig)} cameras",
        sentences=sentences(plan),
        facts=_facts(room),
        cards=_cards(plan),
        key=_KEY,
        above=Markup(room_from_above(room, cameras=list(plan.rig))),
        sides=[Markup(room_from_side(f"side{axis}", room, axis=axis, cameras=list(plan.rig))) for axis in (0, 1)],
        cameras=_camera_rows(plan),
        people="one" if room.keys.people.count == 1 else room.keys.people.count,
        maps=[
            (
                "PCP",
                f"Percent of correct parts; the target is {target.pcp:g}.",
                Markup(place_map("pcp", plan, shown.pcp, worst=60.0, best=100.0)),
            ),
            (
                "Joint error, mm",
                f"Mean error of joints; the target is {target.error:g} mm.",
                Markup(place_map("error", plan, shown.error_mm, worst=2.0 * target.error, best=0.4 * target.error)),
            ),
            (
                "Cameras that see a person whole",
                "Mean number of cameras with all limbs in the picture and none hidden by others.",
                Markup(place_map("views", plan, shown.views, worst=1.0, best=float(max(len(plan.rig), 4)), digits=1)),
            ),
            (
                "Probability of a wrong match, %",
                "Detections of one person taken for another's; of 8 people at each place, so only large values count.",
                Markup(place_map("risk", plan, 100.0 * shown.risk, worst=30.0, best=0.0)),
            ),
        ],
        curve=Markup(buying_curve("curve", plan)) if plan.curve else None,
        bars=Markup(rig_bars("bars", plan)),
        scenes=scenes,
        points=_points(plan),
        command=command,
    )


def _facts(room: Room) -> list[tuple[str, str]]:
    x, y = room.space.size.tolist()
    u, v = room.volume.size.tolist()
    target, objective = room.keys.target, room.keys.objective
    facts = [
        ("room", f"{x:.1f} by {y:.1f} m, {room.space.height:.1f} m high"),
        ("volume", f"{u:.1f} by {v:.1f} m"),
        ("people", f"{room.keys.people.count}"),
        ("detector", room.detector.name),
        ("target", f"{target.pcp:g} PCP, {target.error:g} mm"),
        ("objective", objective.kind),
    ]
    return facts + ([("may fail", f"{objective.failing}")] if objective.failing else [])


def _cards(plan: RigPlan) -> list[dict[str, str]]:
    figures, predicted = plan.figures, plan.best.predicted
    how = f"simulation, {plan.simulated_scenes} scenes" if plan.best.simulated else "fast layer"
    usual = [each for each in plan.alternatives if each.title in ("corners", "ring")]
    cards = [
        {
            "title": "PCP",
            "text": f"{figures.pcp.mean:.1f} %",
            "about": f"{figures.pcp.low:.1f} to {figures.pcp.high:.1f}; {how}",
        },
        {
            "title": "Joint error",
            "text": f"{figures.error_mm.mean:.0f} mm",
            "about": f"{figures.error_mm.low:.0f} to {figures.error_mm.high:.0f}; {how}",
        },
        {
            "title": "Within the target",
            "text": f"{predicted.share:.0f} %",
            "about": f"of the volume; worst place {predicted.worst:.0f} PCP; fast layer",
        },
    ]
    if usual:
        best = max(usual, key=lambda each: (each.simulated or each.predicted).pcp.mean)
        gain = figures.pcp.mean - (best.simulated or best.predicted).pcp.mean
        cards.append(
            {"title": "Gain", "text": f"{gain:+.1f} PCP", "about": f"over cameras without a plan ({best.title})"}
        )
    return cards


def _camera_rows(plan: RigPlan) -> list[list[str]]:
    rows = []
    for camera, built in zip(plan.cameras, plan.rig, strict=True):
        forward = built.R[2]
        bearing = math.degrees(math.atan2(forward[1], forward[0])) % 360.0
        rows.append(
            [
                camera.name,
                camera.mount,
                *(f"{value:.2f}" for value in built.center),
                f"{bearing:.0f}°",
                f"{-math.degrees(math.asin(forward[2])):.0f}°",
                camera.lens or "–",
                f"{100 * camera.sure:.0f} %" if math.isfinite(camera.sure) else "–",
                f"{camera.worth:.1f}",
            ]
        )
    return rows


def _points(plan: RigPlan) -> list[dict[str, Any]]:
    return [
        {
            "now": point.cameras == len(plan.rig),
            "cells": [
                f"{point.cameras}",
                f"{point.figures.pcp.mean:.1f}",
                f"{point.figures.error_mm.mean:.0f}",
                f"{point.figures.share:.0f} %",
                f"{point.figures.worst:.0f}",
                f"{point.cost:g}",
            ],
        }
        for point in plan.curve
    ]
