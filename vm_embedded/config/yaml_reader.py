"""The part of YAML that lens and calibration files use, read strictly.

The robot has no YAML package, and OpenCV's reader does not know sequences that start in their key's column, as most
writers put them. Read here: nested block mappings and sequences, flow sequences and mappings (over several lines
too), plain and quoted scalars, comments; a `%YAML` line, one `---` and tags are skipped. Anchors, aliases, block
scalars, several documents and duplicate keys are refused.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from ..errors import InputError

_KEY = re.compile(r"""("[^"]*"|'[^']*'|[^\s"'\[\]{}#&*!|>%@`,-][^:#{}\[\],]*?|-?\d+)\s*:(?:\s+(.*))?$""")
_TAG = re.compile(r"!\S*\s*")
_INTEGER = re.compile(r"[-+]?\d+")
_REAL = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
_PLAIN_IN_FLOW = re.compile(r"[^,\[\]{}:]+(:[^\s,\[\]{}][^,\[\]{}:]*)*")
_WORDS: dict[str, Any] = {
    "": None,
    "~": None,
    "null": None,
    "true": True,
    "false": False,
    ".nan": math.nan,
    ".inf": math.inf,
    "+.inf": math.inf,
    "-.inf": -math.inf,
}
_DEEPEST = 32


@dataclass
class _Line:
    number: int
    indent: int
    text: str


def read_yaml(text: str) -> Any:
    """Values of a YAML text: dict, list, str, int, float, bool or None. Raises InputError naming the line."""
    lines = _joined(_lines(text))
    if not lines:
        return None
    value, rest = _block(lines, 0, lines[0].indent, 0)
    if rest < len(lines):
        raise _wrong(lines[rest], "unexpected indentation")
    return value


def _wrong(line: _Line, what: str) -> InputError:
    return InputError(f"line {line.number}: {what}: {line.text[:60]!r}")


def _lines(text: str) -> list[_Line]:
    """Lines with content, without comments."""
    lines: list[_Line] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        try:
            content = _without_comment(raw).rstrip(" \t")
        except ValueError as error:
            raise _wrong(_Line(number, 0, raw.strip(" \t")), str(error)) from error
        if not content.strip(" \t") or (not lines and (content.startswith("%") or content == "---")):
            continue
        if content == "...":
            break
        line = _Line(number, len(content) - len(content.lstrip(" ")), content.strip(" \t"))
        if "\t" in raw[: line.indent + 1] or content.startswith("---"):
            raise _wrong(line, "tabs for indentation and several documents are not supported")
        lines.append(line)
    return lines


def _without_comment(raw: str) -> str:
    quote = ""
    for position, character in enumerate(raw):
        if quote:
            if (quote == '"' and character == "\\") or (character == quote == raw[position + 1 : position + 2]):
                raise ValueError("escapes in quotes are not supported")
            quote = "" if character == quote else quote
        elif character in "\"'" and (position == 0 or raw[position - 1] in " [{,:"):
            quote = character
        elif character == "#" and (position == 0 or raw[position - 1] in " \t"):
            return raw[:position]
    if quote:
        raise ValueError("quote is never closed")
    return raw


def _joined(lines: list[_Line]) -> list[_Line]:
    """Lines, with flow collections that span several put together."""
    joined: list[_Line] = []
    depth = 0
    for line in lines:
        if depth > 0:
            joined[-1].text += " " + line.text
        else:
            joined.append(line)
        depth += sum(line.text.count(c) for c in "[{") - sum(line.text.count(c) for c in "]}")
    if depth > 0:
        raise _wrong(joined[-1], "bracket is never closed")
    return joined


def _block(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[Any, int]:
    """The value that begins at a line, and the line after it."""
    if depth > _DEEPEST:
        raise _wrong(lines[at], "nested too deeply")
    first = lines[at].text
    if first == "-" or first.startswith("- "):
        return _sequence(lines, at, indent, depth)
    if _KEY.match(first):
        return _mapping(lines, at, indent, depth)
    return _inline(lines[at], first), at + 1


def _sequence(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[list[Any], int]:
    items = []
    while at < len(lines) and lines[at].indent == indent and (lines[at].text + " ").startswith("- "):
        line = lines[at]
        content = line.text[1:].lstrip(" \t")
        if content:
            # What follows the dash is a block of its own that begins in that column.
            lines[at] = _Line(line.number, indent + len(line.text) - len(content), content)
            value, at = _block(lines, at, lines[at].indent, depth + 1)
        else:
            value, at = _nested(lines, at + 1, indent + 1, depth)
        items.append(value)
    return items, at


def _mapping(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[dict[str, Any], int]:
    table: dict[str, Any] = {}
    while at < len(lines) and lines[at].indent == indent:
        line = lines[at]
        match = _KEY.match(line.text)
        if not match:
            break
        key, content = _unquoted(match.group(1)), _TAG.sub("", match.group(2) or "", count=1)
        if key in table:
            raise _wrong(line, "key stands there twice")
        if content:
            table[key], at = _inline(line, content), at + 1
        else:
            dashed = at + 1 < len(lines) and (lines[at + 1].text + " ").startswith("- ")
            table[key], at = _nested(lines, at + 1, indent if dashed else indent + 1, depth)
    return table, at


def _unquoted(key: str) -> str:
    return key[1:-1] if key[0] in "\"'" else key


def _nested(lines: list[_Line], at: int, least: int, depth: int) -> tuple[Any, int]:
    """The block that begins at a line if it is indented by `least` or more, else nothing."""
    if at < len(lines) and lines[at].indent >= least:
        return _block(lines, at, lines[at].indent, depth + 1)
    return None, at


def _inline(line: _Line, content: str) -> Any:
    """A scalar or flow collection that fills the rest of a line."""
    if content[0] in "[{":
        value, end = _flow(line, content, 0, 0)
        if content[end:].strip(" \t"):
            raise _wrong(line, "something follows a closed bracket")
        return value
    return _scalar(line, content)


def _flow(line: _Line, content: str, at: int, depth: int) -> tuple[Any, int]:
    """The flow value at a position, and the position after it."""
    at = _space(content, at)
    if depth > _DEEPEST or at >= len(content):
        raise _wrong(line, "flow value is cut short or nested too deeply")
    if content[at] in "\"'":
        end = content.find(content[at], at + 1)
        if end < 0:
            raise _wrong(line, "quote is never closed")
        return content[at + 1 : end], end + 1
    if content[at] not in "[{":
        match = _PLAIN_IN_FLOW.match(content, at)
        if not match or not match.group().strip(" \t") or match.group().startswith("? "):
            raise _wrong(line, "a value is missing")
        return _scalar(line, match.group().strip(" \t")), match.end()
    closing = "]" if content[at] == "[" else "}"
    items: list[Any] = []
    table: dict[str, Any] = {}
    at = _space(content, at + 1)
    while content[at : at + 1] != closing:
        value, at = _flow(line, content, at, depth + 1)
        at = _space(content, at)
        if closing == "}":
            if content[at : at + 1] != ":" or str(value) in table:
                raise _wrong(line, "a colon is missing, or a key stands there twice")
            table[str(value)], at = _flow(line, content, at + 1, depth + 1)
            at = _space(content, at)
        else:
            items.append(value)
        if content[at : at + 1] == ",":
            at = _space(content, at + 1)
        elif content[at : at + 1] != closing:
            raise _wrong(line, "a comma or closing bracket is missing")
    return (items if closing == "]" else table), at + 1


def _space(content: str, at: int) -> int:
    while content[at : at + 1] == " ":
        at += 1
    return at


def _scalar(line: _Line, content: str) -> Any:
    if content[0] in "\"'":
        if len(content) < 2 or content[-1] != content[0] or content[0] in content[1:-1]:
            raise _wrong(line, "quote is never closed")
        return content[1:-1]
    if content.lower() in _WORDS:
        return _WORDS[content.lower()]
    if _INTEGER.fullmatch(content):
        return int(content) if len(content) <= 18 else float(content)
    if _REAL.fullmatch(content):
        return float(content)
    if content[0] in "&*|>%@`]}," or ": " in content:
        raise _wrong(line, "this part of YAML is not supported")
    return content
