"""Kept failure: a frozen frame that fails, what fails in it, and why, as a TOML file that is replayed to the bit.

The file needs no scenario and no simulation: cameras, people and errors are all that the detections are made from.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from mvpose import COCO17
from mvpose.arrays import Floats
from mvpose.commands.output_files import write_text
from mvpose.estimators import SequenceEstimator
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line
from mvpose.presets import NEED_DESCRIPTORS
from simharness.hunt.frozen_frame import DrawnError, FrozenFrame, freeze
from simharness.hunt.properties import Violation
from simharness.hunt.shrinking import SEEDS, Judge, fresh_noise, shrink, stage_of
from simharness.scenario.sections.method_section import NAME, EstimatorsSection, MethodSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import ScenarioError, read_toml, toml
from simharness.scenario.validation_messages import explain_all
from simharness.trial.run_trial import with_variants
from simharness.trial.stages.build_trial import build_variants
from simharness.trial.stages.estimators import estimators_of
from simharness.types.recording import Recording

_WIDTH = 120
_NEAR = 0.35  # of a keypoint's error: distance from another joint up to which it lies there


class KeptFailure(FrozenFrame):
    """Frame that fails, with what is known about it."""

    name: str = Field(pattern=NAME, max_length=100)
    text: str = ""
    """What fails and why, in words."""
    violated: str
    """Name of the property that does not hold."""
    person: int = -1
    """Number of the person for whom it is; -1 for nobody in particular."""
    joints: tuple[str, ...] = ()
    """Joints of the violation, where it is one of single joints."""
    variant: str
    """Variant of the method."""
    rival: str = ""
    """Variant with which it is compared."""
    estimators: EstimatorsSection = EstimatorsSection()
    """Places of user-defined estimators."""
    stage: str = ""
    """Stage of the method to blame, where the property is a class of failures."""
    origin: str = ""
    """Where the frame comes from."""
    noise_seeds: Annotated[int, Field(ge=0)] = 0
    noise_failed: Annotated[int, Field(ge=0)] = 0
    """Of how many seeds of additional noise the frame fails again."""
    mended: bool = False
    """Whether the method has been mended, so that the frame must not fail again."""

    def replay(self) -> tuple[Floats, bool]:
        """Return the joints (n, 17, 3) that the method finds in the frame now, and whether it still fails."""
        judge = judge_of(self.variant, self.rival, self.estimators)
        rig, detections, _ = self.detected()
        target = Violation(self.violated, self.person, "", tuple(map(COCO17.index, self.joints)))
        return judge.variant.estimate(rig, detections).joints, judge.fails(target, self)


def judge_of(variant: str, rival: str = "", estimators: EstimatorsSection | None = None) -> Judge:
    """Return a judge of a variant, and of a rival if there is one.

    Raises:
        ValueError: an unknown variant.
    """
    names = tuple(dict.fromkeys(filter(None, (variant, rival))))
    built = estimators_of(MethodSection(variants=names, estimators=estimators or EstimatorsSection()))
    return Judge(built[variant], built.get(rival))


def check_alone(scenario: Scenario) -> None:
    """Check that every frame of a scenario's first variant can be estimated and written out alone.

    Raises:
        ValueError: the variant has memory or needs descriptors, or detections have heat maps.
    """
    name, *_ = scenario.method.variants
    (estimator,) = build_variants(with_variants(scenario, [name])).values()
    if isinstance(estimator, SequenceEstimator):
        raise ValueError(f"variant {name}: has memory, and a frame alone has no past; name a variant without")
    if name in NEED_DESCRIPTORS:
        raise ValueError(f"variant {name}: needs descriptors, which a frozen frame leaves out; name another variant")
    if scenario.detector.heatmaps.size != "none":
        raise ValueError('detector.heatmaps.size: frames are frozen without heat maps; set it to "none"')


def first_violation(
    recording: Recording, judge: Judge, properties: Sequence[str], *, frame: int | None = None
) -> tuple[int, FrozenFrame, Violation]:
    """Return the first frame of a recording that fails, frozen, and its first violation.

    Args:
        recording: the frames.
        judge: of the method.
        properties: names of the properties, in the order in which they are tried.
        frame: the only frame to look at; None: all.

    Raises:
        ValueError: no such frame, or nothing fails.
    """
    if frame is not None and not 0 <= frame < len(recording):
        raise ValueError(f"--frame {frame}: there are the frames 0 to {len(recording) - 1}")
    for k in range(len(recording)) if frame is None else (frame,):
        frozen = freeze(recording.rig, recording.detections[k], recording.truth[k])
        if found := judge.violations(frozen, properties):
            return k, frozen, found[0]
    where = f"in frame {frame}" if frame is not None else f"in {len(recording)} frames"
    raise ValueError(f"nothing fails {where}: none of {', '.join(properties)}")


def keep(
    found: FrozenFrame, violation: Violation, judge: Judge, *, scenario: str, about: Mapping[str, Any]
) -> KeptFailure:
    """Shrink a frame and describe what is left of it.

    Args:
        found: the frame.
        violation: what fails in it.
        judge: of the variant in ``about``.
        scenario: name of the scenario.
        about: ``variant``, ``rival``, ``estimators`` and ``origin`` of the failure.

    Raises:
        ValueError: the frame does not fail.
    """

    def fails(frame: FrozenFrame) -> bool:
        return judge.fails(violation, frame)

    frame = shrink(found, fails)
    (after, *_) = [each for each in judge.violations(frame, (violation.property,)) if violation.is_like(each)]
    rig, detections, truth = frame.detected()
    recording = Recording(np.zeros(1), rig, (detections,), (truth,))
    of_index = after if after.person < 0 else replace(after, person=frame.numbers.index(after.person))
    digest = hashlib.blake2b(frame.model_dump_json().encode(), digest_size=3).hexdigest()
    what = violation.property.rpartition(":")[2].replace("_", "-").lower()
    return KeptFailure(
        **{key: getattr(frame, key) for key in FrozenFrame.model_fields},
        name=f"{scenario}-{what}-{digest}",
        text=describe(frame, after),
        violated=violation.property,
        person=violation.person,
        joints=tuple(COCO17.joints[joint] for joint in violation.joints),
        stage=stage_of(recording, of_index, judge.variant),
        noise_seeds=SEEDS,
        noise_failed=fresh_noise(frame, fails),
        **about,
    )


def describe(frame: FrozenFrame, violation: Violation) -> str:
    """Return in words what fails in a frame that cannot be smaller, and which errors it takes."""
    what = violation.text.format(f"person {violation.person}")
    what = what[:1].upper() + what[1:]
    people, cameras = len(frame.people), len(frame.cameras)
    where = f"{people} {'person' if people == 1 else 'people'}, {cameras} cameras"
    parts = [error_text(frame, each) for each in frame.errors]
    if not parts:
        return f"{what} ({where}), although every detection is perfect."
    without = "it" if len(parts) == 1 else "any one of these"
    return f"{what} ({where}): {'; '.join(parts)}. Without {without} all is right."


def error_text(frame: FrozenFrame, error: DrawnError) -> str:
    """Return one error in words."""
    who = "nobody" if error.person < 0 else f"person {error.person}"
    where = f"in {error.camera}"
    match error.kind:
        case "missed":
            text = f"{who} is not detected {where}"
        case "extra":
            count = sum(each[2] > 0 for each in error.joints)
            again = "a detection of nobody" if error.person < 0 else f"a second detection of {who}"
            text = f"{again} {where}, with {count} joints"
        case "box":
            text = f"the box of {who} {where} has the score {error.score:.2f}"
        case "hidden":
            text = f"{sum(each[0] > 0 for each in error.joints)} joints of {who} are hidden {where}"
        case "picture":
            size = np.linalg.norm(error.joints, axis=-1).mean()
            text = f"{where} {who} is {size:.0f} px from where the calibration puts them"
        case "keypoint":
            text = f"the {error.joint.replace('_', ' ')} of {who} {where} {_keypoint_text(frame, error)}"
    return text


def _keypoint_text(frame: FrozenFrame, error: DrawnError) -> str:
    """Return what is wrong with a keypoint: where it lies, on whose joint if one is near, and how far from its own."""
    if error.offset is None:
        return "is not reported"
    size = float(np.hypot(*error.offset))
    if size < 1.0:
        return f"has the score {error.score:.2f}"
    _, place = frame.places()
    view = [camera.name for camera in frame.cameras].index(error.camera)
    own, joint = frame.numbers.index(error.person), COCO17.index(error.joint)
    away = np.linalg.norm(place[view] - (place[view, own, joint] + error.offset), axis=-1)
    away[own, joint] = np.nan
    names = [f"person {number}'s" for number in frame.numbers], [f"the {each}" for each in COCO17.joints]
    for distances, whose in zip((away[:, joint], away[own]), names, strict=True):
        nearest = int(np.nan_to_num(distances, nan=np.inf).argmin())
        if distances[nearest] < _NEAR * size:
            name = whose[nearest].replace("_", " ")
            return f"lies on {name}, {distances[nearest]:.0f} px apart, and {size:.0f} px from its own place"
    return f"lies {size:.0f} px from its place"


def write_failure(failure: KeptFailure, folder: Path) -> Path:
    """Write a failure into a folder, as NAME.toml, and return the file."""
    path = folder / f"{failure.name}.toml"
    write_text("\n".join(_lines(failure)) + "\n", path, option="--out")
    return path


def _lines(failure: KeptFailure) -> Iterator[str]:
    values = failure.model_dump(exclude_defaults=True)
    tables = {key: values.pop(key, ()) for key in FrozenFrame.model_fields}
    yield "# A frame that fails. Where no [[errors]] say otherwise, everybody is detected in every picture, exactly."
    yield from (f"{key} = {toml(value)}" for key, value in values.items())
    for key, entries in tables.items():
        for entry in entries:
            yield f"\n[[{key}]]"
            for name, value in entry.items():
                line = f"{name} = {toml(value)}"
                if name == "joints" and len(line) > _WIDTH:
                    rows = zip(value, COCO17.joints, strict=True)
                    line = "\n".join(["joints = [", *(f"    {toml(row)},  # {joint}" for row, joint in rows), "]"])
                yield line


def is_failure(path: Path) -> bool:
    """Return whether a file is a kept failure, by its first lines."""
    return path.suffix == ".toml" and path.is_file() and b"\n[[cameras]]\n" in read_bytes(path, what="TOML")


def failures_in(folder: Path) -> list[KeptFailure]:
    """Read all kept failures of a folder, by name.

    Raises:
        ValueError: the folder has none, or one cannot be read.
    """
    found = [read_failure(path) for path in sorted(folder.glob("*.toml")) if is_failure(path)]
    if not found:
        raise ValueError(
            f"{folder}: expected kept failures (TOML), which `simharness shrink` and `hunt` write; got none"
        )
    return found


def read_failure(path: Path) -> KeptFailure:
    """Read a kept failure.

    Raises:
        ScenarioError: the file does not exist, is not TOML, or a key of it is wrong.
    """
    data = read_toml(path)
    try:
        failure = KeptFailure.model_validate_json(json.dumps(data, default=str), strict=True)
        failure.detected()
    except ValidationError as error:
        raise ScenarioError("; ".join(explain_all(error, {}, str(path), root=KeptFailure))) from None
    except (ValueError, KeyError) as error:
        raise ScenarioError(f"{path}: {one_line(str(error), 200)}") from None
    return failure
