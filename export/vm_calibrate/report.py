"""What vm-calibrate found, as lines of text for the terminal and for the head of the lens file."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Size

from .field_pose import FieldFit
from .floor_pose import PoseFit
from .lens_fit import LensFit
from .lens_kinds import picture_angle

_CELLS = (8, 6)
"""Columns and rows of the cells of a picture whose share with a corner is the coverage."""


def lens_lines(fit: LensFit, size: Size, left_out: Counter[str]) -> list[str]:
    """The lens, how well it is known, and the frames that were used."""
    pixels = np.vstack([each.corners.pixels for each in fit.frames])
    reach, corner = (math.degrees(each) for each in _angles(fit, pixels, size))
    counted = [f"{number} {reason}" for reason, number in left_out.items() if number]
    counted += [f"{sighting.name} ({error:.1f} px off)" for sighting, error in fit.outliers]
    covered = f"{100.0 * coverage(pixels, size):.0f} % of the picture"
    focal = ", ".join(_known(value, deviation, "px") for value, deviation in fit.focal_lengths.T)
    center = ", ".join(_known(value, deviation, "px") for value, deviation in fit.center.T)
    return [
        f"lens            {fit.kind}, {size[0]} x {size[1]} px",
        f"focal length    {focal}",
        f"optical center  {center}",
        f"reprojection    {fit.error:.2f} px RMS of {len(pixels)} corners",
        f"coverage        {covered}; corners to {reach:.0f} degrees from the axis, picture to {corner:.0f}",
        f"frames          {len(fit.frames)} used" + (f"; left out: {', '.join(counted)}" if counted else ""),
    ]


def lens_warnings(fit: LensFit, size: Size) -> list[str]:
    """What is doubtful about a fitted lens, each with what to do."""
    pixels = np.vstack([each.corners.pixels for each in fit.frames])
    reach, corner = _angles(fit, pixels, size)
    share, warnings = coverage(pixels, size), []
    if share < 0.6:
        warnings.append(
            f"the board was seen in {100.0 * share:.0f} % of the picture; film it at the edges and in the corners too"
        )
    if fit.error > 1.0:
        warnings.append(
            f"the reprojection error is {fit.error:.1f} px; is the board flat, the film sharp, and {fit.kind} the kind "
            "of the lens?"
        )
    if not (fit.focal_lengths[1] < 0.005 * fit.focal_lengths[0]).all():
        warnings.append("the focal length is not known to 0.5 %; film the board tilted by 30 to 45 degrees, and nearer")
    if len(fit.frames) < 10:
        warnings.append(f"only {len(fit.frames)} frames were used; 20 to 40 are better")
    if reach < 0.75 * corner:
        warnings.append(
            f"no corner was farther than {math.degrees(reach):.0f} degrees from the axis, but the picture reaches "
            f"{math.degrees(corner):.0f}; the lens is guessed there"
        )
    return warnings


def pose_lines(fit: PoseFit) -> list[str]:
    """The pose, how well it is known, and what was used."""
    pose = fit.orientation
    lines = [
        f"height          {_known(pose.height, fit.height, 'm')}",
        f"pitch           {_known(math.degrees(pose.pitch), math.degrees(fit.pitch), 'degrees')}",
        f"roll            {_known(math.degrees(pose.roll), math.degrees(fit.roll), 'degrees')}",
        f"residual        {fit.error:.2f} px RMS; used {len(fit.residuals)}, left out {len(fit.left_out)}",
    ]
    worst = sorted(fit.residuals.items(), key=lambda each: -each[1])[:3]
    lines.append("largest         " + ", ".join(f"{name} ({error:.2f} px)" for name, error in worst))
    return lines + [f"left out        {name}: {reason}" for name, reason in fit.left_out.items()]


def field_lines(fit: FieldFit, fixed: bool) -> list[str]:
    """The pose of a camera that does not move, or the correction of all poses; how well it is known, and from what."""
    pitch, roll, height = fit.errors.tolist()
    errors = np.degrees(fit.deviations[:2]).tolist()
    pose, deviation = fit.orientation, float(fit.deviations[2])
    if fixed:
        lines = [
            f"height          {_known(pose.height, deviation * pose.height, 'm')}" + ("" if fit.scale else ", guessed"),
            f"pitch           {_known(math.degrees(pose.pitch), errors[0], 'degrees')}",
            f"roll            {_known(math.degrees(pose.roll), errors[1], 'degrees')}",
        ]
    else:
        scaled = _known(100.0 * math.expm1(height), 100.0 * deviation, "%") if fit.scale else "not determined"
        lines = [
            f"height off by   {scaled}",
            f"pitch off by    {_known(math.degrees(pitch), errors[0], 'degrees')}",
            f"roll off by     {_known(math.degrees(roll), errors[1], 'degrees')}",
        ]
    return [*lines, f"used            {fit.tried.lines} pieces of lines, {fit.tried.balls} balls; {_SCALES[fit.scale]}"]


_SCALES = {
    "balls": "the balls give the height",
    "lines": "the width of the lines gives the height",
    "": "nothing gives the height",
}


def field_warnings(fit: FieldFit) -> list[str]:
    """What is doubtful about a pose from a field, each with what to do."""
    warnings = []
    if not fit.scale:
        warnings.append(
            "the height is only guessed from usual lines: show a ball, and give --radius; or give --line-width"
        )
    if (fit.deviations[:2] > math.radians(1.0)).any():
        warnings.append("the angles are not known to 1 degree: show more lines, near and far, to both sides")
    return warnings


def coverage(pixels: Floats, size: Size) -> float:
    """Share of the cells of a picture that have one of the pixels (n, 2)."""
    cells = np.floor((pixels + 0.5) / size * _CELLS).astype(int).clip(0, np.array(_CELLS) - 1)
    return len(np.unique(cells, axis=0)) / (_CELLS[0] * _CELLS[1])


def _angles(fit: LensFit, pixels: Floats, size: Size) -> tuple[float, float]:
    """Largest angles from the axis of a corner of the boards and of the picture [rad]."""
    forward = fit.lens.unproject(pixels, size)[:, 0]
    return float(np.arccos(np.clip(np.nanmin(forward), -1.0, 1.0))), picture_angle(fit.lens, size)


def _known(value: float, deviation: float, unit: str) -> str:
    """A value with its standard deviation, to two digits of the latter."""
    if not math.isfinite(deviation):
        return f"{value:.3g} {unit}, not determined"
    digits = max(0, 1 - math.floor(math.log10(max(deviation, 1e-6))))
    return f"{value:.{digits}f} +- {deviation:.{digits}f} {unit}"
