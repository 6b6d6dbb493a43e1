"""Results of a validation, ready for JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

from simharness.reality.validation.evidence import Compared, number, plain
from simharness.reality.validation.validation import HalfPrediction, Validation
from simharness.reality.validation.variant_comparison import SCORES, DoseResponse, SubsetComparison
from simharness.reality.validation.verdicts import BoundVerdict, VerdictState
from simharness.scoring.frame_scores import RULES, HeadRule

_SIDES = ("real", "twin")


def summarize_validation(validation: Validation) -> dict[str, Any]:
    """Return all results ready for JSON; numbers that do not exist are null.

    ``variants.NAME.real.pcp`` and the other scores are numbers by rule for the head: "voxelpose", "2019", and both
    "filled" (missing joints of the face completed from the others). ``subsets.COUNT.NAME.real`` and
    ``dose.TREATMENT.LEVEL.NAME.real`` are single numbers; the latter is the loss of PCP. All of them have the same
    under ``twin``, and their 95 % intervals beside them. Intervals of verdicts are those that are tested.
    """
    recording = validation.recording
    states = [verdict.state for verdict in validation.verdicts]
    return {
        "name": recording.name,
        "kind": recording.kind,
        "cameras": len(recording.rig),
        "frames": {"real": len(recording), "twin": validation.twin_frames},
        "twins": validation.twins,
        "plan": {
            "every": validation.plan.every,
            "twin_every": validation.plan.twin_every,
            "draws": validation.plan.draws,
            "detection_draws": validation.plan.detection_draws,
        },
        "passed": VerdictState.FAILS not in states,
        "counts": {state.value: states.count(state) for state in VerdictState},
        "verdicts": [_verdict(each) for each in validation.verdicts],
        "skill": [each.summary() for each in validation.skills],
        "agreement": {each.variant: each.summary() for each in validation.agreements},
        "corrected": None if validation.corrections is None else validation.corrections.summary(),
        "distance": validation.distance.summary(),
        "variants": {name: _variant(validation, name) for name in validation.whole.variants},
        "contrasts": {
            f"{one} - {other}": {str(rule): figure.summary() for rule, figure in figures.items()}
            for (one, other), figures in validation.whole.contrasts.items()
        },
        "subsets": _subsets(validation.subsets),
        "subset_rank": {name: plain(rank) for name, rank in validation.subsets.ranks.items()},
        "subset_samples": list(validation.subsets.sampled),
        "single_subsets": {
            name: [{"cameras": list(views), **figure.summary()} for views, figure in of.items()]
            for name, of in validation.subsets.single.items()
        },
        "dose": _dose(validation),
        "measurements": {key: figure.summary() for key, figure in validation.whole.measured.items()},
    }


def summarize_halves(predictions: Sequence[HalfPrediction]) -> dict[str, Any]:
    """Return the predictions of halves ready for JSON, by the half that was predicted."""
    result = {}
    for each in predictions:
        whole = summarize_validation(each.validation)
        result[each.half] = {key: whole[key] for key in ("frames", "variants", "contrasts", "subsets", "subset_rank")}
        result[each.half]["verdicts"] = [_verdict(verdict) for verdict in each.verdicts]
    return result


def _verdict(verdict: BoundVerdict) -> dict[str, Any]:
    return {
        "group": verdict.group,
        "name": verdict.name,
        "real": number(verdict.real),
        "twin": number(verdict.twin),
        "difference": number(verdict.difference),
        "interval": [number(verdict.low), number(verdict.high)],
        "bound": verdict.bound,
        "state": verdict.state.value,
    }


def _variant(validation: Validation, name: str) -> dict[str, Any]:
    scores = validation.whole.variants[name]
    result: dict[str, Any] = {}
    for side in _SIDES:
        result[side] = {
            key: {str(rule): number(getattr(scores[key][rule], side).mean) for rule in RULES} for key in SCORES
        }
        result[side]["pcp_parts"] = {
            group: number(getattr(figure, side).mean) for group, figure in validation.whole.parts[name].items()
        }
        result[f"{side}_interval"] = {key: _intervals(scores[key], side) for key in SCORES}
    result["difference"] = {key: {str(rule): number(scores[key][rule].difference) for rule in RULES} for key in SCORES}
    return result


def _intervals(figures: Mapping[HeadRule, Compared], side: str) -> dict[str, list[float | None]]:
    ends = {rule: getattr(figure, side) for rule, figure in figures.items()}
    return {str(rule): [number(each.low), number(each.high)] for rule, each in ends.items()}


def _subsets(subsets: SubsetComparison) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for count, curve in subsets.curves.items():
        result[str(count)] = {name: figure.summary() for name, figure in curve.items()}
        if count in subsets.gains:
            result[str(count)]["full - fast"] = subsets.gains[count].summary()
    return result


def _dose(validation: Validation) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for each in validation.responses:
        level = result.setdefault(each.kind, {}).setdefault(f"{each.level:g}", {})
        level[each.variant] = _response(each)
    return result


def _response(response: DoseResponse) -> dict[str, Any]:
    return {
        **response.loss.summary(),
        "ghosts_per_frame": response.ghosts.summary(),
        "recall": response.recall.summary(),
        "mpjpe_mm": response.mpjpe.summary(),
        "draws": dict(zip(_SIDES, map(_numbers, response.draws), strict=True)),
        "rank_correlation": plain(response.rank),
    }


def _numbers(values: Any) -> list[float | None]:
    return [number(float(value)) for value in values]
