"""What frames say about the camera's pose, as messages have it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ..borders.records import SIZE, Record, Sent

VERDICTS = ("unknown", "consistent", "doubtful", "wrong")


@dataclass(frozen=True, kw_only=True)
class PoseState(Record):
    """What the frames so far say about the camera's pose.

    verdict: wrong, doubtful or consistent; unknown if the frames show too little. pitch [deg]: error of the pitch: true
    minus assumed one; null if unknown. roll [deg]: error of the roll: true minus assumed one; null if unknown. height
    [%]: how much larger the true height is; null if unknown. frames: number of different pictures. balls: number of
    balls that it rests on. lines: number of pieces of lines that it rests on. added_pitch [deg]: correction that is
    added to the pitch; only with [pose] correct. added_roll [deg]: correction that is added to the roll. added_height
    [%]: correction of the height.
    """

    verdict: Annotated[str, Sent(allowed=VERDICTS)]
    pitch: Annotated[float | None, Sent(1, null=True)] = None
    roll: Annotated[float | None, Sent(1, null=True)] = None
    height: Annotated[float | None, Sent(0, null=True)] = None
    frames: Annotated[int, SIZE] = 0
    balls: Annotated[int, SIZE] = 0
    lines: Annotated[int, SIZE] = 0
    added_pitch: Annotated[float | None, Sent(2)] = None
    added_roll: Annotated[float | None, Sent(2)] = None
    added_height: Annotated[float | None, Sent(1)] = None
