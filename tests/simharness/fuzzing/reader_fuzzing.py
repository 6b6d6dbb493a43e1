"""Fuzzing of the readers of files: mutations in a worker process that may crash, hang or exhaust its memory.

``python tests/simharness/fuzzing/reader_fuzzing.py 2000`` mutates the file of every reader 2,000 times and prints a
table; with names of readers behind the number, theirs only.
"""

import contextlib
import json
import os
import selectors
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

LONGEST = 2.0  # seconds of processor time that a reader may take for a file
_PATIENCE = 60.0  # seconds of waiting for an answer, on a machine with other work
_HELPERS = (".", "mvpose/formats", *(f"simharness/{name}" for name in ("trial", "study", "outputs", "world/motion")))
_SHOWN = 12  # problems of a reader that the table lists
_START = 300.0  # seconds of waiting for a worker: kernels compile


@dataclass
class Tally:
    """Results of the mutations of one reader's file."""

    counts: Counter = field(default_factory=Counter)
    slowest: float = 0.0
    memory: int = 0
    problems: list[str] = field(default_factory=list)

    def add(self, number, answer):
        self.counts[answer["outcome"]] += 1
        self.slowest, self.memory = max(self.slowest, answer["seconds"]), max(self.memory, answer["memory"])
        problem = answer["problem"]
        if not problem and answer["seconds"] > LONGEST:
            problem = f"took {answer['seconds']:.1f} s"
        if problem:
            self.problems.append(f"{number}: {answer['what']}: {problem}")


class Worker:
    """Worker process, which is started again when it has died."""

    def __init__(self, folder):
        self._folder, self._process = folder, None
        self.readers = self._start()

    def attempt(self, reader, number):
        """Return the worker's answer, or what became of the worker."""
        if self._process is None:
            self._start()
        self._process.stdin.write(f"{reader}\t{number}\n")
        self._process.stdin.flush()
        line = self._line(_PATIENCE)
        if line:
            return json.loads(line)
        code = self._process.poll()
        self.close()
        problem = "no answer in time" if code is None else f"the process ended with {code}"
        return {"outcome": "failed", "problem": problem, "what": "?", "seconds": 0.0, "memory": 0}

    def close(self):
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def _start(self):
        """Start the process and return the names of the readers."""
        script = Path(__file__).with_name("fuzz_worker.py")
        tests = Path(__file__).parents[2]
        # The packages first: the folder tests/simharness would hide them.
        modules = [str(tests.parent), *(str(tests / folder) for folder in _HELPERS)]
        modules += [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
        self._process = subprocess.Popen(
            [sys.executable, str(script), str(self._folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            cwd=self._folder, env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(modules)},
        )  # fmt: skip
        line = self._line(_START)
        if not line:
            self.close()
            raise RuntimeError("the worker did not start: see its messages above")
        return json.loads(line)

    def _line(self, seconds):
        """Return the next line of the worker; "" where it has died or does not answer."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            if not selector.select(seconds):
                return ""
        line = self._process.stdout.readline()
        if not line:
            self._process.wait(10.0)
        return line


def fuzz(numbers, worker, readers=()):
    """Yield the readers, all or some, each with the tally of some numbers of mutations of its file.

    Raises:
        ValueError: a name that no reader has; the message lists those of the readers.
    """
    if unknown := [name for name in readers if name not in worker.readers]:
        raise ValueError(f"no reader is called {', '.join(unknown)}; the readers are {', '.join(worker.readers)}")
    for reader in readers or worker.readers:
        tally = Tally()
        for number in numbers:
            tally.add(number, worker.attempt(reader, number))
        yield reader, tally


def main():
    columns = ("mutations", "accepted", "refused", "failed", "odd", "worst s", "MiB")
    header = f"{'reader':26}" + "".join(f"{column:>10}" for column in columns)
    count = int(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(Worker(Path(folder))) as worker:
        for name, tally in fuzz(range(count), worker, sys.argv[2:]):
            if header:
                print(header, flush=True)
                header = ""
            counts = [count, *(tally.counts[each] for each in ("accepted", "refused", "failed")), len(tally.problems)]
            cells = [*map(str, counts), f"{tally.slowest:.2f}", f"{tally.memory / 2**20:.0f}"]
            print(f"{name:26}" + "".join(f"{cell:>10}" for cell in cells), flush=True)
            for problem in tally.problems[:_SHOWN]:
                print(f"    {problem}", flush=True)


if __name__ == "__main__":
    try:
        main()
    except ValueError as error:
        sys.exit(f"reader_fuzzing: {error}")
