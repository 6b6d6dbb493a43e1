"""Checks of resolved settings: validation against the models, and what their keys cost together."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from mvpose.detections import MOST_DETECTIONS
from mvpose.files.message_text import all_in_one_line
from simharness.scenario.layers import Origins
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.gate_section import GateSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import Section
from simharness.scenario.toml_files import ScenarioError
from simharness.scenario.validation_messages import explain_all, origin_of

MOST_FRAMES = 100_000
"""Largest number of frames: an hour at 25 Hz."""

MOST_SIGHTS = 10_000_000
"""Largest number of sights of people: frames x cameras x people."""

MOST_PIXELS = 10**13
"""Largest number of rendered pixels: days of rendering."""


class Checker:
    """Validation of resolved settings; mistakes are collected in a list."""

    def __init__(self, file: str, mistakes: list[str]) -> None:
        """Check settings of ``file``; append messages to ``mistakes``."""
        self._file = file
        self._mistakes = mistakes
        self._sections: dict[Any, Section] = {}

    def scenario(self, data: Mapping[str, Any], origins: Origins) -> Scenario | None:
        """Return the scenario of keys over their presets; None where they are not valid.

        Equal sections are shared as one object, because thousands of settings differ in a few sections.
        """
        try:
            # Through JSON, where pydantic's strict mode accepts arrays as tuples: count = "4" and count = true are
            # refused, count = 4 and fov = 75 are accepted.
            scenario = Scenario.model_validate_json(json.dumps(data, default=str), strict=True)
        except ValidationError as error:
            self._mistakes += explain_all(error, origins, self._file)
            return None
        self._mistakes += [
            f"{origin_of(key.split('.'), origins, self._file)}: {message}" for key, message in oversized(scenario)
        ]
        sections = {key: section for key, section in scenario if isinstance(section, Section)}
        shared = {
            # Sections are shared only with equal sets of given keys: some checks depend on which keys were given.
            key: self._sections.setdefault((key, section, frozenset(section.model_fields_set)), section)
            for key, section in sections.items()
        }
        return scenario.model_copy(update=shared)

    def gate(self, data: Any, origins: Origins) -> GateSection:
        """Return the section [gate]."""
        try:
            return GateSection.model_validate_json(json.dumps(data, default=str), strict=True)
        except ValidationError as error:
            self._mistakes += explain_all(error, origins, self._file, section=("gate",))
            return GateSection()


def refuse(mistakes: Sequence[str]) -> None:
    """Raise a :class:`ScenarioError` with every distinct mistake, if there are any."""
    if mistakes:
        # All values of a range may be wrong in the same way: the message about the first is enough.
        messages = {re.split(", (?:e.g.|got) ", mistake)[0]: mistake for mistake in reversed(mistakes)}
        raise ScenarioError(all_in_one_line(list(reversed(messages.values()))))


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
