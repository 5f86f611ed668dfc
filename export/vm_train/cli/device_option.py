"""The option --device, which several commands share."""

from __future__ import annotations

import argparse

_DEVICES = ("auto", "cpu", "cuda")


def add_device(made: argparse._ActionsContainer) -> None:
    """Add --device: what trains."""
    made.add_argument("--device", choices=_DEVICES, default="auto", help="default: a GPU if there is one, else the CPU")
