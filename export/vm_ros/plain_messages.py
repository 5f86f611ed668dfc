"""The messages of ROS 2 as plain classes, to be encoded by `cdr.encode`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import make_dataclass
from types import SimpleNamespace
from typing import Any

from vm_embedded.cameras.ros.message_fields import MESSAGES, fields_of

_LEVELS = {"OK": 0, "WARN": 1, "ERROR": 2}
"""Constants of DiagnosticStatus."""


def plain_classes(names: Iterable[str]) -> SimpleNamespace:
    """The classes of messages with these short names, and functions that make their arrays.

    Those of rclpy check each value, and it copies them field by field: that takes several times as long.
    """
    return with_arrays(
        {name: make_dataclass(name, [field for _, field in fields_of(MESSAGES[name])], slots=True) for name in names}
    )


def with_arrays(classes: Mapping[str, Any]) -> SimpleNamespace:
    """Classes of messages with their constants, and the functions that make their arrays."""
    if "DiagnosticStatus" in classes:
        for level, value in _LEVELS.items():
            setattr(classes["DiagnosticStatus"], level, value)
    return SimpleNamespace(**classes, octets=bytes, doubles=_doubles)


def _doubles(numbers: Sequence[float]) -> list[float]:
    return [float(each) for each in numbers]
