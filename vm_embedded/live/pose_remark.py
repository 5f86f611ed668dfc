"""What to tell a user about a pose that the frames speak against."""

from __future__ import annotations

import math

from ..detection.pose_state import PoseState
from ..geometry.orientation import Orientation

_WORTH_A_WORD = {"pitch": 0.5, "roll": 0.5, "height": 3.0}
"""Smaller errors [deg], [%] are not named."""


def pose_remark(state: PoseState, fixed: Orientation | None) -> str:
    """A line about a doubtful or wrong pose; empty if there is nothing to say.

    fixed: the pose that options or a configuration give for all frames; None if frames have their own.
    """
    if state.verdict not in ("doubtful", "wrong"):
        return ""
    seen = {"pitch": state.pitch, "roll": state.roll, "height": state.height}
    errors = {name: value for name, value in seen.items() if value is not None and abs(value) > _WORTH_A_WORD[name]}
    words = [_in_words(name, value) for name, value in errors.items()]
    seems = f"the camera seems {', '.join(words)}" if words else "the field seems to reach above the horizon"
    rests = f"by {state.lines} pieces of lines and {state.balls} balls in {state.frames} frames"
    return f"the pose is {state.verdict}: {seems} ({rests}): {_advice(errors, fixed)}"


def _in_words(name: str, value: float) -> str:
    """An error [deg], [%] in words."""
    if name == "pitch":
        return f"to look {abs(value):.0f} degrees {'lower' if value > 0.0 else 'higher'}"
    if name == "roll":
        return f"to be tilted {abs(value):.0f} degrees more to the {'right' if value > 0.0 else 'left'}"
    return f"to be {abs(value):.0f} % {'higher' if value > 0.0 else 'lower'} over the floor"


def _advice(errors: dict[str, float], fixed: Orientation | None) -> str:
    """What to do about errors [deg], [%]."""
    if fixed is None or not errors:
        return "check mount and poses; vm-calibrate pose RECORDING --field finds the correction"
    tried = [f"--height {fixed.height * (1.0 + 0.01 * errors['height']):.2f}"] if "height" in errors else []
    angles = {"pitch": fixed.pitch, "roll": fixed.roll}
    tried += [f"--{name} {math.degrees(angles[name]) + errors[name]:.0f}deg" for name in angles if name in errors]
    return f"try {' '.join(tried)}"
