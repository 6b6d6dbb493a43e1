"""Scenario: one frozen model for each section of a file, every key documented, unknown keys refused.

Metres and seconds as everywhere. Angles are in degrees here, because people write and read these files.
"""

from functools import reduce
from pathlib import Path
from typing import Literal

from pydantic import Field

from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection, SensorSection
from simharness.scenario.sections.detector_section import AppearanceSection, DetectorSection
from simharness.scenario.sections.method_section import NAME, MethodSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection, DecoysSection, RoomSection
from simharness.scenario.sections.section import Section, Share, Span, Spread, key

NETWORK_KEYS = (("detector", "network"), ("detector", "onnx"))
"""Keys whose values are names of networks on this machine, or their ONNX files."""

FILE_KEYS: tuple[tuple[str, ...], ...] = (
    ("people", "motion", "file"),
    ("people", "motion", "skeleton"),
    ("clutter", "objects"),
    ("cameras", "file"),
    *NETWORK_KEYS,
    ("appearance", "network"),
)
"""Keys whose values name files, one or a list: recorded motion, objects, calibration, networks. All code that handles
such files uses this list: the paths are relative to the scenario file, and the contents count in the identity of
results."""


class AnnotationSection(Section):
    """Errors of an annotated truth, as published data sets have them; the default is the exact truth.

    The truth of recordings is clicked by people. These errors change only the truth by which a recording is scored:
    that of ``simharness export``.
    """

    shift: Spread = key(
        0.0,
        "constant offset of each joint of each person from the true one: its standard deviation along each "
        "axis of the body, metres",
    )
    random: Spread = key(0.0, "standard deviation along each axis of the error that changes over time, metres")
    life: Span = key(0.0, "correlation time of that error, seconds; 0: drawn anew in every frame")
    noise: Share = key(0.0, "share of the variance of that error that is drawn anew in every frame")
    people: Literal["all", "whole"] = key(
        "all", "whole: people are annotated only where all cameras but one have all of their limb joints in the picture"
    )


class RenderingSection(Section):
    """Rendering of the pictures."""

    renderer: Literal["auto", "raster", "gl", "rays"] = key(
        "raster",
        "raster: numba, on any machine; gl: pyrender on EGL; auto: gl where a GL context can be made, else "
        "raster; rays: no pictures, only visibility by ray casting, fast",
    )
    color: bool = key(True, "render the colour pictures of the report's film")


class Scenario(Section):
    """A scenario: one simulated scene, the cameras and the detector, and the variants under test."""

    name: str = Field(
        pattern=NAME,
        max_length=100,
        description="lowercase letters, digits, - and _; result folders are named after it",
    )
    description: str = Field("", max_length=1000)
    seed: int = key(0, "seed of every random draw; 0 is a seed like any other", ge=0, lt=2**53)
    duration: float = key(4.0, "seconds", gt=0.0, le=36_000.0)
    rate: float = key(10.0, "frames per second", gt=0.0, le=1000.0)
    room: RoomSection = RoomSection()
    people: PeopleSection = PeopleSection()
    clutter: ClutterSection = ClutterSection()
    decoys: DecoysSection = DecoysSection()
    cameras: CamerasSection = CamerasSection()
    faults: FaultsSection = FaultsSection()
    sensor: SensorSection = SensorSection()
    detector: DetectorSection = DetectorSection()
    appearance: AppearanceSection = AppearanceSection()
    annotation: AnnotationSection = AnnotationSection()
    method: MethodSection = MethodSection()
    rendering: RenderingSection = RenderingSection()

    @property
    def frames(self) -> int:
        """Number of frames: the duration at the rate, at least one."""
        return max(1, round(self.duration * self.rate))

    @property
    def named_files(self) -> dict[str, Path]:
        """Files that the scenario names, by dotted key: those of :data:`FILE_KEYS` that are not empty.

        Those of a list have its key and their number: "clutter.objects.0". A network by name is no file yet, but its
        name; the network of a simulated detector does not count.
        """
        values: dict[str, object] = {}
        for parts in FILE_KEYS:
            name, value = ".".join(parts), reduce(getattr, parts, self)
            values |= (
                {f"{name}.{k}": each for k, each in enumerate(value)} if isinstance(value, tuple) else {name: value}
            )
        if self.detector.source == "simulated":
            del values["detector.network"]
        return {name: Path(str(value)) for name, value in values.items() if value}

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the scenario names, in the order of :data:`FILE_KEYS`."""
        return tuple(self.named_files.values())
