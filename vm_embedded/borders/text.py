"""Text that others wrote: what a name may be, and how any text becomes printable."""

from __future__ import annotations

import json
import re
from typing import Any

MOST_NAME = 100
"""Longest name of a class [characters]."""

MOST_REMARK = 1000
"""Longest text about the origin of a network [characters]."""


def printable(text: str) -> str:
    """The text as one line that any terminal and any encoding of Unicode takes.

    What could end the line or control a terminal, and half characters (surrogates), become escapes as in Python.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def utf8(text: str) -> str:
    """The text as UTF-8 and JSON can hold it: half characters become escapes, and nothing else changes.

    A name has one for each byte that is not UTF-8: \\udce4 for the byte 0xE4.
    """
    return text.encode("utf-8", "backslashreplace").decode()


def to_json(value: object, **options: Any) -> str:
    """The value as JSON in ASCII, with its text as from `utf8`: many readers refuse half characters.

    options: of json.dumps.
    """
    return _ESCAPE.sub(_without_half, json.dumps(value, **options))


_ESCAPE = re.compile(r"\\(ud[89ab]..\\ud[c-f]..|ud[89a-f]..|.)")
"""An escape in JSON: two half characters that are a whole one, a half one, or another."""


def _without_half(escape: re.Match[str]) -> str:
    return rf"\\{escape[1]}" if len(escape[1]) == len("ud800") else escape[0]


def printable_lines(text: str) -> str:
    """As `printable`, but the text keeps its line ends."""
    return "\n".join(map(printable, text.split("\n")))


def text_fault(text: str, most: int = MOST_REMARK) -> str:
    """Why this can't be one line of text, as "is longer than ..."; "" if it can. most: allowed characters."""
    if len(text) > most:
        return f"is longer than {most} characters: it has {len(text)}"
    strange = next((each for each in text if not each.isprintable()), "")
    return f"can't contain the character {printable(strange)}, which can't be printed" if strange else ""


def name_fault(name: str) -> str:
    """Why this can't be the name of a class or the like, as "can't be empty" or "is longer than ..."; "" if it can.

    Names go into tables, files of lines, pictures and messages. So a name has 1 to MOST_NAME characters, all of them
    printable, and no blank at its ends.
    """
    if not name:
        return "can't be empty"
    if name != name.strip(" "):
        return "can't start or end with a blank"
    return text_fault(name, MOST_NAME)
