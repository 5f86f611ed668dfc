"""Seeded look networks, their checkpoints and their answers in torch."""

import torch

from tests.looks import look_contract, random_patches
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork, LookShape

SHAPE = LookShape(size=8, channels=(4, 5, 6))


def look_network(seed=0, shape=SHAPE):
    """A network with random weights, whose answers differ from patch to patch, and a calibration that matters."""
    torch.manual_seed(seed)
    network = LookNetwork(shape).eval()
    with torch.no_grad():
        for name, value in network.named_parameters():
            if name.endswith("weight"):
                torch.nn.init.kaiming_normal_(value, nonlinearity="relu")
        network.calibration.copy_(torch.tensor([0.7, -0.4]))
    return network


def look_checkpoint(seed=0, shape=SHAPE, **changes):
    """A checkpoint with three examples; changes: other entries of its contract."""
    contract = look_contract(**{"size": shape.size, "channels": shape.channels} | changes)
    return LookCheckpoint(look_network(seed, shape), contract, random_patches(3, shape.size, seed))


def torch_answers(network, patches):
    """Answers (n, 4) of a look network in torch to patches (n, size, size, 3)."""
    with torch.inference_mode():
        return network(torch.from_numpy(patches)).numpy()
