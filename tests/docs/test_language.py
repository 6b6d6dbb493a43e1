"""The product speaks of itself: texts, docstrings and comments have no word of its making, and no riddles."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAKING = re.compile(
    r"\basked\b|\bissues?\b|\(bars? [\d.<>]|\bbars? (?:is|are|was|were) (?:met|missed)|\bthe bar of\b|\bas required\b"
    r"|\blimits? set during\b|\bhad not seen the code\b|\bdeliverables?\b|\bmilestones?\b"
    r"|\b(?:this|last|next) session\b|\bby the brief\b|\bthe task (?:is|was|asks)\b|\bTODO\b|\bFIXME\b|\breviewers?\b"
    r"|\bdone in version\b|\buntil this study was made\b",
    re.IGNORECASE,
)
RIDDLES = re.compile(r"\b(?:whoever|whomever|of one's own|hither|thereof|wherein|lest)\b", re.IGNORECASE)
TEXTS = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "results/README.md", "results/gallery/README.md", "scenarios/**/*.toml")
    for path in ROOT.glob(pattern)
    if "api" not in path.relative_to(ROOT).parts
)
MODULES = sorted(
    path.relative_to(ROOT).as_posix()
    for folder in ("mvpose", "simharness", "tools", "benchmarks", "examples")
    for path in (ROOT / folder).rglob("*.py")
    if "build" not in path.relative_to(ROOT).parts
)


def prose(file: str) -> list[tuple[int, str]]:
    """Return the docstrings, string statements, and comments of a module, with their lines."""
    source = (ROOT / file).read_text(encoding="utf-8")
    found = [
        (node.lineno, node.value.value)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    comments = ((line, text.partition(" # ")[2]) for line, text in enumerate(source.splitlines(), 1) if " # " in text)
    return found + list(comments)


def places_in(file: str, pattern: re.Pattern[str]) -> list[str]:
    """Return the places at which a pattern occurs in the prose of a file."""
    parts = prose(file) if file.endswith(".py") else [(1, (ROOT / file).read_text(encoding="utf-8"))]
    return [
        f"{file}:{line + text.count(chr(10), 0, match.start())}: {match[0]}"
        for line, text in parts
        for match in pattern.finditer(text)
    ]


def test_there_are_texts_and_modules():
    assert len(TEXTS) > 30
    assert len(MODULES) > 500
    assert sum(len(prose(file)) for file in MODULES) > 3000


@pytest.mark.parametrize("pattern", [MAKING, RIDDLES], ids=["making", "riddles"])
def test_no_text_has_them(pattern):
    assert [place for file in TEXTS for place in places_in(file, pattern)] == []


@pytest.mark.parametrize("pattern", [MAKING, RIDDLES], ids=["making", "riddles"])
def test_no_docstring_or_comment_has_them(pattern):
    assert [place for file in MODULES for place in places_in(file, pattern)] == []


@pytest.mark.parametrize(
    "text", ["12 ms (asked 5)", "the bar is missed", "see issue 12", "(bar .93)", "limit set during the work"]
)
def test_the_list_finds_them(text):
    assert MAKING.search(text)
