"""A strict reader for the part of YAML that lens and calibration files use.

The robot has no YAML package. OpenCV's reader rejects sequences that start in the column of their key, which is how
most programs write them.

Supported: nested block mappings and sequences; flow sequences and mappings, also over several lines; plain and quoted
scalars; comments. Skipped: a `%YAML` line, one `---` before the document and one after it, and tags. Rejected: anchors,
aliases, block scalars, several documents, and duplicate keys.

A recursive descent: each function below `read_yaml` gets a position (a line, or a column in a flow value) and returns
the value that begins there with the position after it. `depth` counts the nesting.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from ..errors import InputError

_KEY = re.compile(r"""("[^"]*"|'[^']*'|[^\s"'\[\]{}#&*!|>%@`,-][^:#{}\[\],]*?|-?\d+)\s*:(?:\s+(.*))?$""")
_TAG = re.compile(r"^!\S*\s*")
_INTEGER = re.compile(r"[-+]?\d+")
_REAL = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
_PLAIN_IN_FLOW = re.compile(r"[^,\[\]{}:]+(:[^\s,\[\]{}][^,\[\]{}:]*)*")
_BEFORE_QUOTE = " [{,:"  # elsewhere, a quote is a character like others: it's
_QUOTED = re.compile(rf"""(?<![^{re.escape(_BEFORE_QUOTE)}])("[^"]*"|'[^']*')""")
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
_MAX_DEPTH = 32


@dataclass
class _Line:
    number: int
    indent: int
    text: str


def read_yaml(text: str) -> Any:
    """The value of a YAML text: dict, list, str, int, float, bool or None. Raises InputError with the line."""
    lines = _joined(_lines(text))
    if not lines:
        return None
    value, rest = _block(lines, 0, lines[0].indent, 0)
    if rest < len(lines):
        raise _error(lines[rest], "unexpected indentation")
    return value


def _error(line: _Line, problem: str) -> InputError:
    return InputError(f"line {line.number}: {problem}: {line.text[:60]!r}")


def _lines(text: str) -> list[_Line]:
    """Lines with content, without comments, each with its number and indentation."""
    lines: list[_Line] = []
    ended = False  # by a `---`, as ros2 topic echo prints it after a message
    for number, raw in enumerate(text.splitlines(), start=1):
        try:
            content = _without_comment(raw).rstrip(" \t")
        except ValueError as error:
            raise _error(_Line(number, 0, raw.strip(" \t")), str(error)) from error
        if not content.strip(" \t") or (not lines and (content.startswith("%") or content == "---")):
            continue
        if content == "...":
            break
        if content == "---" and not ended:
            ended = True
            continue
        line = _Line(number, len(content) - len(content.lstrip(" ")), content.strip(" \t"))
        if ended:
            raise _error(
                line, "several documents are not supported; keep the first (ros2 topic echo --once prints one)"
            )
        if "\t" in raw[: line.indent + 1] or content.startswith("---"):
            raise _error(line, "tabs in the indentation and several documents are not supported")
        lines.append(line)
    return lines


def _without_comment(raw: str) -> str:
    quote = ""
    for position, character in enumerate(raw):
        if quote:
            if (quote == '"' and character == "\\") or (character == quote == raw[position + 1 : position + 2]):
                raise ValueError("escapes in quotes are not supported")
            quote = "" if character == quote else quote
        elif character in "\"'" and (position == 0 or raw[position - 1] in _BEFORE_QUOTE):
            quote = character
        elif character == "#" and (position == 0 or raw[position - 1] in " \t"):
            return raw[:position]
    if quote:
        raise ValueError("quote is not closed")
    return raw


def _joined(lines: list[_Line]) -> list[_Line]:
    """Lines; the lines of a flow collection are joined into one."""
    joined: list[_Line] = []
    depth = 0
    for line in lines:
        if depth > 0:
            joined[-1].text += " " + line.text
        else:
            joined.append(line)
        plain = _QUOTED.sub("", line.text)
        depth += sum(plain.count(c) for c in "[{") - sum(plain.count(c) for c in "]}")
    if depth > 0:
        raise _error(joined[-1], "bracket is not closed")
    return joined


def _block(lines: list[_Line], at: int, indent: int, depth: int) -> tuple[Any, int]:
    """The value that begins at a line, and the line after it."""
    if depth > _MAX_DEPTH:
        raise _error(lines[at], "nested too deeply")
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
            # The text after the dash is a block that begins in that column.
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
            raise _error(line, "expected KEY: VALUE")
        key, content = _unquoted(match.group(1)), _TAG.sub("", match.group(2) or "", count=1)
        if key in table:
            raise _error(line, "duplicate key")
        if content:
            table[key], at = _inline(line, content), at + 1
        else:
            dashed = at + 1 < len(lines) and (lines[at + 1].text + " ").startswith("- ")
            table[key], at = _nested(lines, at + 1, indent if dashed else indent + 1, depth)
    return table, at


def _unquoted(key: str) -> str:
    return key[1:-1] if key[0] in "\"'" else key


def _nested(lines: list[_Line], at: int, least: int, depth: int) -> tuple[Any, int]:
    """The block that begins at a line, if its indentation is at least `least`; else None."""
    if at < len(lines) and lines[at].indent >= least:
        return _block(lines, at, lines[at].indent, depth + 1)
    return None, at


def _inline(line: _Line, content: str) -> Any:
    """A scalar or flow collection that fills the rest of a line."""
    if content[0] in "[{":
        value, end = _flow(line, content, 0, 0)
        if content[end:].strip(" \t"):
            raise _error(line, "unexpected text after the closing bracket")
        return value
    return _scalar(line, content)


def _flow(line: _Line, content: str, at: int, depth: int) -> tuple[Any, int]:
    """The flow value at a position, and the position after it."""
    at = _skip_spaces(content, at)
    if depth > _MAX_DEPTH or at >= len(content):
        raise _error(line, "flow value is incomplete or nested too deeply")
    if content[at] in "\"'":
        end = content.find(content[at], at + 1)
        if end < 0:
            raise _error(line, "quote is not closed")
        return content[at + 1 : end], end + 1
    if content[at] not in "[{":
        match = _PLAIN_IN_FLOW.match(content, at)
        if not match or not match.group().strip(" \t") or match.group().startswith("? "):
            raise _error(line, "missing value")
        return _scalar(line, match.group().strip(" \t")), match.end()
    closing = "]" if content[at] == "[" else "}"
    items: list[Any] = []
    table: dict[str, Any] = {}
    at = _skip_spaces(content, at + 1)
    while content[at : at + 1] != closing:
        value, at = _flow(line, content, at, depth + 1)
        at = _skip_spaces(content, at)
        if closing == "}":
            if content[at : at + 1] != ":" or str(value) in table:
                raise _error(line, "missing colon or duplicate key")
            table[str(value)], at = _flow(line, content, at + 1, depth + 1)
            at = _skip_spaces(content, at)
        else:
            items.append(value)
        if content[at : at + 1] == ",":
            at = _skip_spaces(content, at + 1)
        elif content[at : at + 1] != closing:
            raise _error(line, "missing comma or closing bracket")
    return (items if closing == "]" else table), at + 1


def _skip_spaces(content: str, at: int) -> int:
    while content[at : at + 1] == " ":
        at += 1
    return at


def _scalar(line: _Line, content: str) -> Any:
    if content[0] in "\"'":
        if len(content) < 2 or content[-1] != content[0] or content[0] in content[1:-1]:
            raise _error(line, "quote is not closed")
        return content[1:-1]
    if content.lower() in _WORDS:
        return _WORDS[content.lower()]
    if _INTEGER.fullmatch(content):
        return int(content) if len(content) <= 18 else float(content)
    if _REAL.fullmatch(content):
        return float(content)
    if content[0] in "&*|>%@`]}," or ": " in content:
        raise _error(line, "this part of YAML is not supported")
    return content
