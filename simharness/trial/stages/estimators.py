"""The variants of a scenario: presets of :class:`mvpose.Pipeline`, and methods of one's own.

A method of one's own is any object with ``estimate(rig, detections) -> mvpose.Estimate``, the protocol
:class:`mvpose.pipeline.Estimator`. A scenario says where it is::

    variants = ["full", "mine"]

    [method.estimators]
    mine = "mine.py:Mine"             # a file, relative to the scenario's, and a name in it
    theirs = "package.module:method"  # a name in a module that can be imported

The name stands for such an object; or for a class or a function that makes one when called without arguments. It may
be a :class:`mvpose.Pipeline` with stages of one's own. A file is loaded by itself, not as part of a package, and every
process that estimates loads it anew. Frames come in any order, so a method must not remember the last one.
"""

from __future__ import annotations

import difflib
import functools
import hashlib
import importlib.util
import sys
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from mvpose import Detections, Estimate, Pipeline, Rig
from mvpose.affinity import AppearanceAffinity
from mvpose.checks import as_array
from mvpose.pipeline import Estimator
from simharness.runtime.errors import RunError
from simharness.scenario.sections.method import wrong_variants
from simharness.scenario.sections.scenario import Method

_PROTOCOL = "estimate(rig, detections) -> mvpose.Estimate"


def estimators_of(method: Method, *, appearance: AppearanceAffinity | None = None) -> dict[str, Estimator]:
    """The variants of a scenario, by name.

    Args:
        method: section [method].
        appearance: what distances of descriptors mean to presets.

    Raises:
        ValueError: a variant that is neither, or a method of one's own that cannot be loaded.
    """
    for key, said in wrong_variants(method):
        raise ValueError(f"method.{key}: {said}")
    places = method.estimators.places
    return {
        name: _own(name, places[name]) if name in places else Pipeline.preset(name, appearance=appearance)
        for name in method.variants
    }


@dataclass(frozen=True)
class OwnEstimator:
    """A method of one's own. Only where it is travels between processes: each loads it for itself, once.

    What it answers is checked, and timed: whoever wraps a pipeline hands on that one's time, not its own.

    Attributes:
        name: of the variant.
        place: "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE".
    """

    name: str
    place: str

    @property
    def loaded(self) -> Estimator:
        """The object itself.

        Raises:
            ValueError: it cannot be loaded.
        """
        return load_estimator(self.place)

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Find the people of one frame.

        Raises:
            RunError: the method raised, or answered what is no estimate of these detections.
        """
        estimator = self.loaded
        start = time.perf_counter()
        try:
            answer = estimator.estimate(rig, detections)
        except Exception as error:
            raise RunError(f"{self.name} ({self.place}): {_said(error, _file_of(estimator))}") from error
        seconds = time.perf_counter() - start
        try:
            _check(answer, detections)
        except ValueError as error:
            raise RunError(f"{self.name} ({self.place}): {error}") from None
        return replace(answer, timings={**answer.timings, "total": seconds})


def load_estimator(place: str) -> Estimator:
    """What is at a place, loaded once a process.

    Args:
        place: "FILE.py:ATTRIBUTE", the file relative to the working directory, or "PACKAGE.MODULE:ATTRIBUTE".

    Raises:
        ValueError: no such file, module or attribute; an error inside; or nothing that estimates.
    """
    source, colon, attribute = place.rpartition(":")
    if not (source and colon and attribute):
        raise ValueError(f"expected FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE, got {place!r}")
    return _loaded(_absolute(source), attribute)


def sources_of(place: str) -> Mapping[str, bytes]:
    """The source files that a method of one's own is made of, by name, as they are when this process first asks.

    Of a file those beside it, too, for a method may run or read them; of a module its top-level package. Only Python's:
    what else a method runs or reads is not known.
    """
    return _sources(_absolute(place.rpartition(":")[0]))


def _own(name: str, place: str) -> OwnEstimator:
    own = OwnEstimator(name, place)
    try:
        _ = own.loaded
    except ValueError as error:
        raise ValueError(f"method.estimators.{name}: {error}") from None
    return own


@functools.cache
def _sources(source: str) -> Mapping[str, bytes]:
    if source.endswith(".py"):
        found = [(file.name, file) for file in Path(source).parent.glob("*.py")]
    else:
        spec = importlib.util.find_spec(source.partition(".")[0])
        folders = list((spec and spec.submodule_search_locations) or ())
        found = [(str(file.relative_to(folder)), file) for folder in folders for file in Path(folder).rglob("*.py")]
        if spec and spec.origin and not folders:
            found = [(Path(spec.origin).name, Path(spec.origin))]
    return {name: file.read_bytes() for name, file in sorted(found)}


def _absolute(source: str) -> str:
    return str(Path(source).resolve()) if source.endswith(".py") else source


@functools.cache
def _loaded(source: str, attribute: str) -> Estimator:
    module = _module(source)
    if not hasattr(module, attribute):
        there = [name for name in vars(module) if not name.startswith("_")]
        near = difflib.get_close_matches(attribute, there, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(there) or 'none'}"
        raise ValueError(f"{source} has no {attribute}; {hint}")
    found: Any = getattr(module, attribute)
    if isinstance(found, type) or (callable(found) and not hasattr(found, "estimate")):
        try:
            found = found()
        except Exception as error:
            raise ValueError(f"{source}: {attribute}() raised {_said(error, module.__file__)}") from error
    if not callable(getattr(found, "estimate", None)):
        raise ValueError(f"{source}: {attribute} is {type(found).__name__}, which has no {_PROTOCOL}")
    estimator: Estimator = found
    return estimator


@functools.cache
def _module(source: str) -> ModuleType:
    if not source.endswith(".py"):
        try:
            return import_module(source)
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and error.name and f"{source}.".startswith(f"{error.name}."):
                raise ValueError(
                    f"there is no module {error.name}: install it or put its folder into PYTHONPATH, or name a file, "
                    '"FILE.py:ATTRIBUTE"'
                ) from None
            raise ValueError(f"{source} cannot be imported: {_said(error, None)}") from error
    if not Path(source).is_file():
        raise ValueError(
            f"{source}: no such file; one that a scenario file names is looked for beside it, one of --set where the "
            "command is run"
        )
    # A name of its own in sys.modules, where dataclasses look for the module that they are in.
    name = f"_own_{Path(source).stem}_{hashlib.blake2b(source.encode(), digest_size=4).hexdigest()}"
    spec = importlib.util.spec_from_file_location(name, source)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # a script may end itself when it is imported
        del sys.modules[name]
        raise ValueError(f"{source} cannot be loaded: {_said(error, source)}") from error
    return module


def _check(answer: object, detections: Detections) -> None:
    """Whether an answer is one to these detections."""
    if not isinstance(answer, Estimate):
        raise ValueError(
            f"estimate returned {type(answer).__name__}, expected mvpose.Estimate: Estimate.of_joints(joints) makes one"
        )
    skeleton = detections.skeleton
    joints = as_array(answer.joints, ("n", len(skeleton), 3), f"joints ({skeleton.name})")
    if np.isinf(joints).any():
        raise ValueError("joints must be finite, or NaN where a joint could not be placed, got infinite ones")
    if not np.isfinite(answer.scores).all():
        raise ValueError("scores must be finite, 0 where a joint could not be placed, got NaN or infinite ones")
    labels = answer.matching.labels_of(len(detections))
    if len(labels) and not -1 <= labels.min() <= labels.max() < len(joints):
        raise ValueError(
            f"labels must be -1, or 0 to n - 1 of n = {len(joints)} people, got {labels.min()} to {labels.max()}"
        )


def _file_of(estimator: Estimator) -> str | None:
    return getattr(sys.modules.get(type(estimator).__module__), "__file__", None)


def _said(error: BaseException, file: str | None) -> str:
    """An error in a line, with the last line of a file that it went through; of any file where none is named."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}, line {error.lineno})"
    said = f"{type(error).__name__}: {error}"
    frames = [each for each in traceback.extract_tb(error.__traceback__) if each.filename != __file__]
    own = [each for each in frames if (each.filename == file if file else not each.filename.startswith("<"))]
    return f"{said} ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else said
