"""A model file whose peaks have calibrated probabilities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import onnx
from onnx import numpy_helper

from vm_embedded.network.manifest import METADATA_KEY, PEAK_OUTPUTS
from vm_embedded.network.model_file import ModelFile, parse_model

from .metadata import with_metadata
from .network_weights import network_of
from .self_testing import strong_self_test


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
