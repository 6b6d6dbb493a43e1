"""Parser of the XML of OpenCV's FileStorage: ``<opencv_storage>`` with an element for each name.

Document types, and with them entities that unpack to any size or read other files, are refused.
"""

from __future__ import annotations

import re
from typing import Any
from xml.parsers import expat

from mvpose.formats.calibration.storage_values import Builder, scalar

_ROOT = "opencv_storage"
_QUOTE = "\ue000"  # stands for &quot;, which within a literal is no end of it
_LITERAL = re.compile(r'"([^"]*)"|([^\s"]+)')


def parse_xml(text: str) -> Any:
    """Return the values of a file: of elements that hold text, a scalar, or a list where there are several.

    Raises:
        ValueError: not XML, another root, a document type, or a value that :class:`Builder` refuses.
    """
    reader = _Reader()
    parser = expat.ParserCreate("utf-8")
    parser.StartDoctypeDeclHandler = reader.refuse
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.buffer_text = True
    try:
        parser.Parse(text.replace("&quot;", _QUOTE).encode(), True)
    except expat.ExpatError as error:
        raise ValueError(str(error)) from None
    return reader.builder.root


class _Reader:
    """Handlers of the parser: an element becomes a structure when its first child begins, and else a scalar."""

    def __init__(self) -> None:
        self.builder = Builder()
        self._names: list[str] = []
        self._begun: list[bool] = []  # whether an element has children
        self._text: list[str] = []

    def refuse(self, *_: object) -> None:
        raise ValueError("a document type (<!DOCTYPE), which is not of FileStorage; remove it")

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._names and name != _ROOT:
            raise ValueError(f"the root is <{name[:40]}>, expected <{_ROOT}>")
        if self._names and not self._begun[-1]:
            self._begun[-1] = True
            parent = self._names[-1]
            self.builder.begin([] if name == "_" else {}, "" if parent == "_" else parent)
        self._names.append(name)
        self._begun.append(False)
        self._text.clear()

    def end(self, name: str) -> None:
        self._names.pop()
        if self._begun.pop():
            self.builder.end()
        elif not self._names:
            self.builder.root = {}
        else:
            values = [_literal(match) for match in _LITERAL.finditer("".join(self._text))]
            self.builder.add(values[0] if len(values) == 1 else values, "" if name == "_" else name)
        self._text.clear()

    def text(self, text: str) -> None:
        self._text.append(text)


def _literal(match: re.Match[str]) -> int | float | str:
    quoted, plain = match.groups()
    return quoted.replace(_QUOTE, '"') if plain is None else scalar(plain.replace(_QUOTE, '"'))
