"""Things added until a given share of the joints in the pictures is hidden."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from mvpose.arrays import Bools, Floats
from simharness.scenario.sections.room import Room
from simharness.types.random_streams import stream
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.placement.free_space import FreeSpace, Site
from simharness.world.scene.placement.sight_lines import SightLines, lines_of_sight

Draw = Callable[[np.random.Generator, Room], ObjectModel]

WITHIN = 0.05  # of the share asked for
_AIM = 0.02  # how near to get while things still help: the sample is not everything
_LINES = 24_000  # lines of sight, about, on which the share is measured
_MOMENTS = (6, 48)  # least and most of them
_CANDIDATES = 16  # tried for each thing that is added
_TRIES = 40
_ROUNDS = 60
_BARREN = 6  # rounds without any gain after which it is given up
_ALONG = (0.12, 0.88)  # of a line of sight: where on it a thing is put
_ASKEW = 0.25  # radians, standard deviation of how far its front turns from that line
_LEAST_GAIN = 0.002
# What one thing may hide, where there is a choice: many things that hide a little look more like a room than a few
# that hide much, but where those have no place left, these do it.
_MOST_GAIN = (0.07, 1.0)


def lines_in(space: FreeSpace) -> SightLines:
    """Lines of sight at moments spread evenly over the time that is filmed.

    People are planned for as long before time 0 as after the end, so that time is known.
    """
    shown = np.flatnonzero((space.time >= 0) & (space.time <= space.time[-1] + min(space.time[0], 0)))
    each = max(1, len(space.rig) * int(np.prod(space.joints.shape[1:3])))
    count = int(np.clip(_LINES / each, *_MOMENTS))
    chosen = shown[np.unique(np.linspace(0, len(shown) - 1, min(count, len(shown))).round().astype(int))]
    return lines_of_sight(space.rig, space.time[chosen], space.joints[chosen])


def share_hidden(space: FreeSpace, solids: Sequence[Solid]) -> float:
    """Share of the joints in the pictures, of all people, cameras and moments, that things hide."""
    lines = lines_in(space)
    return float(lines.hidden(solids).mean()) if len(lines) else 0.0


def cover(seed: int, share: float, fillers: Mapping[str, Draw], site: Site) -> None:
    """Add things until they hide the share asked for, within 5 points, together with those that stand there.

    In each round several things of one kind are drawn, each by a stream of its own, and put between a camera and a
    joint; the one that hides most, if not too much at once, stays. Only near the end the one is taken that comes
    nearest to the share, so that asking for more adds to the same things.

    Args:
        seed: of the scenario.
        share: of the joints in the pictures, 0 to 1.
        fillers: draws of the kinds of things to add, by name.
        site: where they are added.

    Raises:
        ValueError: things hide more already, or cannot hide so much; the message says what was reached and what
            limits it.
    """
    lines = lines_in(site.space)
    if not len(lines):
        raise ValueError(
            f"clutter.coverage = {share:g} asks for hidden joints, but no joint is in any picture: take people.count "
            "above 0 and cameras that look at them, or leave clutter.coverage out"
        )
    hidden = lines.hidden(site.solids)
    if hidden.mean() > share + WITHIN:
        raise ValueError(
            f"clutter.coverage = {share:g} is less than what the things that were asked for hide by themselves, "
            f"{hidden.mean():.2f} of the joints in the pictures: ask for fewer things or more coverage"
        )
    reached = 0.0
    for most in _MOST_GAIN:
        added, reached = _fill(seed, share, fillers, site.copy(), lines, hidden, most)
        if abs(reached - share) <= WITHIN:
            for solid in added:
                site.add(solid)
            return
    raise ValueError(
        f"clutter.coverage = {share:g} cannot be reached: {len(added)} more things hide {reached:.2f} of the joints in "
        "the pictures, and others would stand in people's way, within 0.5 m of a lens, or fill more than 60 % of a "
        "picture; lower clutter.coverage, cameras.height, people.count or people.area, or enlarge room.size"
    )


def _fill(
    seed: int, share: float, fillers: Mapping[str, Draw], site: Site, lines: SightLines, hidden: Bools, most: float
) -> tuple[list[Solid], float]:
    """Add things until they hide the share, or nothing helps, none of them more than ``most`` if it can be helped.

    Returns:
        What was added, and the share of the joints that are hidden then.
    """
    added: list[Solid] = []
    barren = 0
    order = stream(seed, "clutter", "coverage").permutation(list(fillers)).tolist()
    for turn in range(_ROUNDS):
        if abs(hidden.mean() - share) <= _AIM or barren == _BARREN:
            break
        barren += 1
        name = order[turn % len(order)]
        found = list(_candidates(seed, turn, fillers[name], site, lines, f"cover {name}{len(added)}"))
        cut = [hidden | lines.cut_by(solid) for solid in found]
        gain = np.array([each.mean() for each in cut]) - hidden.mean()
        if gain.max(initial=0.0) < _LEAST_GAIN:
            continue
        best = int(np.where(gain <= most, gain, -gain).argmax())
        missing = share - hidden.mean()
        if gain[best] > missing + _AIM:
            best = int(np.abs(gain - missing).argmin())
            if abs(gain[best] - missing) >= missing:
                continue
        barren, hidden = 0, cut[best]
        added.append(found[best])
        site.add(found[best])
    return added, float(hidden.mean())


def _candidates(seed: int, turn: int, draw: Draw, site: Site, lines: SightLines, name: str) -> Iterator[Solid]:
    """Things of one kind that could be added, each across a line of sight."""

    def across(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
        chosen, along, askew = int(rng.integers(len(lines))), rng.uniform(*_ALONG), rng.normal(0.0, _ASKEW)
        way = lines.ends[chosen] - lines.starts[chosen]
        return (lines.starts[chosen] + along * way)[:2], float(np.arctan2(way[1], way[0]) + askew)

    for k in range(_CANDIDATES):
        rng = stream(seed, "clutter", "coverage", turn, k)
        solid = site.find(rng, draw(rng, site.space.room), across, kind="clutter", name=name, tries=_TRIES)
        if solid is not None:
            yield solid
