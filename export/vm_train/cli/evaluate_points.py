"""vm-evaluate points: the paper's figure of points on a ball over its distance."""

from __future__ import annotations

import argparse
import math

from vm_embedded.cli.program import EXIT_OK
from vm_embedded.files import check_writable
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.sphere import Sphere


def run_points(options: argparse.Namespace) -> int:
    """Draw the figure, print the numbers at some distances, and return the exit status.

    Raises InputError and GeometryError as points_over_distance does, and InputError if the file can't be written.
    """
    # Imported here: without matplotlib, help works and the error is one clear line.
    from vm_workstation.plots import check_figure_path, save_figure

    from ..evaluation.points_on_ball import PAPER_CAMERA, PosedCamera
    from ..evaluation.points_on_ball_plot import points_figure
    from ..evaluation.points_over_distance import DISTANCES, points_over_distance

    check_figure_path(options.output)
    check_writable(options.output)
    pose = Orientation.from_roll_pitch(options.height, pitch=math.radians(options.pitch))
    camera = PosedCamera(pose, PAPER_CAMERA.lens, PAPER_CAMERA.size)
    ball = Sphere(options.radius)
    curves = points_over_distance(camera, ball, options.intersections, DISTANCES[::2], options.equal_at, options.early)
    title = (
        f"camera {options.height:g} m high, {options.pitch:g} degrees down, "
        f"{camera.size[0]} x {camera.size[1]} px; ball of radius {options.radius:g} m"
    )
    save_figure(points_figure(curves, title), options.output)
    for curve in curves:
        shown = ", ".join(f"{curve.at(each)[0]:.1f} at {each:g} m" for each in (1.0, 2.0, 5.0, 10.0))
        print(f"{curve.mesh:9s}  k = {curve.intersections:g}, {curve.count} points on screen; on the ball: {shown}")
    print(f"{options.output}: written")
    return EXIT_OK
