"""The colors of each class in the masks of an evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vm_embedded.errors import InputError, unknown
from vm_embedded.network.manifest import Manifest
from vm_synth.dataset.files import CLASS_COLORS

from ..data.class_table import ClassTable
from ..data.classes import Classes, Color


def default_colors(model: Path, chosen: Path | None) -> Mapping[str, tuple[Color, ...]]:
    """Colors of classes from the train.toml beside a model or a pictures.json, or else those of vm-synth.

    chosen: the list of pictures, if any. Raises InputError if train.toml can't be read.
    """
    named = [each for each in (chosen, model) if each is not None and each.suffix in (".json", ".pt", ".onnx")]
    for folder in (each.parent for each in named):
        if (folder / "train.toml").exists():
            return ClassTable.read(folder / "train.toml").colors
    return {name: (color,) for name, color in CLASS_COLORS.items()}


def classes_with_colors(
    manifest: Manifest, defaults: Mapping[str, tuple[Color, ...]], more: Sequence[tuple[str, Color]]
) -> Classes:
    """The network's classes with their default colors in masks, and with more colors for some of them.

    A background class without a default color gets the default colors of all classes that the network does not have.
    Raises InputError for a color of a class that the network does not have, and for a class without any color.
    """
    names = [each.name for each in manifest.classes]
    given = [color for _, color in more]
    rest = tuple(each for name, colors in defaults.items() if name not in names for each in colors if each not in given)
    found: dict[str, tuple[Color, ...]] = {
        each.name: defaults.get(each.name, rest if each.kind == "background" else ()) for each in manifest.classes
    }
    for name, color in more:
        if name not in found:
            raise InputError(unknown("class of --color", name, names))
        if color not in found[name]:
            found[name] += (color,)
    for name, each in found.items():
        if not each:
            raise InputError(f"class {name!r} has no color in masks: give it one with --color {name}=R,G,B")
    return Classes(found)
