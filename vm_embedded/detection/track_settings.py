"""The settings of a Tracker."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.entries import check_entries, number
from ..config.units import angle


@dataclass(frozen=True, kw_only=True)
class TrackSettings:
    """Settings of a Tracker. The first four are the errors of a single detection (standard deviations).

    Raises EntryError, an InputError, for a value outside of its limits.
    """

    center_error: float = number(0.05, "error of the center that the network finds, as a share of the radius")
    pixel_error: float = number(0.5, "error of the center that the network finds, added to the one above", "px")
    pose_error: float = angle(0.005, "error of the camera's orientation around each axis", (1e-6, 0.5))
    height_error: float = number(0.01, "error of the camera's height", "m")
    wander: float = number(
        0.4, "how much the velocity of a rolling object changes in a second (standard deviation)", "m/s"
    )
    max_speed: float = number(6.0, "speed of the fastest object, such as a ball after a kick", "m/s", (0.01, 100))
    gate: float = number(
        4.0, "a detection continues a track if it is at most so many standard deviations off", "", (1, 10)
    )
    forget: float = number(1.0, "a track ends when its object was not detected for so long", "s", (0.01, 60))

    def __post_init__(self) -> None:
        check_entries(self)
