"""Pages of the documentation: their texts, the shell commands and the code blocks in them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs" / "guide").glob("*.md")))
}

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_INDENTED = re.compile(r"(?<=\n\n)(?: {4}.*\n)+")  # after an empty line; otherwise it continues a list item
_PROGRAM = re.compile(r"(simharness|make|(\S*/)?python3? -m) \S")
_COMMENT = re.compile(r"\s+# .*")


def commands(text: str) -> Iterator[str]:
    """Yield the shell commands of a Markdown text: indented lines, lines of shell blocks, and inline code."""
    for language, block in FENCE.findall(text):
        if language in ("", "sh", "bash", "shell", "console"):
            yield from (_COMMENT.sub("", line).strip() for line in block.splitlines() if line.strip())
    prose = FENCE.sub("", text)
    for block in _INDENTED.findall(prose):
        yield from (_COMMENT.sub("", line).strip() for line in block.splitlines())
    for span in re.findall(r"`([^`]+)`", _INDENTED.sub("", prose)):
        if _PROGRAM.match(one_line := " ".join(span.split())):
            yield one_line


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language in all pages."""
    return [block for page in PAGES.values() for name, block in FENCE.findall(page) if name == language]


def toml_file(name: str) -> str:
    """Return the TOML block whose first line is its file name; all pages with that file have the same."""
    (block,) = {block for block in blocks("toml") if block.startswith(f"# {name}\n")}
    return block
