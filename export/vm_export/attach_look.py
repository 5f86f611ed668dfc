"""The look network inside a model file: written there, taken out, and checked against torch."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import helper

import vm_embedded
from vm_embedded.arrays import Image, Singles
from vm_embedded.network.close_look import CloseLook
from vm_embedded.network.look_contract import LOOK_KEY, LookTest
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.model_file import ModelFile

from .look_checkpoint import LookCheckpoint
from .look_graph import look_model
from .look_network import LookNetwork

_CHECKED_PATCHES = (0, 1, 2, 7, 40)


def attached(content: bytes, manifest: Manifest, look: LookCheckpoint) -> tuple[bytes, float]:
    """A model file's bytes with a look network, and the largest difference of its answers to torch.

    content, manifest: of the model file. A look network that it already has is replaced. The look's examples become its
    self-test. Raises ModelError if the look judges another class than the file's objects.
    """
    network = look.network.eval()
    contract = replace(
        look.contract,
        self_test=LookTest(look.examples, _answers(network, look.examples)),
        provenance={**look.contract.provenance, "exported_by": f"vm-export {vm_embedded.__version__}"},
    )
    manifest = replace(manifest, look=contract)
    look_content = look_model(network)
    difference = largest_look_difference(look_content, look, manifest)
    return _with_metadata(content, manifest, look_content), difference


def detached(content: bytes, manifest: Manifest) -> bytes:
    """A model file's bytes without its look network. content, manifest: of the model file."""
    return _with_metadata(content, replace(manifest, look=None), None)


def largest_look_difference(content: bytes, look: LookCheckpoint, manifest: Manifest) -> float:
    """The largest difference of an answer between ONNX Runtime and torch; NaN if there is an answer that is NaN.

    content: the bytes of `look_model`. manifest: describes the look. The patches are random, plain, and the examples.
    """
    assert manifest.look is not None
    described = replace(manifest, look=replace(manifest.look, self_test=None))
    session = CloseLook(ModelFile(Path("the new file"), b"", described, "", content))
    random, size = np.random.default_rng(0), look.contract.size
    batches = [random.integers(0, 256, (count, size, size, 3), dtype=np.uint8) for count in _CHECKED_PATCHES]
    plain = np.broadcast_to(np.array([0, 1, 254, 255], dtype=np.uint8)[:, None, None, None], (4, size, size, 3))
    batches += [np.ascontiguousarray(plain), look.examples]
    differences = [np.abs(session.run(each) - _answers(look.network, each)).max(initial=0.0) for each in batches]
    return float(np.max(differences))


def _answers(network: LookNetwork, patches: Image) -> Singles:
    """Torch's answers (n, 4) to patches."""
    with torch.inference_mode():
        answers: Singles = network(torch.from_numpy(np.ascontiguousarray(patches))).numpy()
    return answers


def _with_metadata(content: bytes, manifest: Manifest, look: bytes | None) -> bytes:
    """A model file's bytes with another manifest and look network. The graph and other metadata stay as they are."""
    model = onnx.load_from_string(content)
    metadata = {each.key: each.value for each in model.metadata_props if each.key != LOOK_KEY}
    metadata[METADATA_KEY] = manifest.as_json()
    if look is not None:
        metadata[LOOK_KEY] = base64.b64encode(look).decode()
    helper.set_model_props(model, metadata)
    return bytes(model.SerializeToString(deterministic=True))
