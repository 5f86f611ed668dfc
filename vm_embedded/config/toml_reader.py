"""Parsing TOML from files that nobody has checked."""

from __future__ import annotations

import sys
from typing import Any

from ..errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_DEEPEST = 32
"""Levels of tables and lists; a configuration has four."""


def parse_toml(text: str) -> dict[str, Any]:
    """The table in a TOML text. Raises InputError for other texts and for tables and lists nested too deeply."""
    try:
        table = tomllib.loads(text)
    except ValueError as error:  # also a whole number of thousands of digits
        raise InputError(str(error)) from error
    except RecursionError as error:
        raise InputError(f"nested more than {_DEEPEST} levels deep") from error
    level: list[Any] = [table]
    for _ in range(_DEEPEST):
        level = [inner for each in level for inner in (each.values() if isinstance(each, dict) else each)]
        level = [each for each in level if isinstance(each, dict | list)]
        if not level:
            return table
    raise InputError(f"nested more than {_DEEPEST} levels deep")
