"""Variants of a scenario: presets of :class:`mvpose.Pipeline` and user-defined estimators.

A user-defined estimator is any object with ``estimate(rig, detections) -> mvpose.Estimate``, the protocol
:class:`mvpose.estimators.Estimator`. A scenario gives its place::

    variants = ["full", "mean", "lifted"]

    [method.estimators]
    mean = "mean.py:Mean"             # a file, relative to the scenario file, and a name in it
    lifted = "package.module:method"  # a name in a module that can be imported

The name refers to such an object, or to a class or function that returns one when it is called without arguments. The
object may be a :class:`mvpose.Pipeline` with custom stages. A module is looked for beside the scenario file, in the
working directory, then among what is installed; a file in a package is loaded as a part of it. Each process that
estimates loads it once. Frames come in any order, so an estimator must not depend on earlier frames.

An estimator with memory, such as a tracker, has ``track(rig, frames)`` (:class:`mvpose.estimators.SequenceEstimator`)
instead or as well: it yields one estimate for each frame, and gets all frames of a trial in order in one process.
"""

import copy
import difflib
import functools
import hashlib
import importlib.util
import math
import sys
import time
import traceback
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from mvpose import Detections, Estimate, Rig, preset
from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.commands.errors import MethodError, RunError
from mvpose.detections import MOST_DETECTIONS
from mvpose.estimators import Estimator
from mvpose.files.message_text import prefixed
from mvpose.skeleton import Skeleton
from simharness.scenario.sections.method_section import MethodSection, module_file, wrong_variants
from simharness.trial.stages.estimation import own_rig, track_frames

_PROTOCOL = "estimate(rig, detections) -> mvpose.Estimate"
_METHODS = ("estimate", "track")
_ROUNDING = 1e-9  # of the largest entry of a covariance


def estimators_of(
    method: MethodSection, *, appearance: AppearanceAffinity | None = None, period: float | None = None
) -> dict[str, Estimator]:
    """Return the variants of a scenario, by name.

    Args:
        method: section [method].
        appearance: affinity of descriptors, for presets.
        period: time between frames, seconds, for presets with memory.

    Raises:
        ValueError: an unknown variant, or a user-defined estimator that cannot be loaded.
    """
    for key, message in wrong_variants(method):
        raise ValueError(f"method.{key}: {message}")
    places = method.estimators.places
    return {
        name: _user_estimator(name, places[name])
        if name in places
        else preset(name, appearance=appearance, lag=method.lag, period=period)
        for name in method.variants
    }


@dataclass(frozen=True)
class UserEstimator:
    """User-defined estimator. Only its place is sent to other processes; each process loads the object once.

    It gets copies of cameras and detections, so that it cannot change those of other variants. Its estimates are
    checked, and their total time is measured here, because an estimator that wraps a pipeline returns the timings of
    the pipeline without its added time.
    """

    name: str
    """Name of the variant."""
    place: str
    """"FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"."""

    @property
    def loaded(self) -> Estimator:
        """The loaded object.

        Raises:
            ValueError: the object cannot be loaded.
        """
        return load_estimator(self.place)

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame.

        Raises:
            MethodError: the estimator raised an error, or returned no valid estimate of these detections.
        """
        estimator = self.loaded
        rig, detections = own_rig(self.name, rig), copy.deepcopy(detections)
        start = time.perf_counter()
        try:
            estimate = estimator.estimate(rig, detections)
        except Exception as error:
            raise self._failure(error) from error
        seconds = time.perf_counter() - start
        try:
            _check(estimate, len(detections), detections.skeleton)
        except ValueError as error:
            raise MethodError(f"{self.name} ({self.place}): {error}") from None
        return replace(estimate, timings={**estimate.timings, "total": seconds})

    def _failure(self, error: Exception) -> MethodError:
        message = str(error) if isinstance(error, MethodError) else _describe_error(error, _file_of(self.loaded))
        return MethodError(f"{self.name} ({self.place}): {message}")


@dataclass(frozen=True)
class UserTracker(UserEstimator):
    """User-defined estimator with memory: an object with ``track``, which need not have ``estimate``."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame alone; as :meth:`UserEstimator.estimate`."""
        if callable(getattr(self.loaded, "estimate", None)):
            return super().estimate(rig, detections)
        (estimate,) = track_frames(self, rig, [detections])
        return estimate

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimate of every frame, in order, and check it.

        Raises:
            MethodError: the estimator raised an error, yielded an estimate before it took the frame, or yielded no
                valid estimate of the frame's detections; the message names the frame.
        """
        estimator: Any = self.loaded
        waiting: deque[tuple[int, Skeleton]] = deque()  # detections and skeleton of each frame without an estimate yet
        taken = passed = 0  # frames

        def feed() -> Iterator[Detections]:
            nonlocal taken
            for detections in frames:
                waiting.append((len(detections), detections.skeleton))
                taken += 1
                yield copy.deepcopy(detections)

        given = feed()
        try:
            for estimate in estimator.track(own_rig(self.name, rig), given):
                try:
                    if not waiting:
                        raise ValueError(f"track yielded {passed + 1} estimates after it took {taken} frames")
                    _check(estimate, *waiting.popleft(), method="track")
                except ValueError as error:
                    raise MethodError(f"frame {passed}: {self.name} ({self.place}): {error}") from None
                yield estimate
                passed += 1
        except RunError:
            raise
        except Exception as error:
            raise MethodError(f"frame {max(taken - 1, 0)}: {self._failure(error)}") from error
        for _ in given:  # frames that it did not take
            pass
        if waiting:
            raise MethodError(
                f"frame {passed}: {self.name} ({self.place}): track yielded {passed} estimates for {taken} frames, "
                "expected one for each frame, in order"
            )


def user_estimator(name: str, place: str) -> UserEstimator:
    """Return the user-defined estimator at a place, with memory or without.

    Raises:
        ValueError: as :func:`load_estimator`.
    """
    tracks = callable(getattr(load_estimator(place), "track", None))
    return UserTracker(name, place) if tracks else UserEstimator(name, place)


def load_estimator(place: str) -> Estimator:
    """Return the estimator at a place; each process loads it once.

    Args:
        place: "FILE.py:ATTRIBUTE", the file relative to the working directory, or "PACKAGE.MODULE:ATTRIBUTE", the
            module in the working directory or installed.

    Raises:
        ValueError: the file, module or attribute does not exist, raises an error, or is no estimator.
    """
    source, colon, attribute = place.rpartition(":")
    if not (source and colon and attribute):
        raise ValueError(f"expected FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE, got {place!r}")
    return _loaded(_absolute(source), attribute)


def sources_of(place: str) -> Mapping[str, bytes]:
    """Return the Python source files of a user-defined estimator by name, as they are at the first call in a process.

    For a file these are all Python files of its folder, because an estimator may run or read them; for a module, or a
    file in a package, all files of the top-level package. Other files that an estimator runs or reads are not known.
    """
    return _sources(_absolute(place.rpartition(":")[0]))


def _user_estimator(name: str, place: str) -> UserEstimator:
    with prefixed(f"method.estimators.{name}"):
        return user_estimator(name, place)


@functools.cache
def _sources(source: str) -> Mapping[str, bytes]:
    if source.endswith(".py"):
        package = _package(Path(source))
        root = package[0] / package[1].partition(".")[0] if package else Path(source).parent
        files = [(str(file.relative_to(root)), file) for file in (root.rglob if package else root.glob)("*.py")]
    else:
        spec = importlib.util.find_spec(source.partition(".")[0])
        folders = list((spec and spec.submodule_search_locations) or ())
        files = [(str(file.relative_to(folder)), file) for folder in folders for file in Path(folder).rglob("*.py")]
        if spec and spec.origin and not folders:
            files = [(Path(spec.origin).name, Path(spec.origin))]
    return {name: file.read_bytes() for name, file in sorted(files)}


def _absolute(source: str) -> str:
    """Return the path of a source file, or of a module in the working directory; the name of any other module."""
    file = Path(source) if source.endswith(".py") else module_file(source, Path())
    return source if file is None else str(file.resolve())


def _package(file: Path) -> tuple[Path, str] | None:
    """Return the folder that holds the outermost package of a file, and the name of its module; None without one."""
    folder, names = file.parent, [] if file.stem == "__init__" else [file.stem]
    while (folder / "__init__.py").is_file():
        names.insert(0, folder.name)
        folder = folder.parent
    return None if folder == file.parent else (folder, ".".join(names))


@functools.cache
def _loaded(source: str, attribute: str) -> Estimator:
    module = _module(source)
    if not hasattr(module, attribute):
        names = [name for name in vars(module) if not name.startswith("_")]
        near = difflib.get_close_matches(attribute, names, n=1)
        hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(names) or 'no names'}"
        raise ValueError(f"{source} has no {attribute}; {hint}")
    value: Any = getattr(module, attribute)
    if isinstance(value, type) or (callable(value) and not any(hasattr(value, name) for name in _METHODS)):
        try:
            value = value()
        except Exception as error:
            raise ValueError(f"{source}: {attribute}() raised {_describe_error(error, module.__file__)}") from error
    if not any(callable(getattr(value, name, None)) for name in _METHODS):
        raise ValueError(f"{source}: {attribute} is {type(value).__name__}, which has no {_PROTOCOL}")
    estimator: Estimator = value
    return estimator


@functools.cache
def _module(source: str) -> ModuleType:
    if not source.endswith(".py"):
        try:
            return import_module(source)
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and error.name and f"{source}.".startswith(f"{error.name}."):
                raise ValueError(
                    f"there is no module {error.name}: install it, add its folder to PYTHONPATH, or give a file, "
                    '"FILE.py:ATTRIBUTE"'
                ) from None
            raise ValueError(f"{source} cannot be imported: {_describe_error(error, None)}") from error
    if not Path(source).is_file():
        raise ValueError(
            f"{source}: no such file; a path in a scenario file is relative to that file, a path in --set to the "
            "working directory"
        )
    if package := _package(Path(source)):
        folder, module_name = package
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))
        try:
            return import_module(module_name)
        except (Exception, SystemExit) as error:
            raise ValueError(f"{source} cannot be loaded: {_describe_error(error, None)}") from error
    # A unique name in sys.modules, because dataclasses look up their module there.
    name = f"_estimator_{Path(source).stem}_{hashlib.blake2b(source.encode(), digest_size=4).hexdigest()}"
    spec = importlib.util.spec_from_file_location(name, source)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # a script may call sys.exit when it is imported
        del sys.modules[name]
        raise ValueError(f"{source} cannot be loaded: {_describe_error(error, source)}") from error
    return module


def _check(estimate: object, detections: int, skeleton: Skeleton, *, method: str = "estimate") -> None:
    """Check the return value of an estimator.

    Args:
        estimate: the value.
        detections: number of detections of the frame.
        skeleton: their skeleton.
        method: method that returned or yielded it.

    Raises:
        ValueError: it is no estimate, or not a valid one of these detections.
    """
    if not isinstance(estimate, Estimate):
        verb = "yielded" if method == "track" else "returned"
        raise ValueError(
            f"{method} {verb} {type(estimate).__name__}, expected mvpose.Estimate: Estimate.of_joints(joints) makes one"
        )
    if len(estimate) > MOST_DETECTIONS:
        raise ValueError(f"an estimate has at most {MOST_DETECTIONS} people, got {len(estimate)}")
    joints = as_array(estimate.joints, ("n", len(skeleton), 3), f"joints ({skeleton.name})")
    missing = np.isnan(joints).all(axis=2)
    if not (missing | np.isfinite(joints).all(axis=2)).all():
        raise ValueError(
            "joints must be finite, or NaN in all three coordinates for a joint that could not be placed; got a joint "
            "with infinite or single missing coordinates"
        )
    if missing.all(axis=1).any():
        raise ValueError(f"person {int(missing.all(axis=1).argmax())} has no joint: leave out people without joints")
    if not ((estimate.scores >= 0) & (estimate.scores <= 1)).all():
        raise ValueError(
            "scores must lie in 0..1, and be 0 for a joint that could not be placed, got "
            f"{estimate.scores.min():.6g} to {estimate.scores.max():.6g}"
        )
    if estimate.covariance is not None:
        _check_covariance(estimate.covariance[~missing])
    if estimate.ids is not None and len(np.unique(estimate.ids)) < len(estimate.ids):
        raise ValueError(f"ids must be different for all people of a frame, got {estimate.ids.tolist()}")
    if wrong := [stage for stage, seconds in estimate.timings.items() if not 0 <= seconds < math.inf]:
        raise ValueError(f"timings must be seconds from 0, got {estimate.timings[wrong[0]]} for {wrong[0]!r}")
    labels = estimate.matching.labels_of(detections)
    if len(labels) and not -1 <= labels.min() <= labels.max() < len(joints):
        raise ValueError(
            f"labels must be -1, or 0 to n - 1 of n = {len(joints)} people, got {labels.min()} to {labels.max()}"
        )


def _check_covariance(covariance: Floats) -> None:
    """Check the covariances (k, 3, 3) of placed joints; a joint may have none, which is NaN throughout."""
    known = covariance[~np.isnan(covariance).all(axis=(1, 2))]
    if not np.isfinite(known).all():
        raise ValueError("covariances must be finite, or NaN throughout where a joint has none")
    size = np.abs(known).max(axis=(1, 2), initial=0.0)[:, None, None]
    if not (np.abs(known - known.swapaxes(1, 2)) <= _ROUNDING * size).all():
        raise ValueError("covariances must be symmetric")
    least = np.linalg.eigvalsh(known)[:, 0]
    if not (least >= -_ROUNDING * size[:, 0, 0]).all():
        raise ValueError(
            f"covariances must be positive semi-definite, got one with the eigenvalue {least.min():.3g} square metres"
        )


def _file_of(estimator: Estimator) -> str | None:
    return getattr(sys.modules.get(type(estimator).__module__), "__file__", None)


def _describe_error(error: BaseException, file: str | None) -> str:
    """Return an error as one line, with the last line of ``file`` in its traceback; of any file where it is None."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}, line {error.lineno})"
    message = f"{type(error).__name__}: {error}"
    frames = [each for each in traceback.extract_tb(error.__traceback__) if each.filename != __file__]
    lines = [each for each in frames if (each.filename == file if file else not each.filename.startswith("<"))]
    return f"{message} ({Path(lines[-1].filename).name}, line {lines[-1].lineno})" if lines else message
