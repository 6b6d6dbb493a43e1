"""[cameras], [faults] and [sensor]: the rig, its faults, and the quality of its pictures."""

from typing import Annotated, Literal

from pydantic import Field

from simharness.scenario.sections.section import (
    MOST_CAMERAS,
    Coordinate,
    Elements,
    Factor,
    Length,
    Point,
    Section,
    Share,
    Span,
    Spread,
    Turn,
)

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
View = Annotated[int, Field(ge=0, lt=MOST_CAMERAS)]
Term = Annotated[float, Field(ge=-1000.0, le=1000.0)]  # of a lens; those of fisheye lenses are about 10


class CamerasSection(Section):
    """The rig."""

    layout: Layout = Field("ring", description="preset: a published rig; file: a calibration file of the user")
    count: int = Field(
        5, ge=0, le=MOST_CAMERAS, description="number of cameras of ring, arc, line, corners, dome and pairs"
    )
    radius: Length = Field(
        3.5,
        description="distance from the z axis, metres; corners: half the side of their square, where the room has no "
        "walls",
    )
    height: Coordinate = Field(2.2, description="height above the floor, metres; dome: of the highest camera")
    heights: tuple[Coordinate, ...] = Field(
        (),
        max_length=MOST_CAMERAS,
        description="heights that the cameras take in turn, instead of height; dome: at most height",
    )
    aim: Point = Field((0.0, 0.0, 0.9), description="point at which all cameras look: x, y, z in metres")
    start: float = Field(
        0.0,
        ge=-360.0,
        le=360.0,
        description="bearing of the first camera from the x axis, degrees; line: bearing of its middle; corners: no "
        "effect",
    )
    spread: Annotated[float, Field(gt=0.0, le=360.0)] = Field(120.0, description="arc: angle between its ends, degrees")
    spacing: Length = Field(
        1.0, description="line: distance between neighbours, metres; pairs: between the two cameras of a pair"
    )
    positions: tuple[Point, ...] = Field(
        (), max_length=MOST_CAMERAS, description="free: position of each camera, metres"
    )
    aims: tuple[Point, ...] = Field(
        (), max_length=MOST_CAMERAS, description="free: point at which each camera looks, instead of aim, metres"
    )
    fov: Annotated[float, Field(gt=1.0, lt=170.0)] = Field(75.0, description="horizontal field of view, degrees")
    size: Annotated[tuple[Pixels, Pixels], Elements(("width", "height"))] = Field(
        (800, 600), description="width, height in pixels; layout file: where the file does not hold them"
    )
    distortion: Annotated[tuple[Term, Term, Term, Term, Term], Elements(("k1", "k2", "p1", "p2", "k3"))] = Field(
        (0.0, 0.0, 0.0, 0.0, 0.0), description="lens distortion in OpenCV's order: k1, k2, p1, p2, k3"
    )
    jitter: Spread = Field(
        0.0, description="standard deviation of camera positions along each axis, metres; not of preset and file"
    )
    aim_jitter: Spread = Field(
        0.0, description="standard deviation of the points looked at along each axis, metres; not of preset and file"
    )
    trigger: Literal["common", "free"] = Field(
        "common",
        description="common: all cameras take their pictures at the times of the frames; free: each at its own phase "
        "within half a frame before or after, drawn uniformly and known to the method",
    )
    every: tuple[Annotated[int, Field(ge=1, le=1000)], ...] = Field(
        (),
        max_length=MOST_CAMERAS,
        description="numbers that the cameras take in turn, for cameras of different rates: 2 is a camera with a "
        "picture in every second frame; empty: a picture in every frame",
    )
    preset: Preset | None = Field(None, description="layout preset: the published rig")
    file: str = Field(
        "",
        description="layout file: a calibration of VoxelPose, Panoptic, OpenCV, Pose2Sim or EasyMocap, relative to the "
        "scenario file",
    )
    only: tuple[str, ...] = Field(
        (), max_length=MOST_CAMERAS, description="preset and file: names of the cameras to take; empty: all"
    )


class FaultsSection(Section):
    """Faults of the rig that the method does not know of, drawn for each camera.

    Errors are in the believed calibration; drifts move the true cameras away from it.
    """

    focal: Share = Field(0.0, description="standard deviation of the relative error of focal lengths")
    center: float = Field(
        0.0,
        ge=0.0,
        le=8192.0,
        description="standard deviation of the error of principal points along each axis, pixels",
    )
    rotation: Turn = Field(0.0, description="standard deviation of the error of orientations about each axis, degrees")
    translation: Spread = Field(0.0, description="standard deviation of the error of positions along each axis, metres")
    rotation_drift: Turn = Field(
        0.0, description="standard deviation of the drift of orientations about each axis, degrees per minute"
    )
    translation_drift: Spread = Field(
        0.0, description="standard deviation of the drift of positions along each axis, metres per minute"
    )
    clock_offset: Span = Field(0.0, description="standard deviation of the cameras' clocks, seconds; at most 0.9")
    clock_jitter: Span = Field(0.0, description="standard deviation of the time of each single picture, seconds")
    clocks_known: bool = Field(
        False,
        description="the method is given the true times of pictures, as where clocks have been compared; else those at "
        "which they should have been taken",
    )
    dropped: Share = Field(0.0, description="probability that a picture never arrives")
    frozen: Share = Field(0.0, description="probability that a camera repeats its last picture")
    dead: tuple[View, ...] = Field(
        (), max_length=MOST_CAMERAS, description="indices of the cameras that deliver nothing"
    )
    swapped: tuple[Annotated[tuple[View, View], Elements(("camera", "camera"))], ...] = Field(
        (), max_length=MOST_CAMERAS, description="pairs of indices of cameras that deliver each other's pictures"
    )
    rolling_shutter: float = Field(
        0.0,
        ge=0.0,
        le=10.0,
        description="readout time from the first row to the last, seconds; the method is given it, and variants that "
        "track people use it",
    )


class SensorSection(Section):
    """Quality of the pictures; none of it moves anything in them. Spreads are over the cameras.

    With all keys at zero the pictures are as rendered. ``profile = "webcam"`` in a scenario's [sensor] takes
    ``scenarios/sensors/webcam.toml``, which names the sources of its values.
    """

    gain: Share = Field(0.0, description="relative spread of contrast")
    white_balance: Share = Field(0.0, description="relative spread of red and blue against green")
    exposure: float = Field(0.0, ge=0.0, le=10.0, description="spread of exposure, stops")
    shutter: float = Field(0.0, ge=0.0, le=10.0, description="exposure time, which blurs motion, seconds")
    shot_noise: Share = Field(
        0.0,
        description="standard deviation of the noise of light at white, of 1: 1 / sqrt(electrons) of a white pixel; "
        "its variance is proportional to the light (EMVA Standard 1288)",
    )
    read_noise: Share = Field(
        0.0,
        description="standard deviation of the noise of the readout, of 1: temporal dark noise / electrons of a white "
        "pixel, both in EMVA 1288 data sheets",
    )
    noise: float = Field(
        0.0,
        ge=0.0,
        le=255.0,
        description="standard deviation of additional noise of every finished pixel, of 255, equal in light and dark",
    )
    softness: float = Field(
        0.0,
        ge=0.0,
        le=10.0,
        description="standard deviation of the blur by lens and pixels, pixels: 0.187 / MTF50 in cycles per pixel (for "
        "a Gaussian; measured as in ISO 12233)",
    )
    mosaic: bool = Field(
        False,
        description="a filter of one colour on every pixel (B. Bayer, US patent 3971065), the others interpolated",
    )
    vignetting: Share = Field(
        0.0,
        description="light far from the optical axis, as an exponent of the cos^4 law: 1 is the law itself (natural "
        "vignetting of a thin lens), 0.5 a wide lens, less one that the camera corrects",
    )
    aberration: float = Field(
        0.0,
        ge=-0.05,
        le=0.05,
        description="lateral chromatic aberration: magnification of red above that of green, and of blue below it; "
        "Imatest calls 0.0004 of the radius insignificant, 0.0008 low, 0.0015 moderate",
    )
    tone: Share = Field(
        0.0,
        description="steepness of the camera's response beside sRGB: 1 is 3 v^2 - 2 v^3, which darkens shadows and "
        "brightens lights (for S-shaped responses see M. Grossberg and S. Nayar, CVPR 2003)",
    )
    sharpening: Factor = Field(
        0.0, description="unsharp mask with a radius of one pixel: share of the difference to the blurred picture added"
    )
    jpeg: int = Field(0, ge=0, le=100, description="quality of JPEG compression; 0: none")
