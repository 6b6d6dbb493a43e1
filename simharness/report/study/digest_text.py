"""A digest as a text to read: :mod:`simharness.report.study.digest` makes the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from simharness.report.documents import markdown_table, provenance_sentence
from simharness.report.study.factor_names import NAMES, axis_label
from simharness.report.study.plots import BLAME_COLORS, KIND_COLORS, mean_over, short
from simharness.runtime.progress import duration
from simharness.scoring.catalogue import AP_MM, SCORES, ScoreInfo

HEADS = ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts")
"""The scores of a digest's first table."""
PRINTED = (*(f"ap{limit}" for limit in AP_MM), "map", "recall", "mpjpe_mm", "pcp", "ghosts")
"""The scores of one variant at every value of a factor, in the form in which papers print Panoptic."""
COMPARED = ("pcp", "map", "ghosts")
"""The scores of all variants at every value of a factor."""

_ALONE = "matching alone"
_OWNERS = {
    "detection": "a perfect detector's report of the same pictures mends it; what is hidden from the real one counts "
    "here, too",
    "matching": "perfect detections do not, but with the true matching they do",
    "reconstruction": "neither does: it is reconstruction itself, or what that is given besides detections (a "
    "calibration that is off, pictures that are late, too few views)",
    "method": "perfect detections do not, and the method cannot be told a matching: it comes from elsewhere",
}


def markdown(told: Mapping[str, Any]) -> str:
    """A digest as a text to read.

    Args:
        told: from :func:`simharness.report.study.digest.digest`.
    """
    return "\n".join(_lines(told)) + "\n"


def _lines(told: Mapping[str, Any]) -> Iterator[str]:
    seeds, took = told["seeds"], duration(told["seconds"])
    yield f"# {told['name']}"
    yield f"\n{told['description']}. {told['trials']} trials, seeds {min(seeds)} to {max(seeds)}, {took} of one core."
    yield f"\n    {told['command']}"
    yield f"\n{provenance_sentence(told)}"
    yield from _means(told)
    if told["factors"]:
        parts = told["by_case"] or {"": told}
        for factor in told["factors"]:
            yield from _factor(factor["key"], parts, list(told["means"]))
        yield from _breaking(told, parts)
    yield from _failures(told)


def _means(told: Mapping[str, Any]) -> Iterator[str]:
    names = list(told["means"])
    yield "\n## Variants"
    yield "\nMeans over seeds, each the mean over its settings, with 95 % intervals over seeds.\n"
    for case, means in {"": told["means"], **told["cases"]}.items():
        if case:
            yield f"\nCase {case}:\n"
        rows = [[name, *(_said(means[name][key], SCORES[key]) for key in HEADS)] for name in names]
        yield from markdown_table(["variant", *(_head(key) for key in HEADS)], rows)
        if not case:
            yield "\n" + _listed({SCORES[key].title: SCORES[key].about for key in HEADS})


def _factor(key: str, parts: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> Iterator[str]:
    """The tables along one factor, of each case by itself."""
    found = {case: next((each for each in part["factors"] if each["key"] == key), None) for case, part in parts.items()}
    there = {case: factor for case, factor in found.items() if factor is not None}
    yield f"\n## Against `{key}`" + (f": {axis_label(key)}" if key in NAMES else "")
    for case, factor in there.items():
        where = f"`{key}`{f', case {case}' if case else ''}"
        notes = [f"together with {', '.join(f'`{other}`' for other in factor['along'])}"] if factor["along"] else []
        notes += [mean_over(factor["over"])] if factor["over"] else []
        said = f" ({'; '.join(notes)})" if notes else ""
        values = [short(value) for value in factor["values"]]
        for score in COMPARED:
            yield f"\n{_head(score)}, against {where}{said}:\n"
            rows = [
                [value, *(_said(factor["scores"][name][score][row], SCORES[score]) for name in names)]
                for row, value in enumerate(values)
            ]
            yield from markdown_table([key, *names], rows)
        yield f"\n`{names[0]}`, all scores, against {where}{said}:\n"
        scores = factor["scores"][names[0]]
        rows = [
            [value, *(_said(scores[each][row], SCORES[each]) for each in PRINTED)] for row, value in enumerate(values)
        ]
        yield from markdown_table([key, *map(_head, PRINTED)], rows)
    yield (
        "\nMeans with 95 % intervals over seeds. *AP n*: average precision, people within n mm, the surest first, "
        "against ghosts and missed; *mAP*: the mean of these."
    )


def _breaking(told: Mapping[str, Any], parts: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Where every variant breaks: a row for each factor, case and score."""
    names = list(told["means"])
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for factor in told["factors"]:
        for case, part in parts.items():
            for each in part["breaking"]:
                if each["factor"] == factor["key"]:
                    row = (f"`{each['factor']}`", *([case] if case else []), _threshold(each))
                    rows.setdefault(row, {})[each["variant"]] = _broken(each, len(told["seeds"]))
    if not rows:
        return
    yield "\n## Breaking points"
    yield "\nThe value of a factor at which the mean score passes the threshold.\n"
    heads = ["factor", *(["case"] if told["by_case"] else []), "broken", *names]
    yield from markdown_table(heads, [[*row, *(cells.get(name, "–") for name in names)] for row, cells in rows.items()])
    yield (
        "\nBetween the values that were tried it is by a straight line; in parentheses its 95 % interval over seeds, "
        "*beyond* where that ends outside the values tried. *not within the range*: the mean passes at no value that "
        "was tried. *at once*: it is past already at the mildest. PCP does not see ghosts: they lower precision, the "
        "share of estimated people who are someone."
    )


def _failures(told: Mapping[str, Any]) -> Iterator[str]:
    failures = told["failures"]
    kinds, stages = list(KIND_COLORS), list(BLAME_COLORS)
    if not any("method" in failed["stages"] for failed in failures.values()):
        stages.remove("method")  # which only methods from elsewhere are blamed as
    over = ", over all cases" if told["cases"] else ""
    yield "\n## Failures"
    yield f"\nIn 100 frames{over}, with 95 % intervals over seeds: by kind, then the same by the stage to blame.\n"
    rows = [
        *([kind.replace("_", " "), *(_rate(failed, "kinds", kind) for failed in failures.values())] for kind in kinds),
        *([f"by {stage}", *(_rate(failed, "stages", stage) for failed in failures.values())] for stage in stages),
        [_ALONE, *(_alone(failed) for failed in failures.values())],
    ]
    yield from markdown_table(["failures", *failures], rows)
    yield "\nKinds. " + _listed({kind.replace("_", " "): SCORES[f"failures_{kind}"].about for kind in kinds})
    yield (
        "\nBy: the first whose truth, put in for what the method had, mends the failure. "
        + _listed({stage: _OWNERS[stage] for stage in stages})
        + f" *{_ALONE}*: the share of all failures that the true matching of the real detections mends, with nothing "
        "else put right; it may be of any stage."
    )


def _listed(meanings: Mapping[str, str]) -> str:
    return " ".join(f"*{name}*: {meaning}." for name, meaning in meanings.items())


def _rate(failed: Mapping[str, Any], column: str, key: str) -> str:
    if key not in failed[column]:
        return "0.0"
    low, high = failed["intervals"][column][key]
    return _with_ends(f"{failed[column][key]:.1f}", low, high, 1)


def _alone(failed: Mapping[str, Any]) -> str:
    if failed["matching_alone"] is None:
        return "–"
    low, high = failed["intervals"]["matching_alone"]
    return _with_ends(f"{failed['matching_alone']:.0f} %", low, high, 0)


def _with_ends(mean: str, low: float | None, high: float | None, digits: int) -> str:
    return mean if low is None or high is None else f"{mean} ({low:.{digits}f} to {high:.{digits}f})"


def _head(score: str) -> str:
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def _said(ends: Sequence[float | None] | None, info: ScoreInfo) -> str:
    """A mean and its interval."""
    if ends is None:
        return "–"
    mean, low, high = ends
    return _with_ends(f"{mean:.{info.digits}f}", low, high, info.digits)


def _threshold(each: Mapping[str, Any]) -> str:
    """What broken means of a breaking point."""
    info = SCORES[each["score"]]
    past = "under" if info.better == "higher" else "over"
    return f"{info.title} {past} {each['threshold']:g}{f' {info.unit}' if info.unit else ''}"


def _broken(each: Mapping[str, Any], seeds: int) -> str:
    """Where a variant breaks, with its interval, which one seed has not."""
    low, high = ("beyond" if end is None else f"{end:.3g}" for end in (each["low"], each["high"]))
    ends = f" ({low} to {high})" if seeds > 1 else ""
    if each["value"] is None:  # an interval that lies outside, too, says nothing more
        outside = low == high == "beyond"
        return f"{'not within the range' if each['why'] == 'never' else 'at once'}{'' if outside else ends}"
    return f"{'above' if each['worse_when'] == 'greater' else 'below'} {each['value']:.3g}{ends}"
