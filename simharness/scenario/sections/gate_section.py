"""[gate]: what ``simharness check`` counts as a regression, and what as an unexpected improvement."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from simharness.scenario.sections.section import Percent, Section

Size = Annotated[float, Field(ge=0.0, le=1000.0)]

BOUND = 2.0
"""Default bound of an improvement, in tolerances."""


class Tolerance(Section):
    """Largest loss in the mean of a score that is not a regression, however significant it is.

    Between processors, means over the shipped suite differ by less than a hundredth of these values, and means over one
    of its conditions by less than a third.
    """

    pcp: Percent = Field(0.5, description="percentage points")
    recall: Percent = Field(0.5, description="percentage points")
    precision: Percent = Field(0.5, description="percentage points")
    mpjpe_mm: Size = Field(0.5, description="millimetres")
    match_f1: Percent = Field(0.5, description="percentage points")
    ghosts: Size = Field(0.02, description="ghosts per frame")
    missed: Size = Field(0.01, description="missed people per frame")
    map: Percent = Field(0.5, description="percentage points; sees the order of the scores of people")
    coverage_90: Percent = Field(1.0, description="percentage points further from 90 %")
    score_brier: Size = Field(0.005, description="mean squared error of joint scores as probabilities")
    hota: Percent = Field(1.0, description="percentage points; of variants that give identities")
    idf1: Percent = Field(1.0, description="percentage points; of variants that give identities")


class Improvement(Section):
    """Largest gain in the mean of a score that needs no acceptance; by default twice the tolerance.

    A larger gain is either an improvement that belongs in the baseline, or a suite that became easier. For a score with
    a best value, such as coverage, this is the largest change in either direction.
    """

    pcp: Percent | None = Field(None, description="percentage points")
    recall: Percent | None = Field(None, description="percentage points")
    precision: Percent | None = Field(None, description="percentage points")
    mpjpe_mm: Size | None = Field(None, description="millimetres")
    match_f1: Percent | None = Field(None, description="percentage points")
    ghosts: Size | None = Field(None, description="ghosts per frame")
    missed: Size | None = Field(None, description="missed people per frame")
    map: Percent | None = Field(None, description="percentage points")
    coverage_90: Percent | None = Field(None, description="percentage points, in either direction")
    score_brier: Size | None = Field(None, description="mean squared error of joint scores as probabilities")
    hota: Percent | None = Field(None, description="percentage points")
    idf1: Percent | None = Field(None, description="percentage points")


class GateSection(Section):
    """Rule of ``simharness check``: a change fails it that is significant and larger than allowed."""

    level: float = Field(
        0.05, gt=0.0, lt=1.0, description="significance level: chance of a false alarm where the method did not change"
    )
    slowdown: float = Field(
        1.2,
        gt=1.0,
        le=100.0,
        description="largest factor by which the time of a frame, relative to a reference kernel, may grow",
    )
    slowdown_elsewhere: float = Field(
        2.0, gt=1.0, le=100.0, description="the same on another kind of processor than that of the baseline"
    )
    tolerance: Tolerance = Tolerance()
    improvement: Improvement = Improvement()

    def tolerance_of(self, score: str) -> float:
        """Return the tolerance of a score."""
        return float(getattr(self.tolerance, score))

    def improvement_of(self, score: str) -> float:
        """Return the bound of the improvement of a score."""
        bound = getattr(self.improvement, score)
        return BOUND * self.tolerance_of(score) if bound is None else float(bound)
