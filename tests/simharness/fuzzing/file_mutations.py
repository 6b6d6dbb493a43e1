"""Mutations of files, determined by a seed: cut off, changed bytes, nested, huge, of wrong types, special files."""

import io
import json
import os
import random
import re
import socket
import zipfile
import zlib
from functools import cache
from pathlib import Path

import numpy as np

ODD_VALUES = (
    None,
    True,
    False,
    0,
    -1,
    1,
    1.5,
    10**9,
    10**18,
    10**40,
    10**400,
    -(2**63),
    1e308,
    5e-324,
    float("nan"),
    float("inf"),
    "",
    "x",
    "1",
    "\ud800",
    "é\u202e\x00",
    "x" * 100_000,
    "../../etc/passwd",
    [],
    {},
    [[]],
    [1],
    [1, "x"],
    {"": 1},
    {"a": {"a": 1}},
    [None] * 3,
    [1e400, -1e400],
    [[1, 2], [3]],
    list(range(1000)),
    "\n" * 1000,
    "\x1b[31m",
)
"""Values of wrong types, not finite, huge, or with odd characters."""

_TOML_VALUES = (
    "true",
    "0",
    "-1",
    "1e400",
    "nan",
    "-inf",
    "99999999999999999999",
    "1" + "0" * 400,
    '""',
    '"x"',
    "[]",
    "{}",
    "[[1, 2], [3]]",
    '[1, "x"]',
    "2020-01-01",
    "1e308",
    "[" * 2000,
    '"' + "x" * 100_000 + '"',
    "{ a.b.c = 1 }",
    '"\\u0000\\u202e"',
    "07:32:00",
    "0x7fffffffffffffffffff",
)
_NESTED = (
    b"[" * 100_000,
    b'{"a":' * 50_000,
    b"[" * 900 + b"]" * 900,
    b'{"a":' * 200 + b"1" + b"}" * 200,
    b"a = " + b"[" * 100_000,
    b"a = " + b"[" * 300 + b"]" * 300,
    b".".join([b"a"] * 50_000) + b" = 1",
    b"[" + b".".join([b"a"] * 20_000) + b"]",
    b"%YAML:1.0\n---\na: " + b"[" * 100_000,
    b"%YAML:1.0\n---\n" + b"- " * 50_000,
    b"<?xml version='1.0'?>" + b"<opencv_storage>" + b"<a>" * 50_000,
    b"a = " + b"{a = " * 50_000,
)


def _aliases():
    """Return YAML of a few hundred bytes whose aliases unpack to 9 ** 12 values."""
    lines = [b"a: &a [x, x]"]
    for letter in range(ord("b"), ord("n")):
        lines.append(b"%c: &%c [%s]" % (letter, letter, b", ".join([b"*%c" % (letter - 1)] * 9)))
    return b"%YAML:1.0\n---\n" + b"\n".join(lines) + b"\n"


def _entities():
    """Return XML of a few hundred bytes whose entities unpack to 10 ** 13 characters."""
    declared = [b'<!ENTITY a "aaaaaaaaaa">']
    for letter in range(ord("b"), ord("n")):
        declared.append(b'<!ENTITY %c "%s">' % (letter, b"&%c;" % (letter - 1) * 10))
    return b'<?xml version="1.0"?><!DOCTYPE x [' + b"".join(declared) + b"]><opencv_storage><x>&m;</x></opencv_storage>"


_BOMBS = (
    _aliases(),
    _entities(),
    b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a SYSTEM "file:///dev/zero">]>'
    b"<opencv_storage><x>&a;</x></opencv_storage>",
)
KINDS = (
    "cut",
    "flip",
    "flip",
    "overwrite",
    "delete",
    "repeat",
    "insert",
    "number",
    "number",
    "value",
    "value",
    "value",
    "line",
    "nested",
    "text",
    "huge",
    "special",
    "archive",
)
"""Kinds of mutations; number k of a reader is of kind k modulo their number."""


def mutate(path: Path, original: bytes, draw: random.Random, kind: str) -> str:
    """Replace a file by a mutated one and return what was done to it."""
    if kind == "special":
        return _special(path, original, draw)
    content, what = {
        "cut": _cut,
        "flip": _flip,
        "overwrite": _overwrite,
        "delete": _delete,
        "repeat": _repeat,
        "insert": _insert,
        "number": _number,
        "value": _value,
        "line": _line,
        "nested": _nested,
        "text": _text,
        "huge": _huge,
        "archive": _archive,
    }[kind](original, draw)
    path.write_bytes(content)
    return f"{kind}: {what}"


def _cut(content, draw):
    end = draw.choice((0, 1, len(content) // 2, len(content) - 1, draw.randrange(len(content) + 1)))
    return content[:end], f"to {end} of {len(content)} bytes"


def _flip(content, draw):
    changed = bytearray(content)
    places = [draw.randrange(8 * len(content)) for _ in range(draw.choice((1, 1, 2, 8, 64)))] if content else []
    for place in places:
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed), f"bits {places[:8]}"


def _overwrite(content, draw):
    start, length = draw.randrange(len(content) + 1), draw.choice((1, 2, 4, 8, 64))
    byte = draw.choice((b"\0", b"\xff", b"\x7f", b"\x80", b" ", b"9", b'"', b"-"))
    return content[:start] + byte * length + content[start + length :], f"{byte!r} x {length} at {start}"


def _delete(content, draw):
    start, length = draw.randrange(len(content) + 1), draw.choice((1, 2, 5, 20, 200))
    return content[:start] + content[start + length :], f"{length} at {start}"


def _repeat(content, draw):
    start, length, times = draw.randrange(len(content) + 1), draw.choice((1, 8, 40, 300)), draw.choice((2, 10, 1000))
    piece = content[start : start + length]
    return content[:start] + piece * times + content[start + length :], f"{length} at {start}, {times} times"


def _insert(content, draw):
    start = draw.randrange(len(content) + 1)
    piece = draw.choice(
        (
            b"[",
            b"]",
            b"{",
            b"}",
            b'"',
            b"'",
            b",",
            b":",
            b"=",
            b"\n",
            b"\0",
            b"#",
            b"<",
            b"&",
            b"*",
            b"!!",
            b"%",
            b"\\",
            draw.randbytes(16),
        )
    )
    return content[:start] + piece + content[start:], f"{piece!r} at {start}"


def _number(content, draw):
    """Replace a number of a text file; of a binary one two, four or eight bytes."""
    found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", content))
    values = (
        b"0",
        b"-1",
        b"1e999",
        b"-1e999",
        b"nan",
        b"inf",
        b"NaN",
        b"Infinity",
        b"99999999999999999999999",
        b"1e308",
        b"1e-320",
        b"2147483648",
        b"1" * 5000,
        b"null",
        b'""',
        b"[]",
        b"{}",
        b"x",
        b"",
    )
    if b"\0" in content or not found:
        start = 4 * draw.randrange(len(content) // 4 + 1)
        piece = draw.choice(
            (
                b"\xff" * 4,
                b"\xff\xff\xff\x7f",
                b"\0" * 8,
                b"\xff" * 8,
                b"\0\0\0\x10",
                b"\x01\0\0\0",
                b"\0\0\xf0\x7f",
                b"\xff\x7f",
            )
        )
        return content[:start] + piece + content[start + len(piece) :], f"{piece!r} at {start}"
    place, value = draw.choice(found), draw.choice(values)
    return content[: place.start()] + value + content[place.end() :], f"{value[:30]!r} for {place[0]!r}"


def _value(content, draw):
    """Replace a value anywhere in a JSON file, or behind a sign of equality in a TOML file."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        found = list(re.finditer(rb"=[^\n]*", content))
        if b"\0" in content or not found:
            return _number(content, draw)
        place, value = draw.choice(found), draw.choice(_TOML_VALUES)
        return content[: place.start()] + b"= " + value.encode() + content[
            place.end() :
        ], f"{value[:40]!r} for {place[0][:40]!r}"
    places = [((), None)]
    level = [((), tree)]
    while level:
        path, node = level.pop()
        for key, inner in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
            places.append(((*path, key), inner))
            level.append(((*path, key), inner))
    depth = draw.choice((1, 1, 2, 3, 9))
    path = draw.choice([path for path, _ in places if len(path) <= depth])
    value = draw.choice(ODD_VALUES)
    if not path:
        tree = value
    else:
        node = tree
        for key in path[:-1]:
            node = node[key]
        if draw.random() < 0.15:
            del node[path[-1]]
        elif isinstance(path[-1], str) and draw.random() < 0.1:
            node[str(draw.choice(ODD_VALUES))[:50]] = node.pop(path[-1])
        else:
            node[path[-1]] = value
    return _long_json(tree), f"{str(value)[:40]!a} at {path}"


def _long_json(tree):
    text = json.dumps(tree, default=str)
    return text.encode("utf-8", "surrogatepass")


def _line(content, draw):
    lines = content.split(b"\n")
    k = draw.randrange(len(lines))
    how = draw.choice(("drop", "double", "swap", "blank", "join"))
    if how == "drop":
        del lines[k]
    elif how == "double":
        lines.insert(k, lines[k])
    elif how == "swap":
        other = draw.randrange(len(lines))
        lines[k], lines[other] = lines[other], lines[k]
    elif how == "blank":
        lines[k] = b""
    else:
        lines[k : k + 2] = [b"".join(lines[k : k + 2])]
    return b"\n".join(lines), f"{how} line {k}"


def _nested(content, draw):
    k = draw.randrange(len(_NESTED) + len(_BOMBS))
    piece = (_NESTED + _BOMBS)[k]
    if draw.random() < 0.3 and content:
        return content[: draw.randrange(len(content))] + piece, f"piece {k} behind a part"
    return piece, f"piece {k}"


def _text(content, draw):
    how = draw.choice(("empty", "bom", "crlf", "cr", "utf-16", "latin", "null", "spaces", "zeros", "random", "comment"))
    changed = {
        "empty": b"",
        "bom": b"\xef\xbb\xbf" + content,
        "crlf": content.replace(b"\n", b"\r\n"),
        "cr": content.replace(b"\n", b"\r"),
        "utf-16": content.decode("latin-1").encode("utf-16"),
        "latin": content.replace(b"a", b"\xe4"),
        "null": content.replace(b"e", b"\0"),
        "spaces": b" \n\t" * 1000,
        "zeros": bytes(len(content)),
        "random": draw.randbytes(1000),
        "comment": b"#" * 100_000,
    }[how]
    return changed, how


def _huge(content, draw):
    """Make the content a thousand times as long: a reader whose time grows with the square takes more than its limit.

    Readers take all of their time for these, so they are no longer than that.
    """
    how = draw.choice(("times", "string", "number", "lines", "zeros", "key"))
    changed = {
        "times": content * max(1, 500_000 // max(1, len(content))),
        "string": content.replace(b'"', b'"' + b"x" * 400_000, 1),
        "number": re.sub(rb"\d+", b"7" * 150_000, content, count=1),
        "lines": content + b"\n" * 750_000,
        "zeros": content + bytes(1_250_000),
        "key": content + b"\n" + b"k" * 250_000 + b" = 1",
    }[how]
    return changed, how


def _special(path, original, draw):
    how = draw.choice(("pipe", "folder", "zero", "null", "full", "loop", "socket", "missing", "dangling", "sparse"))
    if how == "pipe":
        os.mkfifo(path)
    elif how == "folder":
        path.mkdir()
    elif how == "socket":
        with socket.socket(socket.AF_UNIX) as opened:
            place = os.getcwd()
            os.chdir(path.parent)  # paths of sockets are short
            opened.bind(path.name)
            os.chdir(place)
    elif how == "sparse":
        path.write_bytes(original)
        os.truncate(path, 2**40)
    elif how != "missing":
        path.symlink_to(
            {"zero": "/dev/zero", "null": "/dev/null", "full": "/dev/full", "loop": path, "dangling": "nowhere"}[how]
        )
    return f"special: {how}"


def _archive(content, draw):
    """Replace the content by an archive that unpacks to much, or that has other members; of other files cut a gzip."""
    how = draw.choice(("bomb", "pickle", "shape", "order", "lying", "bare", "member", "strings", "empty", "gzip"))
    if how == "bare":
        return _npy(np.zeros((2, 1, 17, 3))), how
    if how == "gzip":
        return zlib.compress(content * 3, wbits=31)[: draw.choice((10, 50, 10**9))], how
    names = tuple(_members(content)) or ("joints.npy", "trial.json")
    noise = tuple(draw.randbytes(100) for _ in names) if how == "member" else ()
    return _packed(how, names, noise), how


@cache
def _packed(how, names, noise):
    """Return an archive with members of given names; it is packed once, because a bomb takes a fifth of a second."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for k, name in enumerate(names):
            if how == "bomb":
                with archive.open(name, "w", force_zip64=True) as member:
                    for _ in range(48 if k == 0 else 1):
                        member.write(bytes(2**20))
            elif how == "pickle":
                archive.writestr(name, _npy(np.array([{"a": 1}, None], dtype=object)))
            elif how == "shape":
                archive.writestr(name, _npy_header((10**12,)))
            elif how == "order":
                archive.writestr(name, _npy_header((2**62, 4)))
            elif how == "lying":
                archive.writestr(name, _npy_header((-1, 17, 3)) + bytes(800))
            elif how == "member":
                archive.writestr(name, noise[k])
            elif how == "strings":
                archive.writestr(name, _npy(np.array(["a", "b"])))
            elif how == "empty":
                archive.writestr(name, _npy(np.zeros((0, 0, 0, 3))))
    packed = buffer.getvalue()
    if how == "lying":
        packed = packed.replace((928).to_bytes(4, "little"), (2**31 - 1).to_bytes(4, "little"))
    return packed


def _members(content):
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return archive.namelist()
    except Exception:
        return []


def _npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def _npy_header(shape):
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return buffer.getvalue()
