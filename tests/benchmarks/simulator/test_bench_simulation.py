"""Tables of the simulation benchmark, from made-up figures."""

from __future__ import annotations

import pytest

from benchmarks.simulator.simulation import STAGES, SWEEPS, Size, table_of


def sizes(*, power, build):
    """Sizes with a cost of (people x cameras) ** power microseconds per stage."""

    def size(sweep, people, cameras, frames):
        cost = 1e-3 * (people * cameras) ** power
        return Size(sweep, people, cameras, frames, build, dict.fromkeys(STAGES, cost))

    return [size("target", 4, 5, 2000), *(size(sweep, *point, 100) for sweep in SWEEPS for point in SWEEPS[sweep])]


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_exponents_are_those_of_the_cost(power):
    lines = [line.split() for line in table_of(sizes(power=power, build=1.0)).splitlines()]
    assert [line[1] for line in lines if line and line[0] == "exponent"] == [f"{power:.2f}"] * 3


@pytest.mark.parametrize(("build", "mark"), [(0.9, "✓"), (1.0, "✗")])
def test_the_target_includes_the_build(build, mark):
    """60 microseconds of stages plus the build give 1042 and 943 frames per second."""
    (line,) = [line for line in table_of(sizes(power=1.0, build=build)).splitlines() if "frames per second" in line]
    assert line.split()[3] == f"{1e3 / (build + 0.06):.0f}"
    assert mark in line
