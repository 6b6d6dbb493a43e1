"""Markdown text of a digest; the numbers are from :mod:`simharness.outputs.study.digest`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mvpose.commands.progress import duration
from mvpose.report.tables import markdown_table
from simharness.outputs.study.factor_names import NAMES, axis_label
from simharness.outputs.study.plots import mean_over, short
from simharness.outputs.study.tables import OVER_TIME
from simharness.runtime.number_text import fixed
from simharness.scoring.catalogue import AP_MM, SCORES, ScoreInfo
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.stage_blame import Stage
from simharness.trial.identity import provenance_sentence

HEADS = ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts")
"""Scores of the first table of a digest."""
PRINTED = (*(f"ap{limit}" for limit in AP_MM), "map", "recall", "mpjpe_mm", "pcp", "ghosts")
"""Scores of one variant at every value of a factor, in the order in which papers print them for Panoptic."""
HEADS_OVER_TIME = ("hota", "assa", "idf1", "pcp_tracked", "switches_per_minute", "fragmentations", "jerk_ratio")
"""Scores of the second table, of studies with a variant that tracks people."""
COMPARED = ("pcp", "map", "ghosts")
"""Scores of all variants at every value of a factor."""

_ALONE = "matching alone"
_STAGE_MEANINGS = {
    "detection": "perfect detections of the same pictures repair it; joints that are hidden from the real detector "
    "count here, too",
    "matching": "perfect detections do not repair it, but together with the true matching they do",
    "reconstruction": "neither repairs it: the cause is the reconstruction, or its other inputs (a wrong calibration, "
    "late pictures, too few views)",
    "method": "perfect detections do not repair it, and the user-defined estimator accepts no matching",
}


def markdown(digest: Mapping[str, Any]) -> str:
    """Return the text of a digest.

    Args:
        digest: from :func:`simharness.outputs.study.digest.digest`.
    """
    return "\n".join(_lines(digest)) + "\n"


def _lines(digest: Mapping[str, Any]) -> Iterator[str]:
    seeds, took = digest["seeds"], duration(digest["seconds"])
    yield f"# {digest['name']}"
    yield (
        f"\n{digest['description']}. {digest['trials']} trials, seeds {min(seeds)} to {max(seeds)}, {took} on one core."
    )
    yield f"\n    {digest['command']}"
    yield f"\n{provenance_sentence(digest)}"
    yield from _means(digest)
    if digest["factors"]:
        parts = digest["by_case"] or {"": digest}
        for factor in digest["factors"]:
            yield from _factor(factor["key"], parts, list(digest["means"]))
        yield from _breaking(digest, parts)
    yield from _failures(digest)


def _means(digest: Mapping[str, Any]) -> Iterator[str]:
    names = list(digest["means"])
    yield "\n## Variants"
    yield "\nMeans over seeds with 95 % intervals; the value of a seed is the mean over its settings.\n"
    for case, means in {"": digest["means"], **digest["cases"]}.items():
        if case:
            yield f"\nCase {case}:\n"
        rows = [[name, *(_interval(means[name][key], SCORES[key]) for key in HEADS)] for name in names]
        yield from markdown_table(["variant", *(_head(key) for key in HEADS)], rows)
        tracked = "hota" in means[names[0]]
        if tracked:
            yield ""
            rows = [[name, *(_interval(means[name][key], SCORES[key]) for key in HEADS_OVER_TIME)] for name in names]
            yield from markdown_table(["variant", *(_head(key) for key in HEADS_OVER_TIME)], rows)
        if not case:
            described = (*HEADS, *HEADS_OVER_TIME) if tracked else HEADS
            yield "\n" + _listed({SCORES[key].title: SCORES[key].about for key in described})


def _factor(key: str, parts: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> Iterator[str]:
    """Return the tables of one factor, for each case separately."""
    by_case = {case: factor for case, part in parts.items() for factor in part["factors"] if factor["key"] == key}
    yield f"\n## Against `{key}`" + (f": {axis_label(key)}" if key in NAMES else "")
    for case, factor in by_case.items():
        where = f"`{key}`{f', case {case}' if case else ''}"
        notes = [f"together with {', '.join(f'`{other}`' for other in factor['along'])}"] if factor["along"] else []
        notes += [mean_over(factor["over"])] if factor["over"] else []
        note = f" ({'; '.join(notes)})" if notes else ""
        values = [short(value) for value in factor["values"]]
        known = factor["scores"][names[0]]
        for score in (*COMPARED, *(key for key in OVER_TIME if key in known)):
            yield f"\n{_head(score)}, against {where}{note}:\n"
            rows = [
                [value, *(_interval(factor["scores"][name][score][row], SCORES[score]) for name in names)]
                for row, value in enumerate(values)
            ]
            yield from markdown_table([key, *names], rows)
        yield f"\n`{names[0]}`, all scores, against {where}{note}:\n"
        scores = factor["scores"][names[0]]
        rows = [
            [value, *(_interval(scores[each][row], SCORES[each]) for each in PRINTED)]
            for row, value in enumerate(values)
        ]
        yield from markdown_table([key, *map(_head, PRINTED)], rows)
    yield (
        "\nMeans with 95 % intervals over seeds. *AP n*: average precision of estimates within n mm of a person, by "
        "falling score; ghosts and missed people lower it; *mAP*: the mean of these."
    )


def _breaking(digest: Mapping[str, Any], parts: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Return the table of breaking points: a row for each factor, case and score, a column for each variant."""
    names = list(digest["means"])
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for factor in digest["factors"]:
        for case, part in parts.items():
            for each in part["breaking"]:
                if each["factor"] == factor["key"]:
                    row = (f"`{each['factor']}`", *([case] if case else []), _threshold(each))
                    rows.setdefault(row, {})[each["variant"]] = _broken(each, len(digest["seeds"]))
    if not rows:
        return
    yield "\n## Breaking points"
    yield "\nThe value of a factor at which the mean score passes the threshold.\n"
    heads = ["factor", *(["case"] if digest["by_case"] else []), "broken", *names]
    yield from markdown_table(heads, [[*row, *(cells.get(name, "–") for name in names)] for row, cells in rows.items()])
    yield (
        "\nLinear interpolation between the swept values. In parentheses: 95 % interval over seeds; *beyond*: the "
        "interval ends outside the swept values. *not within the range*: the mean passes the threshold at no swept "
        "value. *at once*: the mean is past the threshold at the mildest value already. Ghosts do not lower PCP; they "
        "lower precision, the share of estimates that match a true person."
    )


def _failures(digest: Mapping[str, Any]) -> Iterator[str]:
    failures = digest["failures"]
    kinds, stages = [str(kind) for kind in FailureKind], [str(stage) for stage in Stage]
    if not any("method" in failed["stages"] for failed in failures.values()):
        stages.remove("method")  # only user-defined estimators can have it
    over = ", over all cases" if digest["cases"] else ""
    yield "\n## Failures"
    yield f"\nPer 100 frames{over}, with 95 % intervals over seeds: by kind, then the same by the stage to blame.\n"
    rows = [
        *([kind.replace("_", " "), *(_rate(failed, "kinds", kind) for failed in failures.values())] for kind in kinds),
        *([f"by {stage}", *(_rate(failed, "stages", stage) for failed in failures.values())] for stage in stages),
        [_ALONE, *(_alone(failed) for failed in failures.values())],
    ]
    yield from markdown_table(["failures", *failures], rows)
    yield "\nKinds. " + _listed({kind.replace("_", " "): SCORES[f"failures_{kind}"].about for kind in kinds})
    yield (
        "\nStage to blame: the first stage whose result, replaced by the truth, repairs the failure. "
        + _listed({stage: _STAGE_MEANINGS[stage] for stage in stages})
        + f" *{_ALONE}*: share of all failures, of any stage, that the true matching of the real detections repairs "
        "without any other change."
    )


def _listed(meanings: Mapping[str, str]) -> str:
    return " ".join(f"*{name}*: {meaning}." for name, meaning in meanings.items())


def _rate(failed: Mapping[str, Any], column: str, key: str) -> str:
    if key not in failed[column]:
        return "0.0"
    low, high = failed["intervals"][column][key]
    return _with_ends(fixed(failed[column][key], 1), low, high, 1)


def _alone(failed: Mapping[str, Any]) -> str:
    if failed["matching_alone"] is None:
        return "–"
    low, high = failed["intervals"]["matching_alone"]
    return _with_ends(f"{fixed(failed['matching_alone'], 0)} %", low, high, 0)


def _with_ends(mean: str, low: float | None, high: float | None, digits: int) -> str:
    return mean if low is None or high is None else f"{mean} ({fixed(low, digits)} to {fixed(high, digits)})"


def _head(score: str) -> str:
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def _interval(ends: Sequence[float | None] | None, info: ScoreInfo) -> str:
    """Return the text of a mean and its interval."""
    mean, low, high = ends or (None, None, None)
    if mean is None:
        return "–"
    return _with_ends(fixed(mean, info.digits), low, high, info.digits)


def _threshold(each: Mapping[str, Any]) -> str:
    """Return the condition that counts as broken."""
    info = SCORES[each["score"]]
    past = "under" if info.better == "higher" else "over"
    return f"{info.title} {past} {each['threshold']:g}{f' {info.unit}' if info.unit else ''}"


def _broken(each: Mapping[str, Any], seeds: int) -> str:
    """Return the breaking point of a variant, with its interval where there are several seeds."""
    low, high = ("beyond" if end is None else f"{end:.3g}" for end in (each["low"], each["high"]))
    ends = f" ({low} to {high})" if seeds > 1 else ""
    if each["value"] is None:  # an interval that lies outside as well adds nothing
        outside = low == high == "beyond"
        return f"{'not within the range' if each['why'] == 'never' else 'at once'}{'' if outside else ends}"
    return f"{'above' if each['worse_when'] == 'greater' else 'below'} {each['value']:.3g}{ends}"
