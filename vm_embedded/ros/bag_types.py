"""The message types of bags: those of the library rosbags, with vision_msgs, which it lacks.

rosbags is an optional package. Only functions of this module import it.
"""

from __future__ import annotations

import re
from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from ..errors import InputError, install_extra
from .message_fields import FIELDS, MESSAGES, fields_of


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


@cache
def typestore() -> Any:
    """rosbags' types of ROS 2 Humble, with vision_msgs. Raises InputError if rosbags is not installed."""
    typesys = import_rosbags().typesys
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for full in FIELDS:
        if full.startswith("vision_msgs/"):
            store.register(typesys.get_types_from_msg(_definition(full), full))
    return store


def _definition(full: str) -> str:
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
