"""Who is to be told apart: people as scenarios draw them, in splits whose seeds no scenario has.

An identity is person ``person`` of the scenario seed ``seed``: the same streams give it the same body and the same look
here as there. Groups are the people of one such scenario, so a group has its own value of ``look_alike``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.clothing import dress, paint
from simharness.world.humans.population import draw_shape, is_child
from simharness.world.humans.wardrobe import Look, draw_looks

Split = Literal["training", "validation", "held-out"]

SPLITS: tuple[Split, ...] = ("training", "validation", "held-out")
CHILDREN = 0.1  # share of people
RUNS = 10**6
"""Seeds of runs: they are less than this."""
_GROUPS = 10**6  # of a split in a run
_SPAN = RUNS * _GROUPS


@dataclass(frozen=True)
class Group:
    """People who may be in one scene.

    Attributes:
        seed: of a scenario that has them.
        size: how many they are.
        look_alike: the dial of that scenario.
        site: seed of the place where they are filmed (:mod:`tools.reid.filming_sites`).
    """

    seed: int
    size: int
    look_alike: float = 0.0
    site: int = 0


@dataclass(frozen=True)
class Figure:
    """One identity to be pictured.

    Attributes:
        seed: of its group.
        person: index in it.
        body: dressed.
        mesh: how it looks, at rest.
    """

    seed: int
    person: int
    body: Body
    mesh: Mesh


def groups(
    split: Split, run: int, count: int, *, size: int, look_alike: Sequence[float] = (0.0,), at_a_site: int = 1
) -> tuple[Group, ...]:
    """The first groups of a split.

    Group k of a split and run always has the same people, however many groups there are, and whatever its dial: only
    their clothes come nearer to each other with it. The seeds of two splits or runs never meet, and are beyond
    those that people write into scenarios.

    Args:
        split: what they are for.
        run: the seed of the run, 0 to 999999.
        count: how many groups, at most 1000000.
        size: people in each.
        look_alike: values of the dial, that the groups take in turn.
        at_a_site: how many groups are filmed in one place, one after the other.

    Raises:
        ValueError: a run or a count out of range.
    """
    if not 0 <= run < RUNS or not 0 <= count <= _GROUPS:
        raise ValueError(f"a run has a seed from 0 to {RUNS - 1} and at most {_GROUPS} groups, got {run} and {count}")
    first = (1 + SPLITS.index(split)) * _SPAN + run * _GROUPS
    return tuple(Group(first + k, size, look_alike[k % len(look_alike)], first + k // at_a_site) for k in range(count))


def split_of(seed: int) -> Split | None:
    """The split that a scenario's seed belongs to; None for the seeds of ordinary scenarios."""
    index = seed // _SPAN - 1
    return SPLITS[index] if 0 <= index < len(SPLITS) else None


def figures(group: Group, people: Iterable[int]) -> tuple[Figure, ...]:
    """Some people of a group, as :func:`simharness.world.scene.build.build` makes them for a scenario of its seed."""
    wanted = list(people)
    looks = draw_looks(group.seed, max(wanted, default=-1) + 1, look_alike=group.look_alike)
    return tuple(_figure(group.seed, person, looks[person]) for person in wanted)


def _figure(seed: int, person: int, look: Look) -> Figure:
    shape = draw_shape(stream(seed, "people", person, "shape"), child=is_child(seed, person, CHILDREN))
    body = dress(make_body(shape), look)
    coat = paint(body, look)
    mesh = Mesh(body.vertices, body.faces, coat.colors, smooth=True, texture=coat.texture, uv=coat.uv)
    return Figure(seed, person, body, mesh)
