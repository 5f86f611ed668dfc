"""The classes of a training: their kinds, and their colors in masks (section [classes] of train.toml)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vm_embedded.borders.text import name_fault
from vm_embedded.config.toml_reader import parse_toml
from vm_embedded.config.toml_writer import toml_key
from vm_embedded.errors import InputError
from vm_embedded.files import read_text
from vm_embedded.network.manifest import KINDS, ObjectClass
from vm_synth.dataset.files import CLASS_COLORS

from .classes import Classes, Color

_KIND_OF = {"ball": "object", "goal": "upright", "robot": "upright", "environment": "background"}
"""Kinds of vm-synth's classes; all others are areas."""


@dataclass(frozen=True)
class ClassTable:
    """Section [classes]: an entry for each class, in the order of the network's outputs. Raises InputError.

    colors: of the class in masks. kinds: one of KINDS for each class.
    """

    colors: Mapping[str, tuple[Color, ...]]
    kinds: Mapping[str, str]

    def __post_init__(self) -> None:
        self.mask_classes()

    @classmethod
    def default(cls) -> ClassTable:
        """The classes and colors of vm-synth and the reference."""
        colors = {name: (color,) for name, color in CLASS_COLORS.items()}
        return cls(colors, {name: _KIND_OF.get(name, "area") for name in colors})

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> ClassTable:
        """Read entries such as `name = { kind = "object", colors = [[255, 0, 0]] }`. Raises InputError."""
        colors, kinds = {}, {}
        if not isinstance(table, Mapping):
            raise InputError(f"classes must be a section [classes], not {table!r}")
        for name, entry in table.items():
            if fault := name_fault(name):
                raise InputError(f"the name of class {name!r} {fault}")
            if not isinstance(entry, Mapping) or set(entry) != {"kind", "colors"}:
                raise InputError(f'{name} must be like {{ kind = "object", colors = [[255, 0, 0]] }}, not {entry!r}')
            if entry["kind"] not in KINDS:
                raise InputError(f"{name}: kind must be one of {', '.join(KINDS)}, not {entry['kind']!r}")
            colors[name], kinds[name] = _colors(name, entry), entry["kind"]
        return cls(colors, kinds)

    @classmethod
    def read(cls, path: Path) -> ClassTable:
        """Read [classes] of a train.toml, which may be that of an earlier release: other sections are not read.

        Without [classes], the classes are the defaults. Raises InputError.
        """
        text = read_text(path, "configuration")
        try:
            table = parse_toml(text)
            return cls.from_table(table["classes"]) if "classes" in table else cls.default()
        except InputError as error:
            raise InputError(f"configuration {path}: {error}") from error

    def to_commented_toml(self) -> str:
        """The section as TOML with a comment."""
        lines = ["[classes]", f"# for each class its kind ({', '.join(KINDS)}) and its RGB colors in masks"]
        for name, colors in self.colors.items():
            shown = ", ".join(str(list(each)) for each in colors)
            lines.append(f'{toml_key(name)} = {{ kind = "{self.kinds[name]}", colors = [{shown}] }}')
        return "\n".join(lines)

    def mask_classes(self) -> Classes:
        """The classes and their colors in masks. Raises InputError for shared colors, or fewer than two classes."""
        return Classes(self.colors)

    @property
    def outputs(self) -> tuple[ObjectClass, ...]:
        """The classes as the outputs of a network."""
        return tuple(ObjectClass(name, kind) for name, kind in self.kinds.items())


def _colors(name: str, entry: Mapping[str, Any]) -> tuple[Color, ...]:
    if not isinstance(entry["colors"], list) or not entry["colors"]:
        raise InputError(f"{name}: colors must be a list of colors as [[255, 0, 0]], not {entry['colors']!r}")
    return tuple(_color(name, each) for each in entry["colors"])


def _color(name: str, value: Any) -> Color:
    whole = isinstance(value, list) and len(value) == 3 and all(type(each) is int for each in value)
    if not whole or not all(0 <= each <= 255 for each in value):
        raise InputError(f"{name}: a color is [red, green, blue] from 0 to 255, not {value!r}")
    red, green, blue = value
    return red, green, blue
