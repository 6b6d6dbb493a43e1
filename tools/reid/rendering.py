"""Rendering of crops with a cache on disk: parts made by the same code are not rendered again."""

from __future__ import annotations

import hashlib
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path

from tools.reid import code_digest
from tools.reid.crops import Crops, Recipe, crops_of_group
from tools.reid.identities import Group, split_of
from tools.reid.poses import Poses, plan_poses

_PART = 10  # groups in a file of the cache


@dataclass(frozen=True)
class RenderJob:
    """Specification of crops to render.

    Attributes:
        groups: groups of people.
        recipe: parameters of the crops.
    """

    groups: tuple[Group, ...]
    recipe: Recipe

    @property
    def name(self) -> str:
        """Digest of the job and of the code that renders it."""
        text = repr((code_digest.digest(), self.recipe, [astuple(group) for group in self.groups]))
        return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def render_crops(job: RenderJob, folder: Path, *, workers: int = 1) -> Crops:
    """Return the crops of a job; render those that are not in the cache.

    Args:
        job: crops to render.
        folder: folder of the cache, made if missing.
        workers: number of processes.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parts = tuple(_parts(job))
    paths = [folder / f"{part.name}.npz" for part in parts]
    missing = [(part, path) for part, path in zip(parts, paths, strict=True) if not path.is_file()]
    if workers > 1 and len(missing) > 1:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=spawn) as pool:
            for _ in pool.map(_render, *zip(*missing, strict=True)):
                pass
    else:
        for part, path in missing:
            _render(part, path)
    return Crops.joined([Crops.load(path) for path in paths])


def _parts(job: RenderJob) -> Iterator[RenderJob]:
    """Split a job into jobs of at most ``_PART`` groups."""
    for first in range(0, len(job.groups), _PART):
        yield RenderJob(job.groups[first : first + _PART], job.recipe)


def _render(job: RenderJob, path: Path) -> None:
    """Render a job and write its crops."""
    crops = Crops.joined(
        [crops_of_group(group, job.recipe, poses=_poses(split_of(group.seed) or "none")) for group in job.groups]
    )
    temporary = path.with_suffix(".part.npz")
    crops.save(temporary)
    temporary.replace(path)  # so a file in the cache is always complete


@cache
def _poses(split: str) -> Poses:
    """Return the poses of a split; every split has different ones."""
    return plan_poses(int.from_bytes(hashlib.blake2b(split.encode(), digest_size=6).digest(), "little"))
