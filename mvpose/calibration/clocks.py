"""Clocks of the cameras, from people who move: how much later than their time stamps each camera takes its pictures.

Views of a moving joint agree on its place only where their pictures are of one time. Offsets of all cameras that make
them agree are found in three steps: whole frames at which the rays of views meet, least squares
with velocities of joints (:mod:`.clock_adjustment`), and changes by whole frames on the way (:mod:`.picture_order`).
Only differences between clocks can be seen: the time of the cameras that agree is taken as right where they are half
of all or more, else the mean time of all.

Coarse search of clock offsets: shifts of whole frames at which the rays of two views meet best.

Every pair of views is compared at every shift; offsets of all cameras follow from the costs of all pairs at once, since
a shift that suits one pair must suit the others as well.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.clock_adjustment import ClockAdjustment, adjust
from mvpose.calibration.findings import ALARM, NEW_TIMES, Finding, Severity, camera_names
from mvpose.calibration.joint_tracks import ImageTracks
from mvpose.calibration.picture_order import ClockStep, find_step, joined_steps, repeated_pictures
from mvpose.calibration.sightings import Sightings, gather
from mvpose.camera import Rig
from mvpose.checks import Sealed
from mvpose.detections import Detections

_MOST = 3000  # points of a view that are compared at each shift
_LEAST = 30  # points that two views share, for a pair to count
_ROUNDS = 20
_LARGEST = 1.0  # s: most by which two clocks differ


def coarse_offsets(rig: Rig, tracks: ImageTracks) -> Floats:
    """Return offsets of the clocks, (V,), seconds: whole frames, true time minus given time, some of them 0.

    Two clocks differ by at most a second.
    """
    views = len(rig)
    most = max(1, round(_LARGEST / tracks.period))
    grid = np.nanmedian(tracks.times, axis=1)
    grid = np.arange(grid[0], grid[-1] + 0.5 * tracks.period, tracks.period)
    samples = tracks.sample(np.repeat(grid[:, None], views, axis=1))
    rays = _rays(rig, samples.points)  # (G, V, K, 3)
    every = max(1, int(np.isfinite(rays[..., 0]).sum(axis=(0, 2)).max() // _MOST))
    costs = np.zeros((views, views, 2 * most + 1))  # of b seen `shift` frames later than a
    for a, b in itertools.combinations(range(views), 2):
        curve = _curve(rays[:, a], rays[:, b], rig.centers[b] - rig.centers[a], most, every)
        costs[a, b], costs[b, a] = curve, curve[::-1]
    return -tracks.period * joint_shifts(costs).astype(np.float64)


def _rays(rig: Rig, points: Floats) -> Floats:
    """Return unit viewing directions (G, V, K, 3) of normalised points (G, V, K, 2)."""
    local = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    world = np.einsum("vij,gvki->gvkj", np.stack([camera.R for camera in rig]), local)
    return world / np.linalg.norm(world, axis=-1, keepdims=True)


def _curve(a: Floats, b: Floats, baseline: Floats, most: int, every: int) -> Floats:
    """Return the cost of each shift, (2 most + 1,), by how far rays a and b (G, K, 3) pass; 0 if it cannot be known.

    Where b is seen s frames later than a, the ray of a in frame k belongs to that of b in frame k + s.
    """
    normals = np.cross(a, baseline)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    frames = np.arange(0, a.shape[1], every)
    sines = np.full((2 * most + 1, a.shape[0], len(frames)), np.nan)
    for row, shift in enumerate(range(-most, most + 1)):
        inside = (frames + shift >= 0) & (frames + shift < b.shape[1])
        there = b[:, frames[inside] + shift]
        sines[row][:, inside] = (normals[:, frames[inside]] * there).sum(axis=-1)
    distances = np.abs(sines.reshape(2 * most + 1, -1))
    counts = np.isfinite(distances).sum(axis=1)
    if counts.min() < _LEAST:
        return np.zeros(2 * most + 1)
    scale = np.nanmedian(distances, axis=1).min()
    mean = np.nanmean(np.log1p((distances / max(scale, 1e-6)) ** 2), axis=1)
    return counts.max() * mean


def joint_shifts(costs: Floats) -> Integers:
    """Return shifts (V,) of least total cost, view by view until none changes, from the best of V starts.

    Args:
        costs: of each pair of views, (V, V, 2 M + 1), at shifts of the second against the first from -M to M.
    """
    most = costs.shape[2] // 2
    best, least = np.zeros(len(costs), np.int64), np.inf
    for start in range(len(costs)):
        shifts = _improved(costs, most, _grown(costs, most, start))
        total = _total(costs, most, shifts)
        if total < least - 1e-9:
            best, least = shifts, total
    return best - int(np.round(np.median(best)))


def _grown(costs: Floats, most: int, start: int) -> Integers:
    """Return shifts that are found one view after the other, beginning at one."""
    shifts, done = np.zeros(len(costs), np.int64), [start]
    while len(done) < len(costs):
        rest = [view for view in range(len(costs)) if view not in done]
        curves = {view: _conditional(costs, most, shifts, view, done) for view in rest}
        view = max(rest, key=lambda each: np.median(curves[each]) - curves[each].min())
        shifts[view] = curves[view].argmin() - most
        done.append(view)
    return shifts


def _improved(costs: Floats, most: int, shifts: Integers) -> Integers:
    for _ in range(_ROUNDS):
        before = shifts.copy()
        for view in range(len(costs)):
            others = [other for other in range(len(costs)) if other != view]
            shifts[view] = _conditional(costs, most, shifts, view, others).argmin() - most
        if (shifts == before).all():
            break
    return shifts


def _conditional(costs: Floats, most: int, shifts: Integers, view: int, others: list[int]) -> Floats:
    """Return the cost of each shift of a view, (2 most + 1,), beside other views with known shifts."""
    total, wanted = np.zeros(2 * most + 1), np.arange(-most, most + 1)
    for other in others:
        index = wanted - shifts[other]
        curve = costs[other, view]
        total += np.where(np.abs(index) <= most, curve[np.clip(index, -most, most) + most], curve.max())
    return total


def _total(costs: Floats, most: int, shifts: Integers) -> float:
    pairs = itertools.combinations(range(len(costs)), 2)
    apart = [(a, b, int(shifts[b] - shifts[a])) for a, b in pairs]
    return float(sum(costs[a, b, s + most] if abs(s) <= most else costs[a, b].max() for a, b, s in apart))


_SHARE = 0.9  # of the probability in an interval
_VAGUE = 0.02  # s: half an interval beyond which a clock is not determined; a person who walks is 2.5 cm elsewhere
_VAGUE_FRAMES = 0.2  # the same in frames, where these are slow
_SLOW = 0.08  # s between frames, beyond which a parabola does not follow limbs between pictures
_SLOW_SHARE = 0.12  # error by what frames are longer (simulated people who walk and run at 5 Hz, seeds 2001 to 2003)
_STILL = 0.2  # least share of the motion that is not noise
_AGREE = 3.0  # standard deviations within which a camera has the time of the reference
_TYPICAL_SPEED = 1.3  # m/s, of people who walk (Bohannon, Age and Ageing 1997)
_MOST_STEPS = 20
_FLOOR = 0.0018  # s: errors that every stride repeats (hidden joints that are guessed) do not average out; measured on
# simulated detectors ("typical", seeds 1000 to 1011, one to four people who walk for ten seconds)
_MOST_FRAMES = 3000  # two minutes at 25 Hz: more do not make an offset surer, and take memory
_ONE_LOSS = 0.4  # s: steps of a clock that are nearer to each other are one, found in parts
_FEWEST = 40  # joints at times that two views share


@dataclass(frozen=True)
class Clocks(Sealed):
    """Clocks of V cameras over F frames."""

    offsets: Floats
    """True time minus given time of each camera's pictures, (V,), seconds, against the reference; 0 where it is not
    determined."""
    interval: Floats
    """Lowest and highest value of 90 % of the probability, (V, 2), seconds; infinite where nothing is known."""
    covariance: Floats
    """Of the offsets, (V, V), s²; infinite where nothing is known."""
    determined: Bools
    """Whether the recording determines each clock, to 20 ms or a fifth of a frame, (V,)."""
    reference: tuple[int, ...]
    """Indices of the cameras whose mean time is taken as right."""
    steps: tuple[ClockStep, ...]
    """Whole frames by which a clock is later from a frame on, because pictures were lost."""
    repeated: Bools
    """Pictures that repeat the one before, (F, V)."""
    times: Floats
    """Corrected times of the pictures, (F, V), seconds; of a repeated picture, when it was first delivered; NaN without
    a picture."""
    names: tuple[str, ...]
    """Names of the cameras."""
    period: float
    """Time between frames, seconds."""

    def corrected(self, frames: Iterable[Detections]) -> tuple[Detections, ...]:
        """Return the frames with the corrected times of their pictures; detections stay as they are.

        The tracker reads the times. A method of single frames takes detections of a frame as those of one time:
        :func:`mvpose.calibration.repaired_pipeline.resampled` moves them there.
        """
        return tuple(replace(each, time=times) for each, times in zip(frames, self.times, strict=True))

    def findings(self) -> tuple[Finding, ...]:
        """Return what is wrong with clocks and the order of pictures."""
        return (*self._offset_findings(), *self._dropped_findings(), *self._repeated_findings())

    def _offset_findings(self) -> Iterable[Finding]:
        for view, name in enumerate(self.names):
            ms, (low, high) = 1e3 * self.offsets[view], 1e3 * self.interval[view]
            if not self.determined[view]:
                text = (
                    f"the clock of {name} is not determined: people move too little where other cameras see them, too"
                )
                mend = "record ten seconds of a person who walks where this camera and two others see them"
                yield Finding("clock-offset", text, "unknown", 0.5, name, view, mend=mend)
                continue
            if low <= 0.0 <= high:
                continue
            deviation = max((high - low) / 2 / norm.ppf((1 + _SHARE) / 2), 1e-6)
            harmful = ALARM["ms"]
            probability = norm.sf((harmful - ms) / deviation) + norm.cdf((-harmful - ms) / deviation)
            late, cost = "later" if ms > 0 else "earlier", float(probability * _TYPICAL_SPEED * abs(ms) / 1e3)
            yield Finding(
                "clock-offset", f"{name} takes its pictures {abs(ms):.1f} ms {late} than their time stamps",
                "alarm" if max(low, -high) > harmful else "note", float(probability), name, view, {"ms": float(ms)},
                {"ms": (float(low), float(high))}, cost, repair=(NEW_TIMES, "TIMES"),
            )  # fmt: skip

    def _dropped_findings(self) -> Iterable[Finding]:
        for step in self.steps:
            name, count = self.names[step.view], abs(step.frames)
            lost = "misses" if step.frames > 0 else "has"
            kind = "dropped-pictures" if step.frames > 0 else "repeated-pictures"
            text = f"{name} {lost} {count} picture{'s' * (count > 1)} {'too many ' * (step.frames < 0)}at "
            text += f"{step.time:.2f} s: all later ones belong to {'later' if step.frames > 0 else 'earlier'} frames"
            yield Finding(
                kind, text, "alarm", float(1.0 - 2.0 * norm.sf(step.deviations)), name, step.view,
                {"pictures": float(count), "since_s": step.time}, cost=_TYPICAL_SPEED * count * self.period,
                repair=(NEW_TIMES, "TIMES"),
            )  # fmt: skip

    def _repeated_findings(self) -> Iterable[Finding]:
        for view, name in enumerate(self.names):
            count = int(self.repeated[:, view].sum())
            if not count:
                continue
            share = count / max(int(np.isfinite(self.times[:, view]).sum()), 1)
            text = f"{name} delivers the same picture again in {count} frames ({100 * share:.1f} %)"
            size, cost = {"pictures": float(count), "percent": 100 * share}, _TYPICAL_SPEED * self.period * share
            severity: Severity = "alarm" if share > 0.01 else "note"
            repair = (NEW_TIMES, "TIMES")
            yield Finding("repeated-pictures", text, severity, 1.0, name, view, size, cost=cost, repair=repair)


def estimate_clocks(rig: Rig, recording: Sequence[Detections] | Sightings, *, period: float = 0.04) -> Clocks:
    """Return the clocks of the cameras; ten seconds of people who walk are enough.

    Of a long recording the 3000 frames in a row with most people are taken; pictures that were lost before or after are
    not found.

    Args:
        rig: the calibrated cameras; it may be off by a few degrees.
        recording: detections of each frame in the order of time, or what :func:`.sightings.gather` makes of them.
        period: time between frames whose detections carry no times, seconds.
    """
    sightings = recording if isinstance(recording, Sightings) else gather(rig, recording, period=period)
    repeated = repeated_pictures(sightings)
    part, first = _busiest(sightings)
    tracks = ImageTracks.of_sightings(rig, part, without=repeated[first : first + len(part.times)])
    names = camera_names(rig)
    if (np.isfinite(tracks.points[..., 0]).sum(axis=1) >= 2).sum() < _FEWEST:
        return _unknown(names, repeated, sightings.times, tracks.period)
    adjustment = adjust(rig, tracks, coarse_offsets(rig, tracks))
    steps: list[ClockStep] = []
    # Residuals of offsets that do not settle come from other people or wrong cameras, not from lost pictures.
    while len(steps) < _MOST_STEPS and adjustment.settled:
        step = find_step(adjustment, tracks.times, tracks.period)
        if step is None:
            break
        steps.append(replace(step, frame=first + step.frame))
        times = tracks.times.copy()
        times[step.frame :, step.view] += step.frames * tracks.period
        tracks = replace(tracks, times=times)
        adjustment = adjust(rig, tracks, adjustment.offsets)
    found = joined_steps(steps, within=round(_ONE_LOSS / tracks.period))
    corrected = sightings.times.copy()
    for step in found:
        corrected[step.frame :, step.view] += step.frames * tracks.period
    return _clocks(names, adjustment, found, repeated, corrected, tracks.period)


def _busiest(sightings: Sightings) -> tuple[Sightings, int]:
    """Return the sightings of the frames in a row with most of them, numbered from 0, and the first of these frames."""
    frames = len(sightings.times)
    if frames <= _MOST_FRAMES:
        return sightings, 0
    total = np.cumsum(np.append(0, np.bincount(sightings.frame, minlength=frames)))
    first = int((total[_MOST_FRAMES:] - total[:-_MOST_FRAMES]).argmax())
    inside = sightings.select((sightings.frame >= first) & (sightings.frame < first + _MOST_FRAMES))
    return replace(inside, frame=inside.frame - first, times=inside.times[first : first + _MOST_FRAMES]), first


def _clocks(
    names: tuple[str, ...],
    adjustment: ClockAdjustment,
    steps: tuple[ClockStep, ...],
    repeated: Bools,
    times: Floats,
    period: float,
) -> Clocks:
    """Return the clocks of an adjustment, with ``times`` (F, V) of the pictures from which steps are taken out."""
    views = len(names)
    noise = np.maximum(adjustment.motion, _STILL)
    deviations = adjustment.deviations / noise
    floor = np.hypot(_FLOOR, _SLOW_SHARE * max(0.0, period - _SLOW))
    covariance = deviations.T @ deviations + floor**2 * np.eye(views)
    mean = np.eye(views) - 1.0 / views
    known = (adjustment.motion > _STILL) & (
        _half_widths(deviations, covariance, mean) < max(_VAGUE, _VAGUE_FRAMES * period)
    )
    if known.sum() < 2:
        return _unknown(names, repeated, times, period)
    reference = _reference(adjustment.offsets, covariance, known)
    against = np.eye(views)
    against[:, reference] -= 1.0 / len(reference)
    offsets, covariance = against @ adjustment.offsets, against @ covariance @ against.T
    halves = _half_widths(deviations, covariance, against)
    offsets = np.where(known, offsets, 0.0)
    halves[~known] = np.inf
    covariance[~known] = covariance[:, ~known] = 0.0
    covariance[~known, ~known] = np.inf
    corrected = np.where(np.isfinite(times), np.fmax.accumulate(times + offsets, axis=0), np.nan)
    for frame in range(1, len(times)):
        corrected[frame] = np.where(repeated[frame], corrected[frame - 1], corrected[frame])
    return Clocks(
        offsets=offsets,
        interval=np.stack([offsets - halves, offsets + halves], axis=1),
        covariance=covariance,
        determined=known,
        reference=tuple(reference.tolist()),
        steps=steps,
        repeated=repeated,
        times=corrected,
        names=names,
        period=period,
    )


def _unknown(names: tuple[str, ...], repeated: Bools, times: Floats, period: float) -> Clocks:
    """Return clocks of which nothing is known."""
    views = len(names)
    interval = np.tile([-np.inf, np.inf], (views, 1))
    covariance = np.where(np.eye(views) > 0, np.inf, 0.0)
    determined = np.zeros(views, np.bool_)
    return Clocks(np.zeros(views), interval, covariance, determined, (), (), repeated, times, names, period)


def _half_widths(deviations: Floats, covariance: Floats, against: Floats) -> Floats:
    """Return half the width of the interval of each offset, (V,), seconds.

    The quantile is that of Student's t: a variance that rests on few people and seconds is uncertain itself, with the
    degrees of freedom of Satterthwaite (Biometrics Bulletin 1946).
    """
    squares = (deviations @ against.T) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = np.fmax(squares.sum(axis=0) ** 2 / (squares**2).sum(axis=0), 1.0)
    return student.ppf((1.0 + _SHARE) / 2.0, freedom) * np.sqrt(np.diag(covariance))


def _reference(offsets: Floats, covariance: Floats, known: Bools) -> Integers:
    """Return the cameras whose clocks agree with the one in the middle; all cameras, if they are fewer than half."""
    ordered = np.flatnonzero(known)[np.argsort(offsets[known], kind="stable")]
    middle = ordered[(len(ordered) - 1) // 2]
    variance = np.diag(covariance) + covariance[middle, middle] - 2.0 * covariance[middle]
    near = np.abs(offsets - offsets[middle]) <= _AGREE * np.sqrt(np.maximum(variance, 0.0))
    agreeing = np.flatnonzero(known & near)
    most = len(agreeing) > 1 and 2 * len(agreeing) >= known.sum()
    return agreeing if most else np.flatnonzero(known)
