"""The message types of bags: those of the library rosbags, with those that it lacks.

rosbags is an optional package. Only functions import it.
"""

from __future__ import annotations

import re
import struct
from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from ...errors import InputError, install_extra
from .message_fields import MESSAGES, fields_of


def import_rosbags() -> ModuleType:
    """rosbags, with its readers, writers and types. Raises InputError if it is not installed."""
    try:
        import rosbags
        import rosbags.highlevel
        import rosbags.rosbag2
        import rosbags.typesys
    except ImportError as error:
        raise InputError(f"bags need the package rosbags ({error}); {install_extra('bags')}") from error
    return rosbags


def damage_errors() -> tuple[type[Exception], ...]:
    """What rosbags and its libraries raise for a damaged bag."""
    from rosbags.highlevel import AnyReaderError
    from rosbags.rosbag2 import ReaderError, reader, storage_sqlite3

    zstd_error: type[Exception] = reader.zstd.ZstdError  # type: ignore[attr-defined]
    sqlite_error: type[Exception] = storage_sqlite3.apsw.Error  # type: ignore[attr-defined]
    library = (AnyReaderError, ReaderError, zstd_error, sqlite_error, RuntimeError)  # the last is that of lz4
    return (*library, OSError, ValueError, KeyError, IndexError, OverflowError, MemoryError, struct.error)


@cache
def typestore() -> Any:
    """rosbags' types of ROS 2 Humble, with further messages of this project. Raises InputError without rosbags."""
    typesys = import_rosbags().typesys
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for full in MESSAGES.values():
        if full not in store.types:
            store.register(typesys.get_types_from_msg(definition(full), full))
    return store


def definition(full: str) -> str:
    """The definition of a message as in its .msg file."""
    lines = []
    for kind, name in fields_of(full):
        short, brackets = re.sub(r"\[.*", "", kind), re.sub(r"^\w+", "", kind)
        lines.append(f"{MESSAGES.get(short, short).replace('/msg/', '/')}{brackets} {name}")
    return "\n".join(lines)


@cache
def bag_types() -> SimpleNamespace:
    """The classes of all messages by their short names, and functions that make their arrays."""
    store = typestore()
    return SimpleNamespace(
        **{name: store.types[full] for name, full in MESSAGES.items()},
        octets=lambda content: np.frombuffer(content, dtype=np.uint8),
        doubles=lambda numbers: np.array(numbers, dtype=np.float64),
    )
