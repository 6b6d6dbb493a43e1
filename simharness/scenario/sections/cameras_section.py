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
    key,
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

    layout: Layout = key("ring", "preset: a published rig; file: a calibration file of the user")
    count: int = key(5, "number of cameras of ring, arc, line, corners, dome and pairs", ge=0, le=MOST_CAMERAS)
    radius: Length = key(
        3.5, "distance from the z axis, metres; corners: half the side of their square, where the room has no walls"
    )
    height: Coordinate = key(2.2, "height above the floor, metres; dome: of the highest camera")
    heights: tuple[Coordinate, ...] = key(
        (), "heights that the cameras take in turn, instead of height; dome: at most height", max_length=MOST_CAMERAS
    )
    aim: Point = key((0.0, 0.0, 0.9), "point at which all cameras look: x, y, z in metres")
    start: float = key(
        0.0,
        "bearing of the first camera from the x axis, degrees; line: bearing of its middle; corners: no effect",
        ge=-360.0,
        le=360.0,
    )
    spread: Annotated[float, Field(gt=0.0, le=360.0)] = key(120.0, "arc: angle between its ends, degrees")
    spacing: Length = key(1.0, "line: distance between neighbours, metres; pairs: between the two cameras of a pair")
    positions: tuple[Point, ...] = key((), "free: position of each camera, metres", max_length=MOST_CAMERAS)
    aims: tuple[Point, ...] = key(
        (), "free: point at which each camera looks, instead of aim, metres", max_length=MOST_CAMERAS
    )
    fov: Annotated[float, Field(gt=1.0, lt=170.0)] = key(75.0, "horizontal field of view, degrees")
    size: Annotated[tuple[Pixels, Pixels], Elements(("width", "height"))] = key(
        (800, 600), "width, height in pixels; layout file: where the file does not hold them"
    )
    distortion: Annotated[tuple[Term, Term, Term, Term, Term], Elements(("k1", "k2", "p1", "p2", "k3"))] = key(
        (0.0, 0.0, 0.0, 0.0, 0.0), "lens distortion in OpenCV's order: k1, k2, p1, p2, k3"
    )
    jitter: Spread = key(0.0, "standard deviation of camera positions along each axis, metres; not of preset and file")
    aim_jitter: Spread = key(
        0.0, "standard deviation of the points looked at along each axis, metres; not of preset and file"
    )
    trigger: Literal["common", "free"] = key(
        "common",
        "common: all cameras take their pictures at the times of the frames; free: each at its own phase "
        "within half a frame before or after, drawn uniformly and known to the method",
    )
    every: tuple[Annotated[int, Field(ge=1, le=1000)], ...] = key(
        (),
        "numbers that the cameras take in turn, for cameras of different rates: 2 is a camera with a "
        "picture in every second frame; empty: a picture in every frame",
        max_length=MOST_CAMERAS,
    )
    preset: Preset | None = key(None, "layout preset: the published rig")
    file: str = key(
        "",
        "layout file: a calibration of VoxelPose, Panoptic, OpenCV, Pose2Sim, EasyMocap or COLMAP, relative to the "
        "scenario file",
    )
    only: tuple[str, ...] = key(
        (), "preset and file: names of the cameras to take; empty: all", max_length=MOST_CAMERAS
    )


class FaultsSection(Section):
    """Faults of the rig that the method does not know of, drawn for each camera.

    Errors are in the believed calibration; drifts move the true cameras away from it.
    """

    focal: Share = key(0.0, "standard deviation of the relative error of focal lengths")
    center: float = key(
        0.0, "standard deviation of the error of principal points along each axis, pixels", ge=0.0, le=8192.0
    )
    rotation: Turn = key(0.0, "standard deviation of the error of orientations about each axis, degrees")
    translation: Spread = key(0.0, "standard deviation of the error of positions along each axis, metres")
    rotation_drift: Turn = key(
        0.0, "standard deviation of the drift of orientations about each axis, degrees per minute"
    )
    translation_drift: Spread = key(
        0.0, "standard deviation of the drift of positions along each axis, metres per minute"
    )
    clock_offset: Span = key(0.0, "standard deviation of the cameras' clocks, seconds; at most 0.9")
    clock_jitter: Span = key(0.0, "standard deviation of the time of each single picture, seconds")
    clocks_known: bool = key(
        False,
        "the method is given the true times of pictures, as where clocks have been compared; else those at "
        "which they should have been taken",
    )
    dropped: Share = key(0.0, "probability that a picture never arrives")
    frozen: Share = key(0.0, "probability that a camera repeats its last picture")
    dead: tuple[View, ...] = key((), "indices of the cameras that deliver nothing", max_length=MOST_CAMERAS)
    swapped: tuple[Annotated[tuple[View, View], Elements(("camera", "camera"))], ...] = key(
        (), "pairs of indices of cameras that deliver each other's pictures", max_length=MOST_CAMERAS
    )
    rolling_shutter: float = key(
        0.0,
        "readout time from the first row to the last, seconds; the method is given it, and variants that "
        "track people use it",
        ge=0.0,
        le=10.0,
    )


class SensorSection(Section):
    """Quality of the pictures; none of it moves anything in them. Spreads are over the cameras.

    With all keys at zero the pictures are as rendered. ``profile = "webcam"`` in a scenario's [sensor] takes
    ``scenarios/sensors/webcam.toml``, which names the sources of its values.
    """

    gain: Share = key(0.0, "relative spread of contrast")
    white_balance: Share = key(0.0, "relative spread of red and blue against green")
    exposure: float = key(0.0, "spread of exposure, stops", ge=0.0, le=10.0)
    shutter: float = key(0.0, "exposure time, which blurs motion, seconds", ge=0.0, le=10.0)
    shot_noise: Share = key(
        0.0,
        "standard deviation of the noise of light at white, of 1: 1 / sqrt(electrons) of a white pixel; "
        "its variance is proportional to the light (EMVA Standard 1288)",
    )
    read_noise: Share = key(
        0.0,
        "standard deviation of the noise of the readout, of 1: temporal dark noise / electrons of a white "
        "pixel, both in EMVA 1288 data sheets",
    )
    noise: float = key(
        0.0,
        "standard deviation of additional noise of every finished pixel, of 255, equal in light and dark",
        ge=0.0,
        le=255.0,
    )
    softness: float = key(
        0.0,
        "standard deviation of the blur by lens and pixels, pixels: 0.187 / MTF50 in cycles per pixel (for "
        "a Gaussian; measured as in ISO 12233)",
        ge=0.0,
        le=10.0,
    )
    mosaic: bool = key(
        False, "a filter of one colour on every pixel (B. Bayer, US patent 3971065), the others interpolated"
    )
    vignetting: Share = key(
        0.0,
        "light far from the optical axis, as an exponent of the cos^4 law: 1 is the law itself (natural "
        "vignetting of a thin lens), 0.5 a wide lens, less one that the camera corrects",
    )
    aberration: float = key(
        0.0,
        "lateral chromatic aberration: magnification of red above that of green, and of blue below it; "
        "Imatest calls 0.0004 of the radius insignificant, 0.0008 low, 0.0015 moderate",
        ge=-0.05,
        le=0.05,
    )
    tone: Share = key(
        0.0,
        "steepness of the camera's response beside sRGB: 1 is 3 v^2 - 2 v^3, which darkens shadows and "
        "brightens lights (for S-shaped responses see M. Grossberg and S. Nayar, CVPR 2003)",
    )
    sharpening: Factor = key(
        0.0, "unsharp mask with a radius of one pixel: share of the difference to the blurred picture added"
    )
    jpeg: int = key(0, "quality of JPEG compression; 0: none", ge=0, le=100)
