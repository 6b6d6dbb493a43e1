"""Rendering a split, part by part: parts that lie in the cache, made by this same code, are not rendered again."""

from __future__ import annotations

import hashlib
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path

from tools.reid import code_digest
from tools.reid.crops import Crops, Recipe, picture_group
from tools.reid.identities import Group, split_of
from tools.reid.poses import Poses, plan_poses

_PART = 10  # groups


@dataclass(frozen=True)
class Order:
    """Crops to be rendered.

    Attributes:
        groups: of whom.
        recipe: how.
    """

    groups: tuple[Group, ...]
    recipe: Recipe

    @property
    def name(self) -> str:
        """Tells it from every other order, and from the same one rendered by other code."""
        text = repr((code_digest.digest(), self.recipe, [astuple(group) for group in self.groups]))
        return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def rendered(order: Order, folder: Path, *, workers: int = 1) -> Crops:
    """The crops of an order, from the cache as far as they are there.

    Args:
        order: what to render.
        folder: the cache.
        workers: processes.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parts = tuple(_parts(order))
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


def _parts(order: Order) -> Iterator[Order]:
    for first in range(0, len(order.groups), _PART):
        yield Order(order.groups[first : first + _PART], order.recipe)


def _render(order: Order, path: Path) -> None:
    crops = Crops.joined([pictured(group, order.recipe) for group in order.groups])
    whole = path.with_suffix(".part.npz")
    crops.save(whole)
    whole.replace(path)  # a file that is there is whole


def pictured(group: Group, recipe: Recipe) -> Crops:
    """Crops of a group, in poses of its split's own."""
    return picture_group(group, recipe, poses=_poses(split_of(group.seed) or "none"))


@cache
def _poses(split: str) -> Poses:
    """Poses of a split: none of them is another's."""
    return plan_poses(int.from_bytes(hashlib.blake2b(split.encode(), digest_size=6).digest(), "little"))
