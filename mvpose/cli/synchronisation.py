"""Recordings whose cameras began at different moments, or have different rates: starts found, frames put together.

Frames are those of the slowest camera. Each holds the picture of every other one that is nearest in time, and the
time of every picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration import estimate_clocks
from mvpose.calibration.starts import find_starts
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.files.message_text import prefixed
from mvpose.formats.detections.recorded_frames import RecordedFrames
from mvpose.wholebody import body_part

_LOOKED_AT = 40.0  # s of a longer recording in which starts are looked for, where most is detected
_NEAR = 0.2  # s, beyond which clocks that start where the people say do not refine this
_LEAST_FRAMES = 2


@dataclass(frozen=True)
class Synchronised:
    """A recording whose frames are of one moment."""

    recorded: RecordedFrames
    """Frames with the numbers of the slowest camera, those that all cameras have."""
    pictures: Integers
    """Number of each camera's picture in each frame, (T, V)."""
    times: Floats
    """Time of each picture, (T, V), seconds by the clock of the slowest camera."""
    starts: Floats
    """Time at which each camera had picture 0, (V,), seconds."""
    rates: Floats
    """Frames per second of each camera, (V,)."""
    refined: Bools
    """Whether the start of each camera is known to a part of a frame, (V,)."""

    @property
    def period(self) -> float:
        """Time between frames, seconds."""
        return float(1.0 / self.rates.min())

    def record(self, view: int) -> dict[str, Any]:
        """Return what files say about a camera."""
        return {"start_s": round(float(self.starts[view]), 6), "fps": round(float(self.rates[view]), 6)}

    def text(self, names: Sequence[str]) -> str:
        """Return what was found, for the user."""
        of = [f"{name} {start:+.3f} s" for name, start in zip(names, self.starts, strict=True)]
        apart = 1e3 * np.ptp(self.times, axis=1).max()
        vague = [name for name, refined in zip(names, self.refined, strict=True) if not refined]
        text = (
            f"starts of the cameras, from the people: {', '.join(of)}; all have {len(self.times)} frames, with the "
            f"numbers of {names[int(self.rates.argmin())]}; pictures of a frame are up to {apart:.0f} ms apart"
        )
        return text + (f"; known to a tenth of a second only: {', '.join(vague)}" if vague else "")


def rates_of(given: str | None, names: Sequence[str], rate: float) -> Floats:
    """Return the frames per second of each camera, of the text of ``--rates``, or one for all.

    Raises:
        ValueError: not a number above 0 for each camera.
    """
    try:
        rates = np.full(len(names), rate) if given is None else np.array([float(each) for each in given.split(",")])
        if rates.shape == (len(names),) and (rates > 0).all() and (rates < 1e6).all():
            return rates
    except ValueError:
        pass
    raise ValueError(f"--rates must be {len(names)} numbers above 0, one for each camera, got {given!r}")


def synchronised(rig: Rig, recorded: RecordedFrames, rates: Floats, frames: tuple[int, int] | None) -> Synchronised:
    """Find when cameras began to record, and put their pictures together.

    Args:
        rig: the calibrated cameras.
        recorded: detections with the numbers of the files, which count from the start of each camera.
        rates: frames per second of each camera, (V,).
        frames: first and last frame to take, by the numbers of the slowest camera; None: all.

    Raises:
        ValueError: the people do not tell when the cameras began; or no such frames.
    """
    views, first = len(rig), int(rates.argmin())
    apart = _grouped(recorded, rates, np.zeros(views), np.zeros(views, np.bool_), shared=False)
    with prefixed("--sync"):
        starts = find_starts(rig, _busiest(apart))
    starts = starts - starts[first]
    found = _grouped(recorded, rates, starts, np.zeros(views, np.bool_), shared=False)
    clocks = estimate_clocks(rig, _busiest(found))
    changes = clocks.offsets - clocks.offsets[first]
    refined = clocks.determined & clocks.determined[first] & (np.abs(changes) < _NEAR)
    return _grouped(recorded, rates, np.where(refined, starts + changes, starts), refined, frames=frames)


def _grouped(
    recorded: RecordedFrames,
    rates: Floats,
    starts: Floats,
    refined: Bools,
    *,
    shared: bool = True,
    frames: tuple[int, int] | None = None,
) -> Synchronised:
    """Return the pictures put together by their starts; of the time that all cameras share, or any has."""
    first = int(rates.argmin())
    spans = np.array([(min(each), max(each)) if each else (0, 0) for each in recorded.pictures])
    begin, end = (starts + spans.T / rates - starts[first]) * rates[first]
    low, high = (begin.max(), end.min()) if shared else (begin.min(), end.max())
    numbers = np.arange(int(np.ceil(low - 0.5)), int(np.floor(high + 0.5)) + 1)
    if frames is not None:
        numbers = numbers[(numbers >= frames[0]) & (numbers <= frames[1])]
    if len(numbers) < _LEAST_FRAMES:
        raise ValueError(
            f"the cameras share the frames {np.ceil(low):.0f} to {np.floor(high):.0f} (numbers of the slowest): "
            "correct --frames, or record for longer"
        )
    when = (numbers / rates[first] + starts[first])[:, None]
    pictures = np.round((when - starts) * rates).astype(np.int64)
    times = pictures / rates + starts
    return Synchronised(recorded.regrouped(numbers, pictures), pictures, times, starts, rates, refined)


def _busiest(found: Synchronised) -> list[Detections]:
    """Return the frames in a row, forty seconds at most, in which most is detected."""
    frames = found.recorded.detections(found.times)
    length = round(_LOOKED_AT / found.period)
    if len(frames) <= length:
        return [body_part(each) for each in frames]
    every = max(1, length // 60)
    counts = np.cumsum([0, *(len(frames[row]) for row in range(0, len(frames), every))])
    width = min(length // every, len(counts) - 1)
    start = every * int((counts[width:] - counts[: len(counts) - width]).argmax())
    return [body_part(frames[row]) for row in range(start, min(start + length, len(frames)))]
