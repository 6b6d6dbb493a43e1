"""Who goes where: tracks that stay in the area and keep everyone apart at all times, found one party at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.motion.paths import (
    SWAY,
    Loop,
    LoopLimits,
    Track,
    draw_loop,
    draw_recorded,
    draw_spot,
    loop_limits,
)

_NARROWEST = 0.45  # metres: half side of the least square to walk round in
_OWN_WAY = (0.7, -0.2)  # share of the draws before anyone is asked to go behind another; less with each plan
_NARROWER = -0.12  # of what loops may be wider than they must; less with each plan
_IN_FILE = 0.5  # chance of that in every draw thereafter
_BEATS = np.array([1.0, 2.0, 0.5, 1.5, 2 / 3])  # rounds of another to one's own: ways gone round in time may cross
_STARTS = 6  # where on a way of one's own it is tried to begin
_TRIES = 300  # draws for each party before the plan starts over
_REFUSALS = 25  # of tracks that keep their distance, for one party: asking whether a track is admitted takes long
_PLANS = 10  # plans before giving up, each sooner content with walks in file
_COARSE, _FINE = 0.25, 1 / 32  # seconds between checks of the distance: everywhere, and where it may be too small
_SCREEN = 16  # every so manyth coarse check comes first: most draws fail there


@dataclass(frozen=True)
class LoopRequest:
    """A wish to go round a loop.

    Attributes:
        what: the activity's name.
        speed: preferred, metres a second; ``slowest`` and ``fastest`` are the limits of keeping in time.
        running: whether it is a run, which needs wider bends and does not become a walk.
    """

    what: str
    speed: float
    slowest: float
    fastest: float
    running: bool = False


@dataclass(frozen=True)
class SpotRequest:
    """A wish to stay on a spot.

    Attributes:
        what: the activity's name.
        clearance: metres around the spot that are filled.
        together: whether the spot is the middle between two.
    """

    what: str
    clearance: float = 0.0
    together: bool = False


@dataclass(frozen=True)
class RecordedRequest:
    """A wish to go a recorded way: ``offset`` (N, 2), metres from its beginning, at ``time`` (N,), seconds."""

    what: str
    time: Floats
    offset: Floats


TrackRequest = LoopRequest | SpotRequest | RecordedRequest
Admit = Callable[[int, Track, Sequence[int]], bool]
"""Says whether a wish, by its index, may have a track that is far enough from those of the wishes that have one."""


def plan_tracks(
    seed: int,
    wishes: Sequence[TrackRequest],
    *,
    area: float,
    spacing: float,
    span: tuple[float, float],
    around: float = 0.0,
    people: Sequence[int] | None = None,
    widest: float | None = None,
    admit: Admit = lambda index, track, before: True,
) -> tuple[Track, ...]:
    """Give every wish a track that stays in the area and away from all others at all times.

    Two tracks are ``spacing`` and the clearances of both apart. Wishes are met one after another, each by draws of
    its own, so that one more leaves the earlier ones where they are. Only when one finds no track does the whole plan
    start over with other draws; then those who need most room choose first, and those who stay keep to the corners and
    to each other.

    Args:
        seed: the scenario's seed.
        wishes: what they ask for.
        area: half the side of the square about the origin that pelvises stay in, metres.
        spacing: least distance between two pelvises, metres.
        span: the first and the last time that the plan must hold for, seconds.
        around: radius about the origin that pelvises stay out of, metres.
        people: the index of the person whose stream draws for each wish; by default the index of the wish.
        widest: as ``area``, for recorded paths that do not fit into ``area`` at any bearing: they get a square as large
            as they need, centred, and a larger one with each plan, up to this; None: ``area``.
        admit: a further condition, asked for tracks that keep their distance.

    Raises:
        ValueError: no such plan was found, or the area is too small for one of the wishes; the message names the keys
            to change.
    """
    half = area - SWAY
    limit = half if widest is None else max(half, widest - SWAY)
    for wish in wishes:
        _check_room(wish, half, limit)
    people = range(len(wishes)) if people is None else people
    placed, refused = 0, 0
    for plan in range(_PLANS):
        board = _Board(span, spacing, around)
        order = list(range(len(wishes)))
        if plan:
            order.sort(key=lambda index: _urgency(wishes[index], movers_first=plan % 2 == 0))
        for index in order:
            rng = stream(seed, "people", people[index], "track", plan)
            square = _square(wishes[index], half, limit, plan)
            refusals = _place(rng, index, wishes[index], board, plan=plan, half=square, admit=admit)
            if index not in board.tracks:
                placed = max(placed, sum(_heads(wishes[done]) for done in board.tracks))
                refused += refusals
                break
        else:
            return tuple(board.tracks[index] for index in range(len(wishes)))
    count = sum(map(_heads, wishes))
    touching = f" ({refused} draws kept that distance, but people or their things touched there)" if refused else ""
    raise ValueError(
        f"people.count = {count} people do not fit: only {placed} found a place in people.area = {area:g} m (half "
        f"the side of their square) with people.spacing = {spacing:g} m between any two for {span[1] - span[0]:g} s"
        f"{touching}; lower people.count{' or raise' if refused else ' or lower'} people.spacing, enlarge people.area, "
        "or take people.activities that need less room"
    )


def _place(
    rng: np.random.Generator, index: int, wish: TrackRequest, board: _Board, *, plan: int, half: float, admit: Admit
) -> int:
    """Put a track on the board, if one is found that keeps its distance and is admitted; how many were refused."""
    own_way = _TRIES * max(0.0, _OWN_WAY[0] + plan * _OWN_WAY[1])
    wide = max(0.0, 1.0 + plan * _NARROWER)
    drawn = (
        _draw(rng, wish, board, half=half, wide=wide, in_file=_IN_FILE if attempt >= own_way else 0.0)
        for attempt in range(_TRIES)
    )
    found: Iterable[Track] = (track for tracks in drawn for track in tracks if board.apart(track, wish))
    if plan and isinstance(wish, SpotRequest):
        found = sorted(found, key=lambda track: board.elbow_room(track, wish, half))
    refusals = 0
    for track in found:
        if admit(index, track, list(board.tracks)):
            board.add(index, track, wish)
            break
        refusals += 1
        if refusals == _REFUSALS:
            break
    return refusals


class _Board:
    """The tracks so far, and where they are at the coarse checks."""

    def __init__(self, span: tuple[float, float], spacing: float, around: float) -> None:
        self.tracks: dict[int, Track] = {}  # by the index of the wish, in the order in which they were found
        self._needs: list[float] = []
        self._spacing, self._around = spacing, around
        self._time = np.linspace(*span, max(2, int(np.ceil((span[1] - span[0]) / _COARSE)) + 1))
        self._taken = np.empty((0, len(self._time), 2))

    @property
    def loops(self) -> list[Loop]:
        return [track for track in self.tracks.values() if isinstance(track, Loop)]

    def add(self, index: int, track: Track, wish: TrackRequest) -> None:
        self.tracks[index] = track
        self._needs.append(_clearance(wish))
        self._taken = np.concatenate([self._taken, track.position(self._time)[None]])

    def apart(self, track: Track, wish: TrackRequest) -> bool:
        """Whether a track keeps its distance from the middle, and from all the others at the same times."""
        if self._around and not self._clear_of_middle(track, wish):
            return False
        if not self.tracks:
            return True
        least = self._spacing + 2 * SWAY + _clearance(wish) + np.array(self._needs)[:, None]
        screen = self._time[::_SCREEN]
        if (_distance(track.position(screen), self._taken[:, ::_SCREEN]) < least).any():
            return False
        slack = _distance(track.position(self._time), self._taken) - least
        if (slack < 0).any():
            return False
        # Between two checks they come nearer by no more than both cover in half of that time.
        step = self._time[1] - self._time[0]
        others = list(self.tracks.values())
        closing = np.array([other.fastest + track.fastest for other in others])[:, None] * step / 2
        between = np.arange(-step / 2, step / 2, _FINE)
        for k in np.flatnonzero((slack < closing).any(axis=1)):
            times = (self._time[slack[k] < closing[k]][:, None] + between).clip(self._time[0], self._time[-1])
            if (_distance(track.position(times), others[k].position(times)) < least[k]).any():
                return False
        return True

    def _clear_of_middle(self, track: Track, wish: TrackRequest) -> bool:
        least = self._around + SWAY + _clearance(wish)
        if (np.hypot(*track.position(self._time).T) < least).any():
            return False
        fine = np.arange(self._time[0], self._time[-1], _FINE)
        return track.fastest == 0 or bool((np.hypot(*track.position(fine).T) >= least).all())

    def elbow_room(self, spot: Track, wish: TrackRequest, half: float) -> float:
        """How much further than it must be a spot is from the next track or from edges of the square, metres.

        Added up over both axes, so that it is least in corners.
        """
        place = spot.position(0.0)
        least = self._spacing + 2 * SWAY + _clearance(wish) + np.array(self._needs)[:, None]
        others = (_distance(place, self._taken) - least).min(initial=np.inf)
        return float(np.minimum(others, half - _clearance(wish) - np.abs(place)).sum())


def _distance(one: Floats, other: Floats) -> Floats:
    return np.hypot(other[..., 0] - one[..., 0], other[..., 1] - one[..., 1])


def _clearance(wish: TrackRequest) -> float:
    return wish.clearance if isinstance(wish, SpotRequest) else 0.0


def _urgency(wish: TrackRequest, *, movers_first: bool) -> tuple[bool, float]:
    """Those who go about come before or after the others, and of these those first who need most room."""
    return isinstance(wish, SpotRequest) == movers_first, -_clearance(wish)


def _heads(wish: TrackRequest) -> int:
    return 2 if isinstance(wish, SpotRequest) and wish.together else 1


def _bends(wish: LoopRequest, half: float) -> LoopLimits:
    return loop_limits(wish.speed, slowest=wish.slowest, fastest=wish.fastest, half=half, running=wish.running)


def _draw(
    rng: np.random.Generator, wish: TrackRequest, board: _Board, *, half: float, wide: float, in_file: float
) -> Sequence[Track]:
    """Tracks to try, none or some; those of one loop begin at different places of it."""
    if isinstance(wish, SpotRequest):
        return [draw_spot(rng, half=half - wish.clearance, apart=wish.together)]
    if isinstance(wish, RecordedRequest):
        recorded = draw_recorded(rng, half=half, time=wish.time, offset=wish.offset)
        return [] if recorded is None else [recorded]
    limits = _bends(wish, half)
    follows, whom = rng.uniform(size=2)
    starts = rng.uniform(size=_STARTS)
    loops = board.loops
    ahead = loops[int(whom * len(loops))] if loops else None
    if ahead is not None and follows < in_file:
        if not limits.slowest <= ahead.speed <= limits.fastest:
            return []
        return [replace(ahead, start=float(start) * ahead.length) for start in starts]
    widest = limits.tightest + wide * (half - limits.tightest)
    loop = draw_loop(rng, half=half, speed=limits.speed, tightest=limits.tightest, widest=widest)
    if loop is None:
        return []
    if ahead is not None:
        speeds = loop.length * ahead.speed / ahead.length * _BEATS
        fit = speeds[(limits.slowest <= speeds) & (speeds <= limits.fastest)]
        loop = replace(loop, speed=float(fit[0])) if len(fit) else loop
    return [replace(loop, start=float(start) * loop.length) for start in starts]


def _square(wish: TrackRequest, half: float, limit: float, plan: int) -> float:
    """Return half the side of the square that a wish is to stay in, metres.

    It is ``half``, except for a recorded path that fits into it at no bearing: its square goes in equal steps, plan by
    plan, from the one that it fits at any bearing to ``limit``.
    """
    if not isinstance(wish, RecordedRequest):
        return half
    extents = _extents(wish)
    if extents.min() <= 2 * half:
        return half
    least = min(float(extents.max()) / 2, limit)
    return least + (limit - least) * plan / (_PLANS - 1)


def _extents(wish: RecordedRequest) -> Floats:
    """Return the sides of the squares around a recorded path, one for each of several bearings, metres."""
    return np.array([np.ptp(wish.offset @ axes, axis=0).max() for axes in _AXES])


def _check_room(wish: TrackRequest, half: float, limit: float) -> None:
    """Raise ValueError if the area is too small for one of the wishes alone."""
    area = half + SWAY
    least = None
    if isinstance(wish, SpotRequest) and half <= wish.clearance:
        least = max(wish.clearance, SWAY) + SWAY
    elif isinstance(wish, LoopRequest) and half < _NARROWEST:
        least = _NARROWEST + SWAY
    elif isinstance(wish, LoopRequest) and _bends(wish, half).speed < _bends(wish, half).slowest:
        grown = np.arange(half, half + 100.0, 0.05)
        least = next((float(h) for h in grown if _bends(wish, h).speed >= _bends(wish, h).slowest), grown[-1]) + SWAY
    elif isinstance(wish, RecordedRequest):
        _check_recorded(wish, half, limit)
    if least is not None:
        raise ValueError(
            f'people.area = {area:g} m is too small for "{wish.what}": it takes {least:.2f} m or more; enlarge '
            "people.area or take other people.activities"
        )


def _check_recorded(wish: RecordedRequest, half: float, limit: float) -> None:
    """Raise ValueError if a recorded path fits into the largest square at no bearing."""
    extents = _extents(wish)
    if extents.min() <= 2 * limit:
        return
    needed = np.ceil(100 * (extents.max() / 2 + SWAY) + 1) / 100
    path = f"people.motion: the recorded path extends over {extents.max():.2f} m"
    if limit > half:
        grown = np.ceil(100 * 2 * (needed - limit - SWAY)) / 100
        raise ValueError(
            f"{path} and needs people.area = {needed:.2f} m (half the side of a square), but the walls of the room "
            f"leave {limit + SWAY:.2f} m: enlarge the first two numbers of room.size by {grown:.2f} m, shorten "
            "duration, or set another people.motion.start"
        )
    raise ValueError(
        f"{path} and does not fit into people.area = {half + SWAY:g} m (half the side of a square): set people.area to "
        f"{needed:.2f} m or more, shorten duration, or set another people.motion.start"
    )


_AXES = np.array([[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in np.radians(np.arange(0, 90, 5))])
