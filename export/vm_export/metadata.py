"""Entries of a model file's metadata."""

from __future__ import annotations

from collections.abc import Mapping

import onnx
from onnx import helper

from vm_embedded.network.model_file import SEAL_KEY, sealed


def metadata_of(content: bytes) -> dict[str, str]:
    """The entries of a model file by key, without its seal. content: its bytes."""
    return _entries(onnx.load_from_string(content))


def with_metadata(content: bytes, entries: Mapping[str, str | None]) -> bytes:
    """A model file's bytes with other entries of metadata, and a new seal. All else stays as it is.

    entries: by key; None removes one.
    """
    model = onnx.load_from_string(content)
    kept = {key: value for key, value in _entries(model).items() if key not in entries}
    helper.set_model_props(model, kept | {key: value for key, value in entries.items() if value is not None})
    return sealed(bytes(model.SerializeToString(deterministic=True)))


def _entries(model: onnx.ModelProto) -> dict[str, str]:
    return {each.key: each.value for each in model.metadata_props if each.key != SEAL_KEY}
