"""Scores of a suite, and its baseline file: a line for each trial and variant, sorted for readable diffs."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.commands.output_files import write_text
from mvpose.files.input_files import MIB, parse_json, read_bytes
from mvpose.files.message_text import one_line, shown
from simharness.gate.trial_command import TrialKey
from simharness.scoring.catalogue import TOLERANCES
from simharness.scoring.pcp import GROUPS

GATED = tuple(TOLERANCES)
"""Keys of the scores that are compared."""

FRAMES = "frames"
"""Key of the number of frames of a trial, the exposure of rates per frame."""

TIME = "time_ratio"
"""Score beside the gated ones: time of a frame divided by the time of the reference kernel."""

GROUP_SCORES = tuple(f"pcp_{group}" for group in GROUPS)
"""PCP of groups of body parts, which says where a change is."""

DETECTED = "detected_px"
"""Mean coordinate of all detected keypoints of a trial, pixels, which says whether the input of the method changed."""

KEPT = (*GATED, *GROUP_SCORES, DETECTED, FRAMES, TIME)

_LARGEST = 64 * MIB  # bytes of a baseline; 200,000 trials
_DIGITS = 4  # decimals: finer than any tolerance, short enough to read in a diff
_HEAD = ("suite", "fingerprint", "code", "processor")


@dataclass(frozen=True)
class Measurement:
    """Scores of a suite."""

    suite: str
    """Name of the suite."""
    fingerprint: str
    """Digest of its settings, seeds and variants, :func:`simharness.gate.suite.fingerprint`."""
    code: str
    """Version of the code that was measured."""
    processor: str
    """Kind of processor that measured it, :func:`simharness.gate.suite.processor`."""
    scores: Mapping[TrialKey, Mapping[str, float | None]]
    """Scores of each trial: all of ``KEPT``, rounded to four decimals, None where a score does not apply."""

    def __post_init__(self) -> None:
        rounded = {
            trial: {key: _round(scores.get(key)) for key in KEPT} for trial, scores in sorted(self.scores.items())
        }
        object.__setattr__(self, "scores", rounded)

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the cases, in order."""
        return tuple(dict.fromkeys(trial.case for trial in self.scores))

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, sorted."""
        return tuple(sorted({trial.variant for trial in self.scores}))


def write_baseline(measurement: Measurement, path: Path) -> None:
    """Write a baseline. The file appears only when it is complete.

    Raises:
        ValueError: the file cannot be written.
    """
    head = [f"  {json.dumps(key)}: {json.dumps(getattr(measurement, key))}," for key in _HEAD]
    rows = [f"    {json.dumps(trial._asdict() | dict(scores))}" for trial, scores in measurement.scores.items()]
    text = "\n".join(["{", *head, '  "trials": [', ",\n".join(rows), "  ]", "}"])
    write_text(text + "\n", path, option="--baseline")


def read_baseline(path: Path) -> Measurement:
    """Read a baseline.

    Raises:
        ValueError: the file is missing, incomplete or no baseline.
    """
    mend = "write one with --update-baseline"
    if not path.exists():
        raise ValueError(f"--baseline {path}: no such file; {mend}")
    try:
        content = read_bytes(path, what="the baseline of a suite", most=_LARGEST)
    except ValueError as error:
        raise ValueError(f"--baseline {error}; {mend}") from None
    try:
        data = parse_json(content)
        head = {key: _text(data, key) for key in _HEAD}
        rows = data["trials"]
        given = {key for row in rows if isinstance(row, dict) for key in row} | {FRAMES, TIME}
        return Measurement(**head, scores=dict(_row(row, given) for row in rows))
    except json.JSONDecodeError as error:
        raise ValueError(
            f"--baseline {path}, line {error.lineno}: not valid JSON: {one_line(error.msg, 160)}; restore it, or {mend}"
        ) from None
    except (KeyError, TypeError, ValueError) as error:
        problem = f"the key {error} is missing" if isinstance(error, KeyError) else one_line(str(error), 200)
        raise ValueError(f"--baseline {path}: not a baseline: {problem}; restore it, or {mend}") from None


def _text(data: Any, key: str) -> str:
    if not isinstance(data, dict):
        raise TypeError(f"expected an object with {', '.join(_HEAD)} and trials, got {type(data).__name__}")
    if not isinstance(data[key], str):
        raise TypeError(f"{key}: expected text, got {shown(data[key])}")
    return str(data[key])


def _row(row: Any, given: set[str]) -> tuple[TrialKey, dict[str, float | None]]:
    """Return trial and scores of one row.

    Args:
        row: the row.
        given: keys of all rows; the others are scores that were not yet gated when the baseline was written.

    Raises:
        TypeError, KeyError: the row is not valid.
    """
    if not isinstance(row, dict):
        raise TypeError(f"trials: expected objects, got {shown(row)}")
    trial = TrialKey(row["case"], row["seed"], row["variant"])
    if not (isinstance(trial.case, str) and isinstance(trial.seed, int) and isinstance(trial.variant, str)):
        raise TypeError(f"trials: expected case, seed and variant, got {shown(list(trial))}")
    scores = {key: row[key] if key in given else None for key in KEPT}
    for key, value in scores.items():
        number = isinstance(value, float | int) and not isinstance(value, bool) and math.isfinite(value)
        if value is not None and not number:
            raise TypeError(f"{trial}: {key}: expected a number or null, got {shown(value)}")
    return trial, scores


def _round(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), _DIGITS)
