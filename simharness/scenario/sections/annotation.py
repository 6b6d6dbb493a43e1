"""[annotation]: errors of the truth that people would make of the scene."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from simharness.scenario.sections.section import Section, Share, Span, Spread


class AnnotationSection(Section):
    """Errors of an annotated truth, as published data sets have them; the default is the exact truth.

    The truth of recordings is clicked by people. These errors change only the truth by which a recording is scored:
    that of ``simharness export`` and of ``simharness evaluate seeds``.
    """

    shift: Spread = Field(
        0.0,
        description="constant offset of each joint of each person from the true one: its standard deviation along each "
        "axis of the body, metres",
    )
    random: Spread = Field(
        0.0, description="standard deviation along each axis of the error that changes over time, metres"
    )
    life: Span = Field(0.0, description="correlation time of that error, seconds; 0: drawn anew in every frame")
    noise: Share = Field(0.0, description="share of the variance of that error that is drawn anew in every frame")
    people: Literal["all", "whole"] = Field(
        "all",
        description="whole: people are annotated only where all cameras but one have all of their limb joints in the "
        "picture",
    )
