"""A rehearsal in plain sentences."""

from __future__ import annotations

import numpy as np

from simharness.planning.floor_coverage import good_rectangle
from simharness.planning.rehearsal_result import Rehearsal
from simharness.statistics.intervals import Interval

_LITTLE = 0.5  # points of PCP: less is no reason to buy or to move a camera
_CROWDED = 90.0  # PCP, percent: with fewer the method is of little use


def sentences(rehearsal: Rehearsal) -> tuple[str, ...]:
    """Return the result in plain sentences, the most important first."""
    return tuple(
        filter(
            None,
            (
                _verdict(rehearsal),
                _numbers(rehearsal),
                _cameras(rehearsal),
                _one_more(rehearsal),
                _crowd(rehearsal),
                _tolerance(rehearsal),
                _matching(rehearsal),
            ),
        )
    )


def _verdict(rehearsal: Rehearsal) -> str:
    setup, count = rehearsal.setup, len(rehearsal.rig)
    people, size = _people(setup.people), _size(*setup.volume.size)
    target = f"PCP {setup.target.pcp:g} and {setup.target.error:g} mm"
    if rehearsal.good_share > 0.995:
        return f"{count} cameras are enough for {people} in the whole volume of {size}: everywhere {target} are met."
    rectangle = good_rectangle(rehearsal.prediction.places, rehearsal.good)
    if rectangle is None:
        return f"{count} cameras are not enough for {people} in {size}: nowhere are {target} met."
    inner = _size(*(rectangle[1] - rectangle[0]))
    return (
        f"{count} cameras are enough for {people} within {inner}; {100 * rehearsal.good_share:.0f} % of the volume of "
        f"{size} meets the target, {target}."
    )


def _numbers(rehearsal: Rehearsal) -> str:
    whole = rehearsal.whole
    return (
        f"In simulation {_with_interval(whole.pcp)} % of the body parts are placed correctly (PCP), and joints of "
        f"people who are found are off by {_with_interval(whole.mpjpe_mm, digits=0)} mm."
    )


def _cameras(rehearsal: Rehearsal) -> str:
    worths = list(rehearsal.cameras.values())
    if all(each.without is None for each in worths):
        return "With two cameras, the failure of either one leaves no positions in space."
    redundant = [each.camera.name for each in worths if each.redundant]
    most = max(worths, key=lambda each: (each.worth.mean, each.worth_mm.mean))
    parts = []
    if most.worth.mean >= _LITTLE:
        parts.append(f"camera {most.camera.name} matters most: without it PCP falls by {most.worth.mean:.1f} points")
    if redundant:
        which = (
            f"camera {redundant[0]} is" if len(redundant) == 1 else f"any one of the cameras {_listed(redundant)} is"
        )
        parts.append(f"{which} redundant: without it PCP falls by less than {_LITTLE:g} points")
    else:
        parts.append("no camera is redundant")
    return _sentence("; ".join(parts))


def _one_more(rehearsal: Rehearsal) -> str:
    extra = rehearsal.extra
    if extra is None:
        return ""
    x, y, z = extra.camera.center
    where = f"at x = {x:.1f}, y = {y:.1f}, {z:.1f} m high"
    gained = (
        f"{max(extra.gain.mean, 0.0):.1f} points of PCP and takes {max(extra.gain_mm.mean, 0.0):.0f} mm from the error"
    )
    if extra.gain.mean < _LITTLE and extra.gain_mm.mean < 0.1 * rehearsal.whole.mpjpe_mm.mean:
        return f"One more camera brings little: the best place, {where}, adds {gained}."
    return f"One more camera should hang {where}: it adds {gained}."


def _crowd(rehearsal: Rehearsal) -> str:
    known = [(each.people, each.pcp.mean) for each in rehearsal.crowds if each.pcp is not None]
    if len(known) < 2:
        return ""
    most, pcp = known[-1]
    enough = [people for people, value in known if value >= _CROWDED]
    if pcp >= _CROWDED:
        return f"Up to {most} people PCP stays at {_CROWDED:g} or above: it is {pcp:.0f} with {most}."
    if not enough:
        return f"PCP is below {_CROWDED:g} with any number of people; with {most} it is {pcp:.0f}."
    return f"PCP stays at {_CROWDED:g} or above up to {_people(max(enough))}; with {most} it is {pcp:.0f}."


def _tolerance(rehearsal: Rehearsal) -> str:
    if not rehearsal.tolerances:
        return ""
    limits = {each.fault.key: each.limit for each in rehearsal.tolerances}
    return (
        f"Errors that cost 5 points of PCP: {limits['rotation']} in the orientation of every camera, "
        f"{limits['translation']} in its position, {limits['clock_offset']} in its clock."
    )


def _matching(rehearsal: Rehearsal) -> str:
    if not np.isfinite(rehearsal.mixed.mean) or rehearsal.mixed.mean < 1.0:
        return ""
    return f"In {rehearsal.mixed.mean:.0f} % of the matches two people are taken for one."


def _with_interval(value: Interval, *, digits: int = 1) -> str:
    text = f"{value.mean:.{digits}f}"
    return f"{text} ({value.low:.{digits}f} to {value.high:.{digits}f})" if np.isfinite(value.low) else text


def _size(x: float, y: float) -> str:
    return f"{x:.1f} by {y:.1f} m"


def _people(count: int) -> str:
    return "1 person" if count == 1 else f"{count} people"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + f" and {names[-1]}"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."
