"""Choreography: motions and props of all people of a scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.motion import track_planning
from simharness.world.motion.activity_registry import Activity, configured_activities, solo
from simharness.world.motion.contact import ContactModel, SampledBody
from simharness.world.motion.motion import Motion, Performance, Prop
from simharness.world.motion.paths import Loop, RecordedPath, Route, Spot, Track, rotation_2d
from simharness.world.motion.poses.kinematics import Cast, Kinematics
from simharness.world.motion.visits import Door, Visitor, draw_doors

_PACE = (1.05, 1.25)  # steps in a room are short and quick
_GRAVITY = 9.81
_RUNNING = 0.7  # speed over sqrt(g x leg length) at which people change from walking to running
_DEEPEST = 0.01  # metres: largest penetration of people of different groups
_BESIDE = 0.3  # metres: least distance of a pelvis from the footprint of another group's prop
_CHECKS = 3  # every third time of a motion planned at ``RATE`` is checked for contact
_STAYING = ("mocap", "hide")  # activities of one person who never becomes a visitor
_NO_CAMERAS = np.zeros((0, 3))
_ORIGIN = Spot(place=np.zeros(2), bearing=0.0)


@dataclass(frozen=True)
class Group:
    """Performers of one activity: one person, two, or more."""

    people: tuple[int, ...]
    """Indices of the people."""
    activity: Activity
    """Their activity."""


def choreograph(
    scenario: Scenario, cast: Cast, time: Floats, *, widest: float | None = None, cameras: Floats = _NO_CAMERAS
) -> Performance:
    """Plan the motions and props of all people, and the times at which they are in the scene.

    People who re-enact joint tracks are at their recorded places: they have no tracks to plan, and may touch.

    A group draws from the streams of its first person, so one more person changes none of the others, except where the
    whole plan starts over or where a person without a partner gets one.

    Args:
        scenario: scenario; its people, seed and duration are used.
        cast: bodies, in the order of the people.
        time: times in seconds at which motions are planned, (N,), see ``motion_clock``.
        widest: largest ``people.area`` that the room allows, metres: what a recorded path may use that does not fit
            into ``people.area``; None: ``people.area``.
        cameras: positions of the cameras, (V, 3) metres, of which doors keep clear.

    Raises:
        ValueError: people do not fit; the message names the keys of the scenario to change.
    """
    people = scenario.people
    if people.motion.tracks:
        return Performance(_reenacted(scenario, cast, time))
    known = configured_activities(people)
    if "mocap" in people.activities:
        known["mocap"] = _recorded(scenario)
    missing = [name for name in people.activities if name not in known]
    if missing:
        raise ValueError(
            f"people.activities: no module registers the activity {missing[0]!r}; registered are "
            f"{', '.join(sorted(known))}"
        )
    groups = _groups(scenario, known)
    visitors = any(group.activity.track is Route for group in groups)
    doors = draw_doors(scenario.seed, people.traffic, scenario.room, cameras) if visitors else ()
    stage = _Stage(scenario, groups, cast, time, doors)
    track_planning.plan_tracks(
        scenario.seed,
        stage.requests,
        area=people.area,
        spacing=people.spacing,
        around=people.around,
        span=(float(time[0]), float(time[-1])),
        people=[group.people[0] for group in groups],
        widest=widest,
        admit=stage.admit,
    )
    placed = stage.performances
    return Performance(
        motions=tuple(motion for performance in placed for motion in performance.motions),
        props=(
            *(prop for performance in placed for prop in performance.props),
            *(door.prop for door in doors if scenario.room.walls),
        ),
        presence=tuple(each for performance in placed for each in performance.presence),
    )


def assign_activities(activities: Sequence[Activity], count: int, *, fallback: Activity) -> tuple[Group, ...]:
    """Assign the activities to people in turn, each to as many people as it takes.

    Args:
        activities: activities in their order, repeated after the last one.
        count: number of people.
        fallback: activity of a person, if too few are left for the one in turn.
    """
    groups: list[Group] = []
    first = 0
    while first < count:
        activity = activities[len(groups) % len(activities)]
        performers = min(activity.performers, count - first)
        if performers < (activity.fewest or activity.performers):
            activity, performers = fallback, fallback.performers
        groups.append(Group(tuple(range(first, first + performers)), activity))
        first += performers
    return tuple(groups)


def roles(scenario: Scenario) -> tuple[str, ...]:
    """Return the name of the activity of each person of a scenario."""
    known = configured_activities(scenario.people)
    known["mocap"] = replace(known["stand"], name="mocap")
    groups = _groups(scenario, known)
    return tuple(group.activity.name for group in groups for _ in group.people)


def _groups(scenario: Scenario, known: Mapping[str, Activity]) -> tuple[Group, ...]:
    """Return the groups of a scenario; a person who does something alone and enters or leaves is a visitor."""
    people = scenario.people
    groups = assign_activities([known[name] for name in people.activities], people.count, fallback=known["stand"])
    return tuple(
        replace(group, activity=known["visit"])
        if group.activity.performers == 1
        and group.activity.name not in _STAYING
        and any(_traffic(scenario, group.people[0]))
        else group
        for group in groups
    )


def _traffic(scenario: Scenario, person: int) -> tuple[bool, bool]:
    """Return whether a person enters after the beginning and leaves before the end, drawn from the person's stream."""
    traffic = scenario.people.traffic
    enters, leaves = stream(scenario.seed, "people", person, "traffic").uniform(size=2)
    return bool(enters < traffic.entering), bool(leaves < traffic.leaving)


def _recorded(scenario: Scenario) -> Activity:
    """Return the activity that plays the recorded motion of a scenario."""
    from simharness.world.motion.mocap import load_clip

    clip = load_clip(scenario.people.motion)

    def perform(mover: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
        return clip.perform(mover, time, place=spot.place, bearing=spot.bearing)

    return Activity("mocap", solo(perform))


def _reenacted(scenario: Scenario, cast: Cast, time: Floats) -> tuple[Motion, ...]:
    """Return the motions of people who re-enact recorded ones.

    Raises:
        ValueError: the file is not valid or does not fit the scenario, or somebody leaves the room.
    """
    from simharness.world.motion.mocap import load_people, reenact

    recorded = load_people(scenario.people)
    motions = tuple(
        replace(reenact(recorded, person, mover, time=time + scenario.people.motion.start), time=time)
        for person, mover in enumerate(cast)
    )
    size = scenario.room.size[:2]
    if scenario.room.walls and motions:
        reach = np.abs([motion.root[:, :2] for motion in motions]).max(axis=1)
        person = int((reach - np.array(size) / 2).max(axis=1).argmax())
        if (reach[person] > np.array(size) / 2).any():
            needed = np.ceil(20 * reach.max(axis=0) + 10) / 10
            raise ValueError(
                f"people.motion.file = {scenario.people.motion.file!r}: person {person} leaves the room, at up to "
                f"|x| = {reach[person, 0]:.2f} m and |y| = {reach[person, 1]:.2f} m: set the first two numbers of "
                f"room.size to {needed[0]:g} and {needed[1]:g} or more"
            )
    return motions


class _Stage:
    """Performances of all groups while tracks are planned; rejects tracks on which groups would touch.

    Attributes:
        requests: track request of each group.
    """

    def __init__(
        self, scenario: Scenario, groups: Sequence[Group], cast: Cast, time: Floats, doors: tuple[Door, ...]
    ) -> None:
        seed = scenario.seed
        self._scenario, self._doors, self._spacing = scenario, doors, scenario.people.spacing
        self._groups, self._cast, self._time = groups, cast, time
        self._contacts = ContactModel(cast)
        self._checks = time[::_CHECKS]
        self._performing: list[partial[Performance]] = []
        self._at_origin: dict[int, Performance] = {}
        self._placed: dict[int, tuple[Performance, list[SampledBody]]] = {}  # of the groups that have a track
        self.requests: list[track_planning.TrackRequest] = []
        for index, group in enumerate(groups):
            manner = stream(seed, "people", group.people[0], "gait")
            froude, pace = manner.uniform(*group.activity.froude), manner.uniform(*_PACE)
            self._performing.append(partial(self._perform, seed, group, pace))
            self.requests.append(self._request(index, group.activity, cast[group.people[0]], froude))

    @property
    def performances(self) -> list[Performance]:
        """Performances of the groups that have a track, in the order of the groups."""
        return [self._placed[index][0] for index in sorted(self._placed)]

    def admit(self, index: int, track: Track, before: Sequence[int]) -> bool:
        """Accept a track unless its group would touch another one, or one would obstruct the props of the other."""
        for group in set(self._placed) - set(before):  # groups of an abandoned plan
            del self._placed[group]
        if isinstance(track, Loop | Route):
            performance = self._performing[index](track)
        else:
            spot = track.spot if isinstance(track, RecordedPath) else track
            performance = move_to(self._origin(index), spot)
        movers = zip(self._groups[index].people, performance.motions, performance.presence, strict=True)
        bodies = [self._contacts.sample(person, motion, self._checks, presence) for person, motion, presence in movers]
        if self._collides(performance, bodies):
            return False
        self._placed[index] = (performance, bodies)
        return True

    def _perform(self, seed: int, group: Group, pace: float, track: Track) -> Performance:
        rng = stream(seed, "people", group.people[0], "motion")  # restarted for each track, so that the manner stays
        movers = [self._cast[person] for person in group.people]
        return group.activity.perform(movers, track, self._time, rng=rng, pace=pace)

    def _origin(self, index: int) -> Performance:
        """Return the performance at the origin, made once: it is the same on every spot and only has to be moved."""
        if index not in self._at_origin:
            self._at_origin[index] = self._performing[index](_ORIGIN)
        return self._at_origin[index]

    def _request(self, index: int, activity: Activity, mover: Kinematics, froude: float) -> track_planning.TrackRequest:
        if activity.name == "mocap":
            return track_planning.RecordedRequest(activity.name, self._time, self._origin(index).motions[0].root[:, :2])
        if activity.track is Route:
            return track_planning.VisitRequest(activity.name, self._visitor(index, mover, froude))
        if activity.track is not Loop:
            return track_planning.SpotRequest(activity.name, activity.clearance, len(self._groups[index].people))
        unit = np.sqrt(_GRAVITY * mover.leg_length)
        slowest, fastest = (unit * limit for limit in activity.froude)
        running = activity.froude[1] > _RUNNING
        if running:
            slowest = min(slowest, unit * _RUNNING)
        return track_planning.LoopRequest(activity.name, unit * froude, slowest, fastest, running)

    def _visitor(self, index: int, mover: Kinematics, froude: float) -> Visitor:
        """Return the plan of a visitor; without people.traffic every visitor comes and goes."""
        traffic = self._scenario.people.traffic
        entering, leaving = _traffic(self._scenario, self._groups[index].people[0])
        always = not (traffic.entering or traffic.leaving)
        speed = float(np.sqrt(_GRAVITY * mover.leg_length)) * froude
        room, duration = self._scenario.room, self._scenario.duration
        return Visitor(entering or always, leaving or always, traffic.away, speed, self._doors, room, duration)

    def _collides(self, performance: Performance, bodies: Sequence[SampledBody]) -> bool:
        """Return whether a performance comes too near to those of other groups."""
        others = [body for _, bodies in self._placed.values() for body in bodies]
        for one in bodies:
            for other in others:
                both = one.present & other.present
                apart = np.linalg.norm(one.motion.root[:, :2] - other.motion.root[:, :2], axis=1)[both]
                if apart.min(initial=np.inf) < self._spacing:
                    return True
                if both.any() and self._contacts.penetration(one, other)[both].max() > _DEEPEST:
                    return True
        before = [prop for earlier, _ in self._placed.values() for prop in earlier.props]
        return any(obstructs(prop, one.motion) for prop in before for one in bodies) or any(
            obstructs(prop, other.motion) for prop in performance.props for other in others
        )


def move_to(performance: Performance, spot: Spot) -> Performance:
    """Return a performance, made at the origin and facing along x, moved to a spot."""
    motions = tuple(replace(motion, root=_moved_poses(motion.root, spot)) for motion in performance.motions)
    props = tuple(
        replace(prop, trajectory=replace(prop.trajectory, pose=_moved_poses(prop.trajectory.pose, spot)))
        for prop in performance.props
    )
    return Performance(motions, props, performance.presence)


def _moved_poses(pose: Floats, spot: Spot) -> Floats:
    """Return poses (N, 7) rotated by a spot's bearing about the origin and shifted to its position."""
    turn = Rotation.from_euler("Z", spot.bearing)
    place = np.column_stack([pose[:, :2] @ rotation_2d(spot.bearing).T + spot.place, pose[:, 2]])
    facing = (turn * Rotation.from_quat(pose[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
    return np.concatenate([place, facing], axis=1)


def obstructs(prop: Prop, motion: Motion) -> bool:
    """Return whether a pelvis comes too near to the footprint of a prop."""
    pose = prop.trajectory.at(motion.time)
    turn = Rotation.from_quat(pose[:, 3:], scalar_first=True).inv()
    offset = turn.apply(np.column_stack([motion.root[:, :2] - pose[:, :2], np.zeros(len(pose))]))[:, :2]
    outside = np.maximum(np.abs(offset) - np.array(prop.size[:2]) / 2, 0.0)
    return bool(np.hypot(*outside.T).min() < _BESIDE)
