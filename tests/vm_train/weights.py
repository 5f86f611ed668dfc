"""Weights of networks, compared."""

import torch

from vm_export.checkpoint import Checkpoint


def weights_of(path):
    """The tensors of a checkpoint, by their names."""
    return Checkpoint.load(path).network.state_dict()


def same(first, second):
    """Whether two networks have the same tensors."""
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)
