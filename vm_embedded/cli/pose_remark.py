"""What to tell a user about a pose that the frames speak against."""

from __future__ import annotations

import math

from ..detection.pose_state import PoseState
from ..geometry.orientation import Orientation

_SEVERAL = {"pitch": 0.5, "roll": 0.5, "height": 3.0}
"""Errors [deg], [%] that are worth a word."""


def pose_remark(state: PoseState, fixed: Orientation | None) -> str:
    """A line about a doubtful or wrong pose; empty if there is nothing to say.

    fixed: the pose that options or a configuration give for all frames; None if each frame has its own.
    """
    if state.verdict not in ("doubtful", "wrong"):
        return ""
    errors = {name: value for name, value in _errors(state).items() if value is not None and abs(value) > _SEVERAL[name]}
    words = [_WORDS[name](value) for name, value in errors.items()]
    seems = f"the camera seems {' and '.join(filter(None, [', '.join(words[:-1]), *words[-1:]]))}" if words else ""
    rests = f"{state.lines} pieces of lines and {state.balls} balls in {state.frames} frames"
    is_sure = "is wrong" if state.verdict == "wrong" else "is doubtful"
    return f"the pose {is_sure}: {seems} ({rests}): {_advice(errors, fixed)}"


def _errors(state: PoseState) -> dict[str, float | None]:
    return {"pitch": state.pitch, "roll": state.roll, "height": state.height}


_WORDS = {
    "pitch": lambda value: f"to look {abs(value):.0f} degrees {'lower' if value > 0.0 else 'higher'}",
    "roll": lambda value: f"to be tilted {abs(value):.0f} degrees more to the {'right' if value > 0.0 else 'left'}",
    "height": lambda value: f"to be {abs(value):.0f} % {'higher' if value > 0.0 else 'lower'} over the floor",
}


def _advice(errors: dict[str, float], fixed: Orientation | None) -> str:
    """What to do about errors [deg], [%]."""
    if fixed is None or not errors:
        return "check the mount and the poses; vm-calibrate pose finds the correction from a recording"
    tried = []
    if "height" in errors:
        tried.append(f"--height {fixed.height * (1.0 + 0.01 * errors['height']):.2f}")
    for name in ("pitch", "roll"):
        if name in errors:
            tried.append(f"--{name} {math.degrees(getattr(fixed, name)) + errors[name]:.0f}deg")
    return f"try {' '.join(tried)}"
