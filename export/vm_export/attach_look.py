"""The look network inside a model file: written there, taken out, and checked against torch."""

from __future__ import annotations

import base64
from dataclasses import replace

import numpy as np
import torch

import vm_embedded
from vm_embedded.arrays import Image, Singles
from vm_embedded.network.look_contract import LOOK_KEY, LookContract
from vm_embedded.network.look_example import LookTest, made_patches
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.session import CloseLook

from .look_checkpoint import LookCheckpoint
from .look_graph import look_model
from .look_network import LookNetwork
from .metadata import with_metadata

_CHECKED_PATCHES = (0, 1, 2, 7, 40)

_MADE = 64
"""Patches that are made for a self-test."""

_UNSURE = (0.05, 0.65)
"""Limits of the probability of a patch that a network is unsure of."""

_PARTS = 256
"""Steps from one patch to another in a search for such a patch. With sixteen, a network was surer of all of them."""


def attached(content: bytes, manifest: Manifest, look: LookCheckpoint) -> tuple[bytes, float]:
    """A model file's bytes with a look network, and the largest difference of an answer to torch.

    content, manifest: of the model file, whose look network is replaced. Classes of the look that the file's network
    has no peaks for are left out. The examples become the self-test. Raises ModelError if none is left.
    """
    look = look.part(manifest.peaks)
    file = look_model(look.network.eval())
    difference = largest_look_difference(file, look)
    provenance = {**look.contract.provenance, "exported_by": f"vm-export {vm_embedded.__version__}"}
    contract = replace(tested_contract(look), provenance=provenance)
    entries = {
        LOOK_KEY: base64.b64encode(file).decode(),
        METADATA_KEY: replace(manifest, look=contract).as_json(),
    }
    return with_metadata(content, entries), difference


def tested_contract(look: LookCheckpoint) -> LookContract:
    """The contract of a look network with its self-test."""
    return replace(look.contract, self_test=_self_test(look))


def _self_test(look: LookCheckpoint) -> LookTest:
    """The most and the least likely example of each class, with the answers to them and to patches made of them.

    For each class that a network is unsure of in none of these, there is also the mixture of both that it is least sure
    of: damaged weights hardly change answers that are nearly 0 or 1.
    """
    probabilities = _answers(look.network.eval(), look.examples)[..., 0]
    likely, unlikely = probabilities.argmax(axis=0), probabilities.argmin(axis=0)
    test = _tested(look.network, look.examples[np.unique([likely, unlikely])])
    low, high = _UNSURE
    unsure = ((test.answers[..., 0] > low) & (test.answers[..., 0] < high)).any(axis=0)
    if unsure.all():
        return test
    shares = np.arange(1, _PARTS)[:, None, None, None]
    added = []
    for number in np.flatnonzero(~unsure):
        one, other = (look.examples[rows[number]].astype(np.int32) for rows in (likely, unlikely))
        mixtures = (((_PARTS - shares) * one + shares * other) // _PARTS).astype(np.uint8)
        added.append(mixtures[np.abs(_answers(look.network, mixtures)[:, number, 0] - 0.5).argmin()])
    return _tested(look.network, np.concatenate([test.patches, added]))


def _tested(network: LookNetwork, patches: Image) -> LookTest:
    """The test with these patches and those that are made of them."""
    return LookTest(patches, _answers(network, np.concatenate([patches, made_patches(patches, _MADE)])))


def detached(content: bytes, manifest: Manifest) -> bytes:
    """A model file's bytes without its look network. content, manifest: of the model file."""
    return with_metadata(content, {LOOK_KEY: None, METADATA_KEY: replace(manifest, look=None).as_json()})


def largest_look_difference(content: bytes, look: LookCheckpoint) -> float:
    """The largest difference of an answer between ONNX Runtime and torch; NaN if there is an answer that is NaN.

    content: the bytes of `look_model`. The patches are random, plain, and the examples.
    """
    session = CloseLook("the new close look", look.contract, content)
    random, size = np.random.default_rng(0), look.contract.size
    batches = [random.integers(0, 256, (count, size, size, 3), dtype=np.uint8) for count in _CHECKED_PATCHES]
    plain = np.broadcast_to(np.array([0, 1, 254, 255], dtype=np.uint8)[:, None, None, None], (4, size, size, 3))
    batches += [np.ascontiguousarray(plain), look.examples]
    differences = [np.abs(session.run(each) - _answers(look.network, each)).max(initial=0.0) for each in batches]
    return float(np.max(differences))


def _answers(network: LookNetwork, patches: Image) -> Singles:
    """Torch's answers (n, C, 4) to patches."""
    with torch.inference_mode():
        answers: Singles = network(torch.from_numpy(np.ascontiguousarray(patches))).numpy()
    return answers
