"""Probability that a track is a person, from the cameras that see it and those that should.

A group of detections that belongs to nobody known is a person who has just come, or a ghost that false detections of a
few views make up by chance. People come at a rate of their own; ghosts are as many as the false detections of the views
allow, a number that the tracker counts. Later pictures add their evidence. A camera finds a person in most pictures,
unless something that nobody modelled hides the person in this view. It finds a ghost only where a false detection
lasts (a poster, a coat on a stand) or another one happens to lie there. Pictures that follow each other closely repeat
themselves, so they count as a fraction of an independent one, and old ones are forgotten. Views in which the track lies
outside the image, or behind another tracked person, say nothing. What lasts is found as reliably as a person, so it is
motion (:mod:`mvpose.tracking.motion`) and more views that tell people from it.

Where people stand as a camera sees them says which views count: their depth, who stands before whom, and who is in the
image.
"""

from dataclasses import dataclass, fields

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.kernels import njit
from mvpose.tracking.motion import staying

_SHORTEST, _LONGEST = 1e-3, 60.0  # seconds: people who were there before the first picture came within a minute
_DENSITY_MEMORY, _FLASH_MEMORY = 5.0, 30.0  # seconds
_FLASHES, _WEIGHT = 0.02, 10.0  # groups per second before any was met, and the seconds that this counts for
FLASH = 0.5  # seconds: a track that ends earlier was a flash
_REACH = 0.35  # metres: distance from the line of sight at which a nearer person hides another
_TURNS_BLIND = 0.1  # probability that a view which saw the person at birth is blind later: people walk behind things
_SWAY = 0.15  # metres: standard deviation of the place where false detections meet, as their keypoints have it
_FRAME = 0.1  # seconds: no group of detections that vanishes at once is older


@dataclass(frozen=True)
class Existence:
    """Model of how often people come, and how often people and ghosts are found.

    The shares of false detections that last and that move were chosen on simulated scenes with four false detections a
    view and on people who come and go, at other seeds than those of the suites and studies (200 to 203, 110, 111).

    Raises:
        ValueError: a probability that is not between 0 and 1, or another value that is not above 0.
    """

    arrivals: float = 0.1
    """People who come into the view of two cameras, per second."""
    departures: float = 0.1
    """Times that a person who is here leaves, per second."""
    found: float = 0.92
    """Probability that a person is found in a picture that can show it."""
    seeable: float = 0.85
    """Probability that a view can see a person whom no tracked person hides."""
    band: float = 0.1
    """Share of the false detections of a view that agree with a given false detection of another view: a band along the
    epipolar line."""
    patch: float = 0.03
    """Share of the false detections of a view that agree with a given place in the room."""
    lasting: float = 0.5
    """Probability that a false detection lasts longer than ``memory``."""
    repeated: float = 0.95
    """Probability that a lasting one is there in a picture: it hangs where it is well seen."""
    mobile: float = 0.1
    """Share of the lasting ones that move: shadows, reflections."""
    statues: float = 0.02
    """False detections per second that appear to several views at one place of the room, and stay."""
    least_clutter: float = 0.02
    """Least number of false detections in a picture, which a tracker starts with."""
    independent: float = 0.2
    """Time between pictures that count as independent, seconds."""
    memory: float = 3.0
    """Time after which evidence has lost 63 % of its weight, seconds."""
    vague: float = 0.5
    """Standard deviation of the position of the best-known joint, metres, above which nobody is reported."""

    def __post_init__(self) -> None:
        probabilities = ("found", "seeable", "band", "patch", "lasting", "repeated", "mobile")
        for each in fields(self):
            value, limit = getattr(self, each.name), 1.0 if each.name in probabilities else np.inf
            if not 0.0 < value < limit:
                raise ValueError(f"{each.name} of the existence model must be above 0 and below {limit:g}, got {value}")

    @property
    def rates(self) -> tuple[float, ...]:
        """Probabilities for :func:`log_odds`."""
        return (
            self.arrivals, self.statues, self.found, self.seeable, self.band, self.patch, self.lasting, self.repeated,
            self.mobile, self.memory,
        )  # fmt: skip

    @property
    def presence(self) -> tuple[float, float, float]:
        """Arguments of :func:`log_presence`."""
        return self.departures, self.found, self.seeable

    @property
    def correlation(self) -> tuple[float, float]:
        """Arguments of :func:`gather_evidence`: time between independent pictures, and memory, seconds."""
        return self.independent, self.memory

    def span(self, dt: float) -> float:
        """Return the time in which people of a new track may have come, from the time since the previous pictures."""
        return min(max(dt, _SHORTEST), _LONGEST)


@njit(cache=True, borrows=True)
def log_odds(span, origin, hits, misses, moved, clutter, flashes, rates):
    """Return the logarithm of the odds that a track is a person.

    A track is a person who came, false detections that agreed by chance, one false detection of all views at once for a
    moment (a reflection, an error that views share), or the same for long. The expected numbers of each at birth are
    those of the rates known now. False detections that last are there from picture to picture, so that those of all
    views agree anew only when one of them has just come: people whom a single view shows make no ghosts all the time.

    Args:
        span: time before its birth in which the track may have come, seconds.
        origin: whether a view was among those that the track was born from, (V,).
        hits: effective number of pictures since then that found the track, by view, (V,).
        misses: effective number that should have, (V,).
        moved: how far the track has moved since its birth, metres.
        clutter: false detections in a picture of each view, (V,).
        flashes: groups per second that vanish as soon as they come.
        rates: :attr:`Existence.rates`.
    """
    arrivals, statues, found, seeable, band, patch, lasting, repeated, mobile, memory = rates
    lasting *= staying(moved, _SWAY, mobile)
    person, statue = np.log(arrivals * span), np.log(statues * span)
    flash, chance = np.log(flashes * min(span, _FRAME)), np.log(band) - 2.0 * np.log(patch)
    born_from, all_last = 0, 1.0  # probability that all of them last, given that they agree
    for v in range(len(hits)):
        if origin[v]:
            person += np.log(found)
            chance += np.log(clutter[v] * patch)
            born_from += 1
    for v in range(len(hits)):
        h, m = hits[v], misses[v]
        stray = min(max(patch * clutter[v], 1e-3), 0.5)
        by_chance = stray**h * (1.0 - stray) ** m
        as_found = found**h * (1.0 - found) ** m
        sees = 1.0 - _TURNS_BLIND if origin[v] else seeable
        last = lasting if origin[v] else lasting * stray
        lasts, goes = last * repeated**h * (1.0 - repeated) ** m, (1.0 - last) * by_chance
        person += np.log(max(sees * as_found + (1.0 - sees) * by_chance, 1e-300))
        statue += np.log(max(sees * as_found + (1.0 - sees) * by_chance, 1e-300))
        chance += np.log(max(lasts + goes, 1e-300))
        all_last *= lasts / max(lasts + goes, 1e-300) if origin[v] else 1.0
        flash += np.log(max(by_chance, 1e-300))
    chance += np.log(max(1.0 - all_last * (1.0 - min(born_from * span / memory, 1.0)), 1e-300))
    most = max(chance, flash, statue)
    return person - most - np.log(np.exp(chance - most) + np.exp(flash - most) + np.exp(statue - most))


@njit(cache=True, borrows=True)
def log_presence(absent, since, departures, found, seeable):
    """Return the log-odds that a person is still here, and not gone since a picture last found the person.

    Args:
        absent: effective number of pictures that should have found the person since then, by view, (V,).
        since: time since then, seconds.
        departures: departures of a person who is here, per second.
        found: probability that a person is found in a picture that can show it.
        seeable: probability that a view can see a person whom no tracked person hides.
    """
    here = 0.0
    for v in range(len(absent)):
        here += np.log(seeable * (1.0 - found) ** absent[v] + 1.0 - seeable)
    return here - np.log(max(departures * since, 1e-9))


@njit(cache=True)
def gather_evidence(evidence, taken, fresh, states, owner, view, now, independent, memory):
    """Update the effective hits and misses (n, V) of tracks by the pictures of a moment, in place.

    Args:
        evidence: arrays (n, V) of the tracks: views that those born in this moment were born from (output); effective
            number of pictures that found a track; effective number that should have; those that should have since one
            last did; and the time at which each camera last did, seconds.
        taken: arrays of the cameras: :attr:`mvpose.camera.Rig.packed`, (V, 22); width and height, (V, 2), pixels;
            whether each gave a picture, (V,); and the time from its previous one, (V,), seconds.
        fresh: whether a track was born in this moment, (n,): pictures that miss it count in full, and those that it
            was born from not at all.
        states: positions and velocities, (n, J, 6).
        owner: track of each detection, (m,), or -1.
        view: camera of each detection, (m,).
        now: seconds.
        independent: time between independent pictures, seconds.
        memory: time after which pictures are forgotten, seconds.
    """
    origin, hits, misses, absent, last = evidence
    cameras, sizes, pictures, since = taken
    n, views = hits.shape
    centers, depth = np.zeros((n, 3)), np.empty(n)
    for t in range(n):
        count = 0
        for j in range(states.shape[1]):
            if not np.isnan(states[t, j, 0]):
                count += 1
                for r in range(3):
                    centers[t, r] += states[t, j, r]
        for r in range(3):
            centers[t, r] /= max(count, 1)
    found, seen = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for d in range(len(owner)):
        if owner[d] >= 0:
            seen[owner[d]] = True
            absent[owner[d]] = 0.0
            last[owner[d], view[d]] = now
    for v in range(views):
        found[:] = False
        for d in range(len(owner)):
            if view[d] == v and owner[d] >= 0:
                found[owner[d]] = True
        camera, step, keep = cameras[v], min(since[v] / independent, 1.0), np.exp(-since[v] / memory)
        for t in range(n):
            depth[t] = depth_of(camera, centers[t])
        for t in range(n):
            if not found[t] and not (pictures[v] and in_image(camera, sizes[v], states[t])):
                continue
            if not found[t]:
                hidden = False
                for other in range(n):
                    hidden = hidden or (
                        other != t and found[other] and 0.0 < depth[other] < depth[t]
                        and beside(camera, centers[t], centers[other]) < _REACH
                    )  # fmt: skip
                if hidden:
                    continue
            hits[t, v] *= keep
            misses[t, v] *= keep
            weight = 1.0 if fresh[t] else step
            if found[t] and fresh[t]:
                origin[t, v] = True
            elif found[t]:
                hits[t, v] += weight
            else:
                misses[t, v] += weight
                absent[t, v] += 0.0 if seen[t] else step


class MeasuredClutter:
    """False detections that a tracker has met: how many there are in a picture of each view, and how many flash.

    Attributes:
        density: false detections in a picture of each view, (V,), a mean over the latest seconds.
        watched: time that the mean is over, (V,), seconds; before the first picture that of the low number with which
            it starts.
        counts: weighted number of groups that vanished as soon as they came, and of seconds, (2,).
    """

    def __init__(self, model: Existence, cameras: int) -> None:
        self._least, self._first = model.least_clutter, model.independent
        self.density = np.full(cameras, model.least_clutter)
        self.watched = np.full(cameras, model.independent)
        self.counts = np.array([_FLASHES * _WEIGHT, _WEIGHT])

    @property
    def flashes(self) -> float:
        """Groups of detections that vanish as soon as they come, per second.

        The mean of a gamma distribution that starts with a low rate and the weight of ten seconds.
        """
        return float(self.counts[0] / self.counts[1])

    def count(self, unclaimed: Floats, pictures: Bools, since: Floats, elapsed: float) -> None:
        """Count the expected number of false detections (V,) of a frame.

        Args:
            unclaimed: expected numbers, (V,).
            pictures: whether each camera gave a picture, (V,).
            since: time from the previous picture of each camera, (V,), seconds; infinite for its first, which counts
                as one independent picture.
            elapsed: time since the previous frame, seconds.
        """
        _count(
            self.density, self.watched, self.counts, unclaimed, pictures, since, self._least, self._first, elapsed
        )  # fmt: skip

    def vanish(self, ages: Floats) -> None:
        """Count the tracks that ended at these ages, in seconds."""
        self.counts[0] += float((ages < FLASH).sum())


@njit(cache=True)
def _count(density, watched, counts, unclaimed, pictures, since, least, first, elapsed):
    keep = np.exp(-elapsed / _FLASH_MEMORY)
    for v in range(len(density)):
        if pictures[v]:
            # A plain mean until it is over the memory, so that a scene full of false detections is known at once.
            seconds = since[v] if since[v] < np.inf else first
            share = 1.0 - np.exp(-seconds / min(watched[v] + seconds, _DENSITY_MEMORY))
            density[v] = max((1.0 - share) * density[v] + share * unclaimed[v], least)
            watched[v] = min(watched[v] + seconds, _DENSITY_MEMORY)
    counts[0] = keep * counts[0] + (1.0 - keep) * _FLASHES * _WEIGHT
    counts[1] = keep * counts[1] + (1.0 - keep) * _WEIGHT + min(elapsed, FLASH)  # a gap shows no flashes


@njit(cache=True, borrows=True)
def depth_of(camera, point):
    """Return the distance of a point along the optical axis."""
    depth = 0.0
    for r in range(3):
        depth += camera[11 + r] * (point[r] - camera[14 + r])
    return depth


@njit(cache=True, borrows=True)
def beside(camera, point, nearer):
    """Return the distance of a nearer point from the line of sight to a point."""
    square, along, reach = 0.0, 0.0, 0.0
    for r in range(3):
        a, b = point[r] - camera[14 + r], nearer[r] - camera[14 + r]
        reach += a * a
        along += a * b
        square += b * b
    return np.sqrt(max(square - along * along / max(reach, 1e-12), 0.0))


@njit(cache=True, borrows=True)
def in_image(camera, size, state):
    """Return whether most joints of a person lie in the image; distortion is left out."""
    inside, known = 0, 0
    for j in range(len(state)):
        if np.isnan(state[j, 0]):
            continue
        known += 1
        z = depth_of(camera, state[j])
        if z <= 0.0:
            continue
        x, y = 0.0, 0.0
        for r in range(3):
            offset = state[j, r] - camera[14 + r]
            x += camera[5 + r] * offset
            y += camera[8 + r] * offset
        u, v = camera[0] * x / z + camera[1] * y / z + camera[2], camera[3] * y / z + camera[4]
        inside += (0.0 <= u < size[0]) and (0.0 <= v < size[1])
    return 2 * inside > known
