"""Who does what, where: from the people of a scenario to everyone's motion and the things that they use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.scenario.sections.scenario import People, Scenario
from simharness.types.random_streams import stream
from simharness.world.motion.contact import ContactModel, SampledBody
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop, RecordedPath, Spot, Track, rotation_2d
from simharness.world.motion.performance import Performance, Prop
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.registry import Activity, activities, solo
from simharness.world.motion.track_planning import LoopRequest, RecordedRequest, SpotRequest, TrackRequest, plan_tracks
from simharness.world.motion.trajectory import Trajectory

_PACE = (1.05, 1.25)  # steps in a room are short and quick
_GRAVITY = 9.81
_RUNNING = 0.7  # speed over sqrt(g x leg length) at which people change from walking to running
_DEEPEST = 0.01  # metres that people may be in one another who do nothing together
_BESIDE = 0.3  # metres between someone's pelvis and the ground plan of somebody else's things
_CHECKS = 3  # of motions planned at ``RATE``, every so manyth is checked for contact
_ORIGIN = Spot(place=np.zeros(2), bearing=0.0)


@dataclass(frozen=True)
class Choreography:
    """Everyone's motion in the order of the people, and the things that they use."""

    motions: tuple[Motion, ...]
    props: tuple[Prop, ...]


@dataclass(frozen=True)
class Group:
    """Those who do one activity together: one person, or two.

    Attributes:
        people: their indices.
        activity: what they do.
    """

    people: tuple[int, ...]
    activity: Activity


def choreograph(
    scenario: Scenario, cast: Sequence[Kinematics], time: Floats, *, widest: float | None = None
) -> Choreography:
    """Plan what everybody does.

    A party's draws come from the streams of its first person, so one more person changes none of the others, except
    where the whole plan starts over or where the one left over from a pair finds a partner.

    Args:
        scenario: its people, seed and duration.
        cast: the bodies, in the order of the people.
        time: seconds, (N,), the times at which motions are planned (``motion_clock``).
        widest: largest ``people.area`` that the room allows, metres: what a recorded path may use that does not fit
            into ``people.area``; None: ``people.area``.

    Raises:
        ValueError: people that do not fit, naming the keys of the scenario to change.
    """
    people = scenario.people
    known = dict(activities())
    if "mocap" in people.activities:
        known["mocap"] = _recorded(scenario)
    missing = [name for name in people.activities if name not in known]
    if missing:
        raise ValueError(f"people.activities: {missing[0]!r} is not known here; there are {', '.join(sorted(known))}")
    parties = assign_activities([known[name] for name in people.activities], people.count, spare=known["stand"])
    stage = _Stage(scenario.seed, parties, cast, time, people.spacing)
    plan_tracks(
        scenario.seed,
        stage.wishes,
        area=people.area,
        spacing=people.spacing,
        around=people.around,
        span=(float(time[0]), float(time[-1])),
        people=[party.people[0] for party in parties],
        widest=widest,
        admit=stage.admit,
    )
    return Choreography(
        motions=tuple(motion for performance in stage.performances for motion in performance.motions),
        props=tuple(prop for performance in stage.performances for prop in performance.props),
    )


def assign_activities(activities: Sequence[Activity], count: int, *, spare: Activity) -> tuple[Group, ...]:
    """Give the activities out in turn, each to as many people as it takes.

    Args:
        activities: in their order; they begin again after the last.
        count: how many people there are.
        spare: what the last one does who finds no partner.
    """
    parties: list[Group] = []
    first = 0
    while first < count:
        activity = activities[len(parties) % len(activities)]
        if first + activity.performers > count:
            activity = spare
        parties.append(Group(tuple(range(first, first + activity.performers)), activity))
        first += activity.performers
    return tuple(parties)


def roles(people: People) -> tuple[str, ...]:
    """What each person of a scenario does, by name."""
    known = dict(activities())
    known["mocap"] = replace(known["stand"], name="mocap")
    parties = assign_activities([known[name] for name in people.activities], people.count, spare=known["stand"])
    return tuple(party.activity.name for party in parties for _ in party.people)


def _recorded(scenario: Scenario) -> Activity:
    """The activity of those who move as somebody once did."""
    from simharness.world.motion.mocap import load_clip

    clip = load_clip(scenario.people.motion)

    def perform(mover: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
        return clip.perform(mover, time, place=spot.place, bearing=spot.bearing, rng=rng)

    return Activity("mocap", 1, Spot, 0.0, solo(perform))


class _Stage:
    """Where parties perform while the plan is made: whoever gets in the way of another is sent elsewhere.

    Attributes:
        wishes: what each party asks of its track.
    """

    def __init__(
        self, seed: int, parties: Sequence[Group], cast: Sequence[Kinematics], time: Floats, spacing: float
    ) -> None:
        self._parties, self._cast, self._time, self._spacing = parties, cast, time, spacing
        self._crowd = ContactModel(cast)
        self._checks = time[::_CHECKS]
        self._performing: list[partial[Performance]] = []
        self._at_origin: dict[int, Performance] = {}
        self._acts: dict[int, tuple[Performance, list[SampledBody]]] = {}  # of the parties that have a track
        self.wishes: list[TrackRequest] = []
        for index, party in enumerate(parties):
            manner = stream(seed, "people", party.people[0], "gait")
            froude, pace = manner.uniform(*party.activity.froude), manner.uniform(*_PACE)
            self._performing.append(partial(self._perform, seed, party, pace))
            self.wishes.append(self._wish(index, party.activity, cast[party.people[0]], froude))

    @property
    def performances(self) -> list[Performance]:
        """Of the parties that have a track, in their order."""
        return [self._acts[index][0] for index in sorted(self._acts)]

    def admit(self, index: int, track: Track, before: Sequence[int]) -> bool:
        """Let a party perform on its track; not where it touches one before, or is in the way of its things."""
        for party in set(self._acts) - set(before):  # of a plan that was given up
            del self._acts[party]
        if isinstance(track, Loop):
            performance = self._performing[index](track)
        else:
            spot = track.spot if isinstance(track, RecordedPath) else track
            performance = move_to(self._origin(index), spot)
        movers = zip(self._parties[index].people, performance.motions, strict=True)
        present = [self._crowd.sample(person, motion, self._checks) for person, motion in movers]
        if self._collides(performance, present):
            return False
        self._acts[index] = (performance, present)
        return True

    def _perform(self, seed: int, party: Group, pace: float, track: Track) -> Performance:
        rng = stream(seed, "people", party.people[0], "motion")  # begun anew for each track: the manner stays
        movers = [self._cast[person] for person in party.people]
        return party.activity.perform(movers, track, self._time, rng=rng, pace=pace)

    def _origin(self, index: int) -> Performance:
        """What is done on a spot is the same on every spot: it is done once, and carried there."""
        if index not in self._at_origin:
            self._at_origin[index] = self._performing[index](_ORIGIN)
        return self._at_origin[index]

    def _wish(self, index: int, activity: Activity, mover: Kinematics, froude: float) -> TrackRequest:
        if activity.name == "mocap":
            return RecordedRequest(activity.name, self._time, self._origin(index).motions[0].root[:, :2])
        if activity.track is not Loop:
            return SpotRequest(activity.name, activity.clearance, activity.performers > 1)
        unit = np.sqrt(_GRAVITY * mover.leg_length)
        slowest, fastest = (unit * limit for limit in activity.froude)
        running = activity.froude[1] > _RUNNING
        if running:
            slowest = min(slowest, unit * _RUNNING)
        return LoopRequest(activity.name, unit * froude, slowest, fastest, running)

    def _collides(self, performance: Performance, present: Sequence[SampledBody]) -> bool:
        """Whether a performance comes too near to those before it."""
        others = [presence for _, others in self._acts.values() for presence in others]
        for one in present:
            for other in others:
                apart = np.linalg.norm(one.motion.root[:, :2] - other.motion.root[:, :2], axis=1)
                if apart.min() < self._spacing or self._crowd.penetration(one, other).max() > _DEEPEST:
                    return True
        before = [prop for earlier, _ in self._acts.values() for prop in earlier.props]
        return any(obstructs(prop, one.motion) for prop in before for one in present) or any(
            obstructs(prop, other.motion) for prop in performance.props for other in others
        )


def move_to(performance: Performance, spot: Spot) -> Performance:
    """A performance at the origin, facing along x, carried to a spot."""
    motions = tuple(
        Motion(motion.time, _moved_poses(motion.root, spot), motion.angles) for motion in performance.motions
    )
    props = tuple(
        Prop(prop.kind, prop.size, Trajectory(prop.trajectory.time, _moved_poses(prop.trajectory.pose, spot)))
        for prop in performance.props
    )
    return Performance(motions, props)


def _moved_poses(pose: Floats, spot: Spot) -> Floats:
    """Poses (N, 7) turned by a spot's bearing about the origin, and shifted to its place."""
    turn = Rotation.from_euler("Z", spot.bearing)
    place = np.column_stack([pose[:, :2] @ rotation_2d(spot.bearing).T + spot.place, pose[:, 2]])
    facing = (turn * Rotation.from_quat(pose[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
    return np.concatenate([place, facing], axis=1)


def obstructs(prop: Prop, motion: Motion) -> bool:
    """Whether someone's pelvis comes too near to the ground plan of a thing."""
    pose = prop.trajectory.at(motion.time)
    turn = Rotation.from_quat(pose[:, 3:], scalar_first=True).inv()
    way = turn.apply(np.column_stack([motion.root[:, :2] - pose[:, :2], np.zeros(len(pose))]))[:, :2]
    outside = np.maximum(np.abs(way) - np.array(prop.size[:2]) / 2, 0.0)
    return bool(np.hypot(*outside.T).min() < _BESIDE)
