"""[people]: the people in the room and their activities."""

from typing import Literal

from pydantic import Field, model_validator

from simharness.scenario.sections.section import Count, Length, Section, Share, Span, Spread

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

    file: str = Field(
        "",
        description="AMC or BVH file, which people perform in random places; or a file or folder of people over time, "
        "in any format that mvpose reads, whom they re-enact at the recorded places, person by person; relative to the "
        "scenario file; empty: none",
    )
    skeleton: str = Field("", description="ASF file of an AMC file; empty: the only one in the same folder")
    start: Span = Field(0.0, description="start time in the recording, seconds")

    @property
    def tracks(self) -> bool:
        """Whether the file holds recorded people, whom those of the scenario re-enact."""
        return bool(self.file) and not self.file.lower().endswith((".amc", ".bvh"))


class TrafficSection(Section):
    """People who come and go: through doors in the walls, or over the edge of a room without walls."""

    entering: Share = Field(
        0.0, description="share of the people who are not there from the beginning; drawn for each person"
    )
    leaving: Share = Field(0.0, description="share of the people who leave before the end; drawn for each person")
    away: Span = Field(
        0.0, description="time after which those who left come back through the same door, seconds; 0: they stay away"
    )
    doors: int = Field(2, ge=1, le=8, description="number of doors, which everyone uses")


class PushSection(Section):
    """A push on one person in dynamic playback: a constant force at one place of the body, for a short time."""

    person: int = Field(0, ge=0, lt=100, description="index of the person who is pushed")
    time: Span = Field(1.0, description="time at which the push begins, seconds")
    duration: float = Field(0.2, ge=0.01, le=10.0, description="time for which the force acts, seconds")
    impulse: float = Field(
        0.0,
        ge=0.0,
        le=1000.0,
        description="change of momentum by the push, N s: the force is impulse / duration; 0: nobody is pushed",
    )
    direction: float = Field(
        0.0,
        ge=-360.0,
        le=360.0,
        description="horizontal direction of the force, degrees counter-clockwise from where the person faces as the "
        "push begins: 0 forwards, 90 to the left, 180 backwards",
    )
    place: Literal["pelvis", "chest", "head", "left_shoulder", "right_shoulder"] = Field(
        "chest", description="part of the body on which the force acts, at its centre of mass"
    )


class PeopleSection(Section):
    """The people in the room and their activities."""

    count: int = Field(4, ge=0, le=100, description="number of people")
    activities: tuple[ActivityName, ...] = Field(
        ("walk", "wave"),
        min_length=1,
        max_length=100,
        description="activities, assigned in turn: one to each person, those of pairs to two people at a time",
    )
    area: Length = Field(
        2.0,
        description="half the side of the square around the origin in which people stay, metres; a recorded motion "
        "that does not fit into it may use the whole room",
    )
    around: Spread = Field(
        0.0,
        description="radius around the origin that people keep free, metres; the first object of [clutter] is there",
    )
    spacing: Length = Field(0.8, description="smallest distance between the pelvises of two people, metres")
    passing: float = Field(0.5, ge=0.4, le=3.0, description='distance between the lanes of "cross" and "swap", metres')
    group: int = Field(
        2, ge=2, le=40, description='number of people who do "cross" or "swap" together, half of them in each direction'
    )
    hidden: float = Field(
        3.0,
        ge=1.0,
        le=600.0,
        description='time in the booth of "hide", in which no camera sees the person, seconds; at least the time that '
        "the person needs to walk through it",
    )
    traffic: TrafficSection = TrafficSection()
    children: Share = Field(0.0, description="probability that a person is a child of 5 to 12 years")
    look_alike: Share = Field(
        0.0, description="similarity of clothes; 0: all people are dressed differently; 1: all wear one uniform"
    )
    alike: Count = Field(
        0, description="number of people to whom look_alike applies, counted from the first; 0: all people"
    )
    camouflage: Share = Field(
        0.0, description="share of the colour of the walls in all clothes; 1: all are dressed in that colour"
    )
    playback: Literal["kinematic", "dynamic"] = Field(
        "kinematic", description="kinematic: as planned; dynamic: tracked by actuators under gravity and contact"
    )
    assist: float = Field(
        300.0,
        gt=0.0,
        le=100_000.0,
        description="dynamic playback: largest force that supports a pelvis, newtons; running needs about 1000",
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
