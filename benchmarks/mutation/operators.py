"""Mutation operators: small changes of one place of a Python file."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==", ast.Is: "is not",
    ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
_REVERSED: dict[type[ast.cmpop], str] = {ast.Lt: ">", ast.LtE: ">=", ast.Gt: "<", ast.GtE: "<="}
_ARITHMETIC: dict[type[ast.operator], str] = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.Mod: "*", ast.FloorDiv: "*",
    ast.BitAnd: "|", ast.BitOr: "&",
}  # fmt: skip
_NAMES = {"min": "max", "max": "min", "argmin": "argmax", "argmax": "argmin", "any": "all", "all": "any"}
_NAMES |= {"minimum": "maximum", "maximum": "minimum", "cos": "sin", "sin": "cos", "nanmin": "nanmax"}
_TESTED = ast.If | ast.While | ast.IfExp


@dataclass(frozen=True, order=True)
class Mutation:
    """Replacement of a stretch of a file.

    Attributes:
        start: index of the first character that is replaced.
        end: index behind the last one.
        text: what stands there instead.
        line: number of the line, from 1.
        function: name of the function around it; "" outside of functions.
    """

    start: int
    end: int
    text: str
    line: int
    function: str = ""

    def applied(self, source: str) -> str:
        """Return the file with the mutation."""
        return source[: self.start] + self.text + source[self.end :]

    def described(self, source: str) -> str:
        """Return what changes, on one line: the place with the change between arrows."""
        begin, end = source.rfind("\n", 0, self.start) + 1, source.find("\n", self.end)
        parts = (
            source[begin : self.start],
            "⟦",
            source[self.start : self.end],
            "→",
            self.text,
            "⟧",
            source[self.end : end],
        )
        return f"line {self.line}, {self.function or 'module'}: `{' '.join(''.join(parts).split())}`"

    def rank(self, file: str, seed: int) -> str:
        """Return the key by which a sample is drawn: that of smaller samples comes first in larger ones."""
        return hashlib.blake2b(f"{seed}:{file}:{self.start}:{self.end}:{self.text}".encode()).hexdigest()


def mutations(source: str) -> list[Mutation]:
    """Return the mutations of a file, in the order of their places.

    Comparisons become those that differ at equality, or the reverse ones; operators and functions their counterparts;
    numbers inside functions grow by one; conditions become constant; statements that bind no name are left out.
    Messages of errors, annotations, docstrings and the values of declared parameters stay: they are no logic.
    """
    found = _Finder(source)
    found.visit(ast.parse(source))
    return sorted(found.mutations)


class _Finder(ast.NodeVisitor):
    def __init__(self, source: str) -> None:
        self._source, self.mutations, self._functions = source, set[Mutation](), list[str]()
        ends = [0]
        for line in source.splitlines(keepends=True):
            ends.append(ends[-1] + len(line))
        self._starts, self._lines = ends, source.splitlines(keepends=True)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self._functions.append(node.name)
        for each in node.body:
            self.visit(each)
        self._functions.pop()

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave out messages of errors."""

    def visit_Assert(self, node: ast.Assert) -> None:
        """Leave out messages of errors."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave out text."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None and self._functions:
            self.visit(node.value)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, operator, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            for table in (_COMPARISONS, _REVERSED):
                if type(operator) in table:
                    self._between(left, right, table[type(operator)])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in _ARITHMETIC and not isinstance(node.left, ast.Constant | ast.JoinedStr):
            self._between(node.left, node.right, _ARITHMETIC[type(node.op)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        other = "or" if isinstance(node.op, ast.And) else "and"
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._between(left, right, other)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not | ast.Invert):
            self._replace(node, ast.get_source_segment(self._source, node.operand) or "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if self._functions and isinstance(node.value, bool):
            self._replace(node, str(not node.value))
        elif self._functions and isinstance(node.value, int | float):
            self._replace(node, repr(node.value + 1))

    def visit_Name(self, node: ast.Name) -> None:
        if node.id in _NAMES and isinstance(node.ctx, ast.Load):
            self._replace(node, _NAMES[node.id])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if node.attr in _NAMES:
            end = self._index(node.end_lineno, node.end_col_offset)
            self._add(end - len(node.attr), end, _NAMES[node.attr], node.lineno)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in _ARITHMETIC:
            self._between(node.target, node.value, _ARITHMETIC[type(node.op)] + "=")
        if self._functions:
            self._replace(node, "pass")
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if self._functions and all(isinstance(each, ast.Subscript | ast.Attribute) for each in node.targets):
            self._replace(node, "pass")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if self._functions and isinstance(node.value, ast.Call):
            self._replace(node, "pass")
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_Continue(self, node: ast.Continue) -> None:
        self._replace(node, "pass")

    def visit_Break(self, node: ast.Break) -> None:
        self._replace(node, "continue")

    def generic_visit(self, node: ast.AST) -> None:
        if isinstance(node, _TESTED) and self._functions and not _guards_an_error(node):
            for text in ("True", "False") if not isinstance(node, ast.While) else ("False",):
                self._replace(node.test, text)
        super().generic_visit(node)

    def _index(self, line: int | None, column: int | None) -> int:
        """Return the index of a character from its line and its column in bytes of UTF-8."""
        assert line is not None
        assert column is not None
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def _replace(self, node: ast.expr | ast.stmt, text: str) -> None:
        start = self._index(node.lineno, node.col_offset)
        self._add(start, self._index(node.end_lineno, node.end_col_offset), text, node.lineno)

    def _between(self, left: ast.expr, right: ast.expr, text: str) -> None:
        """Replace the operator between two operands, whose brackets stay."""
        start = self._index(left.end_lineno, left.end_col_offset)
        end = self._index(right.lineno, right.col_offset)
        between = self._source[start:end]
        inner = between.strip(" \n\t()\\")
        if inner and "#" not in between:
            at = start + between.index(inner)
            self._add(at, at + len(inner), text, left.end_lineno or left.lineno)

    def _add(self, start: int, end: int, text: str, line: int) -> None:
        self.mutations.add(Mutation(start, end, text, line, ".".join(self._functions)))


def _guards_an_error(node: ast.AST) -> bool:
    """Return whether a condition does nothing but lead to an error: that it is raised is tested by its message."""
    return isinstance(node, ast.If) and len(node.body) == 1 and isinstance(node.body[0], ast.Raise)


def changes(source: str, mutation: Mutation) -> bool:
    """Return whether a file with a mutation is valid Python that means something else."""
    try:
        return ast.dump(ast.parse(mutation.applied(source))) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


def sample(files: dict[str, str], count: int, *, seed: int = 0) -> Iterator[tuple[str, Mutation]]:
    """Yield a seeded sample of the mutations of files, ``{path: text}``, without replacement."""
    every = sorted((each.rank(path, seed), path, each) for path, text in files.items() for each in mutations(text))
    yield from islice(((path, each) for _, path, each in every if changes(files[path], each)), count)
