"""Page of a plan, and the preview of a room before any search, each as one self-contained HTML file."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from mvpose.report.documents import fill_template
from simharness.outputs import TEMPLATES
from simharness.outputs.planning.plan_plots import buying_curve, place_map, rig_bars, room_from_above, room_from_side
from simharness.planning.candidates import candidates_in, places_in
from simharness.planning.plan_result import RigPlan, sentences
from simharness.planning.planned_room import Room
from simharness.planning.rig_file import write_rig
from simharness.runtime.number_text import fixed, signed
from simharness.runtime.version import code_version

_SPACING, _LEVELS = 0.4, 0.5  # metres between the drawn places


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
    lenses = ", ".join(f"{each.name} ({each.fov[0]:.0f}°)" for each in room.lenses if not each.turned)
    says = (
        f"Places on {len(room.mounts)} walls, ceilings and areas for tripods give {len(candidates_in(room))} cameras "
        f"to choose from, with the lenses {lenses}."
    )
    return _filled(room, room.fixed, plan=None, sentences=[says], places=places)


def render_plan(plan: RigPlan, *, command: str = "") -> str:
    """Return the page of a plan."""
    target, shown = plan.room.keys.target, plan.prediction

    def drawn(name: str, values: Floats, worst: float, best: float, **style: Any) -> Markup:
        return Markup(place_map(name, plan, values, worst=worst, best=best, **style))

    usual = [each for each in plan.alternatives if each.title in ("corners", "ring")]
    return _filled(
        plan.room,
        list(plan.rig),
        plan=plan,
        sentences=sentences(plan),
        fixed=fixed,
        signed=signed,
        usual=max(usual, key=lambda each: (each.simulated or each.predicted).pcp.mean, default=None),
        looks=_direction,
        maps={
            "pcp": drawn("pcp", shown.pcp, 60.0, 100.0),
            "error": drawn("error", shown.error_mm, 2.0 * target.error, 0.4 * target.error),
            "views": drawn("views", shown.views, 1.0, float(max(len(plan.rig), 4)), digits=1),
            "risk": drawn("risk", 100.0 * shown.risk, 30.0, 0.0),
        },
        curve=Markup(buying_curve(plan)) if plan.curve else None,
        bars=Markup(rig_bars(plan)),
        command=command,
    )


def _filled(room: Room, cameras: Sequence[Camera], *, places: Floats | None = None, **values: Any) -> str:
    """Return the page with the room from above and from both sides."""
    sides = [room_from_side(f"side{axis}", room, axis=axis, places=places, cameras=cameras) for axis in (0, 1)]
    return fill_template(
        "plan.html",
        folder=TEMPLATES,
        program="simharness",
        name=room.name,
        code=code_version(),
        room=room,
        key=_key(room, hung=len(cameras) - len(room.fixed), places=places is not None),
        above=Markup(room_from_above(room, places=places, cameras=cameras)),
        sides=[Markup(each) for each in sides],
        **{"command": "", **values},
    )


def _key(room: Room, *, hung: int, places: bool) -> str:
    """Return what the colours of the drawings of a room mean, without those of things that it does not have."""
    known = [
        (places, "Blue dots: where cameras may hang."),
        (True, "Green: where people will be."),
        (room.obstacles, "Grey: obstacles with their heights."),
        (len(room.doors), "Yellow: doors, where no camera hangs."),
        (hung, "Orange: cameras with their horizontal fields of view and heights."),
        (room.fixed, "Violet: cameras that hang already."),
    ]
    return " ".join(text for there, text in known if there)


def _direction(camera: Camera) -> tuple[float, float]:
    """Return the bearing of a camera from the x axis, and its tilt below the horizon, degrees."""
    x, y, z = camera.R[2].tolist()
    return math.degrees(math.atan2(y, x)) % 360.0, -math.degrees(math.asin(z))
