"""People at uniform times, for formats that state a rate instead of the time of each frame."""

from __future__ import annotations

import numpy as np

from mvpose.recording import People

_TOLERANCE = 0.01  # of the period; a frame nearer than this to its uniform time stays as it is
_LONGEST = 1.5  # periods; across a longer step nothing is interpolated, because a frame was lost there
_MOST_FRAMES = 10  # times as many frames as there are; above, the times are no recording


def uniform(people: People) -> People:
    """Return people at times ``first + k * period``, where the period is the median of theirs.

    Joints between two frames are interpolated linearly where both have them; a lost frame is a gap.

    Raises:
        ValueError: pauses so long that there would be ten times as many frames.
    """
    period = 1.0 / people.rate
    steps = (people.times - people.times[:1]) / period
    if people.frames < 2 or np.abs(steps - np.arange(people.frames)).max() < _TOLERANCE:
        return people
    count = round(steps[-1]) + 1
    if count > _MOST_FRAMES * people.frames:
        raise ValueError(
            f"{people.frames} frames over {people.times[-1] - people.times[0]:.6g} s at a median of {period:.6g} s "
            "between frames have pauses too long for a format with a fixed rate; export the parts separately"
        )
    wanted = np.arange(count)
    after = np.searchsorted(steps, wanted - _TOLERANCE)  # first frame that is not earlier
    exact = (after < len(steps)) & (np.abs(steps[np.minimum(after, len(steps) - 1)] - wanted) <= _TOLERANCE)
    after = np.clip(after, 1, len(steps) - 1)
    gap = steps[after] - steps[after - 1]
    share = (wanted - steps[after - 1]) / gap
    share = np.where(exact, np.round(np.clip(share, 0.0, 1.0)), share)
    usable = exact | ((gap <= _LONGEST) & (share >= 0.0) & (share <= 1.0))
    return People(
        people.times[0] + period * wanted,
        people.ids,
        _between(people.joints, after, share, usable),
        np.nan_to_num(_between(people.scores, after, share, usable)),
        None if people.covariance is None else _between(people.covariance, after, share, usable),
        people.skeleton,
    )


def _between(values: np.ndarray, after: np.ndarray, share: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Return values between the frames before and ``after``; NaN where not usable or where either is absent."""
    weight = share.reshape(-1, *[1] * (values.ndim - 1))
    with np.errstate(invalid="ignore"):
        mixed = (1.0 - weight) * values[after - 1] + weight * values[after]
    mixed = np.where(weight == 0.0, values[after - 1], np.where(weight == 1.0, values[after], mixed))
    mixed[~usable] = np.nan
    return mixed
