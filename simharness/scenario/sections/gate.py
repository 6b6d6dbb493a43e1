"""[gate]: what ``simharness check`` counts as worse."""

from __future__ import annotations

from pydantic import Field

from simharness.scenario.sections.section import Amount, Section


class Tolerance(Section):
    """How much worse the mean of a score may get: what lies within is never a regression, however certain."""

    pcp: Amount = Field(1.0, description="points of percent")
    recall: Amount = Field(1.0, description="points of percent")
    precision: Amount = Field(1.0, description="points of percent")
    mpjpe_mm: Amount = Field(2.0, description="millimetres")
    match_f1: Amount = Field(1.0, description="points of percent")
    ghosts: Amount = Field(0.05, description="ghosts a frame")


class Gate(Section):
    """What ``simharness check`` counts as worse: a change that is both significant and larger than its tolerance."""

    level: float = Field(
        0.05, gt=0.0, lt=1.0, description="chance that a method that did not change is said to be worse"
    )
    slowdown: float = Field(
        1.5, gt=1.0, description="how many times as long a frame may take, beside a reference kernel of the same run"
    )
    tolerance: Tolerance = Tolerance()
