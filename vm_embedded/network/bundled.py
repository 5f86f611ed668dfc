"""The networks that come with the package, in vm_embedded/models, each with a card that says what it is good for."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import InputError, unknown

SHIPPED = ("ball-5x4", "ball-9x4", "ball-best")
"""Their names. Numbers are depth and width."""

DEFAULT = "ball-best"
"""Which one is used if none is named."""

_FOLDER = Path(__file__).parents[1] / "models"


def model_path(model: str | Path) -> Path:
    """The file of a network that comes with the package, by name; everything else is a path already.

    Raises InputError for what is neither.
    """
    if str(model) in SHIPPED:
        return _FOLDER / f"{model}.onnx"
    if not Path(model).suffix and not os.path.exists(model):  # noqa: PTH110 (Path.exists raises for long names)
        raise InputError(unknown("network of the package, and no file,", str(model), SHIPPED))
    return Path(model)
