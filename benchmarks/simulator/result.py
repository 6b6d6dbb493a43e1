"""Reader of the results that ``python -m benchmarks.method --json FILE`` writes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from benchmarks.method.curve import COSTS, PRESETS, Point, Sweep
from benchmarks.method.measure import Machine
from benchmarks.method.published import OTHERS, Comparison
from benchmarks.method.reid import Crops
from benchmarks.method.scenes import STAGES

SWEPT = ("views", "people")
"""Sweeps of ``curve`` that are plotted."""


@dataclass(frozen=True)
class Result:
    """Sections with the time per frame, and their provenance.

    Attributes:
        command: command line of the benchmark.
        machine: machine on which it ran.
        versions: versions of Python and packages, by name.
        seconds: duration of the benchmark, seconds.
        quick: whether only few frames were timed.
        published: times compared with those of other code.
        reid: times of the re-ID network at the same sizes; empty if not measured.
        curve: times along sweeps of views and people.
    """

    command: str
    machine: Machine
    versions: dict[str, str]
    seconds: float
    quick: bool
    published: list[Comparison]
    reid: list[Crops]
    curve: list[Sweep]

    def __post_init__(self) -> None:
        """Check that the result can be plotted."""
        for grows in SWEPT:
            sweep = next((sweep for sweep in self.curve if sweep.grows == grows), None)
            if sweep is None or not sweep.points:
                raise ValueError(f"curve must have points along {' and '.join(SWEPT)}, got none along {grows}")
            fixed = {point.people if grows == "views" else point.views for point in sweep.points}
            if len(fixed) > 1:
                raise ValueError(
                    f"only {grows} may change in the sweep of {grows}, got {sorted(fixed)} "
                    f"{'people' if grows == 'views' else 'views'}"
                )
            for preset in PRESETS:
                _check_numbers(sweep.exponents.get(preset, {}), COSTS, f"exponents along {grows}, {preset}")
        if not any(comparison.paper for comparison in self.published):
            raise ValueError("published must have a row with the times of the paper, got none")
        for comparison in self.published:
            _check_positive(comparison.others, OTHERS, f"others at {_size(comparison.ours)}")
            if comparison.paper:
                _check_positive(comparison.paper, STAGES, f"paper at {_size(comparison.ours)}")
        for point in self._points():
            for preset in PRESETS:
                _check_positive(point.ms.get(preset, {}), COSTS, f"{preset} at {_size(point)}")

    def sweep(self, grows: str) -> Sweep:
        """Return the sweep of a quantity."""
        return next(sweep for sweep in self.curve if sweep.grows == grows)

    def _points(self) -> Iterator[Point]:
        yield from (comparison.ours for comparison in self.published)
        yield from (point for sweep in self.curve for point in sweep.points)


def _size(point: Point) -> str:
    return f"{point.views} × {point.people}"


def _check_numbers(figures: Mapping[str, float], names: Iterable[str], where: str) -> None:
    for name in names:
        if name not in figures or not math.isfinite(figures[name]):
            raise ValueError(f"{where}: {name} must be a number, got {figures.get(name, 'nothing')}")


def _check_positive(figures: Mapping[str, float], names: Iterable[str], where: str) -> None:
    _check_numbers(figures, names, where)
    for name in names:
        if figures[name] <= 0:
            raise ValueError(f"{where}: {name} must be above 0 ms, got {figures[name]} ms")


def read(path: Path) -> Result:
    """Read a result.

    Raises:
        ValueError: a missing file, a file that is not a result of the benchmark, or one without a required section.
    """
    try:
        return TypeAdapter(Result).validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise ValueError(
            f"{path}: {_reason(error)}; expected the result of "
            f"`python -m benchmarks.method --only published reid curve --json {path.name}`: run it again"
        ) from error


def _reason(error: OSError | ValidationError) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    first = error.errors()[0]
    where = ".".join(map(str, first["loc"]))
    return f"{where}: {first['msg']}" if where else first["msg"]
