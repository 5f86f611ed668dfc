"""What the configurations of all kinds of trainings share."""

from __future__ import annotations

KINDS = ("mesh", "look", "tune")
"""Kinds of trainings; each is also the command that begins one."""

OPTIMIZERS = ("adamw", "adam", "sgd", "muon")
SCHEDULES = ("one_cycle", "constant")


def configuration_name(kind: str) -> str:
    """Name of the file with the configuration of a kind of training."""
    return "train.toml" if kind == "mesh" else f"{kind}.toml"


def header(kind: str) -> str:
    """First comment of a configuration that is printed."""
    return f"""Configuration of vm-train {kind}. `vm-train config {kind}` prints this file.
Keep only the entries that you change: missing entries have their defaults.
Each comment gives the meaning of the next entry, its unit in brackets, and its limits.
An entry [low, high] is a range: each {"picture" if kind == "mesh" else "patch"} gets a random value between the two."""
