"""Section [pose]: where poses come from, and how the detector uses them."""

from __future__ import annotations

import math
from dataclasses import Field, dataclass
from typing import Any

from ..borders.sockets import parse_address
from ..config.entries import check_entries, entry, number, one_of, switch
from ..config.units import angle
from ..errors import InputError
from ..geometry.orientation import Orientation

CLOCKS = ("monotonic", "wall", "arrival")
FRAMES = ("camera", "optical")

_ADDED = (-math.radians(45.0), math.radians(45.0))
"""Limits of corrections [rad]."""

UDP_EXAMPLE = "0.0.0.0:5600"
"""Address to receive poses at, for error messages."""


def check_without_ros(source: str) -> None:
    """Raise InputError for poses from ROS: from tf, or from a topic."""
    if source == "tf" or source.startswith("topic:"):
        raise InputError(f"pose source {source} works only with vm-ros and bags; give fixed, stdin, udp: or unix:")


def _checked_source(field: Field[Any], value: object) -> str:
    kind, _, rest = value.partition(":") if isinstance(value, str) else ("", "", "")
    if kind == "udp":
        try:
            parse_address(rest, field.name, UDP_EXAMPLE)
        except InputError as error:
            raise InputError(
                f"{field.name} must be udp:ADDRESS:PORT, as in udp:{UDP_EXAMPLE}, not {value!r}"
            ) from error
    elif not (value in ("fixed", "stdin", "tf") or (kind in ("unix", "topic") and rest and "\0" not in rest)):
        raise InputError(
            f"{field.name} must be fixed, stdin, unix:PATH, udp:ADDRESS:PORT, or with ROS tf or topic:/NAME, "
            f"not {value!r}"
        )
    return str(value)


@dataclass(frozen=True, kw_only=True)
class PoseSettings:
    """Source, clock and frame of the poses, interpolation, and limits beyond which a pose is rejected."""

    source: str = entry(
        _checked_source,
        "fixed",
        "fixed: the pose in [orientation]; stdin, udp:ADDRESS:PORT or unix:PATH (creates the socket): lines of JSON; "
        "tf or topic:/NAME (geometry_msgs/PoseStamped): only for vm-ros and bags",
    )
    clock: str = one_of(
        CLOCKS,
        "monotonic",
        "clock of t; monotonic and wall: the machine's clocks; arrival: t is ignored, and the time of arrival is used",
    )
    frame: str = one_of(
        FRAMES,
        "camera",
        "axes of the camera's frame; camera: x forward, y left, z up; optical (as in OpenCV and ROS): x right, y down, "
        "z forward",
    )
    latency_ms: float = number(0.0, "time to subtract from t", "ms", (-1000, 1000))
    wait_ms: float = number(40.0, "longest time to wait for a pose that is not older than the frame", "ms", (0, 1000))
    extrapolate_ms: float = number(5.0, "longest time to extrapolate beyond the newest pose", "ms", (0, 100))
    max_age_ms: float = number(
        100.0, "a frame is not processed if the newest pose is older than the frame by more than this", "ms", (1, 10000)
    )
    max_climb: float = number(5.0, "a pose is rejected if its height changes faster than this", "m/s", (0.01, 1000))
    max_turn: float = number(
        30.0, "a pose is rejected if its gravity direction turns faster than this", "rad/s", (0.1, 1000)
    )

    add_pitch: float = angle(
        0.0, "added to the pitch of each pose, in radians or with deg; vm-calibrate pose finds it", _ADDED
    )
    add_roll: float = angle(0.0, "added to the roll of each pose, in radians or with deg", _ADDED)
    scale_height: float = number(1.0, "factor for the height of each pose", "", (0.5, 2.0))
    correct: bool = switch(
        False,
        "slowly correct all poses by what lines and balls show, by at most 3 degrees and 10 %; messages say how much",
    )

    def __post_init__(self) -> None:
        check_entries(self)

    def corrected(self, orientation: Orientation) -> Orientation:
        """A pose with the corrections. A fixed pose needs none."""
        if not (self.add_pitch or self.add_roll) and self.scale_height == 1.0:
            return orientation
        return orientation.adjusted(self.add_pitch, self.add_roll, self.scale_height)
