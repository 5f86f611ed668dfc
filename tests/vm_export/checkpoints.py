"""Manifests and seeded checkpoints for the tests of the export."""

import torch

from tests.manifests import ball_manifest
from vm_embedded.mesh.models import MESH_MODELS
from vm_export.canvas_network import CanvasNetwork
from vm_export.canvas_shape import CanvasShape
from vm_export.checkpoint import Checkpoint
from vm_export.network import Network
from vm_export.network_shape import NetworkShape


def manifest(classes=("ball", "environment"), mesh="ring6", **changes):
    return ball_manifest(*classes, mesh=mesh, radius=0.095, object_radius=0.075, **{"max_distance": 10.0} | changes)


def checkpoint(seed=0, shape=None, mesh="ring6"):
    if mesh == "octaves":
        return canvas_checkpoint(seed, shape or CanvasShape(1, 8, 2))
    torch.manual_seed(seed)
    shape = shape or NetworkShape.uniform(3, 4, 2, neighbors=MESH_MODELS[mesh].neighbors)
    return Checkpoint(Network(shape).eval(), manifest([f"class{i}" for i in range(shape.classes)], mesh))


def canvas_checkpoint(seed, shape):
    """As after a training: every batch normalization has an effect of its own."""
    torch.manual_seed(seed)
    network = CanvasNetwork(shape)
    with torch.no_grad():
        for each in network.modules():
            if isinstance(each, torch.nn.BatchNorm2d):
                each.running_mean.normal_(std=0.2)
                each.running_var.uniform_(0.3, 2.0)
                each.weight.uniform_(0.5, 1.5)
                each.bias.normal_(std=0.2)
    names = [f"class{i}" for i in range(shape.classes)]
    peaks = names[: shape.peaks]
    kinds = [f"{each}:object" if each in peaks else each for each in names]
    facts = manifest(kinds, "octaves", peaks=tuple(peaks))
    return Checkpoint(network.eval(), facts)


def peak_checkpoint(seed=0, classes=("ball", "environment")):
    """A checkpoint whose network has peaks for its objects and uprights."""
    kinds = [each.partition(":")[::2] for each in classes]
    peaks = tuple(name for name, kind in kinds if name == "ball" or kind == "upright")
    network = canvas_checkpoint(seed, CanvasShape(1, 8, len(classes), len(peaks))).network
    return Checkpoint(network, manifest(classes, "octaves", peaks=peaks))
