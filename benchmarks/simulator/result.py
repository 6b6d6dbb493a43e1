"""What ``python -m benchmarks.method --json FILE`` wrote, read back and checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from benchmarks.method.curve import COSTS, PRESETS, Point, Sweep
from benchmarks.method.measure import Machine
from benchmarks.method.published import OTHERS, Beside
from benchmarks.method.reid import Crops
from benchmarks.method.tasks import STAGES

SWEPT = ("views", "people")
"""The sweeps of ``curve`` that are shown."""


@dataclass(frozen=True)
class Result:
    """The sections that say what a frame costs, and where they come from.

    Attributes:
        command: that measured them.
        machine: on which.
        versions: of Python and packages, by name.
        seconds: that it took.
        quick: whether only few frames were timed.
        published: sizes at which others were timed.
        reid: the re-ID network at the same sizes, or nothing.
        curve: growth.
    """

    command: str
    machine: Machine
    versions: dict[str, str]
    seconds: float
    quick: bool
    published: list[Beside]
    reid: list[Crops]
    curve: list[Sweep]

    def __post_init__(self) -> None:
        """Refuse what cannot be shown."""
        for grows in SWEPT:
            sweep = next((sweep for sweep in self.curve if sweep.grows == grows), None)
            if sweep is None or not sweep.points:
                raise ValueError(f"curve must have points along {' and '.join(SWEPT)}, there are none along {grows}")
            fixed = {point.people if grows == "views" else point.views for point in sweep.points}
            if len(fixed) > 1:
                raise ValueError(f"only {grows} may grow along {grows}, got {sorted(fixed)} of the other")
            for preset in PRESETS:
                _all_there(sweep.exponents.get(preset, {}), COSTS, f"exponents along {grows}, {preset}")
        if not any(beside.paper for beside in self.published):
            raise ValueError("published must have the size of the paper's figures, no row has any")
        for beside in self.published:
            _positive(beside.others, OTHERS, f"others at {_size(beside.ours)}")
            if beside.paper:
                _positive(beside.paper, STAGES, f"paper at {_size(beside.ours)}")
        for point in self._points():
            for preset in PRESETS:
                _positive(point.ms.get(preset, {}), COSTS, f"{preset} at {_size(point)}")

    def sweep(self, grows: str) -> Sweep:
        """The sweep along which this grows."""
        return next(sweep for sweep in self.curve if sweep.grows == grows)

    def _points(self) -> Iterator[Point]:
        yield from (beside.ours for beside in self.published)
        yield from (point for sweep in self.curve for point in sweep.points)


def _size(point: Point) -> str:
    return f"{point.views} × {point.people}"


def _all_there(figures: Mapping[str, float], names: Iterable[str], where: str) -> None:
    for name in names:
        if name not in figures or not math.isfinite(figures[name]):
            raise ValueError(f"{where}: {name} must be a number, got {figures.get(name, 'nothing')}")


def _positive(figures: Mapping[str, float], names: Iterable[str], where: str) -> None:
    _all_there(figures, names, where)
    for name in names:
        if figures[name] <= 0:
            raise ValueError(f"{where}: {name} must take some time, got {figures[name]} ms")


def read(path: Path) -> Result:
    """Read a result.

    Raises:
        ValueError: no such file, or one that is not of the benchmark, or without one of the sections.
    """
    try:
        return TypeAdapter(Result).validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise ValueError(
            f"{path}: {_why(error)}; expected the figures of "
            f"`python -m benchmarks.method --only published reid curve --json {path.name}`: run it again"
        ) from error


def _why(error: OSError | ValidationError) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    first = error.errors()[0]
    where = ".".join(map(str, first["loc"]))
    return f"{where}: {first['msg']}" if where else first["msg"]
