"""A program of any language as a method under test: JSON on its standard input, JSON on its standard output.

In a file that a scenario names, ``foreign = "wrapped.py:foreign"``::

    foreign = ForeignProgram(["./program", "--fast"], seconds=10)
"""

import contextlib
import json
import os
import selectors
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose import Detections, Estimate, Rig
from mvpose.commands.errors import MethodError
from mvpose.files.input_files import MIB, parse_json
from mvpose.files.message_text import one_line, shown

_CHUNK = 2**16  # bytes that are read at once
_TAIL = 2**12  # bytes of standard error that are kept
_SHOWN = 300  # characters of them in a message
_WAIT = 0.02  # seconds between looks whether a program has ended whose children hold its pipes
_GUARD = ("/bin/sh", "-c", "read -r end; kill -s KILL 0")  # the read ends when this process does, however it ends


@dataclass(frozen=True)
class ForeignProgram:
    """Estimator that starts a program for every frame.

    The program reads one JSON object: ``P`` (V, 3, 4) in metres, ``view`` (m,) the camera of each detection,
    ``keypoints`` (m, J, 2) pixels without lens distortion, ``scores`` (m, J) with 0 for a joint that was not detected,
    and ``names``, the J joints. It writes one: ``joints`` (n, J, 3) in metres, null for a joint that was not placed,
    and optionally ``labels`` (m,) and ``scores``, as :meth:`mvpose.Estimate.of_joints` takes them.

    It runs in a process group of its own. When it ends, fails, takes too long or writes too much, when the run is
    interrupted and when this process dies, the whole group is killed, with all that the program has started in it.
    """

    command: Sequence[str | Path]
    """Program and arguments. Its working directory is that of this process."""
    seconds: float = 60.0
    """Longest time of a frame."""
    megabytes: float = 64.0
    """Largest output of a frame, MiB."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame.

        Raises:
            MethodError: see :meth:`run`; or the output is no such JSON object.
        """
        rows = zip(detections.view, detections.keypoints, strict=True)
        request = {
            "P": rig.P.tolist(),
            "view": detections.view.tolist(),
            "keypoints": np.nan_to_num([rig[view].undistort(points) for view, points in rows]).tolist(),
            "scores": detections.scores.tolist(),
            "names": list(detections.skeleton.joints),
        }
        output = self.run(json.dumps(request))
        try:
            people = parse_json(output)
            return Estimate.of_joints(
                people["joints"], labels=people.get("labels"), scores=people.get("scores"), skeleton=detections.skeleton
            )
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise self._failure(
                f'wrote no JSON object with "joints" (n, {len(detections.skeleton)}, 3): '
                f"{type(error).__name__}: {error}; its output begins {shown(output[:_SHOWN])}"
            ) from None

    def run(self, text: str) -> str:
        """Return what the program writes for an input.

        Raises:
            MethodError: it cannot be started, takes too long, writes too much, or ends with an exit code but 0; the
                message has the end of its standard error.
        """
        with tempfile.TemporaryFile() as given, _process_group() as group:
            given.write(text.encode())
            given.seek(0)
            try:
                process = subprocess.Popen(
                    self.command, stdin=given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, process_group=group
                )
            except OSError as error:
                raise self._failure(f"cannot be started: {error.strerror}: install it or correct the command") from None
            with process:
                try:
                    output, errors, fault = self._read(process, group)
                finally:
                    _kill(group)
        if fault or process.returncode:
            fault = fault or (
                f"ended with exit code {process.returncode}"
                if process.returncode > 0
                else f"was ended by {signal.Signals(-process.returncode).name}"
            )
            lines = [line for line in errors.decode(errors="replace").splitlines() if line.strip()]
            tail = one_line(" | ".join(lines)[-_SHOWN:], _SHOWN)
            raise self._failure(
                f"{fault}; " + (f"its standard error ends: {tail}" if tail else "its standard error is empty")
            )
        return output.decode(errors="replace")

    def _read(self, process: "subprocess.Popen[bytes]", group: int) -> tuple[bytes, bytes, str]:
        """Return the output of a program, the end of its standard error, and what it did wrong, until it has ended."""
        deadline = time.monotonic() + self.seconds
        assert process.stdout is not None
        assert process.stderr is not None
        output, errors = bytearray(), bytearray()
        with selectors.DefaultSelector() as pipes:
            pipes.register(process.stdout, selectors.EVENT_READ, output)
            pipes.register(process.stderr, selectors.EVENT_READ, errors)
            while True:
                ended = process.poll() is not None  # before the last look into the pipes, so that nothing is missed
                if ended:
                    _kill(group)  # children that would hold the pipes
                ready = pipes.select(0.0 if ended else _WAIT if pipes.get_map() else _WAIT / 20)
                for key, _ in ready:
                    chunk = os.read(key.fd, _CHUNK)
                    key.data.extend(chunk)
                    if not chunk:
                        pipes.unregister(key.fileobj)
                del errors[:-_TAIL]
                fault = ""
                if len(output) > self.megabytes * MIB:
                    fault = f"wrote more than {self.megabytes:g} MiB for a frame"
                elif time.monotonic() > deadline:
                    fault = f"did not answer within {self.seconds:g} s"
                if fault or (ended and not ready):
                    return bytes(output), bytes(errors), fault

    def _failure(self, what: str) -> MethodError:
        return MethodError(f'the program "{one_line(" ".join(map(str, self.command)), 120)}" {what}')


@contextlib.contextmanager
def _process_group() -> Iterator[int]:
    """Give the number of a new group of processes, which is killed at the end, or when this process dies."""
    null = subprocess.DEVNULL
    with subprocess.Popen(_GUARD, stdin=subprocess.PIPE, stdout=null, stderr=null, process_group=0) as guard:
        try:
            yield guard.pid
        finally:
            _kill(guard.pid)


def _kill(group: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):  # of a group that has ended
        os.killpg(group, signal.SIGKILL)
