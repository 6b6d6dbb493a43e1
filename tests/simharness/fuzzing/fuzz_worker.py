"""Worker process of the fuzzing.

Its output is a line of JSON with the names of the readers, and then one for each line ``READER NUMBER`` of its input,
separated by a tab, with the result of that mutation.
"""

import hashlib
import json
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

from file_mutations import KINDS, mutate
from reader_cases import CASES

from mvpose.files.message_text import LONGEST

MEMORY = 3 * 2**30  # bytes that a reader may take
_answers: dict[tuple[str, str], dict] = {}  # by reader and digest of the mutated file


def attempt_once(reader, number, seeds, folder):
    """Return what a reader does with one mutation of its file; files that it has read before are not read again.

    Many mutations have few results: there are six huge files of a reader, whatever the number.
    """
    what = place_mutation(reader, number, seeds, folder)
    special = what.startswith("special: ")  # some of these files cannot be read
    content = what if special else hashlib.sha256((folder / CASES[reader].file).read_bytes()).hexdigest()
    key = (reader, content)
    if key not in _answers:
        _answers[key] = attempt(reader, what, folder)
    return {**_answers[key], "what": what}


def place_mutation(reader, number, seeds, folder):
    """Make a folder with the files of a reader, of which one is mutated, and return what was done to it."""
    case = CASES[reader]
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(seeds / reader, folder)
    path = folder / case.file
    original = path.read_bytes()
    path.unlink()
    return mutate(path, original, random.Random(f"{reader} {number}"), KINDS[number % len(KINDS)])


def attempt(reader, what, folder):
    """Return what a reader does with the mutated file in a folder."""
    case = CASES[reader]
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    problem = ""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            case.read(folder)
            outcome = "accepted"
        except ValueError as error:
            outcome, text = "refused", str(error)
            if "\n" in text.strip() or len(text) > LONGEST + len(str(folder)) or not text.strip():
                problem = f"a message of {len(text)} characters and {text.count(chr(10)) + 1} lines: {text[:300]!a}"
        except BaseException as error:
            outcome = "failed"
            where = traceback.extract_tb(error.__traceback__)[-1]
            problem = f"{type(error).__name__}: {str(error)[:200]!a} ({where.filename}:{where.lineno})"
    if outcome != "failed" and not problem and warned:
        first = warned[0]
        problem = f"{first.category.__name__}: {str(first.message)[:150]!a} ({first.filename}:{first.lineno})"
    seconds = time.process_time() - start
    memory = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    return {"outcome": outcome, "problem": problem, "what": what, "seconds": seconds, "memory": memory}


def main():
    answers = sys.stdout
    sys.stdout = sys.stderr
    place = Path(tempfile.mkdtemp(dir=sys.argv[1]))
    seeds = place / "seeds"
    for name, case in CASES.items():
        (seeds / name).mkdir(parents=True)
        case.make(seeds / name)
        try:
            case.read(seeds / name)  # the modules of the reader are imported, too
        except Exception as error:
            raise SystemExit(f"{name}: the file is not valid before it is mutated: {error}") from error
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, taken + MEMORY))
    print(json.dumps(list(CASES)), file=answers, flush=True)
    for line in sys.stdin:
        reader, number = line.rstrip("\n").split("\t")
        print(json.dumps(attempt_once(reader, int(number), seeds, place / "files")), file=answers, flush=True)


main()
