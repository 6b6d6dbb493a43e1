"""Page of a rehearsal as one self-contained HTML file, to print and to take to the room."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.documents import fill_template
from mvpose.report.tables import NOTHING
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
from simharness.planning.rehearsal_result import HEIGHTS, Estimated, ExtraCamera, Rehearsal
from simharness.runtime.number_text import fixed, signed
from simharness.statistics.intervals import Interval
from simharness.trial.identity import provenance_sentence

_LAYER, _SIMULATION, _GEOMETRY = "fast layer", "simulation", "geometry"
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
    bottom = tolerance_bottom(rehearsal)
    return fill_template(
        "rehearsal.html",
        folder=TEMPLATES,
        program="simharness",
        name=rehearsal.name,
        code=provenance["code"],
        sentences=rehearsal.sentences,
        enough=rehearsal.good_share > 0,
        facts=_facts(rehearsal),
        cards=_cards(rehearsal),
        view=rig_view_3d(rehearsal),
        maps=_maps(rehearsal),
        heights=_heights(rehearsal),
        cameras=_camera_rows(rehearsal),
        extra=_extra(rehearsal.extra),
        crowd=Markup(crowd_curve(rehearsal, name="crowd")),
        matching=Markup(matching_curve(rehearsal, name="matching")),
        tolerances=[
            {
                "title": each.fault.title,
                "limit": each.limit,
                "svg": Markup(
                    tolerance_curve(each, rehearsal.whole.pcp, name=f"tolerance-{each.fault.key}", bottom=bottom)
                ),
            }
            for each in rehearsal.tolerances
        ],
        subsets=_subset_rows(rehearsal),
        subset_curve=Markup(subset_curve(rehearsal, name="sets")) if _all_sets(rehearsal) else None,
        scenes=len(rehearsal.scenes),
        target=rehearsal.setup.target,
        command=provenance.get("command") or "",
        provenance=provenance_sentence(provenance),
    )


def _facts(rehearsal: Rehearsal) -> list[tuple[str, str]]:
    setup = rehearsal.setup
    x, y = setup.volume.size
    return [
        ("cameras", str(len(rehearsal.rig))),
        ("people", str(setup.people)),
        ("volume", f"{x:.1f} by {y:.1f} m, {setup.volume.height:.1f} m high"),
        ("detector", setup.detector.name),
        ("target", f"PCP {setup.target.pcp:g}, {setup.target.error:g} mm"),
        ("scenes", str(len(rehearsal.scenes))),
    ]


def _cards(rehearsal: Rehearsal) -> list[dict[str, str]]:
    whole, target = rehearsal.whole, rehearsal.setup.target
    return [
        {
            "title": "PCP",
            "text": f"{fixed(whole.pcp.mean, 1)} %",
            "about": f"{_span(whole.pcp, 1)}; fast layer {fixed(whole.layer_pcp, 1)}",
            "source": _SIMULATION,
        },
        {
            "title": "Joint error",
            "text": f"{fixed(whole.mpjpe_mm.mean, 0)} mm",
            "about": f"{_span(whole.mpjpe_mm, 0)} mm; fast layer {fixed(whole.layer_error_mm, 0)}",
            "source": _SIMULATION,
        },
        {
            "title": "People found",
            "text": f"{fixed(whole.recall.mean, 1)} %",
            "about": f"{_span(whole.recall, 1)}",
            "source": _SIMULATION,
        },
        {
            "title": "Good floor",
            "text": f"{100 * rehearsal.good_share:.0f} %",
            "about": f"of the volume has PCP {target.pcp:g} and {target.error:g} mm",
            "source": _LAYER,
        },
    ]


def _maps(rehearsal: Rehearsal) -> list[dict[str, Any]]:
    """Return the maps with title, source and caption."""
    prediction, scenes = rehearsal.prediction, rehearsal.scenes
    pcp, error = MapColors(_LEAST_PCP, 100.0), MapColors(_BEST_MM, _WORST_MM, better="low")
    parts = simulated_map(rehearsal, [100.0 * np.where(each.inside, each.parts, np.nan) for each in scenes])
    off = simulated_map(rehearsal, [1000.0 * np.where(each.inside, each.errors, np.nan) for each in scenes])
    ellipses, factor = ellipse_map(rehearsal, name="map-ellipses")
    views = MapColors(0.0, float(len(rehearsal.rig)), digits=1)
    rows: list[tuple[str, str, str, str]] = [
        (
            "Cameras that see a person whole",
            _LAYER,
            "Mean number of cameras that see all joints of a person who stands there, while the others hide some.",
            floor_map(rehearsal, prediction.views, views, name="map-views"),
        ),
        ("PCP, %", _LAYER, "Body parts placed correctly.", floor_map(rehearsal, prediction.pcp, pcp, name="map-pcp")),
        (
            "PCP, %",
            _SIMULATION,
            "The same from simulated people who came by; no number where too few did.",
            floor_map(rehearsal, parts, pcp, name="map-pcp-simulated"),
        ),
        (
            "Joint error, mm",
            _LAYER,
            "Expected mean error of the joints of people who are found.",
            floor_map(rehearsal, prediction.error_mm, error, name="map-error"),
        ),
        (
            "Joint error, mm",
            _SIMULATION,
            "The same from simulated people.",
            floor_map(rehearsal, off, error, name="map-error-simulated"),
        ),
        (
            "Recall, %",
            _LAYER,
            "Probability that a person is found.",
            floor_map(rehearsal, 100.0 * prediction.recall, MapColors(50.0, 100.0), name="map-recall"),
        ),
        (
            "Error ellipses",
            _LAYER,
            f"One standard deviation of a joint of the trunk on the floor, {factor} times as large as it is. Long "
            "ellipses point along the depth that no camera sees from the side.",
            ellipses,
        ),
        (
            "Matching risk, %",
            _LAYER,
            "Probability that not all detections of a person are matched rightly.",
            floor_map(
                rehearsal, 100.0 * prediction.risk, MapColors(0.0, 50.0, better="none"), name="map-risk", outlined=False
            ),
        ),
    ]
    return [
        {"title": title, "source": source, "caption": caption, "svg": Markup(svg)}
        for title, source, caption, svg in rows
    ]


def _heights(rehearsal: Rehearsal) -> list[tuple[str, Markup]]:
    """Return the maps of coverage by height."""
    scale = MapColors(0.0, float(len(rehearsal.rig)))
    return [
        (
            f"{height:g} m",
            Markup(
                floor_map(rehearsal, row.astype(float), scale, name=f"map-height-{k}", outlined=False, size=_QUARTER)
            ),
        )
        for k, (height, row) in enumerate(zip(HEIGHTS, rehearsal.coverage, strict=True))
    ]


def _camera_rows(rehearsal: Rehearsal) -> list[dict[str, Any]]:
    """Return a row for each camera, the most valuable first."""
    rows = sorted(rehearsal.cameras.values(), key=lambda each: -each.worth.mean)
    return [
        {
            "name": each.camera.name,
            "place": _place(each.camera),
            "looks": _direction(each.camera),
            "sees": f"{100 * each.sees:.0f} %",
            "worth": _cell(each.worth, 1),
            "worth_mm": _cell(each.worth_mm, 0),
            "layer": signed(each.layer_worth, 1) if np.isfinite(each.layer_worth) else NOTHING,
            "verdict": "redundant" if each.redundant else "needed" if each.needed else "",
        }
        for each in rows
    ]


def _extra(extra: ExtraCamera | None) -> dict[str, Any] | None:
    if extra is None:
        return None
    return {
        "place": _place(extra.camera),
        "looks": _direction(extra.camera),
        "places": extra.places,
        "gain": _cell(extra.gain, 1),
        "gain_mm": _cell(extra.gain_mm, 0),
        "layer": signed(extra.layer_gain, 1),
        "pcp": _cell(extra.rig.pcp, 1),
    }


def _all_sets(rehearsal: Rehearsal) -> bool:
    return len({len(names) for names in rehearsal.subsets}) > 2


def _subset_rows(rehearsal: Rehearsal) -> list[dict[str, Any]]:
    """Return a row for each set of cameras that was scored: by number of cameras, the best first."""
    rows = sorted(rehearsal.subsets.items(), key=lambda item: (-len(item[0]), -_or_zero(item[1])))
    return [
        {
            "cameras": ", ".join(names),
            "count": len(names),
            "pcp": _cell(each.pcp, 1),
            "mpjpe_mm": _cell(each.mpjpe_mm, 0),
            "recall": _cell(each.recall, 1),
            "layer": f"{fixed(each.layer_pcp, 1)}",
        }
        for names, each in rows[:_MOST_SETS]
    ]


def _or_zero(each: Estimated) -> float:
    return each.pcp.mean if np.isfinite(each.pcp.mean) else 0.0


def _place(camera: Camera) -> str:
    x, y, z = camera.center
    return f"{x:.2f}, {y:.2f}, {z:.2f}"


def _direction(camera: Camera) -> str:
    """Return where a camera looks: the bearing from the x axis, and how far down."""
    x, y, z = _unit(camera.R[2])
    down = float(np.degrees(np.arcsin(np.clip(-z, -1.0, 1.0))))
    tilt = f"{abs(down):.0f}° {'down' if down >= 0 else 'up'}"
    return tilt if np.hypot(x, y) < 1e-3 else f"{np.degrees(np.arctan2(y, x)) % 360:.0f}°, {tilt}"


def _unit(direction: Floats) -> Floats:
    return direction / np.linalg.norm(direction)


def _cell(value: Interval, digits: int) -> tuple[str, str]:
    """Return a number and its interval in small print."""
    if not np.isfinite(value.mean):
        return NOTHING, ""
    return fixed(value.mean, digits), _span(value, digits)


def _span(value: Interval, digits: int) -> str:
    if not np.isfinite(value.low):
        return ""
    return f"{fixed(value.low, digits)} to {fixed(value.high, digits)}"
