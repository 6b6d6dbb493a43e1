"""What a scenario file may say: one frozen model a section, every key documented, unknown keys refused.

Metres and seconds as everywhere; angles are in degrees here, for people write and read these files.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from simharness.scenario.sections.appearance import Appearance
from simharness.scenario.sections.cameras import Cameras, Faults, Sensor
from simharness.scenario.sections.detector import Detector
from simharness.scenario.sections.people import People
from simharness.scenario.sections.room import Clutter, Decoys, Room
from simharness.scenario.sections.section import Positive, Section

__all__ = [
    "Appearance",
    "Cameras",
    "Clutter",
    "Decoys",
    "Detector",
    "Estimators",
    "Faults",
    "Method",
    "People",
    "Rendering",
    "Room",
    "Scenario",
    "Sensor",
]


_NAME = r"^[a-z0-9][a-z0-9_-]*$"
_PLACE = r"^.+:[A-Za-z_]\w*$"


class Estimators(Section):
    """Methods of one's own by name: a file or a module, and what there has a method ``estimate``."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "additionalProperties": {"type": "string", "pattern": _PLACE},
            "propertyNames": {"pattern": _NAME},
        },
    )
    __pydantic_extra__: dict[str, str]

    @property
    def places(self) -> dict[str, str]:
        """Where each of them is, by name."""
        return dict(self.model_extra or {})

    @property
    def files(self) -> tuple[Path, ...]:
        """The files among those places."""
        sources = (place.rpartition(":")[0] for place in self.places.values())
        return tuple(Path(source) for source in sources if source.endswith(".py"))

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, place in self.places.items():
            if not re.match(_NAME, name):
                raise ValueError(f"names of small letters, digits, - and _, {name!r} is none")
            if not re.match(_PLACE, place):
                raise ValueError(f"FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE, {place!r} of {name!r} is neither")
        return self


class Method(Section):
    """Which variants of the method run on the detections."""

    variants: tuple[str, ...] = Field(
        ("full", "no-3dps"), min_length=1, description="presets of mvpose.Pipeline, and names of method.estimators"
    )
    estimators: Estimators = Field(
        Estimators(), description='methods of one\'s own: name = "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"'
    )


class Rendering(Section):
    """How the views are made."""

    renderer: Literal["auto", "raster", "gl", "rays"] = Field(
        "raster",
        description="raster: numba, anywhere; gl: pyrender on EGL; auto: gl where a context can be made; "
        "rays: no pictures at all, visibility by rays: fast",
    )
    color: bool = Field(True, description="take the colour pictures of which the report's film is made")


class Scenario(Section):
    """A whole scenario file."""

    name: str = Field(pattern=_NAME)
    description: str = ""
    seed: int = Field(0, ge=0, description="of every random draw; 0 is a seed like any other")
    duration: Positive = Field(4.0, description="seconds")
    rate: Positive = Field(10.0, description="frames per second")
    room: Room = Room()
    people: People = People()
    clutter: Clutter = Clutter()
    decoys: Decoys = Decoys()
    cameras: Cameras = Cameras()
    faults: Faults = Faults()
    sensor: Sensor = Sensor()
    detector: Detector = Detector()
    appearance: Appearance = Appearance()
    method: Method = Method()
    rendering: Rendering = Rendering()

    @property
    def frames(self) -> int:
        """How many frames the duration holds at the rate; at least one."""
        return max(1, round(self.duration * self.rate))

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it names: recorded motion, calibration, networks."""
        motion = self.people.motion
        named = (motion.file, motion.skeleton, self.cameras.file, self.detector.onnx, self.appearance.network)
        return tuple(Path(name) for name in named if name)
