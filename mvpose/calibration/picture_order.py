"""Pictures that a camera delivers twice, and pictures that it loses without a gap in their numbers.

A repeated picture has the same detections as the one before, to the last digit. A lost picture is not seen itself: all
later ones come a frame too early, so the clock of the camera is a frame later from then on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.calibration.clock_adjustment import ClockAdjustment
from mvpose.calibration.sightings import Sightings

_LEAST = 5  # keypoints that do not move at all: fewer may be chance, where a detector rounds to whole pixels
_CERTAIN = 5.0  # standard deviations of a step
_BLOCK = 1.0  # s: errors are correlated in time for less than this
_LEAST_SHARE = 0.08  # of the information about a clock on each side of a step; less is that of a few paces


@dataclass(frozen=True)
class ClockStep:
    """Whole frames by which the pictures of a camera are later, or earlier, from a frame on."""

    view: int
    """Index of the camera."""
    frame: int
    """First frame after the step."""
    time: float
    """Its time, seconds."""
    frames: int
    """Pictures that were lost; negative for pictures too many."""
    deviations: float
    """Size of the step, in standard deviations of what is measured."""


def repeated_pictures(sightings: Sightings) -> Bools:
    """Return which pictures repeat the one before of their camera, (F, V)."""
    frames, views = sightings.times.shape
    result = np.zeros((frames, views), np.bool_)
    order = np.lexsort((sightings.pixels[:, 1], sightings.pixels[:, 0], sightings.frame, sightings.view))
    key = sightings.view[order] * frames + sightings.frame[order]
    starts = np.searchsorted(key, np.arange(frames * views + 1))
    pixels = sightings.pixels[order]
    for view in range(views):
        last: Floats = np.zeros((0, 2))
        for frame in range(frames):
            index = view * frames + frame
            these = pixels[starts[index] : starts[index + 1]]
            result[frame, view] = len(these) >= _LEAST and np.array_equal(these, last)
            last = these if len(these) else last
    return result


def find_step(adjustment: ClockAdjustment, times: Floats, period: float) -> ClockStep | None:
    """Return the step of one clock that explains most, or None where no step is certain.

    Args:
        adjustment: the clocks, each constant.
        times: times of the pictures, (F, V), seconds.
        period: time between frames, seconds.
    """
    best: ClockStep | None = None
    block = np.floor((adjustment.times - adjustment.times[0]) / _BLOCK).astype(int)
    for view in range(times.shape[1]):
        score, curvature = adjustment.scores[:, view], adjustment.curvatures[:, view]
        if not curvature.sum() > 0.0:
            continue
        split, size, deviations = _steepest(score, curvature, block)
        frames = round(size / period)
        if frames == 0 or deviations < _CERTAIN or abs(size / period - frames) > 0.4:
            continue
        if best is None or deviations > best.deviations:
            frame = int(np.searchsorted(np.nanmedian(times, axis=1), adjustment.times[split]))
            best = ClockStep(view, frame, float(adjustment.times[split]), frames, float(deviations))
    return best


def joined_steps(steps: Sequence[ClockStep], *, within: int) -> tuple[ClockStep, ...]:
    """Return steps in the order of time, those of one camera that are at most ``within`` frames apart as one."""
    result: list[ClockStep] = []
    for step in sorted(steps, key=lambda each: (each.view, each.frame)):
        last = result[-1] if result else None
        if last is None or last.view != step.view or step.frame - last.frame > within:
            result.append(step)
            continue
        surer = max(last, step, key=lambda each: each.deviations)
        result[-1] = replace(surer, frames=last.frames + step.frames)
    return tuple(sorted((each for each in result if each.frames), key=lambda each: each.frame))


def _steepest(score: Floats, curvature: Floats, block: Floats) -> tuple[int, float, float]:
    """Return the instant before which a step is most certain, its size (s) and its size in standard deviations."""
    before, weight = np.cumsum(score)[:-1], np.cumsum(curvature)[:-1]
    after, rest = score.sum() - before, curvature.sum() - weight
    inside = np.minimum(weight, rest) > _LEAST_SHARE * curvature.sum()
    if not inside.any():
        return 0, 0.0, 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        sizes = np.where(inside, after / rest - before / weight, 0.0)
        errors = np.where(inside, np.sqrt(1.0 / weight + 1.0 / rest), np.inf)
    split = int(np.abs(sizes / errors).argmax())
    # What is left beside the step says how much errors of a second go together.
    level = np.where(np.arange(len(score)) <= split, before[split] / weight[split], after[split] / rest[split])
    left = np.bincount(block, score - level * curvature)
    tempered = max(1.0, float((left**2).sum() / curvature.sum()))
    return split + 1, float(sizes[split]), float(abs(sizes[split]) / (errors[split] * np.sqrt(tempered)))
