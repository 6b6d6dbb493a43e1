"""Size of a scenario: what its keys cost together, and the largest that is accepted."""

from __future__ import annotations

from collections.abc import Iterator

from mvpose.detections import MOST_DETECTIONS
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.scenario import Scenario

MOST_FRAMES = 100_000
"""Largest number of frames: an hour at 25 Hz."""

MOST_SIGHTS = 10_000_000
"""Largest number of sights of people: frames x cameras x people."""

MOST_PIXELS = 10**13
"""Largest number of rendered pixels: days of rendering."""

MOST_TRIALS = 1_000_000
"""Largest number of trials of a study, and of its seeds."""


def camera_count(cameras: CamerasSection) -> int | None:
    """Return the number of cameras of a rig; None where a published rig or a file determines it."""
    if cameras.layout in ("preset", "file"):
        return len(cameras.only) or None
    return len(cameras.positions) if cameras.layout == "free" else cameras.count


def oversized(scenario: Scenario, *, views: int | None = None) -> Iterator[tuple[str, str]]:
    """Yield the key and a message for each product of keys that is too large.

    Args:
        scenario: a resolved scenario, whose single keys are valid.
        views: number of cameras; :func:`camera_count` by default, and one camera where that is unknown.
    """
    views = views or camera_count(scenario.cameras) or 1
    frames, people = scenario.frames, scenario.people.count
    if frames > MOST_FRAMES:
        yield (
            "duration",
            f"duration x rate = {scenario.duration:g} s x {scenario.rate:g} Hz makes {frames:,} frames: expected at "
            f"most {MOST_FRAMES:,}",
        )
    elif (sights := frames * views * people) > MOST_SIGHTS:
        yield (
            "duration",
            f"{frames:,} frames x {views} cameras x {people} people makes {sights:,} sights of people: expected at "
            f"most {MOST_SIGHTS:,}",
        )
    width, height = scenario.cameras.size
    pixels = frames * views * width * height
    if scenario.rendering.renderer != "rays" and frames <= MOST_FRAMES and pixels > MOST_PIXELS:
        yield (
            "cameras.size",
            f"{frames:,} frames x {views} cameras x {width} x {height} pixels makes {pixels:,} pixels to render: "
            f'expected at most {MOST_PIXELS:,}; rendering.renderer = "rays" renders none',
        )
    detections = views * (people + scenario.detector.phantoms.rate)
    if detections > MOST_DETECTIONS:
        yield (
            "people.count",
            f"{views} cameras x ({people} people + {scenario.detector.phantoms.rate:g} phantoms) makes "
            f"{detections:.0f} detections in a frame: expected at most {MOST_DETECTIONS}",
        )
