"""A model file with another look network, another confidence or another canary; its mesh network stays as it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import onnx
from onnx import numpy_helper

from vm_embedded.errors import ModelError
from vm_embedded.files import write_file
from vm_embedded.network.canary import CANARY_KEY, Canary
from vm_embedded.network.manifest import METADATA_KEY, PEAK_OUTPUTS
from vm_embedded.network.model_file import ModelFile, parse_model, read_model

from .attach_canary import CanaryPicture, NotFoundError, with_canary
from .attach_look import detached, tested_contract
from .export import with_look
from .look_checkpoint import LookCheckpoint
from .look_weights import look_of
from .metadata import with_metadata
from .network_weights import network_of
from .self_testing import strong_self_test


@dataclass(frozen=True)
class ChangedLook:
    """What became of a model file. difference: largest one to torch of the look's answers, 0 without a look.
    lost_canary: whether the file had a canary that its networks do not find any more."""

    difference: float
    lost_canary: bool


def change_look(model: str | Path, path: str | Path, look: LookCheckpoint | None) -> ChangedLook:
    """Write a copy of a model file with this look network, or without one; its mesh network stays as it is.

    Its canary gets the new answers, or is removed if the networks do not find every class in it any more.

    Raises ModelError if an answer differs from torch by more than LARGEST_DIFFERENCE, if the look does not fit the
    file's classes, or if there is no look to remove. Raises InputError if the file can't be written.
    """
    read, difference = read_model(model), 0.0
    if look is not None:
        content, difference = with_look(path, read.content, look)
    elif read.manifest.look is None:
        raise ModelError(f"{model} has no close look to remove")
    else:
        content = detached(read.content, read.manifest)
    return ChangedLook(difference, _finish(path, content, read.canary))


def change_confidence(
    model: str | Path, path: str | Path, look: LookCheckpoint | None, peaks: Mapping[str, tuple[float, float]]
) -> bool:
    """Write a copy of a model file with this look network, or the one it has, and with other scores of peaks:
    `scale * score + offset`, by class. Returns whether its canary is lost, as in ChangedLook.

    Raises ModelError and InputError as `change_look`.
    """
    read = read_model(model)
    content = with_calibrated_peaks(path, read, peaks) if peaks else read.content
    if look is not None:
        content, _ = with_look(path, content, look)
    return _finish(path, content, read.canary)


def _finish(path: str | Path, content: bytes, canary: Canary | None) -> bool:
    """Write a model file whose networks have changed, with new answers to its canary. Returns whether it is lost."""
    lost = False
    if canary is not None:
        try:
            content = with_canary(content, CanaryPicture.of(canary))
        except NotFoundError:
            content, lost = with_metadata(content, {CANARY_KEY: None}), True
    write_file(Path(path), content)
    return lost


def lost_canary_message(output: Path, model: str | Path) -> str:
    """What to tell a user whose new model file has no canary any more."""
    return (
        f"{output} has no canary, because its networks do not find every class in that of {model}; give it another "
        f"picture with vm-export {output} --canary IMAGE LENS"
    )


def change_canary(model: str | Path, path: str | Path, canary: CanaryPicture) -> None:
    """Write a copy of a model file with new self-tests and this canary; its networks stay as they are.

    Raises ModelError for a file of another program, and InputError if the picture does not show every class, or the
    file can't be written.
    """
    read = read_model(model)
    look = look_of(read)
    manifest = replace(
        read.manifest,
        self_test=strong_self_test(network_of(read).network, read.manifest),
        look=None if look is None else tested_contract(look),
    )
    write_file(Path(path), with_canary(with_metadata(read.content, {METADATA_KEY: manifest.as_json()}), canary))


def with_calibrated_peaks(path: str | Path, read: ModelFile, changes: Mapping[str, tuple[float, float]]) -> bytes:
    """The bytes of a model file, in which the score of a class's peaks becomes `scale * score + offset`.

    path: of the new file, for messages. changes: scale and offset by class; each has peaks.
    """
    model, manifest = onnx.load_from_string(read.content), read.manifest
    for constant in model.graph.initializer:
        if constant.name not in ("peaks.kernel", "peaks.bias"):
            continue
        values = numpy_helper.to_array(constant).copy()
        for name, (scale, offset) in changes.items():
            row = PEAK_OUTPUTS * manifest.peaks.index(name)
            values[row] = scale * values[row] + (offset if constant.name == "peaks.bias" else 0.0)
        constant.CopyFrom(numpy_helper.from_array(values, constant.name))
    changed = replace(read, content=bytes(model.SerializeToString()), manifest=replace(manifest, self_test=None))
    tested = replace(manifest, self_test=strong_self_test(network_of(changed).network, manifest))
    return parse_model(path, with_metadata(changed.content, {METADATA_KEY: tested.as_json()})).content
