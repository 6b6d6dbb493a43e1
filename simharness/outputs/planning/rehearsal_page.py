"""Page of a rehearsal as one self-contained HTML file, to print and to take to the room."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.documents import fill_template
from simharness.outputs import TEMPLATES
from simharness.outputs.planning.rehearsal_plots import (
    MapColors,
    crowd_curve,
    ellipse_map,
    floor_map,
    matching_curve,
    rig_view_3d,
    simulated_map,
    subset_curve,
    tolerance_bottom,
    tolerance_curve,
)
from simharness.planning.rehearsal_result import HEIGHTS, Rehearsal
from simharness.runtime.number_text import fixed, signed
from simharness.statistics.intervals import Interval
from simharness.trial.identity import provenance_sentence

_WORST_MM, _BEST_MM = 100.0, 15.0  # ends of the colours of joint errors
_LEAST_PCP = 60.0
_QUARTER = (2.7, 2.65)  # inches of 72 px
_MOST_SETS = 60  # rows of the table of sets of cameras


def render_rehearsal(rehearsal: Rehearsal, *, provenance: Mapping[str, Any]) -> str:
    """Return the page of a rehearsal.

    Args:
        rehearsal: the rehearsal.
        provenance: keys of :func:`simharness.trial.identity.provenance`.

    Returns:
        A self-contained HTML document.
    """
    bottom, pcp = tolerance_bottom(rehearsal), rehearsal.whole.pcp
    every = len({len(names) for names in rehearsal.subsets}) > 2
    sets = sorted(rehearsal.subsets.items(), key=lambda item: (-len(item[0]), -np.nan_to_num(item[1].pcp.mean)))
    return fill_template(
        "rehearsal.html",
        folder=TEMPLATES,
        program="simharness",
        name=rehearsal.name,
        rehearsal=rehearsal,
        setup=rehearsal.setup,
        code=provenance["code"],
        view=rig_view_3d(rehearsal),
        maps=_maps(rehearsal),
        cameras=sorted(rehearsal.cameras.values(), key=lambda each: -each.worth.mean),
        crowd=Markup(crowd_curve(rehearsal)),
        matching=Markup(matching_curve(rehearsal)),
        tolerances=[
            (each, Markup(tolerance_curve(each, pcp, name=f"tolerance-{each.fault.key}", bottom=bottom)))
            for each in rehearsal.tolerances
        ],
        subsets=sets[:_MOST_SETS],  # by number of cameras, the best first
        subset_curve=Markup(subset_curve(rehearsal)) if every else None,
        fixed=fixed,
        signed=signed,
        cell=Interval.texts,
        looks=_direction,
        command=provenance.get("command") or "",
        provenance=provenance_sentence(provenance),
    )


def _maps(rehearsal: Rehearsal) -> dict[str, Any]:
    """Return the maps by name, and how much larger the ellipses are drawn than they are."""
    prediction, scenes = rehearsal.prediction, rehearsal.scenes
    pcp, error = MapColors(_LEAST_PCP, 100.0), MapColors(_BEST_MM, _WORST_MM, better="low")
    counted = MapColors(0.0, float(len(rehearsal.rig)))
    parts = simulated_map(rehearsal, [100.0 * np.where(each.inside, each.parts, np.nan) for each in scenes])
    off = simulated_map(rehearsal, [1000.0 * np.where(each.inside, each.errors, np.nan) for each in scenes])
    ellipses, factor = ellipse_map(rehearsal)

    def drawn(name: str, values: Floats, colors: MapColors, **style: Any) -> Markup:
        return Markup(floor_map(rehearsal, values, colors, name=f"map-{name}", **style))

    return {
        "views": drawn("views", prediction.views, replace(counted, digits=1)),
        "pcp": drawn("pcp", prediction.pcp, pcp),
        "pcp_simulated": drawn("pcp-simulated", parts, pcp),
        "error": drawn("error", prediction.error_mm, error),
        "error_simulated": drawn("error-simulated", off, error),
        "recall": drawn("recall", 100.0 * prediction.recall, MapColors(50.0, 100.0)),
        "ellipses": Markup(ellipses),
        "ellipse_factor": factor,
        "risk": drawn("risk", 100.0 * prediction.risk, MapColors(0.0, 50.0, better="none"), outlined=False),
        "heights": [
            (height, drawn(f"height-{k}", row.astype(float), counted, outlined=False, size=_QUARTER))
            for k, (height, row) in enumerate(zip(HEIGHTS, rehearsal.coverage, strict=True))
        ],
    }


def _direction(camera: Camera) -> str:
    """Return where a camera looks: the bearing from the x axis, and how far down."""
    x, y, z = camera.R[2] / np.linalg.norm(camera.R[2])
    down = float(np.degrees(np.arcsin(np.clip(-z, -1.0, 1.0))))
    tilt = f"{abs(down):.0f}° {'down' if down >= 0 else 'up'}"
    return tilt if np.hypot(x, y) < 1e-3 else f"{np.degrees(np.arctan2(y, x)) % 360:.0f}°, {tilt}"
