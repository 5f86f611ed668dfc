"""The whole object of a box, also where the border of the picture cuts it."""

from __future__ import annotations

from vm_embedded.geometry.lens import Size

from .box import Box

_CUT = 2.0
"""Edges of boxes closer than this to the border of the picture are taken for cut off [px]."""


def cut_edges(box: Box, size: Size) -> tuple[bool, bool, bool, bool]:
    """Whether the border of a picture of this width and height [px] cuts the left, upper, right and lower edge."""
    width, height = size
    return (
        box.left < _CUT - 0.5,
        box.top < _CUT - 0.5,
        box.right > width - 0.5 - _CUT,
        box.bottom > height - 0.5 - _CUT,
    )


def whole_object(box: Box, size: Size, is_round: bool) -> tuple[float, float, float]:
    """Center x and y, and half the width, of the object in a box [px].

    is_round: a box that the border of a picture of this size cuts is completed to a square.
    """
    x, y = box.center.tolist()
    if not is_round:
        return x, y, 0.5 * box.width
    radius = 0.5 * max(box.width, box.height)
    left, top, right, bottom = cut_edges(box, size)
    if left and not right:
        x = box.right - radius
    elif right:
        x = box.left + radius
    if top and not bottom:
        y = box.bottom - radius
    elif bottom:
        y = box.top + radius
    return x, y, radius
