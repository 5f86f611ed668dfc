"""Fits an annotation to its image file: the stated size, and the turn that the EXIF entry asks for."""

from __future__ import annotations

from dataclasses import replace

from vm_embedded.cameras.exif import UPRIGHT
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size

from .annotation import Annotation, RawBox
from .findings import TURNED, Finding
from .image_facts import ImageFacts


def fit(annotation: Annotation, facts: ImageFacts, label: str) -> tuple[list[RawBox], list[Finding]]:
    """The boxes of an image in its upright pixels, with edges from 0 to width and height, and remarks.

    If the annotation states the size as stored, and the turn swaps width and height, its boxes are turned with the
    image. If both sizes are equal or it states none, they are taken as drawn on the upright image. label: of the image,
    for messages. Raises InputError if the stated size is another one.
    """
    turn, size = facts.orientation != UPRIGHT, facts.size
    stated = annotation.size
    as_stored = turn and stated == facts.stored and stated != size
    if stated is not None and stated != size and not as_stored:
        allowed = f"{_px(size)}, or {_px(facts.stored)} without its EXIF turn" if turn else _px(size)
        raise InputError(f"{annotation.file} states a size of {_px(stated)}, but the image has {allowed}")
    boxes = [_scaled(box, size) for box in annotation.boxes] if annotation.shares else list(annotation.boxes)
    if not turn or (stated == size and size != facts.stored):
        return boxes, []
    about = f"{label}: turned by its EXIF orientation {facts.orientation}"
    if as_stored:
        turned = [_turned(box, facts) for box in boxes]
        text = f"{about}, but {annotation.file} states the size as stored, {_px(facts.stored)}: boxes turned"
        return turned, [Finding(TURNED, text, is_fault=False)]
    where = "does not state" if stated is None else "leaves open"
    text = f"{about}; {annotation.file} {where} whether its boxes are: taken as drawn on the turned image"
    return boxes, [Finding(TURNED, text, is_fault=False)]


def _px(size: Size) -> str:
    return f"{size[0]} x {size[1]} px"


def _scaled(box: RawBox, size: Size) -> RawBox:
    left, top, right, bottom = box.edges
    return replace(box, edges=(left * size[0], top * size[1], right * size[0], bottom * size[1]))


def _turned(box: RawBox, facts: ImageFacts) -> RawBox:
    """A box on the image as stored, on the upright image."""
    left, top, right, bottom = box.edges
    if facts.orientation >= 5:
        left, top, right, bottom = top, left, bottom, right
    width, height = facts.size
    if facts.orientation in (2, 3, 6, 7):
        left, right = width - right, width - left
    if facts.orientation in (3, 4, 7, 8):
        top, bottom = height - bottom, height - top
    return replace(box, edges=(left, top, right, bottom))
