"""The processor of this machine, as Linux describes it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple


class Processor(NamedTuple):
    """Name, instruction sets, and whether it is an ARM processor."""

    name: str
    flags: set[str]
    is_arm: bool


def read_processor(cpuinfo: Path) -> Processor:
    """The processor in a file such as /proc/cpuinfo. Raises OSError if it can't be read."""
    lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    fields = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    is_arm = "Features" in fields  # x86 calls them flags
    flags = set(fields.get("Features" if is_arm else "flags", "").split())
    return Processor(fields.get("model name", "ARM" if is_arm else "unknown"), flags, is_arm)
