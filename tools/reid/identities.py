"""Identities of the re-ID data set: people drawn as in scenarios, in splits with separate ranges of seeds.

An identity is person ``person`` of the scenario seed ``seed``. The random streams are those of scenarios, so the
identity has the same body and look as in a scenario with that seed. A group is the set of people of one such scenario,
and has one value of ``look_alike``. Ordinary scenarios use none of these seeds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.accessories import wear
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.figure import figure_mesh
from simharness.world.humans.population import draw_shape, is_child
from simharness.world.humans.wardrobe import Look, draw_looks

Split = Literal["training", "validation", "held-out"]

SPLITS: tuple[Split, ...] = ("training", "validation", "held-out")
CHILDREN = 0.1  # fraction of people who are children
RUNS = 10**6
"""Upper bound of the seeds of runs, exclusive."""
_GROUPS = 10**6  # greatest number of groups in a split of a run
_SPAN = RUNS * _GROUPS


@dataclass(frozen=True)
class Group:
    """People of one scene.

    Attributes:
        seed: seed of the scenario.
        size: number of people.
        look_alike: parameter ``look_alike`` of the scenario.
        site: seed of the filming site (:mod:`tools.reid.filming_sites`).
    """

    seed: int
    size: int
    look_alike: float = 0.0
    site: int = 0


@dataclass(frozen=True)
class DressedPerson:
    """Body and surface of one identity.

    Attributes:
        seed: seed of the group.
        person: index in the group.
        body: dressed body.
        mesh: coloured mesh of the rest body.
    """

    seed: int
    person: int
    body: Body
    mesh: Mesh


def groups(
    split: Split, run: int, count: int, *, size: int, look_alike: Sequence[float] = (0.0,), at_a_site: int = 1
) -> tuple[Group, ...]:
    """Return the first groups of a split.

    Group k of a split and run always has the same people, for any number of groups and any value of ``look_alike``,
    which changes their clothes only. The seeds of two splits or runs are always different, and larger than those
    written in scenario files.

    Args:
        split: split of the data set.
        run: seed of the run, 0 to 999999.
        count: number of groups, at most 1000000.
        size: number of people in each group.
        look_alike: values of ``look_alike``, which the groups take in turn.
        at_a_site: number of successive groups filmed at the same site.

    Raises:
        ValueError: ``run`` or ``count`` is out of range.
    """
    if not 0 <= run < RUNS or not 0 <= count <= _GROUPS:
        raise ValueError(
            f"the seed of a run must be from 0 to {RUNS - 1} and its groups at most {_GROUPS}, got {run} and {count}"
        )
    first = (1 + SPLITS.index(split)) * _SPAN + run * _GROUPS
    return tuple(Group(first + k, size, look_alike[k % len(look_alike)], first + k // at_a_site) for k in range(count))


def split_of(seed: int) -> Split | None:
    """Return the split of a scenario seed, or None for the seed of an ordinary scenario."""
    index = seed // _SPAN - 1
    return SPLITS[index] if 0 <= index < len(SPLITS) else None


def dressed_people(group: Group, people: Iterable[int]) -> tuple[DressedPerson, ...]:
    """Make people of a group, equal to those that :func:`simharness.world.scene.build.build` makes for its seed."""
    indices = list(people)
    looks = draw_looks(group.seed, max(indices, default=-1) + 1, look_alike=group.look_alike)
    return tuple(_dressed_person(group.seed, person, looks[person]) for person in indices)


def _dressed_person(seed: int, person: int, look: Look) -> DressedPerson:
    shape = draw_shape(stream(seed, "people", person, "shape"), child=is_child(seed, person, CHILDREN))
    body = wear(dress(make_body(shape), look), look)
    return DressedPerson(seed, person, body, figure_mesh(body, look))
