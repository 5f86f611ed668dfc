"""Seeded look networks, their checkpoints and their answers in torch."""

from dataclasses import replace

import torch

from tests.looks import look_contract, random_patches
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork, LookShape

SHAPE = LookShape(size=8, channels=(4, 5, 6))


def look_network(seed=0, shape=SHAPE):
    """A network with random weights, whose answers differ from patch to patch and from class to class, and a
    calibration that matters."""
    torch.manual_seed(seed)
    network = LookNetwork(shape).eval()
    with torch.no_grad():
        for name, value in network.named_parameters():
            if name.endswith("weight"):
                torch.nn.init.kaiming_normal_(value, nonlinearity="relu")
        number = torch.arange(shape.classes)
        network.calibration.copy_(torch.stack([0.7 + 0.1 * number, -0.4 + 0.2 * number], dim=1))
    return network


def look_checkpoint(seed=0, shape=SHAPE, classes=("ball",), **changes):
    """A checkpoint with three examples, which judges these classes; changes: other entries of its contract."""
    shape = replace(shape, classes=len(classes))
    contract = look_contract(*classes, **{"size": shape.size, "channels": shape.channels} | changes)
    return LookCheckpoint(look_network(seed, shape), contract, random_patches(3, shape.size, seed))


def torch_answers(network, patches):
    """Answers (n, C, 4) of a look network in torch to patches (n, size, size, 3)."""
    with torch.inference_mode():
        return network(torch.from_numpy(patches)).numpy()
