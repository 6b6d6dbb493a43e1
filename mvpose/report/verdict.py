"""Verdict of the doctor in plain words, as both pages show it."""

import math
from dataclasses import dataclass

from mvpose.calibration.findings import KINDS, Diagnosis, Finding

_SENTENCES = {
    "fine": "Nothing is wrong with the cameras",
    "cannot tell": "This recording does not determine whether the cameras are right",
}
_UNITS = {
    "degrees": "°", "metres": "m", "ms": "ms", "s": "s", "px": "px", "pixels": "px", "percent": "%", "hz": "Hz",
    "mm": "mm", "cm": "cm", "factor": "", "frames": "frames", "pictures": "pictures", "share": "",
}  # fmt: skip
_NAMES = {
    "degrees": "angle", "metres": "distance", "mm": "distance", "ms": "time", "s": "time", "px": "distance",
    "percent": "share",
}  # fmt: skip
_DECIMALS = {"°": 2, "m": 2, "cm": 1, "mm": 0, "ms": 1, "s": 1, "px": 1, "%": 1, "frames": 0, "pictures": 0}


@dataclass(frozen=True)
class Quantity:
    """Size of a finding as text: its name, value with unit, and interval (empty where there is none)."""

    name: str
    value: str
    interval: str


def sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict as one sentence, with the worst finding where it is not fine."""
    alarms = diagnosis.alarms
    if not alarms and diagnosis.verdict == "cannot tell":
        reason = _named(diagnosis.open_questions[0]).removeprefix("cannot tell: ")
        return f"{_SENTENCES[diagnosis.verdict]}: {reason}."
    if not alarms:
        within = diagnosis.within
        size = f"{within['degrees']:.1f} degrees or {100 * within['metres']:.0f} cm" if within else ""
        return f"{_SENTENCES['fine']}{f': none is off by more than {size}' if within else ''}."
    more = len(alarms) - 1
    others = "" if not more else f" There {'are' if more > 1 else 'is'} {more} more fault{'s' if more > 1 else ''}."
    return f"{sentence_of(alarms[0])}{others}"


def sentence_of(finding: Finding) -> str:
    """Return a finding as a sentence; one that starts with the name of a camera calls it a camera."""
    text = _named(finding)
    return f"{text[:1].upper()}{text[1:]}."


def _named(finding: Finding) -> str:
    text, name = (finding.text or KINDS[finding.kind]).rstrip("."), finding.camera
    if name and text.startswith(f"{name} ") and not name.lower().startswith("camera"):
        text = f"camera {text}"
    return text


def quantities(finding: Finding) -> list[Quantity]:
    """Return the sizes of a finding as text, with their 90 % intervals."""
    return [_quantity(key, value, finding.interval.get(key)) for key, value in finding.size.items()]


def _quantity(key: str, value: float, interval: tuple[float, float] | None) -> Quantity:
    name, unit = _name_and_unit(key)
    factor = 1.0
    if unit == "m" and abs(value) < 1.0:
        unit, factor = "cm", 100.0
    digits = _DECIMALS.get(unit, 3)
    bounds = "" if interval is None else " to ".join(_text(factor * bound, digits) for bound in interval)
    space = "" if unit in ("", "°") else " "
    return Quantity(name, f"{_text(factor * value, digits)}{space}{unit}", bounds)


def _name_and_unit(key: str) -> tuple[str, str]:
    """Return the name and the unit of a key such as ``since_s``: ("since", "s")."""
    head, _, unit = key.rpartition("_")
    if unit in _UNITS:
        return head.replace("_", " ") or _NAMES.get(unit, unit), _UNITS[unit]
    return key.replace("_", " "), ""


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "∞" if value > 0 else "–∞"
