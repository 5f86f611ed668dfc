"""Names of classes, as files and options give them."""

from __future__ import annotations

from vm_embedded.borders.text import name_fault
from vm_embedded.errors import InputError


def class_name(text: str) -> str:
    """The name of a class, with one blank instead of other white space, and none at its ends.

    Raises InputError for an empty name, and for one that can't be printed or is too long.
    """
    name = " ".join(text.split())
    if fault := name_fault(name):
        raise InputError(f"the name of class {name!r} {fault}")
    return name
