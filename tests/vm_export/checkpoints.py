"""Manifests and seeded checkpoints for the tests of the export."""

import torch

from tests.manifests import ball_manifest
from vm_embedded.mesh.models import MESH_MODELS
from vm_export.checkpoint import Checkpoint
from vm_export.network import Network
from vm_export.network_shape import NetworkShape


def manifest(classes=("ball", "environment"), mesh="ring6", **changes):
    return ball_manifest(*classes, mesh=mesh, radius=0.095, object_radius=0.075, **{"max_distance": 10.0} | changes)


def checkpoint(seed=0, shape=None, mesh="ring6"):
    torch.manual_seed(seed)
    shape = shape or NetworkShape.uniform(3, 4, 2, neighbors=MESH_MODELS[mesh].neighbors)
    facts = manifest([f"class{i}" for i in range(shape.classes)], mesh, layer_dilations=shape.layer_dilations)
    return Checkpoint(Network(shape).eval(), facts)
