"""What the user should know after the last frame: signs that lens, pose or size of the object is wrong."""

from __future__ import annotations

from collections.abc import Iterator

from ..detection.detections import Detections
from ..detection.detector import Detector
from ..geometry.lens import Lens, Size
from ..geometry.lens_doubt import lens_doubt
from .size_hint import size_hint, size_ratios

_SEVERAL = 5
"""Frames with mesh points that are needed to say that nothing is found."""

_RARE = 0.05
"""With a radius of the user's, share of frames with objects below which that radius is doubtful."""


class ClosingRemarks:
    """Collects what the frames show, and says what is strange about it."""

    def __init__(self, detector: Detector) -> None:
        manifest = detector.manifest
        self._radius = manifest.object_radius
        self._is_own_radius = detector.settings.object_radius is not None
        self._has_objects = any(each.kind == "object" for each in manifest.classes)
        self._has_peaks = bool(manifest.peaks)
        self._doubt = ""  # the first one about a lens
        self._frames = self._shown = self._found = 0  # frames, those with mesh points, those with objects
        self._has_features = False  # whether a frame showed a feature of the field
        self._sizes: list[float] = []  # of the objects, relative to the expected size

    def add(self, source: str, lens: Lens, size: Size, detections: Detections) -> None:
        """Note the detections of a frame. source: its name. lens, size [px]: of its image."""
        doubt = None if self._doubt else lens_doubt(lens, size)
        self._doubt = self._doubt if doubt is None else f"{source}: {doubt}"
        self._frames += 1
        self._shown += len(detections.pixels) > 0
        self._found += len(detections) > 0
        field = detections.field
        self._has_features = self._has_features or (field is not None and any(field.as_dict().values()))
        self._sizes += size_ratios(detections)

    def lines(self) -> Iterator[str]:
        """One line for each remark."""
        if self._doubt:
            yield self._doubt
        # Without peaks, sizes are as coarse as the mesh.
        hint = size_hint(self._sizes, self._radius) if self._has_peaks else ""
        if hint:
            yield hint
        if self._frames and not self._shown:
            yield "no frame shows a near part of the plane: check --height [m], --pitch (down is above 0), and lens"
        if self._shown >= _SEVERAL and self._has_objects and self._finds_too_little():
            yield (
                f"objects were found in {self._found} of {self._shown} frames: if more show some, check "
                f"--object-radius (a radius, not a diameter; it is {self._radius:g}), --height and the lens; --explain "
                "lists what was rejected"
            )

    def _finds_too_little(self) -> bool:
        """Whether nothing was found at all, or with a radius of the user's too few objects."""
        if self._is_own_radius:
            return self._found < _RARE * self._shown
        return not self._found and not self._has_features
