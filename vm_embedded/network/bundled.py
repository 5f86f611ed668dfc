"""The networks that come with the package, in vm_embedded/models, each with a card that describes it."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError, unknown
from ..files import exists

SHIPPED = ("ball", "soccer")
"""Their names. `soccer` also finds the features of a field."""

DEFAULT = "ball"
"""The network to use if none is named."""

_FOLDER = Path(__file__).parents[1] / "models"


def model_path(model: str | Path, folder: Path = Path()) -> Path:
    """The file of a network: a name of the package, else a path, which may be relative to a folder.

    Raises InputError for a name that is neither, and for a network that is not installed.
    """
    if str(model) in SHIPPED:
        path = _FOLDER / f"{model}.onnx"
        if not path.exists():
            raise InputError(
                f"network {model} is not installed; a robot has only that of its bundle: give the path of a model "
                "file, such as /opt/vm-embedded/current/etc/model.onnx"
            )
        return path
    path = folder / model
    # Path takes an empty name for the current folder.
    if not str(model) or (not path.suffix and not exists(path)):
        raise InputError(f"{unknown('network', str(model), SHIPPED)}, or the path of a model file")
    return path


def shipped_name(path: Path) -> str | None:
    """The name of the network of the package that is in a file; None for other files."""
    path = path.resolve()
    return path.stem if path.parent == _FOLDER.resolve() and path.stem in SHIPPED else None
