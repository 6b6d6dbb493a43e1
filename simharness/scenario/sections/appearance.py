"""[appearance]: descriptors of what people look like, the method's second cue (paper, section 3.2)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from simharness.scenario.sections.section import Section


class Appearance(Section):
    """Where the descriptors of detections come from."""

    source: Literal["none", "pictures", "drawn"] = Field(
        "none",
        description="none: detections carry no descriptors; pictures: a network reads them off the rendered pictures; "
        "drawn: from a model of the network's distances, without pictures",
    )
    network: str = Field(
        "", description="ONNX file of a re-ID network, relative to the scenario file; empty: the one that mvpose ships"
    )
