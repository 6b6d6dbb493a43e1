"""[appearance]: appearance descriptors of people, the second cue of the method (paper, section 3.2)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from simharness.scenario.sections.section import Section


class AppearanceSection(Section):
    """Source of the descriptors of detections."""

    source: Literal["none", "pictures", "drawn"] = Field(
        "none",
        description="none: detections carry no descriptors; pictures: a network computes them from the rendered "
        "pictures; drawn: drawn from a model of the network's distances, without pictures",
    )
    network: str = Field(
        "",
        description="ONNX file of a re-ID network, relative to the scenario file; empty: the one shipped with mvpose",
    )
