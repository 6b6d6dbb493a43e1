"""What a scenario file may say: one frozen model a section, every key documented, unknown keys refused.

Metres and seconds as everywhere; angles are in degrees here, for people write and read these files.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]

Activity = Literal["walk", "stand", "wave", "point", "talk", "reach"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Room(_Section):
    """The room: a floor and four walls around the origin."""

    size: tuple[Positive, Positive, Positive] = Field((8.0, 8.0, 3.0), description="x, y, z in metres")


class People(_Section):
    """Who is in the room and what they do."""

    count: int = Field(4, ge=0, le=100)
    activities: tuple[Activity, ...] = Field(
        ("walk", "wave"), min_length=1, description="handed out in turn: person i does activities[i % len]"
    )
    area: Positive = Field(2.0, description="half the side of the square about the origin that they stay in, metres")
    spacing: Positive = Field(0.8, description="least distance between the pelvises of two people, metres")


class Clutter(_Section):
    """Things that stand in the way."""

    boxes: int = Field(0, ge=0, le=50)
    shelves: int = Field(0, ge=0, le=10)


class Cameras(_Section):
    """The rig: cameras on a ring, evenly spaced, all looking at one point."""

    layout: Literal["ring"] = "ring"
    count: int = Field(5, ge=0, le=64)
    radius: Positive = Field(3.5, description="metres from the z axis")
    height: float = Field(2.2, description="metres above the floor")
    aim: tuple[float, float, float] = Field((0.0, 0.0, 0.9), description="the point that all look at, metres")
    start: float = Field(0.0, description="bearing of the first camera from the x axis, degrees")
    fov: Annotated[float, Field(gt=1.0, lt=170.0)] = Field(75.0, description="horizontal field of view, degrees")
    size: tuple[Annotated[int, Field(ge=16, le=8192)], Annotated[int, Field(ge=16, le=8192)]] = Field(
        (800, 600), description="width, height in pixels"
    )


class Detector(_Section):
    """How the simulated 2D detector errs. All zero is a perfect detector of whatever is visible."""

    jitter: float = Field(0.35, ge=0.0, description="keypoint noise as a multiple of OKS sigma x sqrt(area)")
    miss_visible: Share = Field(0.01, description="chance that a visible joint is not detected")
    miss_self: Share = Field(0.25, description="the same for a joint hidden by the person's own body")
    miss_occluded: Share = Field(0.7, description="the same for a joint hidden by another person or a thing")
    miss_person: Share = Field(0.02, description="chance that a person is missed in one view and frame")
    least_visible: int = Field(
        5, ge=1, le=17, description="a person with fewer visible joints in a view is never detected there"
    )
    phantoms: float = Field(0.1, ge=0.0, le=20.0, description="mean number of phantom people per view and frame")
    box_jitter: float = Field(0.03, ge=0.0, le=0.5, description="box side noise as a share of the box's size")


class Method(_Section):
    """Which variants of the method run on the detections."""

    variants: tuple[str, ...] = Field(("full", "no-3dps"), min_length=1, description="presets of mvpose.Pipeline")


class Rendering(_Section):
    """How the views are made."""

    renderer: Literal["auto", "raster", "gl"] = Field(
        "raster",
        description="raster: numba, anywhere; gl: pyrender on EGL; auto: gl where a context can be made",
    )
    color: bool = Field(True, description="shade every picture; without it there are depth and ids, and no film")


class Scenario(_Section):
    """A whole scenario file."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    description: str = ""
    seed: int = Field(0, ge=0, description="of every random draw; 0 is a seed like any other")
    duration: Positive = Field(4.0, description="seconds")
    rate: Positive = Field(10.0, description="frames per second")
    room: Room = Room()
    people: People = People()
    clutter: Clutter = Clutter()
    cameras: Cameras = Cameras()
    detector: Detector = Detector()
    method: Method = Method()
    rendering: Rendering = Rendering()

    @property
    def frames(self) -> int:
        """How many frames the duration holds at the rate; at least one."""
        return max(1, round(self.duration * self.rate))
