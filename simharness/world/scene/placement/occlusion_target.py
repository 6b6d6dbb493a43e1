"""Objects added until a given share of the joints in the pictures is occluded."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from mvpose.arrays import Bools, Floats
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.placement.free_space import FreeSpace, Site
from simharness.world.scene.placement.sight_lines import SightLines, lines_of_sight

Draw = Callable[[np.random.Generator, RoomSection], ObjectModel]

WITHIN = 0.05  # accepted deviation from the requested share
_AIM = 0.02  # targeted deviation on the sample of lines, smaller because the sample is not complete
_LINES = 24_000  # approximate number of lines of sight on which the share is measured
_TIMES = (6, 48)  # least and largest number of times
_CANDIDATES = 16  # candidates for each added object
_TRIES = 40
_ROUNDS = 60
_MAX_FAILED_ROUNDS = 6  # rounds without gain after which the search ends
_ALONG = (0.12, 0.88)  # position of an object on a line of sight, as a share of its length
_YAW_SPREAD = 0.25  # radians: standard deviation of the angle between its front and that line
_LEAST_GAIN = 0.002
# Largest gain of one object, in the order of attempts: many objects that each hide a little are more like a real room
# than a few that hide much; the latter are used only if there is no place for the former.
_MOST_GAIN = (0.07, 1.0)


def lines_in(space: FreeSpace) -> SightLines:
    """Return lines of sight at times spread evenly over the filmed sequence.

    People are planned for equally long before time 0 and after the end, so the end of the sequence is known.
    """
    shown = np.flatnonzero((space.time >= 0) & (space.time <= space.time[-1] + min(space.time[0], 0)))
    each = max(1, len(space.rig) * int(np.prod(space.joints.shape[1:3])))
    count = int(np.clip(_LINES / each, *_TIMES))
    chosen = shown[np.unique(np.linspace(0, len(shown) - 1, min(count, len(shown))).round().astype(int))]
    return lines_of_sight(space.rig, space.time[chosen], space.joints[chosen])


def cover(seed: int, share: float, fillers: Mapping[str, Draw], site: Site) -> None:
    """Add objects until they and the present solids occlude the requested share of joints, within 5 points.

    In each round several objects of one kind are drawn, each by a separate stream, and placed between a camera and a
    joint; the one with the largest gain below a limit is kept. Only in the last step the one with the share nearest to
    the request is taken, so a larger request adds to the same objects.

    Args:
        seed: seed of the scenario.
        share: requested share of the joints in the pictures, 0 to 1.
        fillers: functions that draw objects to add, by kind.
        site: site to which they are added.

    Raises:
        ValueError: present solids occlude more already, or the share cannot be reached; the message gives the share
            that was reached and the limits.
    """
    lines = lines_in(site.space)
    if not len(lines):
        raise ValueError(
            f"clutter.coverage = {share:g} cannot be reached, because no joint is in any picture: use people.count "
            "above 0 and cameras that look at them, or remove clutter.coverage"
        )
    hidden = lines.hidden(site.solids)
    if hidden.mean() > share + WITHIN:
        raise ValueError(
            f"clutter.coverage = {share:g} is less than the share of joints that the requested objects occlude "
            f"already, {hidden.mean():.2f}: request fewer objects or a higher clutter.coverage"
        )
    reached = 0.0
    for most in _MOST_GAIN:
        added, reached = _fill(seed, share, fillers, site.copy(), lines, hidden, most)
        if abs(reached - share) <= WITHIN:
            for solid in added:
                site.add(solid)
            return
    raise ValueError(
        f"clutter.coverage = {share:g} cannot be reached: with {len(added)} added objects {reached:.2f} of the joints "
        "in the pictures are occluded, and further ones would obstruct people, stand within 0.5 m of a camera, or fill "
        "more than 60 % of a picture; lower clutter.coverage, cameras.height, people.count or people.area, or enlarge "
        "room.size"
    )


def _fill(
    seed: int, share: float, fillers: Mapping[str, Draw], site: Site, lines: SightLines, hidden: Bools, most: float
) -> tuple[list[Solid], float]:
    """Add objects until they occlude the share or no candidate helps, with gains of at most ``most`` if possible.

    Returns:
        Added objects, and the share of joints that are occluded then.
    """
    added: list[Solid] = []
    failed = 0
    order = stream(seed, "clutter", "coverage").permutation(list(fillers)).tolist()
    for attempt in range(_ROUNDS):
        if abs(hidden.mean() - share) <= _AIM or failed == _MAX_FAILED_ROUNDS:
            break
        failed += 1
        name = order[attempt % len(order)]
        candidates = list(_candidates(seed, attempt, fillers[name], site, lines, f"cover {name}{len(added)}"))
        cut = [hidden | lines.cut_by(solid) for solid in candidates]
        gain = np.array([each.mean() for each in cut]) - hidden.mean()
        if gain.max(initial=0.0) < _LEAST_GAIN:
            continue
        best = int(np.where(gain <= most, gain, -gain).argmax())
        missing = share - hidden.mean()
        if gain[best] > missing + _AIM:
            best = int(np.abs(gain - missing).argmin())
            if abs(gain[best] - missing) >= missing:
                continue
        failed, hidden = 0, cut[best]
        added.append(candidates[best])
        site.add(candidates[best])
    return added, float(hidden.mean())


def _candidates(seed: int, attempt: int, draw: Draw, site: Site, lines: SightLines, name: str) -> Iterator[Solid]:
    """Yield objects of one kind that could be added, each across a line of sight."""

    def sample_place(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
        chosen, along, turn = int(rng.integers(len(lines))), rng.uniform(*_ALONG), rng.normal(0.0, _YAW_SPREAD)
        way = lines.ends[chosen] - lines.starts[chosen]
        return (lines.starts[chosen] + along * way)[:2], float(np.arctan2(way[1], way[0]) + turn)

    for k in range(_CANDIDATES):
        rng = stream(seed, "clutter", "coverage", attempt, k)
        solid = site.find(rng, draw(rng, site.space.room), sample_place, kind="clutter", name=name, tries=_TRIES)
        if solid is not None:
            yield solid
