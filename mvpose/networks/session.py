"""Session of a network in an ONNX file, run by onnxruntime on crops."""

import hashlib
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from mvpose.networks.card import Card, read_card_file
from mvpose.networks.crops import Pixels

Values = NDArray[np.float32]
Provider = Literal["cpu", "cuda", "auto"]

_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_CUDA = "CUDAExecutionProvider"
_LONGEST_MESSAGE = 400  # characters
_GREY = 128  # value of the test crops


def as_session(model: "str | Path | Session") -> "Session":
    """Return a session unchanged, or open one with the defaults for a file."""
    return model if isinstance(model, Session) else Session(model)


def check_content(path: Path) -> None:
    """Check the SHA-256 of an ONNX file against the model card beside it; a file without such a card passes.

    Without this check damaged weights would load without an error, and a file truncated near its end would only lose
    its metadata.

    Args:
        path: ONNX file; its card is the .json file of the same name, with an entry ``sha256``.

    Raises:
        ValueError: another digest than that of the card, or a card that cannot be read.
    """
    expected = (read_card_file(path) or {}).get("sha256")
    if expected is None:
        return
    card = path.with_suffix(".json")
    if not isinstance(expected, str):
        raise ValueError(f"{card}: sha256 must be text, got a {type(expected).__name__}; copy the card again")
    with path.open("rb") as opened:
        got = hashlib.file_digest(opened, "sha256").hexdigest()
    if got != expected.lower():
        raise ValueError(
            f"network {path}: is not the file of this card: {card} has sha256 {expected[:64]}, the file has {got} "
            f"({path.stat().st_size} bytes). The file is damaged or is another network: copy both again from their "
            "source, or remove the card if this network is intended"
        )


class Session:
    """Open network that maps crops of images to arrays, checked once when the file is opened.

    Name, size, layout, type and batch of the input are read from the file; the card supplies what the file leaves
    open. A session can be pickled: the other process opens the same file.

    Args:
        path: ONNX file.
        card: model card that replaces the card in the file; without either, the defaults of :class:`Card` are used.
        provider: ``cpu``, ``cuda``, or ``auto`` (CUDA if this onnxruntime has it).
        threads: number of threads of one run.
        batch: greatest number of crops in one run. A file with a fixed batch size is run at that size, padded with
            blank crops.

    Attributes:
        path: ONNX file.
        card: given card, or the card in the file.
        size: width and height of a crop in pixels.
        outputs: names of the outputs that are read.
        shapes: shapes of the outputs for one crop, without the batch.

    Raises:
        ValueError: a missing file, a truncated or invalid ONNX file, a file that does not match the card beside it
            (the .json file of its name, if that has a ``sha256``), a provider that is unavailable or cannot be
            started, other inputs than one batch of pictures, an input size that neither file nor card gives or on
            which they differ, or outputs that are missing, not finite, or without a row for each crop.
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
        self.shapes = self._output_shapes()

    def __reduce__(self) -> "tuple[Callable[[], Session], tuple[()]]":
        return self._reopen, ()

    @property
    def providers(self) -> list[str]:
        """Execution providers of onnxruntime that the network runs on, first choice first."""
        return self._session.get_providers()

    def __call__(self, crops: Pixels) -> list[Values]:
        """Run the network.

        Args:
            crops: (m, height, width, 3) uint8, red green blue.

        Returns:
            Arrays of the outputs, (m, ...) each.

        Raises:
            ValueError: crops of another shape or type, a failed run, or an output that is not finite.
        """
        shape = (self.size[1], self.size[0], 3)
        if crops.dtype != np.uint8 or crops.shape[1:] != shape:
            raise ValueError(f"crops must be (m, {', '.join(map(str, shape))}) uint8, got {crops.dtype} {crops.shape}")
        results = [np.empty((len(crops), *shape), np.float32) for shape in self.shapes]
        for start in range(0, len(crops), self._batch):
            part = slice(start, start + self._batch)
            for result, values in zip(results, self._run(crops[part]), strict=True):
                if values.shape[1:] != result.shape[1:]:
                    self._refuse(
                        f"output for a crop must be {result.shape[1:]}, as when it was opened, got {values.shape[1:]}"
                    )
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
            self._refuse("no such file; expected an ONNX file. Copy the file there or correct the path")
        check_content(self.path)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 4  # errors are raised as exceptions; other messages would clutter the terminal
        try:
            session = onnxruntime.InferenceSession(
                str(self.path), options, providers=providers, enable_fallback=int(provider == "auto")
            )
        except Exception as error:  # onnxruntime's exceptions share no base class
            why = _reason(str(error).replace(str(self.path), ""), onnxruntime.__version__)
            self._refuse(f"cannot be loaded: {why}. Message of onnxruntime: {error}", error)
        if provider == "cuda" and _CUDA not in session.get_providers():  # onnxruntime silently falls back to the CPU
            self._refuse(
                f"provider 'cuda': CUDA cannot be started here, the network would run on "
                f"{', '.join(session.get_providers())}; install the driver, CUDA and cuDNN that onnxruntime-gpu "
                f"{onnxruntime.__version__} needs, or use 'auto'"
            )
        return session

    def _read_input(self) -> None:
        """Read name, type, layout, size and batch of the input."""
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
                "its image preprocessing"
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
        self.size = self._input_size(width, height)

    def _input_size(self, width: int | str | None, height: int | str | None) -> tuple[int, int]:
        """Return the input size from file and card; a name or None in the file is a size that it leaves open."""
        size: list[int] = []
        card_size = self.card.size or (None, None)
        for key, in_file, in_card in zip(("width", "height"), (width, height), card_size, strict=True):
            fixed = in_file if isinstance(in_file, int) and in_file > 0 else None
            extent = in_card if fixed is None else fixed
            if extent is None:
                self._refuse(f"leaves the {key} of its input {self._input!r} open; give Card(size=(width, height))")
            if in_card not in (None, extent):
                self._refuse(
                    f"takes pictures of {key} {fixed}, but its card has size = {self.card.size}; correct the card"
                )
            size.append(extent)
        return size[0], size[1]

    def _chosen_outputs(self) -> tuple[str, ...]:
        available = [each.name for each in self._session.get_outputs()]
        missing = [name for name in self.card.outputs if name not in available]
        if missing:
            self._refuse(f"has no output {missing[0]!r}; expected one of {', '.join(map(repr, available))}")
        return self.card.outputs or tuple(available)

    def _output_shapes(self) -> tuple[tuple[int, ...], ...]:
        """Return the output shapes for one crop; two crops are run, to detect exports with a hidden batch of one."""
        count = min(2, self._batch)
        crops = np.full((count, self.size[1], self.size[0], 3), _GREY, np.uint8)
        return tuple(values.shape[1:] for values in self._run(crops))

    def _run(self, crops: Pixels) -> list[Values]:
        """Return the outputs, (n, ...) each, for at most one batch of n crops."""
        count = len(crops)
        feed = self._feed(crops, self._fixed or count)
        hint = "" if len(feed) == 1 or self._fixed else "; if it takes one crop at a time, open it with batch=1"
        if self._layout_open:
            hint += (
                f"; the file leaves the shape of its input {self._input!r} open, so it is given (n, 3, height, width): "
                "if it takes (n, height, width, 3), export it with a fixed shape"
            )
        try:
            raw = self._session.run(list(self.outputs), {self._input: feed})
        except Exception as error:
            self._refuse(f"fails on a batch of {len(feed)}{hint}. Message of onnxruntime: {error}", error)
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
                    + ("; float16 overflows beyond 65504: export in float32" if half else "")
                )
            results.append(values[:count].astype(np.float32))
        return results

    def _feed(self, crops: Pixels, count: int) -> NDArray:
        """Return normalised crops in the layout of the input, padded with blank crops to ``count``."""
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
        text = " ".join(what.split())  # messages of onnxruntime have lines, and names from the file of any length
        if len(text) > _LONGEST_MESSAGE:
            text = f"{text[: _LONGEST_MESSAGE - 150]} … {text[-147:]}"
        raise ValueError(f"network {self.path}: {text}") from cause


def _providers(requested: Provider, available: list[str]) -> list[str]:
    if requested not in ("cpu", "cuda", "auto"):
        raise ValueError(f"provider must be cpu, cuda or auto, got {requested!r}")
    cuda = _CUDA in available
    if requested == "cuda" and not cuda:
        raise ValueError(
            f"provider 'cuda': this onnxruntime has only {', '.join(available)}; install onnxruntime-gpu, or use 'auto'"
        )
    return ([_CUDA] if cuda and requested != "cpu" else []) + ["CPUExecutionProvider"]


def _reason(text: str, version: str) -> str:
    """Return why a file cannot be loaded, and the remedy, from the error message of onnxruntime."""
    message = text.lower()
    if "external data" in message or "external initializer" in message:
        return (
            "its weights are in a separate file, which is missing or truncated. Copy that file beside this one under "
            "its original name, or export the network as one file"
        )
    if re.search(r"opset \d+ is under development|model ir version", message):  # not "missing opset": a truncated file
        return (
            f"it has a newer ONNX version than onnxruntime {version} reads. Install a newer onnxruntime, or export it "
            "for an older opset"
        )
    return (
        f"it is truncated, is not an ONNX file, or needs operations that onnxruntime {version} does not have. Copy or "
        "export it again"
    )
