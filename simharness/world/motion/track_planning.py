"""Track planning: tracks that stay in the area and keep people apart at all times, found one group at a time."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.motion import paths
from simharness.world.motion.paths import Route
from simharness.world.motion.visits import Visitor

_NARROWEST = 0.45  # metres: half side of the smallest square to walk round in
_ALONE = (0.7, -0.2)  # fraction of the draws before a person may follow another on the same loop; less with each plan
_NARROWER = -0.12  # change with each plan of how much wider than necessary loops may be
_FOLLOWING = 0.5  # probability to follow another, in every later draw
_ROUND_RATIOS = np.array([1.0, 2.0, 0.5, 1.5, 2 / 3])  # ratios of round times: loops with such a ratio may cross
_STARTS = 6  # start positions tried on each loop
_TRIES = 300  # draws for each group before the plan starts over
_REFUSALS = 25  # rejected tracks of one group before the plan starts over: ``admit`` is slow
_VISIT_TRIES = 40  # draws for each visitor: each tries many ways
_PLANS = 10  # plans before giving up; later ones let people follow each other sooner
_COARSE, _FINE = 0.25, 1 / 32  # seconds between distance checks: everywhere, and where the distance may be too small
_FREE, _FREE_MARGIN = 0.1, 0.05  # seconds between checks of a visitor's way, and metres that may be missed between two
_SCREEN = 16  # every sixteenth coarse check comes first: most draws fail there


class _Alone:
    """Request of one person who needs no more room than a pelvis."""

    clearance = 0.0
    people = 1


@dataclass(frozen=True)
class LoopRequest(_Alone):
    """Request for a loop."""

    activity: str
    """Name of the activity."""
    speed: float
    """Preferred speed in metres per second."""
    slowest: float
    """Lowest speed accepted to stay synchronous with others, metres per second."""
    fastest: float
    """Highest such speed, metres per second."""
    running: bool = False
    """Whether the activity is a run, which needs wider bends and must not become a walk."""


@dataclass(frozen=True)
class SpotRequest:
    """Request for a spot."""

    activity: str
    """Name of the activity."""
    clearance: float = 0.0
    """Radius around the spot that the performers use, metres."""
    people: int = 1
    """Number of people who use it; the spot is the midpoint between them."""


@dataclass(frozen=True)
class RecordedRequest(_Alone):
    """Request for a recorded path: ``offset`` (N, 2) in metres from its start at ``time`` (N,) in seconds."""

    activity: str
    time: Floats
    offset: Floats


@dataclass(frozen=True)
class VisitRequest(_Alone):
    """Request for the route of a visitor."""

    activity: str
    visitor: Visitor


TrackRequest = LoopRequest | SpotRequest | RecordedRequest | VisitRequest
Admit = Callable[[int, paths.Track, Sequence[int]], bool]
"""Condition on tracks: (index of the request, its track, indices of the requests that have one) to accepted or not."""


def plan_tracks(
    seed: int,
    requests: Sequence[TrackRequest],
    *,
    area: float,
    spacing: float,
    span: tuple[float, float],
    around: float = 0.0,
    people: Sequence[int] | None = None,
    widest: float | None = None,
    admit: Admit = lambda index, track, before: True,
) -> tuple[paths.Track, ...]:
    """Find a track for every request that stays in the area and away from all other tracks at all times.

    Two tracks keep ``spacing`` plus both clearances apart. Requests are served one after another with separate random
    streams, so that one more leaves the earlier tracks where they are; visitors, who find their way round the others,
    are last. If a request finds no track, the whole plan
    starts over with other draws; then requests that need most room are served first, and spots are placed in corners
    and close to each other.

    Args:
        seed: the scenario's seed.
        requests: track requests.
        area: half the side of the square about the origin that pelvises stay in, metres.
        spacing: least distance between two pelvises, metres.
        span: first and last time of the plan in seconds.
        around: radius about the origin that pelvises stay out of, metres.
        people: index of the person whose stream is used for each request; by default the index of the request.
        widest: upper limit of ``area`` for recorded paths that do not fit into ``area`` at any bearing: they get a
            square that they fit into, and a larger one with each plan; None: ``area``.
        admit: additional condition, tested on tracks that keep their distance.

    Raises:
        ValueError: no plan was found, or the area is too small for one of the requests; the message names the keys to
            change.
    """
    half = area - paths.SWAY
    limit = half if widest is None else max(half, widest - paths.SWAY)
    for request in requests:
        _check_room(request, half, limit)
    people = range(len(requests)) if people is None else people
    placed, refused = 0, 0
    for plan in range(_PLANS):
        board = _Board(span, spacing, around)
        order = list(range(len(requests)))
        if plan:  # moving people before or after the others, and large clearances first
            last = plan % 2 == 0  # spots
            order.sort(key=lambda k: (isinstance(requests[k], SpotRequest) == last, -requests[k].clearance))
        order.sort(key=lambda index: isinstance(requests[index], VisitRequest))
        for index in order:
            rng = stream(seed, "people", people[index], "track", plan)
            square = _square(requests[index], half, limit, plan)
            refusals = _place(rng, index, requests[index], board, plan=plan, half=square, admit=admit)
            if index not in board.tracks:
                placed = max(placed, sum(requests[done].people for done in board.tracks))
                refused += refusals
                break
        else:
            return tuple(board.tracks[index] for index in range(len(requests)))
    count = sum(request.people for request in requests)
    touching = f" ({refused} tracks kept that distance, but people or their props touched)" if refused else ""
    grown = any(_square(request, half, limit, plan=0) > half for request in requests)
    room = f" (recorded paths in {limit + paths.SWAY:.2f} m, up to the walls)" if grown else ""
    raise ValueError(
        f"people.count = {count} people do not fit: at most {placed} could be placed in people.area = {area:g} m (half "
        f"the side of a square){room} with people.spacing = {spacing:g} m between any two for {span[1] - span[0]:g} s"
        f"{touching}; lower people.count{' or raise' if refused else ' or lower'} people.spacing, enlarge "
        f"{'room.size' if grown else 'people.area'}, or choose people.activities that need less room"
    )


class _Board:
    """Tracks found so far, with their positions at the coarse checks."""

    def __init__(self, span: tuple[float, float], spacing: float, around: float) -> None:
        self.tracks: dict[int, paths.Track] = {}  # by the index of the request, in the order in which they were added
        self._needs: list[float] = []
        self._spacing, self._around = spacing, around
        self._time = np.linspace(*span, max(2, int(np.ceil((span[1] - span[0]) / _COARSE)) + 1))
        self._taken = np.empty((0, len(self._time), 2))

    @property
    def start(self) -> float:
        """First time of the plan, seconds."""
        return float(self._time[0])

    def add(self, index: int, track: paths.Track, request: TrackRequest) -> None:
        self.tracks[index] = track
        self._needs.append(request.clearance)
        self._taken = np.concatenate([self._taken, _places(track, self._time)[None]])

    def apart(self, track: paths.Track, request: TrackRequest) -> bool:
        """Return whether a track keeps its distance from the centre and, at all times, from all other tracks."""
        if self._around and not self._clear_of_centre(track, request):
            return False
        if not self.tracks:
            return True
        least = self._spacing + 2 * paths.SWAY + request.clearance + np.array(self._needs)[:, None]
        screen = self._time[::_SCREEN]
        if (_distance(_places(track, screen), self._taken[:, ::_SCREEN]) < least).any():
            return False
        slack = _distance(_places(track, self._time), self._taken) - least
        if (slack < 0).any():
            return False
        # Between two checks two people approach by at most the paths that both cover in half of that time.
        step = self._time[1] - self._time[0]
        others = list(self.tracks.values())
        closing = np.array([other.fastest + track.fastest for other in others])[:, None] * step / 2
        between = np.arange(-step / 2, step / 2, _FINE)
        for k in np.flatnonzero((slack < closing).any(axis=1)):
            times = (self._time[slack[k] < closing[k]][:, None] + between).clip(self._time[0], self._time[-1])
            if (_distance(_places(track, times), _places(others[k], times)) < least[k]).any():
                return False
        return True

    def free(self, route: Route, start: float, end: float) -> bool:
        """Return whether a route keeps its distance from all tracks between two times, checked coarsely."""
        times = np.arange(start, end + _FREE, _FREE)
        places = _places(route, times)
        if (np.hypot(*places.T) < self._around + paths.SWAY).any() and self._around:
            return False
        for other, need in zip(self.tracks.values(), self._needs, strict=True):
            if (_distance(places, _places(other, times)) < self._spacing + 2 * paths.SWAY + need + _FREE_MARGIN).any():
                return False
        return True

    def _clear_of_centre(self, track: paths.Track, request: TrackRequest) -> bool:
        least = self._around + paths.SWAY + request.clearance
        if (np.hypot(*track.position(self._time).T) < least).any():
            return False
        fine = np.arange(self._time[0], self._time[-1], _FINE)
        return track.fastest == 0 or bool((np.hypot(*track.position(fine).T) >= least).all())

    def elbow_room(self, spot: paths.Track, request: TrackRequest, half: float) -> float:
        """Return the distance of a spot beyond the required one to the nearest track or edge of the square, metres.

        Summed over both axes, so that it is smallest in corners.
        """
        place = spot.position(0.0)
        least = self._spacing + 2 * paths.SWAY + request.clearance + np.array(self._needs)[:, None]
        others = (_distance(place, self._taken) - least).min(initial=np.inf)
        return float(np.minimum(others, half - request.clearance - np.abs(place)).sum())


def _place(
    rng: np.random.Generator, index: int, request: TrackRequest, board: _Board, *, plan: int, half: float, admit: Admit
) -> int:
    """Add a track that keeps its distance and is admitted, if one is drawn; return the number of rejected tracks."""
    alone = _TRIES * max(0.0, _ALONE[0] + plan * _ALONE[1])
    wide = max(0.0, 1.0 + plan * _NARROWER)
    drawn = (
        _draw(rng, request, board, half=half, wide=wide, following=_FOLLOWING if attempt >= alone else 0.0)
        for attempt in range(_TRIES)
    )
    if isinstance(request, VisitRequest):
        routes = (request.visitor.draw(rng, half=half, start=board.start, free=board.free) for _ in range(_VISIT_TRIES))
        drawn = ([] if route is None else [route] for route in routes)
    candidates: Iterable[paths.Track] = (track for tracks in drawn for track in tracks if board.apart(track, request))
    if plan and isinstance(request, SpotRequest):
        candidates = sorted(candidates, key=lambda track: board.elbow_room(track, request, half))
    refusals = 0
    for track in candidates:
        if admit(index, track, list(board.tracks)):
            board.add(index, track, request)
            break
        refusals += 1
        if refusals == _REFUSALS:
            break
    return refusals


def _places(track: paths.Track, time: Floats) -> Floats:
    """Return the positions of a track at times (...), (..., 2) metres; NaN, which is near nobody, while absent."""
    if not isinstance(track, Route) or track.presence.always:
        return track.position(time)
    return np.where(track.presence.at(time)[..., None], track.position(time), np.nan)


def _distance(one: Floats, other: Floats) -> Floats:
    return np.hypot(other[..., 0] - one[..., 0], other[..., 1] - one[..., 1])


def _limits(request: LoopRequest, half: float) -> paths.LoopLimits:
    return paths.loop_limits(
        request.speed, slowest=request.slowest, fastest=request.fastest, half=half, running=request.running
    )


def _draw(
    rng: np.random.Generator, request: TrackRequest, board: _Board, *, half: float, wide: float, following: float
) -> Sequence[paths.Track]:
    """Draw candidate tracks, possibly none; candidates on one loop differ in their start positions."""
    if isinstance(request, SpotRequest):
        return [paths.draw_spot(rng, half=half - request.clearance, apart=request.people > 1)]
    if isinstance(request, RecordedRequest):
        recorded = paths.draw_recorded(rng, half=half, time=request.time, offset=request.offset)
        return [] if recorded is None else [recorded]
    assert isinstance(request, LoopRequest)  # routes of visitors are drawn by them
    limits = _limits(request, half)
    follows, which = rng.uniform(size=2)
    starts = rng.uniform(size=_STARTS)
    loops = [track for track in board.tracks.values() if isinstance(track, paths.Loop)]
    ahead = loops[int(which * len(loops))] if loops else None
    if ahead is not None and follows < following:
        if not limits.slowest <= ahead.speed <= limits.fastest:
            return []
        return [replace(ahead, start=float(start) * ahead.length) for start in starts]
    widest = limits.tightest + wide * (half - limits.tightest)
    loop = paths.draw_loop(rng, half=half, speed=limits.speed, tightest=limits.tightest, widest=widest)
    if loop is None:
        return []
    if ahead is not None:
        speeds = loop.length * ahead.speed / ahead.length * _ROUND_RATIOS
        fit = speeds[(limits.slowest <= speeds) & (speeds <= limits.fastest)]
        loop = replace(loop, speed=float(fit[0])) if len(fit) else loop
    return [replace(loop, start=float(start) * loop.length) for start in starts]


def _square(request: TrackRequest, half: float, limit: float, plan: int) -> float:
    """Return half the side of the square that a request is to stay in, metres.

    It is ``half``, except for a recorded path that does not fit into it at any bearing. The square of such a path grows
    in equal steps, plan by plan, from the one into which the path fits at any bearing to ``limit``.
    """
    if not isinstance(request, RecordedRequest):
        return half
    extents = _extents(request)
    if extents.min() <= 2 * half:
        return half
    least = min(float(extents.max()) / 2, limit)
    return least + (limit - least) * plan / (_PLANS - 1)


def _extents(request: RecordedRequest) -> Floats:
    """Return the sides of the squares that enclose a recorded path at several bearings, metres."""
    return np.array([np.ptp(request.offset @ axes, axis=0).max() for axes in _AXES])


def _check_room(request: TrackRequest, half: float, limit: float) -> None:
    """Raise ValueError if the area is too small for one of the requests alone."""
    area = half + paths.SWAY
    least = None
    if isinstance(request, SpotRequest) and half <= request.clearance:
        least = max(request.clearance, paths.SWAY) + paths.SWAY
    elif isinstance(request, LoopRequest) and half < _NARROWEST:
        least = _NARROWEST + paths.SWAY
    elif isinstance(request, LoopRequest) and not _limits(request, half).suffices:
        grown = np.arange(half, half + 100.0, 0.05)
        least = next((float(h) for h in grown if _limits(request, h).suffices), grown[-1]) + paths.SWAY
    elif isinstance(request, RecordedRequest):
        _check_recorded(request, half, limit)
    if least is not None:
        raise ValueError(
            f'people.area = {area:g} m is too small for "{request.activity}": it takes {least:.2f} m or more; enlarge '
            "people.area or choose other people.activities"
        )


def _check_recorded(request: RecordedRequest, half: float, limit: float) -> None:
    """Raise ValueError if a recorded path does not fit into the largest square at any bearing."""
    extents = _extents(request)
    if extents.min() <= 2 * limit:
        return
    needed = np.ceil(100 * (extents.max() / 2 + paths.SWAY) + 1) / 100
    path = f"people.motion: the recorded path extends over {extents.max():.2f} m"
    if limit > half:
        grown = np.ceil(100 * 2 * (needed - limit - paths.SWAY)) / 100
        raise ValueError(
            f"{path} and needs people.area = {needed:.2f} m (half the side of a square), but the walls of the room "
            f"leave {limit + paths.SWAY:.2f} m: enlarge the first two numbers of room.size by {grown:.2f} m, shorten "
            "duration, or set another people.motion.start"
        )
    raise ValueError(
        f"{path} and does not fit into people.area = {half + paths.SWAY:g} m (half the side of a square): set "
        f"people.area to {needed:.2f} m or more, shorten duration, or set another people.motion.start"
    )


_AXES = np.array([[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in np.radians(np.arange(0, 90, 5))])
