"""Report of a validation as one self-contained HTML file."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose.report.documents import fill_template
from simharness.outputs import TEMPLATES
from simharness.outputs.validation import plots, tables
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.skill import ALL
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.validation import Validation
from simharness.reality.validation.verdicts import BOUNDS, VerdictState
from simharness.runtime.number_text import fixed
from simharness.scoring.frame_scores import RULES
from simharness.trial.identity import provenance_sentence

_APART = 6  # groups of figures that are named as those in which twins differ most
_HEADS = {"voxelpose": "VoxelPose", "2019": "2019"}
_RATIOS = (
    *("bones.shank", "bones.thigh", "bones.forearm", "bones.upper arm", "behind", "affinity.different"),
    *("detected", "missing.ears", "missing.elbows", "missing.wrists", "missing.knees", "missing.ankles"),
    *("phantoms", "others", "score.q10", "score.q50"),
)


def render_validation(validation: Validation, *, provenance: Mapping[str, Any], fitted_on: str = "") -> str:
    """Return the page of a validation.

    Args:
        validation: the validation.
        provenance: keys of :func:`simharness.trial.identity.provenance`.
        fitted_on: name of the recording to which the twins were fitted; empty: the same.

    Returns:
        A self-contained HTML document.
    """
    recording = validation.recording
    pcp = [figures["pcp"][rule] for figures in validation.whole.variants.values() for rule in tables.PUBLISHED]
    return fill_template(
        "validation.html",
        folder=TEMPLATES,
        program="simharness",
        name=recording.name,
        recording=recording,
        validation=validation,
        code=provenance["code"],
        fitted_on=fitted_on,
        tables=tables,
        fixed=fixed,
        isfinite=np.isfinite,
        all_variants=ALL,
        treatments=KINDS,
        worst=max(abs(each.difference) for each in pcp),
        counts={state.value: sum(each.state == state for each in validation.verdicts) for state in VerdictState},
        apart=list(validation.distance.groups.items())[:_APART],
        rivals=list(dict.fromkeys(rival for each in validation.skills for rival in each.rivals)),
        groups=tables.group_rows(validation.verdicts),
        verdicts=list(tables.verdict_rows(validation.verdicts)),
        heads=[_HEADS.get(rule.mapping, rule.mapping) for rule in tables.PUBLISHED],
        rules=(*tables.PUBLISHED, RULES[2]),
        colors=plots.colors(validation.plan.variants),
        plots={key: Markup(svg) for key, svg in _plots(validation).items()},
        curves=[(name, Markup(svg)) for name, svg in _subset_plots(validation)],
        responses=[(title, Markup(svg)) for title, svg in _response_plots(validation)],
        bounds=BOUNDS,
        command=provenance.get("command") or "",
        provenance=provenance_sentence(provenance),
    )


def _points(validation: Validation) -> dict[str, dict[str, list[tuple[float, float]]]]:
    """Return (real, twin) PCP of every scored setting, by kind of setting and variant."""
    names = validation.plan.variants
    result: dict[str, dict[str, list[tuple[float, float]]]] = {
        "all cameras": {
            name: [(pcp[rule].real.mean, pcp[rule].twin.mean) for rule in tables.PUBLISHED]
            for name, pcp in ((name, validation.whole.variants[name]["pcp"]) for name in names)
        }
    }
    most = max(validation.subsets.curves)
    for count in validation.subsets.curves:
        if count < most:
            result[f"{count} cameras"] = {
                name: [
                    (each.real.mean, each.twin.mean)
                    for views, each in validation.subsets.single[name].items()
                    if len(views) == count
                ]
                for name in names
            }
    if validation.responses:
        result["treated"] = {
            name: [(each.pcp.real.mean, each.pcp.twin.mean) for each in validation.responses if each.variant == name]
            for name in names
        }
    return result


def _plots(validation: Validation) -> dict[str, str]:
    shades = plots.colors(validation.plan.variants)
    drawn = {
        "agreement": plots.agreement(_points(validation), shades),
        "parts": plots.part_differences(validation.whole.parts, shades),
        "ratios": plots.ratios(_ratios(validation)),
    }
    if validation.responses:
        drawn["losses"] = plots.losses(validation.responses, shades)
    return drawn


def _ratios(validation: Validation) -> dict[str, tuple[Compared, tuple[float, float] | None]]:
    """Return the measurements whose ratio says something, with the accepted range."""
    shown: dict[str, tuple[Compared, tuple[float, float] | None]] = {}
    for key in _RATIOS:
        figure = validation.whole.measured[key]
        if not (np.isfinite(figure.real.mean) and figure.real.mean > 0 and np.isfinite(figure.twin.mean)):
            continue
        accepted = None
        if key.startswith("bones."):
            accepted = BOUNDS.bones
        elif key == "affinity.different":
            accepted = (1 - BOUNDS.ambiguous, 1 + BOUNDS.ambiguous)
        elif key == "behind":
            share = BOUNDS.behind / figure.real.mean
            accepted = (max(0.0, 1 - share), 1 + share)
        shown[tables.measurement_title(key).removesuffix(", %").removesuffix(", mm")] = figure, accepted
    return shown


def _subset_plots(validation: Validation) -> list[tuple[str, str]]:
    subsets, shades = validation.subsets, plots.colors(validation.plan.variants)
    ends = [
        end
        for curve in subsets.curves.values()
        for each in curve.values()
        for end in (each.real.mean, each.twin.mean, each.real.low, each.twin.low)
    ]
    low = 5 * np.floor(np.nanmin(ends) / 5)
    return [
        (name, plots.subset_curve(subsets, name, shades[name], name=f"subsets-{name}", low=low))
        for name in validation.plan.variants
    ]


def _response_plots(validation: Validation) -> list[tuple[str, str]]:
    shades = plots.colors(validation.plan.variants)
    by_kind = {
        kind: [each for each in validation.responses if each.kind == kind]
        for kind in dict.fromkeys(each.kind for each in validation.responses)
    }
    return [(KINDS[kind].title, plots.response(of, shades, name=f"dose-{kind}")) for kind, of in by_kind.items()]
