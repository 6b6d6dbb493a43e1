"""OpenCV's FileStorage (YAML or XML) in plain Python values: reader and writer.

OpenCV's own reader crashes the process on some damaged files, so files are parsed by LibYAML, as events, and Expat, and
scalars are interpreted by OpenCV's rules. YAML begins with ``%YAML:1.0``, which is no valid directive, and has matrices
tagged ``!!opencv-matrix``; XML has ``<opencv_storage>`` with an element for each name. Aliases of YAML and document
types of XML, by which a small file unpacks to any size or reads other files, are refused; OpenCV does not know them
either.
"""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from mvpose.files.input_files import CALIBRATION, read_bytes
from mvpose.files.message_text import one_line, shown

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # only its events are used
_DIRECTIVE = re.compile(r"\s*%YAML[^\n]*(?:\n|$)")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ROOT = "opencv_storage"
_QUOTE = "\ue000"  # stands for &quot;, which within a literal is no end of it
_LITERAL = re.compile(r'"([^"]*)"|([^\s"]+)')
_DEEPEST = 32  # structures in each other; a calibration has three
_INTEGER = re.compile(r"[-+]?(?:0[xX][0-9a-fA-F]{1,15}|[0-9]{1,18})")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_SPECIAL = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan, "-.nan": math.nan}
_MATRIX = {"dt", "data"}  # beside rows and cols, or sizes where the dimensions are not two
_TYPE = re.compile(r"([0-9]{0,3})([ucwsifdhHIUnNb])")  # channels and type of a matrix's elements


def read_storage(path: Path, *, what: str) -> dict[str, Any]:
    """Read a whole file: maps as dicts, sequences as lists, matrices as arrays of floats, text and numbers.

    Args:
        path: the file.
        what: the expected content, for the message.

    Raises:
        ValueError: the file does not exist, is truncated, is no valid YAML or XML of FileStorage, or has no names.
    """
    content = read_bytes(path, what=what, most=CALIBRATION)
    try:
        text = content.decode("utf-8-sig")
        value = with_matrices(parse_xml(text) if text.lstrip().startswith("<") else parse_yaml(text))
    except ValueError as error:
        raise ValueError(
            f"{path}: cannot be read as OpenCV's FileStorage ({one_line(str(error), 160)}; the file has {len(content)} "
            f"bytes); expected {what}. It may be cut off, or lack %YAML:1.0 in its first line"
        ) from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected {what}, got a file without named values")
    return value


def read_beside(path: Path, *, what: str) -> dict[str, Any]:
    """Read a file and, where its name contains ``intri`` or ``extri``, the counterpart in the same folder, too.

    Raises:
        ValueError: as :func:`read_storage`, for either file.
    """
    values = read_storage(path, what=what)
    other = counterpart(path)
    if other is not None and other.exists():
        values = {**read_storage(other, what=what), **values}
    return values


def counterpart(path: Path) -> Path | None:
    """Return the file beside one of intrinsics or extrinsics that has the rest; None for one of another name."""
    for part, counterpart in (("intri", "extri"), ("extri", "intri"), ("cameras.txt", "images.txt")):
        if part in path.name:
            return path.with_name(path.name.replace(part, counterpart))
    return None


def missing_half(path: Path) -> str:
    """Return the name of the counterpart file for messages, or the names that both files should have."""
    other = counterpart(path)
    return f"{other.name} beside it" if other else "a file beside it (the two must be called intri.yml and extri.yml)"


def matrix(value: ArrayLike) -> NDArray[np.float64]:
    """Return a value as a matrix (rows, columns), as FileStorage writes it."""
    return np.atleast_2d(np.asarray(value, float))


def write_storage(path: Path, values: dict[str, Any]) -> None:
    """Write named values: text, numbers, arrays, and lists and dicts of these.

    Raises:
        ValueError: a name that FileStorage refuses: it does not begin with a letter, or has characters other than
            letters, digits, spaces, - and _.
    """
    storage = cv2.FileStorage(str(path.suffix or ".yml"), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in values.items():
        _write(storage, key, value)
    path.write_text(storage.releaseAndGetString(), encoding="utf-8")


def _write(storage: cv2.FileStorage, key: str, value: Any) -> None:
    try:
        if isinstance(value, dict):
            storage.startWriteStruct(key, cv2.FILE_NODE_MAP)
            for name, each in value.items():
                _write(storage, name, each)
            storage.endWriteStruct()
        elif isinstance(value, list):
            storage.startWriteStruct(key, cv2.FILE_NODE_SEQ)
            for each in value:
                _write(storage, "", each)
            storage.endWriteStruct()
        else:
            storage.write(key, value)
    except cv2.error:
        raise ValueError(
            f"OpenCV's FileStorage refuses the name {key!r}: expected a letter, then letters, digits, spaces, - and _"
        ) from None


def parse_yaml(text: str) -> Any:
    """Return the values of the first document of a file, without matrices.

    Raises:
        ValueError: not YAML, nested deeply, an alias or an anchor, or a key that is no text or stands twice.
    """
    text = _DIRECTIVE.sub("", text, count=1)
    text = _ESCAPE.sub(lambda match: "'" if match[1] == "'" else match[0], text)  # OpenCV writes \', no escape of YAML
    root = None
    try:
        events = yaml.parse(text, Loader=_LOADER)
        for event in events:
            if isinstance(event, yaml.DocumentEndEvent):
                break
            if isinstance(event, yaml.NodeEvent):
                root = _yaml_value(event, events)
    except (yaml.YAMLError, RecursionError) as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        raise ValueError(f"line {mark.line + 1}: {problem}" if mark and problem else str(error)) from None
    return root


def _yaml_value(event: yaml.Event, events: Iterator[yaml.Event], depth: int = 0) -> Any:
    """Return the value that begins with an event; its other events are taken from the rest."""
    if event.anchor is not None:
        raise ValueError(f"the anchor or alias {shown(event.anchor)}, which is not of FileStorage")
    if isinstance(event, yaml.ScalarEvent):
        return event.value if event.style else _scalar(event.value)  # plain: None or ""
    _check_depth(depth)
    if isinstance(event, yaml.SequenceStartEvent):
        return [_yaml_value(each, events, depth + 1) for each in _until(yaml.SequenceEndEvent, events)]
    pairs = []
    for name in _until(yaml.MappingEndEvent, events):
        if not isinstance(name, yaml.ScalarEvent):
            raise ValueError("a list, a map or an alias in the place of a name")
        pairs.append((name.value, _yaml_value(next(events), events, depth + 1)))
    return _map(pairs)


def _until(end: type[yaml.Event], events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
    while not isinstance(event := next(events), end):
        yield event


def parse_xml(text: str) -> Any:
    """Return the values of a file: of elements that hold text, a scalar, or a list where there are several.

    Raises:
        ValueError: not XML, another root, nested deeply, a name that stands twice, or a document type.
    """
    parser = ElementTree.XMLParser(target=_Tree())
    try:
        parser.feed(text.replace("&quot;", _QUOTE))
        root = parser.close()
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from None
    if root.tag != _ROOT:
        raise ValueError(f"the root is <{root.tag[:40]}>, expected <{_ROOT}>")
    return _xml_value(root) if len(root) else {}


class _Tree(ElementTree.TreeBuilder):
    """Builder of the elements of a file."""

    def doctype(self, *_: object) -> None:
        """Refuse a document type."""
        raise ValueError("a document type (<!DOCTYPE), which is not of FileStorage; remove it")


def _xml_value(element: ElementTree.Element, depth: int = 0) -> Any:
    """Return the value of an element: a structure if it has children, of the kind of the first one."""
    if not len(element):
        values = [_literal(match) for match in _LITERAL.finditer(element.text or "")]
        return values[0] if len(values) == 1 else values
    _check_depth(depth)
    pairs = [(each.tag, _xml_value(each, depth + 1)) for each in element]
    return [value for _, value in pairs] if pairs[0][0] == "_" else _map(pairs)


def _literal(match: re.Match[str]) -> int | float | str:
    quoted, plain = match.groups()
    return quoted.replace(_QUOTE, '"') if plain is None else _scalar(plain.replace(_QUOTE, '"'))


def _scalar(text: str) -> int | float | str:
    """Return a scalar without quotes: a number, or else text. Nothing else is special: ``yes`` is text."""
    if _INTEGER.fullmatch(text):
        digits = text.lstrip("+-")
        base = 16 if digits[:2] in ("0x", "0X") else 8 if digits[0] == "0" and digits.isdigit() else 10
        try:
            return int(text, base)
        except ValueError:  # 08
            return float(text)
    if _REAL.fullmatch(text):
        return float(text)
    return _SPECIAL.get(text.lower(), text)


def _check_depth(depth: int) -> None:
    if depth >= _DEEPEST:
        raise ValueError(f"nested more than {_DEEPEST} deep")


def _map(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in pairs:
        if name in values:
            raise ValueError(f"the name {shown(name)} stands twice; remove one of them")
        values[name] = value
    return values


def with_matrices(value: Any) -> Any:
    """Return a JSON value with FileStorage's matrices, maps of ``rows cols dt data``, as arrays of floats.

    Raises:
        ValueError: a matrix whose size does not fit its data.
    """
    if isinstance(value, dict):
        if value.keys() >= _MATRIX:
            return _matrix_of(value)
        return {key: with_matrices(each) for key, each in value.items()}
    return [with_matrices(each) for each in value] if isinstance(value, list) else value


def _matrix_of(given: dict[str, Any]) -> NDArray[np.float64]:
    """Return a matrix of FileStorage: (rows, columns), (rows, columns, channels) or of its sizes."""
    data, kind = given["data"], _TYPE.fullmatch(str(given["dt"]))
    sides = given["sizes"] if "sizes" in given else [given.get("rows"), given.get("cols")]
    if kind is None:
        raise ValueError(f"a matrix has the type of elements {shown(given['dt'])}; expected d, f, i, u or another one")
    if not isinstance(sides, list) or not all(isinstance(side, int) and side >= 0 for side in sides):
        raise ValueError(f"a matrix has rows and cols {shown(sides)}; expected whole numbers")
    data = data if isinstance(data, list) else [data]
    if not all(isinstance(value, int | float) for value in data):
        raise ValueError("a matrix has data other than numbers")
    shape = [*sides, int(kind[1])] if kind[1] and int(kind[1]) > 1 else sides
    if math.prod(shape) != len(data):
        raise ValueError(f"a matrix of {' x '.join(map(str, shape))} has {len(data)} numbers")
    return np.array(data, float).reshape(shape)
