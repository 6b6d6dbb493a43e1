"""Detectors of people by the file of their network."""

from pathlib import Path
from typing import cast

from mvpose.networks.detector import Kind, PeopleFinder, PersonDetector, PictureSession
from mvpose.networks.movenet import MoveNet
from mvpose.networks.session import Provider


def open_finder(
    path: str | Path, *, kind: str | None = None, least: float | None = None, provider: Provider = "cpu"
) -> PeopleFinder:
    """Open a detector of people, of the kind that its card or its outputs show.

    Args:
        path: ONNX file.
        kind: kind of the network; None: that of the file.
        least: least score of a person; None: the default of the kind.
        provider: as of :class:`mvpose.networks.Session`.

    Raises:
        ValueError: as of the detectors.
    """
    session = PictureSession(path, provider=provider)
    finder: PeopleFinder
    if kind is None and session.card.name == MoveNet.kind:
        finder = MoveNet(session)
    else:
        finder = PersonDetector(session, kind=cast("Kind | None", kind))
    finder.least = finder.least if least is None else least
    return finder
