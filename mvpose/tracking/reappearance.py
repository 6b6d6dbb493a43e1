"""People whom a tracker knows, those whom it follows and lost ones, and the identities of those who come back.

What tracked people look like, and how much it says about who has come back.

A track keeps the mean of the unit descriptors of its detections. The inner product of two means is the mean cosine over
all pairs of their detections, so distances have the scale of :class:`mvpose.affinity.AppearanceAffinity` for single
pairs, however many detections there are. As in :class:`mvpose.affinity.FusedAffinity`, the distance that counts as
large depends on the people: where somebody else, who was seen at the same time, looks as much like a person as that
person does, appearance says nothing.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import check_numbers
from mvpose.kernels import njit
from mvpose.tracking.motion import MotionModel, transition
from mvpose.tracking.tracks import Tracks

_MEMORY = 60.0  # seconds that a mean covers: in a minute people show all their sides
_HEIGHT = 0.2  # metres: standard deviation of a change of the height of a trunk, that of half of those who sit down
_SIZE = 0.05  # standard deviation of the logarithm of the size of a body as one pose shows it
_LONGEST = 1.0  # seconds for which one frame counts at most


def scale_of(affinity: object) -> AppearanceAffinity:
    """Return the scale of descriptor distances of an affinity; the general one if it has none."""
    for each in (affinity, getattr(affinity, "appearance", None)):
        if isinstance(each, AppearanceAffinity):
            return each
    return AppearanceAffinity()


@njit(cache=True)
def learn_looks(looks, described, owner, descriptors, elapsed):
    """Update what n tracks look like by the descriptors of m detections, in place; return their number, (n,).

    Args:
        looks: mean unit descriptors, (n, D).
        described: seconds that each mean covers, (n,).
        owner: track of each detection, (m,), or -1.
        descriptors: of any length, (m, D); NaN or zero for none.
        elapsed: seconds since the previous frame.
    """
    n, dimensions = looks.shape
    sums, count = np.zeros((n, dimensions)), np.zeros(n, np.int64)
    for d in range(len(owner)):
        square = 0.0
        for k in range(dimensions):
            square += descriptors[d, k] * descriptors[d, k]
        if owner[d] >= 0 and 0.0 < square < np.inf:
            count[owner[d]] += 1
            for k in range(dimensions):
                sums[owner[d], k] += descriptors[d, k] / np.sqrt(square)
    weight = min(max(elapsed, 1e-3), _LONGEST)
    for t in range(n):
        if count[t]:
            share = weight / (described[t] + weight)
            described[t] = min(described[t] + weight, _MEMORY)
            for k in range(dimensions):
                looks[t, k] += share * (sums[t, k] / count[t] - looks[t, k])
    return count


@njit(cache=True)
def look_distances(one, other):
    """Return the distances (n, k) of unit vectors whose cosines are those of means (n, D) and (k, D)."""
    distance = np.empty((len(one), len(other)))
    for i in range(len(one)):
        for k in range(len(other)):
            cosine = 0.0
            for d in range(one.shape[1]):
                cosine += one[i, d] * other[k, d]
            distance[i, k] = np.sqrt(max(2.0 - 2.0 * cosine, 0.0))
    return distance


def nearest_rival(tracks: Tracks, others: Tracks) -> Floats:
    """Return the least distance of each track (n,) to one of the others who was there at the same time.

    Only tracks that were people count, because the detections of a ghost may be torn from a person's. Infinite where
    there is none.
    """
    if not len(tracks) or not len(others) or not tracks.looks.shape[1]:
        return np.full(len(tracks), np.inf)
    together = (others.born_at < tracks.seen[:, None]) & (tracks.born_at[:, None] < others.seen)
    counts = others.reported & (others.described > 0.0) & (others.ids != tracks.ids[:, None])
    distance = look_distances(tracks.looks, others.looks)
    return np.where(together & counts, distance, np.inf).min(axis=1)


def evidence_of_looks(
    born: Tracks, lost: Tracks, present: Tracks, witnesses: Integers, scale: AppearanceAffinity
) -> Floats:
    """Return the log-likelihood ratio of being the same person and somebody new, (n, k); 0 where nothing is known.

    Args:
        born: n new tracks.
        lost: k lost ones.
        present: people who are followed, none of whom is a new or a lost one.
        witnesses: descriptors of each new track, (n,). The views show the same clothes, so the evidence grows with the
            root of their number.
        scale: scale of descriptor distances.
    """
    if not len(born) or not len(lost) or not born.looks.shape[1]:
        return np.zeros((len(born), len(lost)))
    distance = look_distances(born.looks, lost.looks)
    rival = np.minimum(lost.rival, nearest_rival(lost, present))[None, :]
    here = present.reported & (present.described > 0.0)
    for others, counts in ((present.looks, here), (born.looks, born.described > 0.0)):
        away = np.where(counts, look_distances(born.looks, others), np.inf)
        if others is born.looks:
            np.fill_diagonal(away, np.inf)
        rival = np.minimum(rival, away.min(axis=1, initial=np.inf)[:, None])
    middle = scale.midpoint
    nats = np.maximum(np.minimum(rival, middle) - distance, 0.0) - np.maximum(np.minimum(distance, rival) - middle, 0.0)
    known = (born.described > 0.0)[:, None] & (lost.described > 0.0)
    return np.where(known, nats / scale.slope * np.sqrt(witnesses)[:, None], 0.0)


@dataclass(frozen=True)
class Reappearance:
    """Model of where people who were lost come back, and of how they look then.

    The trunk of a person who is lost moves on as the motion model says, a random walk after a while. Somebody who
    appears is taken for the lost person whom that motion and the size of the body make likeliest, jointly for all who
    are not yet known for certain, one to one, unless it is likelier that somebody new has come: lost people come back
    at a rate of their own, near the place that the motion predicts, and new ones at another, anywhere in the room.
    Where detections carry descriptors, the likelihood of the looks (:func:`evidence_of_looks`) counts as well. It
    alone decides when the place says nothing more, and only if it outweighs the chance that somebody new is seen.

    Raises:
        ValueError: a value that is not above 0.
    """

    memory: float = 10.0
    """Time after which the place of a lost person says nothing more, seconds. People in a room of a few metres are
    anywhere in it after ten seconds of walking. Who has no descriptors is forgotten then."""
    gate: float = 9.0
    """Largest squared distance from the place where the person was lost, in variances of the motion model; a person
    stays within 9 in 97 of 100 cases (chi-square of three degrees of freedom)."""
    returns: float = 0.3
    """Rate at which a lost person comes back, per second: people are hidden for a few seconds."""
    arrivals: float = 0.1
    """People who come, per second, as in :class:`mvpose.tracking.existence.Existence`."""
    room: float = 50.0
    """Area in which they may appear, square metres."""
    deviation: float = 0.1
    """Standard deviation of the trunk's position in one frame, metres."""
    looks_memory: float = 600.0
    """Time after which a lost person with descriptors is forgotten, seconds. Clothes are worn for hours; but so many
    other people pass in hours that one of them looks alike, and all of them must be kept."""
    odds: float = 9.0
    """Least odds that somebody who comes after ``memory`` is one of the lost people, by their looks."""
    most: int = 200
    """Largest number of lost people who are remembered, the latest."""

    def __post_init__(self) -> None:
        names = ("memory", "gate", "returns", "arrivals", "room", "deviation", "looks_memory", "odds", "most")
        check_numbers(self, "the reappearance model", positive=names)

    def remembers(self, lost: Tracks, time: float) -> Bools:
        """Return which lost tracks may still come back, (n,)."""
        gone = time - lost.seen
        kept = gone < np.where(lost.described > 0.0, max(self.looks_memory, self.memory), self.memory)
        if kept.sum() > self.most:
            kept[np.argsort(np.where(kept, gone, np.inf), kind="stable")[self.most :]] = False
        return kept

    def match(
        self,
        born: Tracks,
        lost: Tracks,
        *,
        time: float,
        motion: MotionModel,
        trunk: Bools,
        present: Tracks,
        witnesses: Integers,
        scale: AppearanceAffinity,
    ) -> Integers:
        """Return the lost track that each new one continues, (n,); -1 for none.

        Args:
            born: n new tracks.
            lost: tracks that were lost.
            time: seconds.
            motion: motion of people.
            trunk: joints of the trunk, (J,).
            present: tracks that are followed.
            witnesses: number of descriptors of each new track, (n,).
            scale: scale of descriptor distances.
        """
        result = np.full(len(born), -1)
        if not len(lost) or not len(born):
            return result
        # Twice the negative logarithm of likelihoods; the last columns stand for nobody known.
        cost = np.full((len(born), len(lost) + len(born)), self.gate)
        here, there, gone = _center(born, trunk), _center(lost, trunk), time - lost.seen
        other_body = _other_body(here[:, None, 2] - there[:, 2], born.length, lost.length)
        looks = 2.0 * evidence_of_looks(born, lost, present, witnesses, scale)
        anywhere = gone >= self.memory
        prior = self.gate + 2.0 * np.log(self.odds * max(int(anywhere.sum()), 1))
        for k in range(len(lost)):
            variance = transition(gone[k], *motion.trunk)[2] + self.deviation**2
            way2 = ((here - there[k])[:, :2] ** 2).sum(axis=1)
            place = prior if anywhere[k] else self._place(way2, variance)
            value = place + other_body[:, k] - looks[:, k]
            cost[:, k] = np.where(value < self.gate, value, 2.0 * self.gate)
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if column < len(lost) and cost[row, column] < self.gate:
                result[row] = column
        return result

    def _place(self, distance2: Floats, variance: float) -> Floats:
        """Return twice the negative log-likelihood ratio of a return against an arrival, plus :attr:`gate`.

        A person appears on the floor: the densities are of two dimensions.

        Args:
            distance2: squared distances from the predicted place, (n,), square metres.
            variance: variance of the predicted place along an axis, square metres.
        """
        ratio = self.returns / (2.0 * np.pi * variance) / (self.arrivals / self.room)
        return distance2 / variance + self.gate - min(2.0 * np.log(ratio), self.gate)


def _other_body(change: Floats, born: Floats, lost: Floats) -> Floats:
    """Return twice the negative log-likelihood ratio of the bodies (n, k) against the same body.

    Args:
        change: changes of the height of the trunk, (n, k), metres.
        born: bone lengths of n tracks, (n, B), metres.
        lost: bone lengths of k lost ones, (k, B), metres.
    """
    size = np.log(born.sum(axis=1)[:, None] / lost.sum(axis=1)) if born.shape[1] else 0.0
    return (change / _HEIGHT) ** 2 + (size / _SIZE) ** 2


def _center(tracks: Tracks, trunk: Bools) -> Floats:
    """Return the mean of the known joints of each trunk, (n, 3); infinite where none is known."""
    joints = tracks.state[:, trunk, :3]
    known = np.isfinite(joints[..., 0])
    total = np.where(known[..., None], joints, 0.0).sum(axis=1)
    count = known.sum(axis=1)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), np.inf)


class Population:
    """Tracks that are followed, lost ones who may come back, and the number of identities so far.

    Args:
        tracks: tracks that are followed.
        lost: lost tracks.
        born: number of identities so far.
    """

    def __init__(self, tracks: Tracks, lost: Tracks, born: int = 0) -> None:
        self.tracks, self.lost, self.born = tracks, lost, born

    def see_looks(self, dimensions: int) -> None:
        """Make room for descriptors of a length, or refuse another length than before.

        Raises:
            ValueError: another length.
        """
        known = self.tracks.looks.shape[1]
        if not known:
            self.tracks, self.lost = self.tracks.widened(dimensions), self.lost.widened(dimensions)
        elif dimensions not in (0, known):
            raise ValueError(
                f"descriptors must be (m, {known}) as in earlier frames, got (m, {dimensions}): start another tracker"
            )

    def number(self, count: int) -> Integers:
        """Return new identities, (count,)."""
        self.born += count
        return np.arange(self.born - count, self.born)

    def settle(self) -> None:
        """Leave the identities of lost people to the tracks that are reported under them."""
        if len(self.lost):
            tracks, others = np.nonzero((self.tracks.ids[:, None] == self.lost.ids) & self.tracks.reported[:, None])
            if len(tracks):
                for k, other in zip(tracks.tolist(), others.tolist(), strict=True):
                    self.tracks.resume(k, self.lost, other)
                self.lost = self.lost.select(np.isin(self.lost.ids, self.lost.ids[others], invert=True))

    def keep(self, followed: Bools) -> Floats:
        """Stop to follow the other tracks, and return their times of birth; those who were people may come back."""
        tracks = self.tracks
        gone = tracks.select(~followed & tracks.reported)
        for others in (tracks, self.lost):
            gone.rival = np.minimum(gone.rival, nearest_rival(gone, others))
        self.lost, self.tracks = self.lost.join(gone), tracks.select(followed)
        return tracks.born_at[~followed]

    def forget(self, now: float, model: Reappearance) -> None:
        """Forget lost people who no longer can come back at a time in seconds."""
        if len(self.lost):
            remembered = model.remembers(self.lost, now)
            if not remembered.all():
                self.lost = self.lost.select(remembered)
