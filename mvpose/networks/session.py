"""A network in an ONNX file, run by onnxruntime on crops."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from mvpose.networks.card import Card
from mvpose.networks.crops import Pixels

Values = NDArray[np.float32]
Provider = Literal["cpu", "cuda", "auto"]

_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_CUDA = "CUDAExecutionProvider"
_GREY = 128  # of the crops that a network is tried with


def as_session(model: str | Path | Session) -> Session:
    """A session as it is, or one with the defaults for a file."""
    return model if isinstance(model, Session) else Session(model)


def check_content(path: Path) -> None:
    """Refuse a file that is not the one whose SHA-256 the card beside it states; without such a card pass it.

    Damaged weights load as well as right ones, and of a file that is cut off near its end only the metadata is lost.

    Args:
        path: of the ONNX file; its card is the .json of its name, with an entry ``sha256``.

    Raises:
        ValueError: it is another file.
    """
    card = path.with_suffix(".json")
    expected = _stated_digest(card)
    if expected is None:
        return
    with path.open("rb") as opened:
        got = hashlib.file_digest(opened, "sha256").hexdigest()
    if got != expected.lower():
        raise ValueError(
            f"network {path}: is not the file of this card: {card} states sha256 {expected}, the file has {got} "
            f"({path.stat().st_size} bytes). It is damaged, or another network: copy both again from where they came "
            "from, or move the card away if this network is meant"
        )


class Session:
    """A network that maps crops of images to arrays, checked once when it is opened.

    The name, size, layout, type and batch of the input are read from the file; what the file leaves open is on its
    card. Can be pickled: the other process opens the same file.

    Args:
        path: the ONNX file.
        card: normalisation and meaning, in place of the card that the file carries; the field's defaults where
            neither says anything.
        provider: ``cpu``; ``cuda``; or ``auto``, CUDA where this onnxruntime has it.
        threads: that one run may use.
        batch: crops in one run, at most. A file with a batch of its own is run at that, with blank crops to fill up.

    Attributes:
        path: of the file.
        card: as stated or read.
        size: width and height of a crop.
        outputs: names of what is read.
        shapes: of the outputs for one crop, without the batch.

    Raises:
        ValueError: no such file, one that is cut off or no ONNX, one that is not the file of the card beside it (the
            .json of its name, where that states a ``sha256``), a provider that is not there or does not come up,
            anything but one input of pictures, an input size that neither file nor card states or that they
            contradict, outputs that are missing, or not finite, or not a row for each crop.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        card: Card | None = None,
        provider: Provider = "cpu",
        threads: int = 1,
        batch: int = 32,
    ) -> None:
        if batch < 1 or threads < 1:
            raise ValueError(f"batch and threads must be at least 1, got {batch} and {threads}")
        self.path = Path(path)
        self._reopen = partial(Session, self.path, card=card, provider=provider, threads=threads, batch=batch)
        self._session = self._open(provider, threads)
        try:
            self.card = card or Card.from_metadata(self._session.get_modelmeta().custom_metadata_map)
        except ValueError as error:
            self._refuse(str(error))
        self._read_input()
        self._batch = self._fixed or batch
        self.outputs = self._chosen_outputs()
        self.shapes = self._try()

    def __reduce__(self) -> tuple[Callable[[], Session], tuple[()]]:
        return self._reopen, ()

    @property
    def providers(self) -> list[str]:
        """What the network runs on, as onnxruntime names it, first choice first."""
        return self._session.get_providers()

    def __call__(self, crops: Pixels) -> list[Values]:
        """Run the network.

        Args:
            crops: (m, height, width, 3) uint8, red green blue.

        Returns:
            The outputs, (m, ...) each.

        Raises:
            ValueError: crops of another shape or type, a run that fails, an output that is not finite.
        """
        shape = (self.size[1], self.size[0], 3)
        if crops.dtype != np.uint8 or crops.shape[1:] != shape:
            raise ValueError(f"crops must be (m, {', '.join(map(str, shape))}) uint8, got {crops.dtype} {crops.shape}")
        results = [np.empty((len(crops), *shape), np.float32) for shape in self.shapes]
        for start in range(0, len(crops), self._batch):
            part = slice(start, start + self._batch)
            for result, values in zip(results, self._run(crops[part]), strict=True):
                if values.shape[1:] != result.shape[1:]:
                    self._refuse(f"outputs of {result.shape[1:]} for a crop became {values.shape[1:]}")
                result[part] = values
        return results

    def _open(self, provider: Provider, threads: int) -> Any:
        try:
            import onnxruntime
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                f"network {self.path}: onnxruntime is not installed, which runs networks; "
                "pip install 'mvpose[networks]'",
                name=error.name,
            ) from error

        providers = _providers(provider, onnxruntime.get_available_providers())
        if not self.path.is_file():
            self._refuse("no such file; expected an ONNX file. Copy it there or correct the path")
        check_content(self.path)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 4  # what matters is raised; the rest is noise on a user's terminal
        try:
            session = onnxruntime.InferenceSession(str(self.path), options, providers=providers)
        except Exception as error:  # onnxruntime's exceptions share no base class
            why = _reason(str(error).replace(str(self.path), ""), onnxruntime.__version__)
            self._refuse(f"cannot be loaded: {why}. onnxruntime says: {error}", error)
        if provider == "cuda" and _CUDA not in session.get_providers():  # onnxruntime takes the CPU and goes on
            self._refuse(
                f"provider 'cuda': CUDA does not come up here, the network would run on "
                f"{', '.join(session.get_providers())}; install the driver, CUDA and cuDNN that onnxruntime-gpu "
                f"{onnxruntime.__version__} needs, or take 'auto'"
            )
        return session

    def _read_input(self) -> None:
        """Name, type, layout, size and batch of the input."""
        inputs = self._session.get_inputs()
        if len(inputs) != 1:
            names = ", ".join(repr(each.name) for each in inputs)
            self._refuse(f"expected one input, a batch of pictures, got {len(inputs)}: {names}")
        (given,) = inputs
        shape = given.shape or []
        self._input = given.name
        if given.type not in _TYPES:
            self._refuse(
                f"input {given.name!r} must be {' or '.join(_TYPES)}, got {given.type}; export the network without "
                "the code that reads pictures"
            )
        self._dtype = _TYPES[given.type]
        if len(shape) != 4:
            self._refuse(f"input {given.name!r} must be (n, 3, height, width) or (n, height, width, 3), got {shape}")
        self._channels_last = shape[3] == 3 and shape[1] != 3
        self._layout_open = not any(isinstance(extent, int) and extent > 0 for extent in shape[1:])
        channels = shape[3] if self._channels_last else shape[1]
        if isinstance(channels, int) and channels != 3:
            self._refuse(f"input {given.name!r} must have 3 channels, red green blue, got {shape}")
        self._fixed = shape[0] if isinstance(shape[0], int) and shape[0] > 0 else 0
        height, width = shape[1:3] if self._channels_last else shape[2:]
        self.size = self._agreed_size(width, height)

    def _agreed_size(self, width: int | str | None, height: int | str | None) -> tuple[int, int]:
        """The input size of file and card together; a name or None in the file is a size that it leaves open."""
        size: list[int] = []
        for key, own, stated in zip(("width", "height"), (width, height), self.card.size or (None, None), strict=True):
            fixed = own if isinstance(own, int) and own > 0 else None
            extent = stated if fixed is None else fixed
            if extent is None:
                self._refuse(f"leaves the {key} of its input {self._input!r} open; state Card(size=(width, height))")
            if stated not in (None, extent):
                self._refuse(f"takes pictures of {key} {fixed}, but its card says size = {self.card.size}")
            size.append(extent)
        return size[0], size[1]

    def _chosen_outputs(self) -> tuple[str, ...]:
        there = [each.name for each in self._session.get_outputs()]
        missing = [name for name in self.card.outputs if name not in there]
        if missing:
            self._refuse(f"has no output {missing[0]!r}; it has {', '.join(map(repr, there))}")
        return self.card.outputs or tuple(there)

    def _try(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of the outputs for one crop; two are run, for exports that only pretend to take any number."""
        count = min(2, self._batch)
        crops = np.full((count, self.size[1], self.size[0], 3), _GREY, np.uint8)
        return tuple(values.shape[1:] for values in self._run(crops))

    def _run(self, crops: Pixels) -> list[Values]:
        """Outputs, (n, ...) each, for at most one batch of n crops."""
        count = len(crops)
        feed = self._feed(crops, self._fixed or count)
        hint = "" if len(feed) == 1 or self._fixed else "; if it takes one crop at a time, open it with batch=1"
        if self._layout_open:
            hint += (
                f"; the file leaves the extents of its input {self._input!r} open, so it is fed (n, 3, height, width): "
                "if it takes (n, height, width, 3), export it with that shape stated"
            )
        try:
            raw = self._session.run(list(self.outputs), {self._input: feed})
        except Exception as error:
            self._refuse(f"fails on a batch of {len(feed)}{hint}. onnxruntime says: {error}", error)
        results = []
        for name, values in zip(self.outputs, raw, strict=True):
            if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
                kind = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
                self._refuse(f"output {name!r} must be an array of floats, got {kind}; choose with Card(outputs=...)")
            if values.ndim < 2 or len(values) != len(feed):
                self._refuse(f"output {name!r} must have a row for each of {len(feed)} crops, got {values.shape}{hint}")
            if not np.isfinite(values[:count]).all():
                half = np.float16 in (values.dtype, self._dtype)
                self._refuse(
                    f"output {name!r} has values that are not finite"
                    + ("; float16 ends at 65504: export in float32" if half else "")
                )
            results.append(values[:count].astype(np.float32))
        return results

    def _feed(self, crops: Pixels, count: int) -> NDArray:
        """Normalised crops as the input wants them, blank ones after them up to ``count``."""
        mean, std = np.array(self.card.mean, np.float32), np.array(self.card.std, np.float32)
        if self.card.color_order == "bgr":
            crops, mean, std = crops[..., ::-1], mean[::-1], std[::-1]
        if not self._channels_last:
            crops, mean, std = crops.transpose(0, 3, 1, 2), mean[:, None, None], std[:, None, None]
        feed = np.zeros((count, *crops.shape[1:]), np.float32)
        fed = feed[: len(crops)]
        fed[:] = crops
        fed *= 1.0 / (255.0 * std)
        fed -= mean / std
        return feed.astype(self._dtype, copy=False)

    def _refuse(self, what: str, cause: Exception | None = None) -> NoReturn:
        raise ValueError(f"network {self.path}: {what}") from cause


def _providers(wanted: Provider, there: list[str]) -> list[str]:
    if wanted not in ("cpu", "cuda", "auto"):
        raise ValueError(f"provider must be cpu, cuda or auto, got {wanted!r}")
    cuda = _CUDA in there
    if wanted == "cuda" and not cuda:
        raise ValueError(
            f"provider 'cuda': this onnxruntime has only {', '.join(there)}; install onnxruntime-gpu, or take 'auto'"
        )
    return ([_CUDA] if cuda and wanted != "cpu" else []) + ["CPUExecutionProvider"]


def _reason(text: str, version: str) -> str:
    """What keeps a file from being loaded, and what to do, from what onnxruntime says of it."""
    said = text.lower()
    if "external data" in said or "external initializer" in said:
        return (
            "its weights lie in a file of their own, which is missing or cut off. Copy that file, whole, beside this "
            "one under the name it had, or export the network as one file"
        )
    if re.search(r"opset \d+ is under development|model ir version", said):  # not: "missing opset", of a cut file
        return (
            f"it is of a newer ONNX than onnxruntime {version} reads. Install a newer onnxruntime, or export it for an "
            "older opset"
        )
    return (
        f"it is cut off, is no ONNX file, or needs operations that onnxruntime {version} does not have. Copy or export "
        "it again"
    )


def _stated_digest(card: Path) -> str | None:
    """The SHA-256 of a network that the card beside it states; None where there is none, or other JSON."""
    try:
        content = json.loads(card.read_bytes())
    except (OSError, ValueError):
        return None
    stated = content.get("sha256") if isinstance(content, dict) else None
    return stated if isinstance(stated, str) else None
