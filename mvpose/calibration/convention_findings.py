"""Findings about the files of a rig, and the unit of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mvpose.calibration.consistency import Reading
from mvpose.calibration.conventions import FoundMistake
from mvpose.calibration.findings import Finding

_UNITS = {
    0.001: "divided by 1000 twice (or metres taken for millimetres)",
    0.01: "divided by 100 (or metres taken for centimetres)",
    0.1: "divided by 10",
    0.0254: "metres taken for inches",
    10.0: "in decimetres",
    39.37: "in inches",
    100.0: "in centimetres",
    1000.0: "in millimetres",
    3.281: "in feet",
}
_SAME_UNIT = 1.3  # factor within which people's size names a unit: adults and children differ by more from other sizes
_ODD = 1.6  # times as large or as small as adults: an alarm; a child of six has two thirds of an adult's size
_UNUSUAL = 1.25  # a note


def mistake_finding(verdict: FoundMistake, names: Sequence[str]) -> Finding:
    """Return the finding of a mistake in the files."""
    mistake = verdict.mistake
    named = [names[view] for view in mistake.views]
    everyone = verdict.whole and len(mistake.views) == len(names)
    who = "all cameras" if everyone else " and ".join(named)
    one = len(mistake.views) == 1
    expression = f"rig[{mistake.views[0]}]" if one else "camera"
    prefix = "for camera in rig: " if everyone and "{camera}" in mistake.mend else ""
    mend = mistake.mend.replace("{camera}", expression).replace("{who}", who)
    return Finding(
        mistake.kind,
        mistake.text.replace("{who}", who),
        probability=min(verdict.probability, 1.0),
        camera=named[0] if not everyone else None,
        view=mistake.views[0] if not everyone else None,
        size=dict(mistake.size),
        cost=verdict.probability * len(mistake.views) / len(names),
        mend=prefix + mend,
    )


def unit(reading: Reading, ratio: float) -> tuple[Reading, list[Finding]]:
    """Return the reading in metres, and what the size of people says about the unit.

    Args:
        reading: cameras whose scale is to be checked.
        ratio: how many times as large as adults people are under it; NaN if unknown.
    """
    if not np.isfinite(ratio) or 1 / _UNUSUAL < ratio < _UNUSUAL:
        return reading, []
    size = {"times_adults": float(ratio)}
    interval = {"times_adults": (float(ratio / 1.15), float(ratio * 1.15))}
    if 1 / _ODD < ratio < _ODD:
        note = Finding(
            "wrong-unit",
            f"people are {ratio:.2f} times as large as adults: they are children or very tall, or the scale of the "
            "calibration (the squares of the board) is wrong",
            severity="note",
            probability=0.5,
            size=size,
            interval=interval,
            cost=abs(float(np.log(ratio))) * 0.3,
            mend="measure a distance between two cameras; multiply every t by the true over the calibrated one",
        )
        return reading, [note]
    factor = min(_UNITS, key=lambda each: abs(np.log(each / ratio)))
    named = abs(np.log(factor / ratio)) < np.log(_SAME_UNIT)
    scale = factor if named else float(f"{ratio:.2g}")
    cameras = reading.cameras.copy()
    cameras[:, 14:17] /= scale
    text = (
        f"the translations of all cameras are {_UNITS[factor]}: "
        if named
        else "the translations of all cameras are not in metres: "
    ) + f"people are {ratio:.3g} times as large as adults"
    alarm = Finding(
        "wrong-unit",
        text,
        probability=0.99,
        size=size,
        interval=interval,
        cost=1.0,
        mend=f"for camera in rig: t = camera.t / {scale:g}",
    )
    return replace(reading, cameras=cameras), [alarm]
