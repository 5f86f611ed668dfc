"""Entries of a model file's metadata."""

from __future__ import annotations

from collections.abc import Mapping

import onnx
from onnx import helper

from vm_embedded.network.model_file import SEAL_KEY, sealed


def with_metadata(content: bytes, entries: Mapping[str, str | None]) -> bytes:
    """A model file's bytes with other entries of metadata, and a new seal. All else stays as it is.

    entries: by key; None removes one.
    """
    model = onnx.load_from_string(content)
    kept = {each.key: each.value for each in model.metadata_props if each.key not in (SEAL_KEY, *entries)}
    helper.set_model_props(model, kept | {key: value for key, value in entries.items() if value is not None})
    return sealed(bytes(model.SerializeToString(deterministic=True)))
