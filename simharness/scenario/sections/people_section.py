"""[people]: the people in the room and their activities."""

from typing import Literal

from pydantic import model_validator

from simharness.scenario.sections.section import Count, Length, Section, Share, Span, Spread, key

ActivityName = Literal[
    "walk",
    "stand",
    "wave",
    "point",
    "talk",
    "squat",
    "crouch",
    "kneel",
    "turn",
    "step",
    "run",
    "reach",
    "carry",
    "dance",
    "lie",
    "sit",
    "shake_hands",
    "hug",
    "hand_over",
    "table",
    "cross",
    "swap",
    "hide",
    "visit",
    "mocap",
]


class MocapSection(Section):
    """Recorded motion of the people whose activity is "mocap"; of all people where no activities are given."""

    file: str = key(
        "",
        "AMC or BVH file, which people perform in random places; or a file or folder of people over time, "
        "in any format that mvpose reads, whom they re-enact at the recorded places, person by person; relative to the "
        "scenario file; empty: none",
    )
    skeleton: str = key("", "ASF file of an AMC file; empty: the only one in the same folder")
    start: Span = key(0.0, "start time in the recording, seconds")

    @property
    def tracks(self) -> bool:
        """Whether the file holds recorded people, whom those of the scenario re-enact."""
        return bool(self.file) and not self.file.lower().endswith((".amc", ".bvh"))


class TrafficSection(Section):
    """People who come and go: through doors in the walls, or over the edge of a room without walls."""

    entering: Share = key(0.0, "share of the people who are not there from the beginning; drawn for each person")
    leaving: Share = key(0.0, "share of the people who leave before the end; drawn for each person")
    away: Span = key(0.0, "time after which those who left come back through the same door, seconds; 0: they stay away")
    doors: int = key(2, "number of doors, which everyone uses", ge=1, le=8)


class PushSection(Section):
    """A push on one person in dynamic playback: a constant force at one place of the body, for a short time."""

    person: int = key(0, "index of the person who is pushed", ge=0, lt=100)
    time: Span = key(1.0, "time at which the push begins, seconds")
    duration: float = key(0.2, "time for which the force acts, seconds", ge=0.01, le=10.0)
    impulse: float = key(
        0.0,
        "change of momentum by the push, N s: the force is impulse / duration; 0: nobody is pushed",
        ge=0.0,
        le=1000.0,
    )
    direction: float = key(
        0.0,
        "horizontal direction of the force, degrees counter-clockwise from where the person faces as the "
        "push begins: 0 forwards, 90 to the left, 180 backwards",
        ge=-360.0,
        le=360.0,
    )
    place: Literal["pelvis", "chest", "head", "left_shoulder", "right_shoulder"] = key(
        "chest", "part of the body on which the force acts, at its centre of mass"
    )


class PeopleSection(Section):
    """The people in the room and their activities."""

    count: int = key(4, "number of people", ge=0, le=100)
    activities: tuple[ActivityName, ...] = key(
        ("walk", "wave"),
        "activities, assigned in turn: one to each person, those of pairs to two people at a time",
        min_length=1,
        max_length=100,
    )
    area: Length = key(
        2.0,
        "half the side of the square around the origin in which people stay, metres; a recorded motion "
        "that does not fit into it may use the whole room",
    )
    around: Spread = key(
        0.0, "radius around the origin that people keep free, metres; the first object of [clutter] is there"
    )
    spacing: Length = key(0.8, "smallest distance between the pelvises of two people, metres")
    passing: float = key(0.5, 'distance between the lanes of "cross" and "swap", metres', ge=0.4, le=3.0)
    group: int = key(
        2, 'number of people who do "cross" or "swap" together, half of them in each direction', ge=2, le=40
    )
    hidden: float = key(
        3.0,
        'time in the booth of "hide", in which no camera sees the person, seconds; at least the time that '
        "the person needs to walk through it",
        ge=1.0,
        le=600.0,
    )
    traffic: TrafficSection = TrafficSection()
    children: Share = key(0.0, "probability that a person is a child of 5 to 12 years")
    look_alike: Share = key(
        0.0, "similarity of clothes; 0: all people are dressed differently; 1: all wear one uniform"
    )
    alike: Count = key(0, "number of people to whom look_alike applies, counted from the first; 0: all people")
    camouflage: Share = key(0.0, "share of the colour of the walls in all clothes; 1: all are dressed in that colour")
    playback: Literal["kinematic", "dynamic"] = key(
        "kinematic", "kinematic: as planned; dynamic: tracked by actuators under gravity and contact"
    )
    assist: float = key(
        300.0,
        "dynamic playback: largest force that supports a pelvis, newtons; running needs about 1000",
        gt=0.0,
        le=100_000.0,
    )
    push: PushSection = PushSection()
    motion: MocapSection = MocapSection()

    @model_validator(mode="after")
    def _file_and_activity_agree(self) -> "PeopleSection":
        if self.motion.file and "activities" not in self.model_fields_set:
            object.__setattr__(self, "activities", ("mocap",))  # a named file is meant to be played
        if ("mocap" in self.activities) != bool(self.motion.file):
            raise ValueError(
                'the activity "mocap" and people.motion = { file = "..." } to go together: give both or neither'
            )
        if self.playback == "dynamic" and (
            {"hide", "visit"} & set(self.activities) or self.traffic.entering or self.traffic.leaving
        ):
            raise ValueError(
                'people.playback = "kinematic" with the activities "hide" and "visit" and with people.traffic, because '
                "simulated contacts stop people at curtains and doors"
            )
        if self.push.impulse and self.playback != "dynamic":
            raise ValueError(
                'people.playback = "dynamic" with people.push.impulse above 0, because people are pushed in dynamic '
                "playback alone"
            )
        if self.push.impulse and self.push.person >= self.count:
            raise ValueError(f"people.push.person below people.count = {self.count}, got {self.push.person}")
        if self.motion.tracks and set(self.activities) != {"mocap"}:
            raise ValueError(
                'people.activities = ["mocap"] with the recorded people of people.motion.file, because every person '
                "re-enacts one of them: leave activities out"
            )
        return self
