"""The pose of a fixed camera over the floor as numbers of a fit: logarithm of the height, pitch and roll."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.orientation import Orientation

from .shared_fit import SharedFit


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A fitted pose.

    orientation: of the camera. height [m], pitch and roll [rad]: standard deviations. error: RMS residual [px].
    residuals: RMS residual of each ball or frame that was used, by name [px]. left_out: balls or frames that were not
    used, with the reason. warnings: what the measurements do not determine well.
    """

    orientation: Orientation
    height: float
    pitch: float
    roll: float
    error: float
    residuals: dict[str, float]
    left_out: dict[str, str]
    warnings: tuple[str, ...]


def orientation_of(numbers: Floats) -> Orientation:
    """The orientation of the numbers (3,) of a fit."""
    height, pitch, roll = (float(each) for each in numbers)
    turn = math.tau  # a step of the fit may go beyond it
    return Orientation.from_roll_pitch(
        math.exp(min(height, 10.0)), roll=math.remainder(roll, turn), pitch=math.remainder(pitch, turn)
    )


def numbers_of(normal: Floats, height: float) -> Floats:
    """The numbers (3,) of a camera at a height [m] whose frame sees the floor's upward normal (3,)."""
    pitch = math.atan2(-normal[0], math.hypot(normal[1], normal[2]))
    roll = math.atan2(normal[1], normal[2])
    return np.array([math.log(height), pitch, roll])


def pose_fit(
    fit: SharedFit, error: float, residuals: dict[str, float], left_out: dict[str, str], advice: str
) -> PoseFit:
    """The result of a fit whose shared numbers are a pose. advice: for a pose that is not well determined."""
    orientation = orientation_of(fit.shared)
    height, pitch, roll = (float(each) for each in fit.deviations())
    warnings = []
    if not height < 0.03:
        warnings.append(f"the height is {_percent(height)}; {advice}")
    for name, angle in (("pitch", pitch), ("roll", roll)):
        if not angle < math.radians(0.7):
            warnings.append(f"the {name} is {_degrees(angle)}; {advice}")
    return PoseFit(orientation, height * orientation.height, pitch, roll, error, residuals, left_out, tuple(warnings))


def _percent(share: float) -> str:
    return f"only known to {100.0 * share:.0f} %" if share < 1.0 else "not determined"


def _degrees(angle: float) -> str:
    return f"only known to {math.degrees(angle):.1f} degrees" if angle < 1.0 else "not determined"
