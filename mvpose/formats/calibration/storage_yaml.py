"""Parser of the YAML of OpenCV's FileStorage: ``%YAML:1.0`` (no valid YAML directive), ``!!opencv-matrix``.

The events of LibYAML are taken one by one, without recursion. Aliases, by which a small file unpacks to any size, are
refused; FileStorage does not know them either.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from mvpose.files.message_text import shown
from mvpose.formats.calibration.storage_values import Builder, scalar

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # only its events are used
_DIRECTIVE = re.compile(r"\s*%YAML[^\n]*(?:\n|$)")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)


def parse_yaml(text: str) -> Any:
    """Return the values of the first document of a file.

    Raises:
        ValueError: not YAML, an alias or an anchor, a key that is no text, or a value that :class:`Builder` refuses.
    """
    text = _DIRECTIVE.sub("", text, count=1)
    text = _ESCAPE.sub(lambda match: "'" if match[1] == "'" else match[0], text)  # OpenCV writes \', no escape of YAML
    builder = Builder()
    keys: list[str | None] = []  # for each open structure: the key whose value is next; None: a key is next, or a list
    maps: list[bool] = []
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            if getattr(event, "anchor", None) is not None:
                raise ValueError(f"the anchor or alias {shown(event.anchor)}, which is not of FileStorage")
            if isinstance(event, yaml.DocumentEndEvent):
                break
            in_map = bool(maps) and maps[-1]
            if isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
                keys.pop()
                maps.pop()
                builder.end()
            elif isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent | yaml.ScalarEvent):
                if in_map and keys[-1] is None:
                    if not isinstance(event, yaml.ScalarEvent):
                        raise ValueError("a list or map in the place of a name")
                    keys[-1] = event.value
                    continue
                key = (keys[-1] or "") if in_map else ""
                if in_map:
                    keys[-1] = None
                if isinstance(event, yaml.ScalarEvent):
                    builder.add(event.value if event.style else scalar(event.value), key)  # plain: None or ""
                else:
                    is_map = isinstance(event, yaml.MappingStartEvent)
                    builder.begin({} if is_map else [], key)
                    keys.append(None)
                    maps.append(is_map)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(_reason(error)) from None
    return builder.root


def _reason(error: Exception) -> str:
    """Return the line and the problem of an error of the parser."""
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    return f"line {mark.line + 1}: {problem}" if mark is not None and problem else str(error)
