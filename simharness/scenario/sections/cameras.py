"""[cameras], [faults] and [sensor]: the rig, what is wrong with it, and what its pictures are like."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from simharness.scenario.sections.section import Amount, Point, Positive, Section, Share

Layout = Literal["ring", "arc", "line", "corners", "dome", "pairs", "free", "preset", "file"]
Preset = Literal[
    "campus",
    "shelf",
    "panoptic",
    "cmu0",
    "cmu1",
    "cmu2",
    "cmu3",
    "cmu4",
    "panoptic3",
    "panoptic4",
    "panoptic6",
    "panoptic7",
]
Pixels = Annotated[int, Field(ge=16, le=8192)]


class Cameras(Section):
    """The rig."""

    layout: Layout = Field("ring", description="preset: a published rig; file: a calibration of your own")
    count: int = Field(5, ge=0, le=64, description="of ring, arc, line, corners, dome and pairs")
    radius: Positive = Field(
        3.5, description="metres from the z axis; corners: half side of their square, where the room has no walls"
    )
    height: float = Field(2.2, description="metres above the floor; dome: of the highest camera")
    heights: tuple[float, ...] = Field(
        (), description="heights that the cameras take in turn, instead of height; dome: at most height"
    )
    aim: Point = Field((0.0, 0.0, 0.9), description="the point that all look at, metres")
    start: float = Field(
        0.0, description="bearing of the first camera from the x axis, degrees; line: of its middle; not of corners"
    )
    spread: Annotated[float, Field(gt=0.0, le=360.0)] = Field(120.0, description="arc: between its ends, degrees")
    spacing: Positive = Field(1.0, description="line: between neighbours; pairs: between the two of a pair, metres")
    positions: tuple[Point, ...] = Field((), description="free: where each camera stands, metres")
    aims: tuple[Point, ...] = Field((), description="free: what each camera looks at, instead of aim, metres")
    fov: Annotated[float, Field(gt=1.0, lt=170.0)] = Field(75.0, description="horizontal field of view, degrees")
    size: tuple[Pixels, Pixels] = Field((800, 600), description="width, height in pixels; file: where it does not say")
    distortion: tuple[float, float, float, float, float] = Field(
        (0.0, 0.0, 0.0, 0.0, 0.0), description="of the lenses: k1, k2, p1, p2, k3 as OpenCV orders them"
    )
    jitter: Amount = Field(
        0.0, description="standard deviation of where cameras stand, each way, metres; not of preset and file"
    )
    aim_jitter: Amount = Field(
        0.0, description="standard deviation of where they look, each way, metres; not of preset and file"
    )
    preset: Preset | None = Field(None, description="of layout preset")
    file: str = Field(
        "", description="of layout file: a calibration of VoxelPose, Panoptic, OpenCV, Pose2Sim or EasyMocap"
    )
    only: tuple[str, ...] = Field((), description="preset and file: the names of the cameras to take; empty: all")


class Faults(Section):
    """What is wrong with the rig, unknown to the method: drawn for each camera.

    Errors are in what the method believes of the cameras; drifts move the cameras away from it.
    """

    focal: Share = Field(0.0, description="standard deviation of focal lengths' error, as a share")
    center: Amount = Field(0.0, description="standard deviation of principal points' error, each way, pixels")
    rotation: Amount = Field(0.0, description="standard deviation of orientations' error about each axis, degrees")
    translation: Amount = Field(0.0, description="standard deviation of positions' error, each way, metres")
    rotation_drift: Amount = Field(0.0, description="standard deviation of turning about each axis, degrees a minute")
    translation_drift: Amount = Field(0.0, description="standard deviation of moving, each way, metres a minute")
    clock_offset: Amount = Field(0.0, description="standard deviation of cameras' clocks, seconds; at most 0.9")
    clock_jitter: Amount = Field(0.0, description="standard deviation of each picture's time besides, seconds")
    dropped: Share = Field(0.0, description="chance that a picture never arrives")
    frozen: Share = Field(0.0, description="chance that a camera repeats its last picture")
    dead: tuple[Annotated[int, Field(ge=0)], ...] = Field((), description="cameras that deliver nothing")
    swapped: tuple[tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]], ...] = Field(
        (), description="pairs of cameras that deliver each other's pictures"
    )
    rolling_shutter: Amount = Field(0.0, description="time from the first row to the last, seconds")


class Sensor(Section):
    """What the pictures are like; none of it moves anything in them. Spreads are over cameras."""

    gain: Share = Field(0.0, description="spread of contrast, as a share")
    white_balance: Share = Field(0.0, description="spread of red and blue against green, as a share")
    exposure: Amount = Field(0.0, description="spread of exposure, stops")
    shutter: Amount = Field(0.0, description="how long the shutter stays open: motion blur, seconds")
    noise: Amount = Field(0.0, description="standard deviation of every pixel's noise, of 255")
    jpeg: int = Field(0, ge=0, le=100, description="quality of JPEG compression; 0: none")
