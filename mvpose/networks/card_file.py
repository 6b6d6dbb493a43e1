"""Model card beside a network: a JSON file of the network's name, with its digest and what was measured of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

_LARGEST = 2**24  # bytes; a card has some kilobytes


def read_card_file(network: Path) -> dict[str, Any] | None:
    """Return the content of the card beside a network; None where there is no card.

    Args:
        network: ONNX file; its card is the ``.json`` file of the same name.

    Raises:
        ValueError: there is a card and it cannot be read: no regular file, too large, not JSON, or no object.
    """
    card = network.with_suffix(".json")
    if not card.exists():
        return None
    try:
        if not card.is_file():  # a pipe or a device could be read for ever
            raise ValueError("it is no regular file")
        if (size := card.stat().st_size) > _LARGEST:
            raise ValueError(f"it has {size} bytes, expected at most {_LARGEST}")
        content = json.loads(card.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        why = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ValueError(
            f"{card}: cannot be read as the card of {network.name}: {why}. Copy both again from their source, or "
            "remove the card if this network is intended without one"
        ) from None
    if not isinstance(content, dict):
        raise ValueError(
            f"{card}: expected the card of {network.name}, a JSON object, got a {type(content).__name__}; copy both "
            "again from their source"
        )
    return content
