"""Joints and people that are left out of results: uncertain, faster than people move, or seen too shortly.

Rules, one after another; what they leave out is a gap in all files, and nothing is filled in:

1. a joint whose expected error is larger than that of a joint anywhere around the body;
2. a joint that moves faster than people do: of each joint the most frames stay that can be reached from each other;
3. a person of whom less than half of the joints are left in a frame is left out there;
4. a person who is there in too few frames.

Rules 2 and 4 need identities. The fastest measured run is 12.4 m/s (R. Graubner and E. Nixdorf on the 2009 World
Championships in Athletics, New Studies in Athletics 26, 2011); trunk and head move no faster. The foot that stands does
not move, so the one that swings is twice as fast, 24.8 m/s; a ball leaves the hand of experienced players of handball
at less (van den Tillaar and Ettema, "A force-velocity relationship and coordination patterns in overarm throwing",
Journal of Sports Science and Medicine 3, 2004).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.reconstruction.error_scale import PRIOR_FREEDOM
from mvpose.recording import People

FASTEST = 24.8
"""Fastest joint of a person, m/s; joints of trunk and head move half as fast."""

LARGEST_ERROR = 0.25
"""Expected error, metres, from which an estimate says little: the length of a forearm (0.146 of stature; Drillis and
Contini, 1966)."""

_TRUNK = {"shoulder", "hip", "neck", "mid_hip", "thorax", "pelvis", "nose", "eye", "ear", "head_bottom", "head_top"}
_WINDOW = 100  # frames in which the earlier place of a joint is looked for


@dataclass(frozen=True)
class OutputLimits:
    """OutputLimits of what results hold.

    Raises:
        ValueError: a limit that is not above 0.
    """

    max_error: float = LARGEST_ERROR
    """Largest expected error of a joint, metres: half of such joints should be nearer to the truth."""
    max_speed: float = FASTEST
    """Largest speed of arms and legs, m/s; that of trunk and head is half of it."""
    min_frames: int = 5
    """Fewest frames of a person; of a shorter recording all."""

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not value > 0:
                raise ValueError(f"--{key.replace('_', '-')} must be above 0, or inf for no limit, got {value}")


@dataclass(frozen=True)
class LeftOut:
    """What was left out of the results of a recording, for its files and its page."""

    limits: OutputLimits
    """The limits."""
    ids: Integers
    """Identities of the n people before."""
    counts: Integers
    """Joints that each rule left out of each person, (4, n), in the order of the rules."""
    present: Integers
    """Joints of each person before, (n,)."""
    frames: Integers
    """Frames in which each person was there before, (n,)."""

    @property
    def people(self) -> Integers:
        """Identities of people of whom nothing is left."""
        return self.ids[(self.present > 0) & (self.counts.sum(axis=0) == self.present)]

    def sentences(self) -> list[str]:
        """Return a sentence for each rule that left something out."""
        limits, total = self.limits, max(1, int(self.present.sum()))
        whys = (
            f"with an expected error above {limits.max_error:g} m",
            f"faster than {limits.max_speed:g} m/s (trunk and head {limits.max_speed / 2:g} m/s)",
            "of people of whom less than half was left in the frame",
            f"of people who are there in fewer than {limits.min_frames} frames",
        )
        told = [
            f"{count} joints {why} ({100 * count / total:.2g} %)"
            for count, why in zip(self.counts.sum(axis=1).tolist(), whys, strict=True)
            if count
        ]
        if len(self.people):
            gone = np.isin(self.ids, self.people)
            told.append(
                f"{len(self.people)} whole people, identity "
                + ", ".join(
                    f"{identity} (in {frames} frames)"
                    for identity, frames in zip(self.ids[gone].tolist(), self.frames[gone].tolist(), strict=True)
                )
            )
        return told

    def to_json(self) -> dict[str, Any]:
        """Return limits and counts as JSON values."""
        rules = ("uncertain", "fast", "incomplete", "short")
        return {
            "limits": {key: value if np.isfinite(value) else None for key, value in vars(self.limits).items()},
            "joints_before": int(self.present.sum()),
            "joints": dict(zip(rules, self.counts.sum(axis=1).tolist(), strict=True)),
            "people": self.people.tolist(),
            "by_person": {
                str(identity): dict(zip(rules, counts, strict=True))
                for identity, counts in zip(self.ids.tolist(), self.counts.T.tolist(), strict=True)
                if any(counts)
            },
        }


def within_limits(
    people: People, limits: OutputLimits, *, tracked: bool = True, errors: Floats | None = None
) -> tuple[People, LeftOut]:
    """Return people without what is beyond the limits, and what that was.

    Args:
        people: the people.
        limits: the limits.
        tracked: whether identities say who somebody is in the next frame; else speed and duration are not judged.
        errors: :func:`expected_errors`, where they are known without covariances.
    """
    present = people.present
    kept, counts = present.copy(), np.zeros((4, len(people)), np.int64)

    def leave_out(rule: int, which: Bools) -> None:
        counts[rule] = (kept & which).sum(axis=(0, 2))
        kept[which] = False

    leave_out(0, (expected_errors(people) if errors is None else errors) > limits.max_error)
    if tracked:
        leave_out(1, ~_reachable(people, kept, limits.max_speed))
    broken = 2 * kept.sum(axis=2) < present.sum(axis=2)
    leave_out(2, np.broadcast_to(broken[..., None], kept.shape))
    if tracked:
        short = kept.any(axis=2).sum(axis=0) < min(limits.min_frames, people.frames)
        leave_out(3, np.broadcast_to(short[None, :, None], kept.shape))
    left = LeftOut(limits, people.ids, counts, present.sum(axis=(0, 2)), present.any(axis=2).sum(axis=0))
    if not counts.any():
        return people, left
    rows = kept.any(axis=(0, 2))
    return replace(
        people,
        ids=people.ids[rows],
        joints=people.joints[:, rows],
        scores=np.where(kept, people.scores, 0.0)[:, rows],
        covariance=None if people.covariance is None else people.covariance[:, rows],
        freedom=None if people.freedom is None else people.freedom[:, rows],
    ), left


def expected_errors(people: People) -> Floats:
    """Return the expected median error of each joint, (T, n, J), metres; NaN where absent, or without covariances.

    The squared length of a Gaussian error of covariance C is nearly a chi-square of (tr C)² / tr C² degrees of freedom
    (Satterthwaite, 1946), that of a multivariate t an F, and the median of an F is that of Wilson and Hilferty's
    approximation (Proceedings of the National Academy of Sciences 17, 1931): within 5 %.
    """
    if people.covariance is None:
        return np.full(people.scores.shape, np.nan)
    freedom = np.full(people.scores.shape, PRIOR_FREEDOM) if people.freedom is None else people.freedom
    freedom = np.nan_to_num(freedom, nan=PRIOR_FREEDOM, posinf=1e9)
    trace = np.trace(people.covariance, axis1=-2, axis2=-1)
    squared = np.sum(people.covariance**2, axis=(-2, -1))
    with np.errstate(invalid="ignore", divide="ignore"):
        sides = np.where(squared > 0.0, trace**2 / squared, 3.0)
        median = (freedom - 2.0) / freedom * ((1.0 - 2.0 / (9.0 * sides)) / (1.0 - 2.0 / (9.0 * freedom))) ** 3
        errors: Floats = np.sqrt(np.maximum(trace * median, 0.0))
    return np.where(np.isfinite(trace), errors, np.nan)


def _reachable(people: People, kept: Bools, max_speed: float) -> Bools:
    """Return the joints that can be reached at a speed from those of other frames, (T, n, J)."""
    fastest = np.where([part in _TRUNK for part in people.skeleton.parts], max_speed / 2.0, max_speed)
    result = np.ones(kept.shape, bool)
    for person, joint in np.ndindex(kept.shape[1:]):
        rows = np.flatnonzero(kept[:, person, joint])
        places, times = people.joints[rows, person, joint], people.times[rows]
        far = np.linalg.norm(np.diff(places, axis=0), axis=1) > fastest[joint] * np.diff(times)
        if far.any():
            result[rows, person, joint] = _longest_chain(places, times, float(fastest[joint]))
    return result


def _longest_chain(places: Floats, times: Floats, fastest: float) -> Bools:
    """Return the most places (T, 3) of which each can be reached from the one before at a speed, (T,)."""
    length, before = np.ones(len(places), np.int64), np.full(len(places), -1)
    for k in range(1, len(places)):
        first = max(0, k - _WINDOW)
        distance = np.linalg.norm(places[first:k] - places[k], axis=1)
        can = distance <= fastest * (times[k] - times[first:k])
        if can.any():
            best = int(np.argmax(np.where(can, length[first:k], 0)[::-1]))  # the latest of the best
            before[k] = k - 1 - best
            length[k] = length[before[k]] + 1
    chain, at = np.zeros(len(places), bool), int(np.argmax(length))
    while at >= 0:
        chain[at] = True
        at = int(before[at])
    return chain
