"""Poses from pictures of a field: lines that must be parallel and equally wide, and balls of a known size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cameras.frame_source import Frame
from vm_embedded.cameras.image_files import lens_beside, open_source
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.pose_search import SURE_BALLS, PoseSearch, Tried, View, corrected
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.field.pose_evidence import HEIGHT
from vm_embedded.geometry.lens import Lens
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear

MOST_FRAMES = 100
"""Frames that a fit looks at."""

_GUESS = Orientation.from_roll_pitch(0.7, 0.0, math.radians(15.0))
"""The pose to search from if nothing is known."""

_PITCHES = np.radians([0.0, -12.0, 12.0, -24.0, 24.0, 40.0]).tolist()
"""Pitches to search from, added to the guess."""

_SCOUTS = 5
"""Frames that are searched from far away."""

_FEWEST_LINES, _FEWEST_BALLS = 3, 3
"""Clues without which a pose is not known."""

_SHARED = 2.0
"""Clues have errors in common: standard deviations are larger by this factor."""

_FLOOR = np.array([math.radians(0.15), math.radians(0.15), 0.01])
"""Standard deviations of pitch, roll and logarithm of the height, at least."""


@dataclass(frozen=True, eq=False)
class FieldFit:
    """Errors of the poses of frames: what to add to pitch and roll [rad] and to the logarithm of the height.

    errors, deviations (3,): with standard deviations. views: the frames, with the poses before. tried: see Tried.
    scale: what tells the height: "balls", "lines", or "" for nothing.
    """

    errors: Floats
    deviations: Floats
    views: Sequence[View]
    tried: Tried
    scale: str

    @property
    def orientation(self) -> Orientation:
        """The pose of the first frame, without errors."""
        return corrected(self.views[0].orientation, np.append(self.errors, 0.0))


def read_views(
    source: str, lens: Lens | None, fov: float | None, orientation: Orientation | None, most: int = MOST_FRAMES
) -> tuple[list[View], bool]:
    """Frames of a video, recording or folder, evenly spread, and whether they have poses.

    lens, fov [rad], orientation: of the user; frames of a recording have their own. Raises InputError.
    """
    opened = open_source(source)
    stride = max((opened.count or most) // most, 1)
    views: list[View] = []
    has_poses = True
    for frame in opened.frames:
        if frame.index % stride or len(views) == most:
            continue
        view, has_pose = _view(frame, lens, fov, orientation)
        views.append(view)
        has_poses = has_poses and has_pose
    return views, has_poses


def _view(frame: Frame, lens: Lens | None, fov: float | None, orientation: Orientation | None) -> tuple[View, bool]:
    image = frame.read()
    size = image.shape[1], image.shape[0]
    beside = lens_beside(frame.path)
    own = None if beside is None else read_lens_file(beside)
    known = own.lens if own is not None else lens
    if known is None and fov is not None:
        known = Rectilinear.from_horizontal_fov(fov, size)
    if known is None:
        raise InputError(f"{frame.source}: no lens; give --lens FILE, or --fov ANGLE for a lens without distortion")
    pose = orientation or (own.orientation if own is not None else None)
    return View(image, known.for_image(size), pose or _GUESS), pose is not None


def fit_field(
    views: Sequence[View], has_poses: bool, model: str, radius: float | None, line_width: float | None
) -> FieldFit:
    """The errors of the poses of frames. has_poses: the poses are about right; otherwise they are searched.

    model: network that sees lines and balls. radius [m]: of the balls. line_width [m]: None if it is not known. Raises
    InputError if the frames show too little.
    """
    detector = Detector.from_file(model, Settings(object_radius=radius))
    scouts = views[:: -(-len(views) // _SCOUTS)]
    search = PoseSearch(detector, scouts, line_width)
    bar = ProgressBar(None, "vm-calibrate", unit="poses")
    bar.show(0)
    found = search.found()[1] if has_poses else search.found(_PITCHES, np.log([0.4, 0.7, 1.0, 1.4, 2.2]).tolist())[1]
    if len(views) > len(scouts):
        found = PoseSearch(detector, views, line_width).refined(found)
    bar.clear()
    if found.lines < _FEWEST_LINES and found.balls < _FEWEST_BALLS:
        raise InputError(
            f"the frames show only {found.lines} pieces of lines and {found.balls} balls: show lines and balls near "
            "the camera, and check --radius"
        )
    scale = "balls" if found.ball_gain > SURE_BALLS else "lines" if line_width is not None else ""
    deviations = np.maximum(_SHARED * found.deviations[: HEIGHT + 1], _FLOOR)
    return FieldFit(found.total[: HEIGHT + 1], deviations, views, found, scale)
