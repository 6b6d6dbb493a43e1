"""Search methods of a hunt: which points of the unit cube are tried next. The same seed gives the same points.

Uniform random points; Latin hypercubes (McKay, Beckman & Conover, Technometrics 1979); and MAP-Elites (Mouret & Clune,
"Illuminating search spaces by mapping elites", 2015), which keeps for every cell of an archive the point that fails
most reliably, and varies these (Vassiliades & Mouret, "Discovering the elite hypervolume", GECCO 2018).
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import qmc

from mvpose.arrays import Floats
from simharness.hunt.hunted_trial import BINS, NOISES, HuntFinding
from simharness.scoring.stage_blame import Stage
from simharness.types.random_streams import stream

BATCH = 16
"""Points that are tried before the method hears of their results."""

_STAGES = ("", *map(str, Stage))
_ISO, _LINE = 0.1, 0.2  # spread of new points about an elite, and along the way to another one
_UNIFORM = 4  # one in so many points of MAP-Elites is anywhere


class RandomSearch:
    """Uniform random points of the unit cube of some dimensions; the base of other search methods."""

    def __init__(self, dimensions: int, seed: int) -> None:
        self._dimensions, self._seed, self._batches = dimensions, seed, itertools.count()

    def ask(self) -> Floats:
        """Return the next :data:`BATCH` points, (n, d)."""
        return stream(self._seed, "hunt", "random", next(self._batches)).random((BATCH, self._dimensions))

    def tell(self, points: Floats, findings: Sequence[Sequence[HuntFinding]]) -> None:
        """Take what was found at points (n, d); the next points do not depend on it."""


class LatinHypercube(RandomSearch):
    """Latin hypercubes of as many points as there are trials, one after the other."""

    def __init__(self, dimensions: int, seed: int, trials: int = 64) -> None:
        super().__init__(dimensions, seed)
        drawn = int(stream(seed, "hunt", "hypercube").integers(2**32))
        sampler = qmc.LatinHypercube(dimensions, seed=drawn)
        self._points = (point for _ in itertools.count() for point in sampler.random(trials))

    def ask(self) -> Floats:
        """Return the next points."""
        return np.array(list(itertools.islice(self._points, BATCH)))


class MapElites(RandomSearch):
    """Variations of the points that fail most reliably in each cell, and random points.

    Raises:
        ValueError: the library ``ribs`` is not installed.
    """

    def __init__(self, dimensions: int, seed: int, properties: Sequence[str]) -> None:
        super().__init__(dimensions, seed)
        try:
            from ribs.archives import GridArchive
            from ribs.emitters import IsoLineEmitter
        except ImportError:
            raise ValueError(
                '--method map-elites: needs ribs; install the extra "hunt", or choose another method'
            ) from None
        sizes = [len(properties), len(_STAGES), *(len(borders) + 1 for borders in BINS.values())]
        ranges = [(-0.5, size - 0.5) for size in sizes]
        self._names = tuple(properties)
        self._archive: Any = GridArchive(solution_dim=dimensions, dims=sizes, ranges=ranges, seed=seed)
        self._emitter: Any = IsoLineEmitter(
            self._archive,
            iso_sigma=_ISO,
            line_sigma=_LINE,
            x0=np.full(dimensions, 0.5),
            bounds=[(0.0, 1.0)] * dimensions,
            batch_size=BATCH,
            seed=seed,
        )

    def ask(self) -> Floats:
        """Return the next points."""
        points = super().ask()
        if not self._archive.empty:
            points = np.where((np.arange(BATCH) % _UNIFORM == 0)[:, None], points, self._emitter.ask())
        return points

    def tell(self, points: Floats, findings: Sequence[Sequence[HuntFinding]]) -> None:
        """Keep the points that fail more reliably than those of their cells."""
        for point, found in zip(points, findings, strict=True):
            for each in found:
                name, stage, *bins = each.cell
                cell = [self._names.index(name), _STAGES.index(stage), *bins]
                self._archive.add_single(point, each.failed / NOISES, np.array(cell, float))


def search_method(
    name: str, dimensions: int, seed: int, *, properties: Sequence[str], trials: int | None
) -> RandomSearch:
    """Return a search method by its name: random, lhs or map-elites.

    Raises:
        ValueError: no such method, or ``ribs`` is missing.
    """
    if name == "map-elites":
        return MapElites(dimensions, seed, properties)
    if name not in ("random", "lhs"):
        raise ValueError(f"--method {name}: no such method; expected map-elites, lhs or random")
    return LatinHypercube(dimensions, seed, trials or 64) if name == "lhs" else RandomSearch(dimensions, seed)
