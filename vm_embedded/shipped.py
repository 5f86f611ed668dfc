"""The networks that come with the package, in vm_embedded/models, each with a card that says what it is good for."""

from __future__ import annotations

from pathlib import Path

SHIPPED = ("ball-5x4", "ball-9x4", "ball-best")
"""Their names. Numbers are depth and width."""

DEFAULT = "ball-best"
"""Which one is used if none is named."""

_FOLDER = Path(__file__).with_name("models")


def model_path(model: str | Path) -> Path:
    """The file of a network that comes with the package, by name; everything else is a path already."""
    return _FOLDER / f"{model}.onnx" if str(model) in SHIPPED else Path(model)
