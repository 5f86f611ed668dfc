"""Text that others wrote: what a name may be, and how any text becomes one printable line."""

from __future__ import annotations

MOST_NAME = 100
"""Longest name of a class [characters]."""


def printable(text: str) -> str:
    """The text as one line that any terminal and any encoding of Unicode takes.

    What could end the line or control a terminal, and half characters (surrogates), are written as Python escapes.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def shortened(text: str, most: int = MOST_NAME) -> str:
    """The text, or its start and "..." if it has more than `most` characters."""
    return text if len(text) <= most else text[: most - 3] + "..."


def name_fault(name: str) -> str:
    """Why this can't be the name of a class or the like, as "can't be empty" or "is longer than ..."; "" if it can.

    Names go into tables, files of lines, pictures and messages of the network. So a name has 1 to MOST_NAME characters,
    all of them printable, and no blank at its ends.
    """
    if not name:
        return "can't be empty"
    if len(name) > MOST_NAME:
        return f"is longer than {MOST_NAME} characters: it has {len(name)}"
    if not name.isprintable():
        strange = next(each for each in name if not each.isprintable())
        return f"can't contain the character {printable(strange)}, which can't be printed"
    if name != name.strip():
        return "can't start or end with a blank"
    return ""
