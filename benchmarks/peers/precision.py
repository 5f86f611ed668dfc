"""Faster convolutions of torch on a CPU."""

from __future__ import annotations

import torch


def fast_convolutions() -> None:
    """Let convolutions round their inputs to bfloat16; sums stay in float32.

    A training takes half of the time on a CPU with instructions for it, and hardly changes. Others ignore it.
    """
    torch.backends.mkldnn.conv.fp32_precision = "bf16"  # type: ignore[attr-defined]
