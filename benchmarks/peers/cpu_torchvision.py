"""Makes torchvision usable beside a torch without CUDA: import this module before torchvision.

The operators of the torchvision on PyPI need the libraries of CUDA. Without them, its import fails where it describes
the operators for non-maximum suppression. This module defines them; OpenCV does the work.
"""

from __future__ import annotations

import cv2
import torch


def suppress(boxes: torch.Tensor, scores: torch.Tensor, overlap: float) -> torch.Tensor:
    """Indices of the boxes (n, 4) left, top, right, bottom that no better one overlaps by more, best first."""
    corners = boxes.double().numpy().copy()
    corners[:, 2:] -= corners[:, :2]
    kept = cv2.dnn.NMSBoxes(corners.tolist(), scores.double().tolist(), 0.0, overlap)
    return torch.as_tensor(kept, dtype=torch.int64).flatten()


if torch.version.cuda is None:
    for name in ("nms", "qnms"):
        torch.library.define(f"torchvision::{name}", "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    torch.library.impl("torchvision::nms", "CPU", suppress)
    import torchvision.extension

    torchvision.extension._has_ops = lambda: True
