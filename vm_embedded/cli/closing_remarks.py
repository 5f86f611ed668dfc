"""What the user should know after the last frame: signs that lens, pose or size of the object is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ..arrays import Image
from ..detection.detection import Detection
from ..detection.detections import Detections
from ..detection.detector import Detector
from ..detection.pose_search import View, with_search
from ..geometry.lens import Lens
from ..geometry.lens_doubt import lens_doubt
from ..geometry.orientation import Orientation
from ..live.pose_remark import pose_remark

_SEVERAL = 5
"""Frames with mesh points that are needed to say that nothing is found."""

_RARE = 0.05
"""With a radius of the user's, share of frames with objects below which that radius is doubtful."""


_SURE, _MOST = 0.9, 0.6
"""With certain objects of the right size in most frames, no better pose is sought: their confidence, and the share of
these frames."""

_TILTED = 1.5
"""Error of pitch or roll [deg] from which a wrong size of objects may come from the pose."""

_VIEWS = 5
"""Frames that are kept to search for a better pose."""


class ClosingRemarks:
    """Collects what the frames show, and says what is strange about it. most_views: frames in which a better pose is
    sought if the given one is doubtful."""

    def __init__(self, detector: Detector, most_views: int = _VIEWS) -> None:
        self._detector, manifest = detector, detector.manifest
        self._radius = manifest.object_radius
        self._is_own_radius = detector.settings.object_radius is not None
        self._has_objects = any(each.kind == "object" for each in manifest.classes)
        self._has_peaks = bool(manifest.peaks)
        self._doubt = ""  # the first one about a lens
        self._frames = self._shown = self._found = 0  # frames, those with mesh points, those with objects
        self._sure = 0  # frames with a certain object of the right size
        self._has_features = False  # whether a frame showed a feature of the field
        self._sizes: list[float] = []  # of the objects, relative to the expected size
        self._last: Detections | None = None
        self._views: list[View] = []  # of frames as far apart as possible
        self._most_views, self._stride = most_views, 1  # frames between two views
        self._fixed: Orientation | None = None  # the user's pose of all frames

    def add(
        self,
        source: str,
        image: Image,
        lens: Lens,
        orientation: Orientation,
        detections: Detections,
        is_users: bool = False,
    ) -> None:
        """Note the detections of a frame, with what they say about the pose. source: its name. is_users: the pose is
        the one that the user gave for all frames."""
        doubt = None if self._doubt else lens_doubt(lens, (image.shape[1], image.shape[0]))
        self._doubt = self._doubt if doubt is None else f"{source}: {doubt}"
        self._keep(View(image, lens, orientation))
        self._last, self._fixed = detections, orientation if is_users else None
        self._frames += 1
        self._shown += len(detections.pixels) > 0
        self._found += len(detections) > 0
        self._sure += any(each.confidence > _SURE and each.distances_agree for each in detections)
        field = detections.field
        self._has_features = self._has_features or (field is not None and any(field.as_dict().values()))
        self._sizes += size_ratios(detections)

    def _keep(self, view: View) -> None:
        if self._frames % self._stride:
            return
        self._views.append(view)
        if len(self._views) > self._most_views:
            self._views, self._stride = self._views[::2], 2 * self._stride

    def lines(self) -> Iterator[str]:
        """One line for each remark. If the frames leave doubts about the pose, it takes some seconds to search for a
        better one."""
        if self._doubt:
            yield self._doubt
        # Without peaks, sizes are as coarse as the mesh.
        hint = size_hint(self._sizes, self._radius) if self._has_peaks else ""
        remark = self._about_pose(hint)
        if remark:
            yield remark
        if self._frames and not self._shown:
            yield "no frame shows a near part of the plane: check --height [m], --pitch (down is above 0), and lens"
        if self._shown >= _SEVERAL and self._has_objects and self._finds_too_little():
            yield (
                f"objects were found in {self._found} of {self._shown} frames: if more show some, check "
                f"--object-radius (a radius, not a diameter; it is {self._radius:g}), --height and the lens; --explain "
                "lists what was rejected"
            )

    def _about_pose(self, hint: str) -> str:
        """A remark about the pose, or the hint about the size of the objects, which also shows a wrong height."""
        state = None if self._last is None else self._last.pose
        if state is None:
            return hint
        is_plausible = state.verdict in ("unknown", "consistent") and self._sure > _MOST * self._frames
        if not is_plausible:
            state = with_search(state, self._detector, self._views)
        is_tilted = any(abs(each or 0.0) > _TILTED for each in (state.pitch, state.roll))
        return hint if hint and not is_tilted else pose_remark(state, self._fixed)

    def _finds_too_little(self) -> bool:
        """Whether nothing was found at all, or with a radius of the user's too few objects."""
        if self._is_own_radius:
            return self._found < _RARE * self._shown
        return not self._found and not self._has_features


_FEWEST = 5
"""Objects that are needed for a hint."""

_LARGE = 6.0
"""Least radius of an object whose size is measured [px]."""

_DIFFERENT, _ALIKE = 0.1, 0.15
"""Least difference of the median size from the expected one, and largest difference between the quartiles."""


def size_ratios(found: Iterable[Detection]) -> list[float]:
    """Apparent sizes of the objects that are large enough to measure, each divided by the expected size."""
    return [each.distance / each.distance_by_angle for each in found if each.radius >= _LARGE]


def size_hint(ratios: Sequence[float], radius: float) -> str:
    """A line if these ratios agree on another size than that of the expected radius [m]; empty if not."""
    if len(ratios) < _FEWEST:
        return ""
    first, median, third = np.quantile(ratios, [0.25, 0.5, 0.75]).tolist()
    if abs(median - 1.0) < _DIFFERENT or third - first > _ALIKE:
        return ""
    return (
        f"the objects look {median:.2f} times as large as expected: check --object-radius (it is {radius:g}; "
        f"{median * radius:.3f} would fit), --height and the lens"
    )
