"""Catalogue of planted bugs, and their application to the text of a file."""

from __future__ import annotations

import ast
import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

CATALOGUE = Path(__file__).with_name("catalogue.toml")

Effect = Literal["real", "outside", "equivalent"]


@dataclass(frozen=True)
class Bug:
    """Bug to be planted in one file.

    Attributes:
        id: its name.
        file: file that it changes, relative to the checkout.
        edits: texts that the file has exactly once, each with its replacement.
        breaks: what goes wrong, one sentence.
        tests: test files and folders near it, the most likely to notice first.
        effect: ``"real"``: scores of the suite change; ``"outside"``: only results that no condition of the suite has
            change; ``"equivalent"``: no correct result changes.
        why: reason of an effect that is not real.
        measured: measured effect on the scores of the suite; "" where it was not measured.
        suite: shipped suite of the gate that has to notice it.

    Raises:
        ValueError: no edits or no tests, an unknown effect, or an effect that is not real without a reason.
    """

    id: str
    file: str
    edits: tuple[tuple[str, str], ...]
    breaks: str
    tests: tuple[str, ...]
    effect: Effect
    why: str = ""
    measured: str = ""
    suite: str = "ci"

    def __post_init__(self) -> None:
        object.__setattr__(self, "edits", tuple((str(text), str(other)) for text, other in self.edits))
        object.__setattr__(self, "tests", tuple(self.tests))
        if not self.edits or not self.tests:
            raise ValueError(f"bug {self.id!r}: expected at least one edit and one test file")
        if self.effect not in get_args(Effect):
            raise ValueError(
                f"bug {self.id!r}: effect must be one of {', '.join(get_args(Effect))}, got {self.effect!r}"
            )
        if self.effect != "real" and not self.why:
            raise ValueError(f"bug {self.id!r}: expected a reason `why` its effect is {self.effect}")

    @property
    def digest(self) -> str:
        """Digest of the change and of the tests, hexadecimal: results of another change or other tests do not hold."""
        return hashlib.blake2b(repr((self.file, self.edits, self.tests)).encode(), digest_size=6).hexdigest()

    def planted(self, text: str) -> str:
        """Return the text of the file with the bug.

        Raises:
            ValueError: an edited text that the file does not have exactly once, or a result that is not valid Python
                or means the same as before: the code has changed, and the catalogue must follow.
        """
        result = text
        for old, new in self.edits:
            if (count := text.count(old)) != 1:
                raise ValueError(
                    f"bug {self.id!r} no longer applies: {self.file} has its text {count} times, expected once: "
                    f"{old.strip().splitlines()[0]!r}; write the edit for the present code"
                )
            result = result.replace(old, new)
        try:
            same = ast.dump(ast.parse(result)) == ast.dump(ast.parse(text))
        except SyntaxError as error:
            raise ValueError(f"bug {self.id!r}: {self.file} with the bug is not valid Python: {error}") from None
        if same:
            raise ValueError(f"bug {self.id!r} changes nothing in {self.file}")
        return result


def read_catalogue(path: Path = CATALOGUE) -> dict[str, Bug]:
    """Read the bugs by name, in the order of the file.

    Raises:
        ValueError: a bug with missing or unknown keys, or of the name of another.
    """
    entries: list[Mapping[str, Any]] = tomllib.loads(path.read_text(encoding="utf-8"))["bug"]
    bugs: dict[str, Bug] = {}
    for entry in entries:
        try:
            bug = Bug(**entry)
        except TypeError as error:
            raise ValueError(f"{path}: bug {entry.get('id')!r}: {error}") from None
        if bug.id in bugs:
            raise ValueError(f"{path}: two bugs are called {bug.id!r}")
        bugs[bug.id] = bug
    return bugs


def unplantable(bugs: Mapping[str, Bug], root: Path) -> list[str]:
    """Return a message for each bug that does not apply to a checkout, or whose tests it does not have."""
    messages = []
    for bug in bugs.values():
        try:
            bug.planted((root / bug.file).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            messages.append(str(error))
        messages += [f"bug {bug.id!r}: no tests {test}" for test in bug.tests if not (root / test).exists()]
    return messages
