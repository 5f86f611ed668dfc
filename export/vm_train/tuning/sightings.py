"""What a close look sees clearly in boxed frames, wherever it is: to find objects without a box."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.pyramid import Pyramid

from ..boxes.box import Box, BoxedPicture
from ..boxes.unlabeled import FoundBox
from .boxed_objects import all_objects
from .candidates import ClassLook, search_radii, seen_objects

CLEAR = 0.95
"""Probability from which a sighting is clear."""

_ABOVE, _CANDIDATES = 0.1, 20


def clear_sightings(
    look: ClassLook, pictures: Sequence[BoxedPicture], is_round: bool, report: Callable[[], None]
) -> Iterator[FoundBox]:
    """The objects of the look's class that it sees clearly, as large as those that have boxes.

    report: is called after each picture. Raises InputError for an image that can't be read, and ModelError.
    """
    objects = all_objects(pictures, look.name, is_round)
    if not len(objects):
        return
    radii = search_radii(objects)
    for picture in pictures:
        pyramid = Pyramid(read_image(picture.image), "bgr")
        windows, probabilities = seen_objects(pyramid, picture.size, look, radii, _ABOVE, _CANDIDATES)
        for (x, y), radius, probability in zip(windows.centers, windows.radii, probabilities, strict=True):
            if probability >= CLEAR:
                box = Box(look.name, x - radius, y - radius, x + radius, y + radius)
                yield FoundBox(picture.image, box, float(probability))
        report()
