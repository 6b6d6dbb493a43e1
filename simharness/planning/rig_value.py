"""Value of a set of cameras in tenths of a millisecond, for a search that asks a million times.

What a camera sees of the joints of everyone comes from the fast layer (:mod:`.fast_layer`). What the detector makes of
it counts by its probabilities (:class:`SightingOdds`) in place of single draws, so that a camera moved by a centimetre
has nearly the same value: a search would otherwise climb the noise. A joint is placed where two cameras or more report
it rightly; its expected error follows from the information of the rays, and a part of the body is correct if the
errors at its ends are below half of its length (PCP, alpha = 0.5). Matching is taken to be right: the best sets of a
search are judged again by the fast layer with the method itself, and then by the simulator.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.kernels import njit
from simharness.planning.camera_terms import keypoint_deviation
from simharness.planning.candidates import Candidate
from simharness.planning.fast_layer import FastLayer
from simharness.planning.planned_room import Room
from simharness.planning.visibility import see
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.views import Views, Visibility

_JOINTS = np.array([0, 3, 4, *range(5, 17)])  # nose, ears, and shoulders to ankles of COCO-17
# Parts of PCP by indices into _JOINTS; a part of the head is correct if any of its joints is, all others need all.
_PARTS = np.array(
    [
        [3, 5, -1, -1], [4, 6, -1, -1], [5, 7, -1, -1], [6, 8, -1, -1],  # upper and lower arms
        [9, 11, -1, -1], [10, 12, -1, -1], [11, 13, -1, -1], [12, 14, -1, -1],  # upper and lower legs
        [3, 4, 9, 10], [0, 1, 2, -1],  # torso, head
    ]
)  # fmt: skip
_TORSO = 8  # index of the first part that is no limb
_HEAD_LENGTH = 0.3  # metres: from the chin to the top of the head
_SHARPNESS = (1.5, 4.0)  # PCP and mm over which the share of places within the target falls, for the search
_LOWEST = 0.1  # of the places: "worst" is their mean in the search
_MEAN, _SEEN, _WHOLE = 0.05, 0.5, 0.05  # weights of what guides the search where the objective itself is flat
_DIM, _SPARE = 0.8, 0.05  # share of its sightings that a doubtful camera makes, and weight of the value with such ones
_EVERY = 3  # of so many people one is looked at for that value: it needs no more, and a search is twice as fast
_FALSE = 0.1  # metres across the ray: farther keypoints are false, as are guesses at hidden joints
_BINS = np.array([0.25, 0.5, 0.75, 0.95])  # of the share of a person's joints that the camera sees
_PRIOR = 4.0  # sightings: weight of the odds over all bins, and over all joints, where there are few

ERROR = 2.0
"""Points off the objective for an error as large as the target, and in proportion for smaller ones."""


@dataclass(frozen=True)
class SightingOdds:
    """Odds of sightings.

    Attributes:
        right, false: probability that a joint is reported rightly, or falsely, by joint, visibility and bin of the
            visible share of the person, (17, V, B).
        detector: the detector.
        sightings: number of right reports that were counted.
    """

    right: Floats
    false: Floats
    detector: DetectorSection
    sightings: int = 0

    @classmethod
    def measure(cls, layer: FastLayer, cameras: Sequence[Camera]) -> "SightingOdds":
        """Return the odds of the layer's detector, counted over its draws in some cameras."""
        shape = (17, len(Visibility), len(_BINS) + 1)
        counts = np.zeros((3, *shape))
        for camera in cameras:
            terms, views = layer.terms(camera), see(camera, layer.scenes, layer.obstacles)
            people = layer.scenes.people
            joints = np.broadcast_to(np.arange(17), terms.reported.shape)
            here = np.broadcast_to(layer.scenes.present[..., None], terms.reported.shape)
            cells = tuple(each[here] for each in (joints, views.visibility[:, 0], _bins(views)))
            keypoints = terms.block.keypoints[:, 0, :people]
            away = np.linalg.norm(keypoints - camera.project(layer.scenes.joints), axis=-1)
            metres = camera.depth(layer.scenes.joints) / camera.K[0, 0]
            with np.errstate(invalid="ignore"):
                right = terms.reported & (away * metres <= np.maximum(_FALSE, 3.0 * terms.deviation * metres))
            for count, chosen in zip(counts, (right, terms.reported & ~right, here), strict=True):
                np.add.at(count, cells, chosen[here])
        return cls(_shrunk(counts[0], counts[2]), _shrunk(counts[1], counts[2]), layer.detector, int(counts[0].sum()))

    def in_camera(self, views: Views, camera: Camera) -> tuple[Floats, Floats, Floats]:
        """Return the odds of right and of false reports, and the deviation of right ones, pixels, all (S, Q, 17)."""
        state, bins, joints = views.visibility[:, 0], _bins(views), np.arange(17)
        pictured = views.boxes[:, 0, :, 2:].min(axis=-1, keepdims=True) > 0  # nobody else is ever reported
        right, false = (np.where(pictured, odds[joints, state, bins], 0.0) for odds in (self.right, self.false))
        return right, false, keypoint_deviation(self.detector, views)


@dataclass(frozen=True)
class Maps:
    """Expected figures of a set of cameras at P places."""

    pcp: Floats
    """Percentage of correct parts, (P,)."""
    error_mm: Floats
    """Expected error of the joints that are placed, millimetres, (P,); NaN where none is."""
    seen: Floats
    """Mean over joints of the probability of two right sightings or more, and half of that of one, (P,)."""


@dataclass(frozen=True)
class Correction:
    """Correction of the figures to those of the method on the same scenes.

    Attributes:
        gain, power: the percentage of wrong parts is ``gain`` times its ``power``-th power.
        error: factor of the errors.
    """

    gain: float = 1.0
    power: float = 1.0
    error: float = 1.0

    def corrected(self, maps: Maps) -> Maps:
        """Return corrected figures."""
        lost = np.minimum(self.gain * np.maximum(100.0 - maps.pcp, 0.0) ** self.power, 100.0)
        return Maps(100.0 - lost, self.error * maps.error_mm, maps.seen)


class RigValue:
    """Value of sets of cameras in a room.

    Args:
        room: the room.
        layer: fast layer of its volume; a coarse one suffices.
        odds: probabilities of sightings.
        correction: correction of the figures.
    """

    def __init__(
        self, room: Room, layer: FastLayer, odds: SightingOdds, *, correction: Correction | None = None
    ) -> None:
        self.room, self.layer, self.odds = room, layer, odds
        self._correction = correction or Correction()
        scenes = layer.scenes
        self._present = scenes.present.ravel()
        self._joints = np.ascontiguousarray(scenes.joints.reshape(-1, 17, 3)[self._present][:, _JOINTS])
        self._place = np.ascontiguousarray(scenes.place.ravel()[self._present])
        self._lengths = _lengths(self._joints)

    def terms(self, candidate: Candidate) -> Floats:
        """Return what a camera contributes, see :meth:`terms_of`."""
        return self.terms_of(candidate.camera(self.room, name="candidate"))

    def terms_of(self, camera: Camera) -> Floats:
        """Return what a camera contributes to J joints of M people, (M, J, 6) float32.

        They are the direction of the ray, its information where it is right (1/m²), and the probabilities that the
        joint is reported rightly, and falsely.
        """
        views = see(camera, self.layer.scenes, self.layer.obstacles)
        right, false, deviation = (
            each.reshape(-1, 17)[self._present][:, _JOINTS] for each in self.odds.in_camera(views, camera)
        )
        ways = self._joints - camera.center
        distance = np.linalg.norm(ways, axis=-1)
        metres = distance / camera.K[0, 0]  # across the ray, of one pixel
        result = np.empty((*distance.shape, 6), np.float32)
        result[..., :3] = ways / distance[..., None]
        result[..., 3] = 1.0 / np.maximum(deviation * metres, 1e-3) ** 2
        result[..., 4], result[..., 5] = right, false
        return result

    def maps(self, terms: Sequence[Floats]) -> Maps:
        """Return the figures of a set of cameras."""
        return self._maps(self._sum(terms), self._nothing)

    def value(self, terms: Sequence[Floats]) -> float:
        """Return the value of a set."""
        return float(self.values_with(terms, [self._nothing])[0])

    def values_with(self, terms: Sequence[Floats], others: Sequence[Floats]) -> Floats:
        """Return the value of a set with each of other cameras added, (n,).

        The value with doubtful cameras, each of which makes a part of its sightings, counts a little: of sets that all
        reach the target, the one is better that has cameras to spare everywhere.
        """
        whole = self._states(terms)
        values = np.array([self._with(whole, other) for other in others])
        failing = self.room.keys.objective.failing
        if not failing:
            return values
        count = len(terms)
        worst = np.full(len(others), np.inf)
        for lost in combinations(range(count), min(failing, count)):
            rest = self._states([terms[k] for k in range(count) if k not in lost])
            for k, other in enumerate(others):
                worst[k] = min(worst[k], self._with(rest, other))
        for lost in combinations(range(count), min(failing - 1, count)):
            rest = self._states([terms[k] for k in range(count) if k not in lost])
            alone = self._with(rest, self._nothing)
            for k, other in enumerate(others):
                if other is not self._nothing:
                    worst[k] = min(worst[k], alone)
        return worst + _WHOLE * values

    @cached_property
    def _nothing(self) -> Floats:
        return np.zeros((len(self._joints), len(_JOINTS), 6), np.float32)

    def _sum(self, terms: Sequence[Floats], *, every: int = 1) -> Floats:
        """Return the state of all joints with some cameras, (m, J, 10), of everybody or of some people."""
        state = np.zeros((len(self._place[::every]), len(_JOINTS), 10))
        state[..., 6] = 1.0
        for each in terms:
            _add(each, state)
        return state

    def _states(self, terms: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Return the state of all joints with some cameras, and with the same cameras where they are doubtful."""
        return self._sum(terms), self._sum([_dimmed(each) for each in terms], every=_EVERY)

    def _with(self, states: tuple[Floats, Floats], more: Floats) -> float:
        """Return the value of states with one more camera."""
        whole, dim = self._maps(states[0], more), self._maps(states[1], _dimmed(more), every=_EVERY)
        return self._valued(whole) + _SPARE * self._valued(dim)

    def _maps(self, state: Floats, more: Floats, *, every: int = 1) -> Maps:
        sums = np.zeros((len(self.layer.places), 5))
        place, lengths = (np.ascontiguousarray(each[::every]) for each in (self._place, self._lengths))
        _evaluate(state, more, place, lengths, _PARTS, sums)
        people = np.maximum(sums[:, 4], 1.0)
        error = np.divide(1000.0 * sums[:, 1], sums[:, 2], out=np.full(len(sums), np.nan), where=sums[:, 2] > 0)
        known = sums[:, 4] > 0
        maps = Maps((100.0 * sums[:, 0] / people)[known], error[known], (sums[:, 3] / people)[known])
        return self._correction.corrected(maps)

    def _valued(self, maps: Maps) -> float:
        """Return the objective, 0 to 100, and a little of what guides the search where it is flat."""
        kind, target = self.room.keys.objective.kind, self.room.keys.target
        mean = float(maps.pcp.mean())
        error = np.where(np.isfinite(maps.error_mm), maps.error_mm, 1e3)
        if kind == "mean":
            main = mean
        elif kind == "worst":
            main = float(np.sort(maps.pcp)[: max(1, round(_LOWEST * len(maps.pcp)))].mean())
        else:
            within = _sigmoid((maps.pcp - target.pcp) / _SHARPNESS[0]) * _sigmoid(
                (target.error - error) / _SHARPNESS[1]
            )
            main = 100.0 * float(within.mean())
        off = ERROR * float(np.minimum(error / target.error, 1.0).mean())
        return main + _MEAN * mean + _SEEN * float(maps.seen.mean()) - off


def _dimmed(terms: Floats) -> Floats:
    """Return the contribution of a camera (M, J, 6) that makes a part of its sightings, for some people."""
    return terms[::_EVERY] * np.array([1, 1, 1, 1, _DIM, _DIM], np.float32)


def _bins(views: Views) -> np.ndarray:
    """Return the bin of the share of each person's joints that is visible, repeated for the joints, (S, Q, 17)."""
    state = views.visibility[:, 0]
    share = ((state == Visibility.VISIBLE) | (state == Visibility.SELF_OCCLUDED)).mean(axis=-1)
    return np.broadcast_to(np.searchsorted(_BINS, share)[..., None], state.shape)


def _shrunk(hits: Floats, trials: Floats) -> Floats:
    """Return shares of hits by cell, (17, V, B), drawn towards those of all joints where there are few trials."""
    hit, tried = hits.sum(axis=(0, 2)), trials.sum(axis=(0, 2))
    share = np.divide(hit, tried, out=np.zeros(hit.shape), where=tried > 0)
    over_joints = (hits.sum(axis=0) + _PRIOR * share[:, None]) / (trials.sum(axis=0) + _PRIOR)
    return (hits + _PRIOR * over_joints) / (trials + _PRIOR)


def _sigmoid(x: Floats) -> Floats:
    return 1.0 / (1.0 + np.exp(-np.clip(x, -50.0, 50.0)))


def _lengths(joints: Floats) -> Floats:
    """Return the lengths of the parts (M, 10) of people (M, 15, 3), metres."""
    ends = np.stack([np.linalg.norm(joints[:, a] - joints[:, b], axis=-1) for a, b in _PARTS[:_TORSO, :2]], axis=1)
    torso = np.linalg.norm(joints[:, [3, 4]].mean(axis=1) - joints[:, [9, 10]].mean(axis=1), axis=-1)
    return np.column_stack([ends, torso, np.full(len(joints), _HEAD_LENGTH)])


@njit(cache=True)
def _add(terms, state):
    """Add the sightings of one camera (M, J, 6) to the state (M, J, 10) of all joints."""
    for m in range(terms.shape[0]):
        for j in range(terms.shape[1]):
            _add_ray(terms[m, j], state[m, j])


@njit(cache=True)
def _add_ray(ray, state):
    """Add a sighting to the state of a joint.

    The state is the expected information (xx, yy, zz, xy, xz, yz), the probabilities of no and of one right sighting,
    and the expected numbers of right and of false ones.
    """
    right = ray[4]
    if right > 0:
        weight = right * ray[3]
        x, y, z = ray[0], ray[1], ray[2]
        state[0] += weight * (1 - x * x)
        state[1] += weight * (1 - y * y)
        state[2] += weight * (1 - z * z)
        state[3] -= weight * x * y
        state[4] -= weight * x * z
        state[5] -= weight * y * z
        state[7] = state[7] * (1 - right) + state[6] * right
        state[6] *= 1 - right
    state[8] += right
    state[9] += ray[5]


@njit(cache=True)
def _evaluate(state, more, place, lengths, parts, sums):
    """Add PCP, error, weight of the errors, sightings and people at each place to sums (P, 5)."""
    count = more.shape[1]
    joint = np.empty(10)
    error, placed = np.empty(count), np.empty(count)
    for m in range(more.shape[0]):
        here = sums[place[m]]
        for j in range(count):
            joint[:] = state[m, j]
            _add_ray(more[m, j], joint)
            here[3] += (1.0 - joint[6] - 0.5 * joint[7]) / count
            error[j] = _error(joint)
            placed[j] = 0.0
            if error[j] < 1.0:
                two = max(1.0 - joint[6] - joint[7], 0.0)
                placed[j] = two * (1.0 - (joint[9] / (joint[8] + joint[9])) ** 2)
                here[1] += placed[j] * error[j]
                here[2] += placed[j]
        for p in range(parts.shape[0]):
            chance, best, mean, ends = 1.0, 0.0, 0.0, 0
            for k in range(parts.shape[1]):
                j = parts[p, k]
                if j >= 0:
                    chance, best = chance * placed[j], max(best, placed[j])
                    mean += min(error[j], 1.0)
                    ends += 1
            if p == parts.shape[0] - 1:
                chance = best
            here[0] += chance / (1.0 + (mean / ends / (0.5 * lengths[m, p])) ** 6) / parts.shape[0]
        here[4] += 1.0


@njit(cache=True)
def _error(a):
    """Return the root of the trace of the inverse of information (xx, yy, zz, xy, xz, yz), metres; inf if singular."""
    xx, yy, zz, xy, xz, yz = a[0], a[1], a[2], a[3], a[4], a[5]
    one, two, three = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    determinant = xx * one - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    trace = xx + yy + zz
    if determinant <= 1e-7 * trace**3:  # nearly parallel rays
        return np.inf
    return np.sqrt((one + two + three) / determinant)
