"""[people]: who is in the room and what they do."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from simharness.scenario.sections.section import Amount, Count, Positive, Section, Share

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
    "mocap",
]


class Mocap(Section):
    """Recorded motion, for those whose activity is "mocap"; everybody's, where no activities are given."""

    file: str = Field("", description="an AMC or BVH file, relative to the scenario file; empty: none")
    skeleton: str = Field("", description="the ASF file of an AMC file; empty: the only one beside it")
    start: Amount = Field(0.0, description="where in the clip to begin, seconds")


class People(Section):
    """Who is in the room and what they do."""

    count: int = Field(4, ge=0, le=100)
    activities: tuple[ActivityName, ...] = Field(
        ("walk", "wave"),
        min_length=1,
        description="handed out in turn, one to each person, those of pairs to two at a time",
    )
    area: Positive = Field(
        2.0,
        description="half the side of the square about the origin that they stay in, metres; a recorded motion that "
        "does not fit into it may use the whole room",
    )
    around: Amount = Field(
        0.0,
        description="radius about the origin that they keep free, metres; the first thing of the clutter stands there",
    )
    spacing: Positive = Field(0.8, description="least distance between the pelvises of two people, metres")
    children: Share = Field(0.0, description="chance that a person is a child of 5 to 12 years")
    look_alike: Share = Field(0.0, description="0: everybody is dressed differently; 1: all wear one uniform")
    alike: Count = Field(0, description="how many people look_alike is about, from the first; 0: everybody")
    playback: Literal["kinematic", "dynamic"] = Field(
        "kinematic", description="kinematic: as planned; dynamic: tracked by actuators under gravity and contact"
    )
    assist: Positive = Field(
        300.0,
        description="dynamic playback: the largest force that helps a pelvis along, newtons; who runs needs 1000 or so",
    )
    motion: Mocap = Mocap()

    @model_validator(mode="after")
    def _file_and_activity_agree(self) -> People:
        if self.motion.file and "activities" not in self.model_fields_set:
            object.__setattr__(self, "activities", ("mocap",))  # a named file is meant to be played
        if ("mocap" in self.activities) != bool(self.motion.file):
            raise ValueError(
                'the activity "mocap" and people.motion = { file = "..." } to go together: give both or neither'
            )
        return self
