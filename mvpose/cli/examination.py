"""Short examination of the calibration of every recording that is estimated: the doctor on some of its frames."""

from collections.abc import Sequence

import numpy as np

from mvpose.calibration.findings import Diagnosis
from mvpose.cli.inputs import Inputs
from mvpose.commands.programs import note
from mvpose.detections import Detections
from mvpose.report.verdict import sentence
from mvpose.wholebody import body_part

MOST_FRAMES = 100
"""Frames that are examined, of twelve seconds at most: about two seconds of computing."""

_SPACING = 0.12  # s: largest time between examined frames, in which people are still followed


def examine(inputs: Inputs) -> Diagnosis | None:
    """Ask the doctor about some frames, and print the verdict; None where the examination failed.

    Its failure is no failure of the estimation.
    """
    from mvpose.calibration import diagnose

    rows, step = examined_frames(inputs.frames, period=inputs.period)
    frames = [body_part(inputs.frames[row]) for row in rows.tolist()]
    try:
        diagnosis = diagnose(inputs.rig, frames, period=step * inputs.period)
    except Exception as error:
        note(f"the calibration was not examined ({type(error).__name__}: {error}); `mvpose doctor` examines it alone")
        return None
    note(f"calibration, by {len(rows)} of {len(inputs.frames)} frames: {_verdict(diagnosis)}")
    return diagnosis


def examined_frames(frames: Sequence[Detections], *, period: float) -> tuple[np.ndarray, int]:
    """Return the rows of at most :data:`MOST_FRAMES` frames, and the step between them.

    They are as far apart as people can be followed, and where most is detected.

    Args:
        frames: detections of all frames.
        period: time between frames, seconds.
    """
    step = max(1, min(int(_SPACING / period + 1e-9), -(-len(frames) // MOST_FRAMES)))
    rows = np.arange(0, len(frames), step)
    counts = np.concatenate([[0], np.cumsum([len(frames[row]) for row in rows.tolist()])])
    width = min(MOST_FRAMES, len(rows))
    first = int(np.argmax(counts[width:] - counts[: len(counts) - width]))
    return rows[first : first + width], step


def _verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict as one line."""
    return sentence(diagnosis) + (" `mvpose doctor` says what mends it" if diagnosis.alarms else "")
