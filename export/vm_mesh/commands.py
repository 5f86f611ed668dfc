"""The commands of vm-mesh."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.cameras.image_files import read_image
from vm_embedded.config.units import parse_size
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.files import check_writable, write_file
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.network.bundled import model_path
from vm_workstation.plots import check_figure_path, save_figure

from .built_mesh import BuiltMesh
from .drawing import figure_from_above, figure_on_picture
from .options import (
    check_distances,
    distances_or,
    image_size,
    lens_file,
    models_for,
    orientation_of,
    plan_and_model,
    positive,
)
from .plots import quality_figure, range_figure
from .quality import Links, Quality, measure_quality
from .useful_range import UsefulRange, useful_range


def show(options: argparse.Namespace) -> None:
    """Draw a mesh into a file."""
    _check_figure(options.output, options)
    if options.model and len(options.model) > 1:
        raise InputError("vm-mesh show draws one mesh; give one --model")
    _check_view(options)
    file = lens_file(options)
    plan, model = plan_and_model(options, file)
    built = BuiltMesh.build((options.model or [model])[0], plan)
    if options.image is not None:
        if file is None:
            raise InputError("--image needs the lens of the picture; give --lens")
        orientation = orientation_of(options, file, plan.height)
        figure = figure_on_picture(built, read_image(options.image), file.lens, orientation)
    else:
        view = options.view or ("directions" if built.model == "wall6" else "ground")
        reach = plan.max_distance if view == "directions" else min(2.0, plan.max_distance)
        if options.reach is not None:
            reach = positive("--reach", options.reach)
        objects = tuple(options.object or ())
        check_distances("--object", objects)
        figure = figure_from_above(built, view, reach, objects)
    save_figure(figure, options.output)
    print(f"{options.output}: {built.model}, {len(built.mesh)} points")


def quality(options: argparse.Namespace) -> None:
    """Print, plot and write how evenly meshes sample."""
    if options.output is not None:
        _check_figure(options.output, options)
    if options.json is not None:
        check_writable(options.json, _inputs(options))
    plan, _ = plan_and_model(options, None)
    # Not evenly spaced, so that they do not fall on rings; closer together near the camera's foot, where meshes differ.
    distances = distances_or(options.distance, plan.max_distance * 0.8 * np.linspace(0.0, 1.0, 60) ** 2)
    found = {model: measure_quality(BuiltMesh.build(model, plan), distances) for model in models_for(options, plan)}
    print(plan)
    print("equivalent k on an object: mean (lowest to highest of all bearings); links in steps, angles in degrees")
    for model, each in found.items():
        print(f"{model:8s} {_points_text(each)}")
        print(f"{'':8s} {_links_text(each.links)}")
    if options.output is not None:
        save_figure(quality_figure(plan, {model: each.points for model, each in found.items()}), options.output)
        print(f"{options.output}: written")
    _write_json(options.json, {model: each.as_dict() for model, each in found.items()})


def range_(options: argparse.Namespace) -> None:
    """Print and plot pixels and points on an object, and the largest useful distance."""
    if options.output is not None:
        _check_figure(options.output, options)
    file = lens_file(options)
    if file is None:
        raise InputError("vm-mesh range needs a lens; give --lens")
    plan, _ = plan_and_model(options, file)
    scale = (file.lens if options.size is None else file.lens.for_image(parse_size(options.size))).scale
    distances = distances_or(options.distance, np.array([0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0]))
    found = useful_range(plan, scale, distances)
    print(f"{plan.shape}, camera {plan.height:g} m high, lens with {scale:.0f} px/rad on its axis")
    print(f"an object has about {found.points:.0f} points at every distance (k = {plan.intersections:g})")
    print("\n".join(_range_lines(found, plan.intersections)))
    if options.output is not None:
        many = np.geomspace(max(distances[0], 0.01), max(distances[-1], 0.02), 200)
        save_figure(range_figure(plan, useful_range(plan, scale, many)), options.output)
        print(f"{options.output}: written")


def compare(options: argparse.Namespace) -> None:
    """Print and write the properties of several models."""
    file = lens_file(options)
    if file is None:
        _refuse(options, ("size", "pitch", "roll"), "needs --lens: only a camera with a lens sees points")
    plan, _ = plan_and_model(options, file)
    distances = 0.8 * plan.max_distance * np.linspace(0.0, 1.0, 25) ** 2
    size = None if file is None else image_size(options, file)
    if options.json is not None:
        check_writable(options.json, _inputs(options))
    print(plan)
    print("model       points  on screen  build [ms]  k from    to  spread  link lengths  angles [deg]")
    found: dict[str, Any] = {}
    for model in models_for(options, plan):
        built = BuiltMesh.build(model, plan)
        measured = measure_quality(built, distances)
        seen = None if file is None or size is None else _points_on_screen(built, options, file, size)
        print(_comparison_line(built, measured, seen))
        found[model] = measured.as_dict() | {
            "points": len(built.mesh),
            "on_screen": seen,
            "build_ms": built.build_ms,
        }
    _write_json(options.json, found)


COMMANDS: dict[str, Callable[[argparse.Namespace], None]] = {
    "show": show,
    "quality": quality,
    "range": range_,
    "compare": compare,
}


def _points_text(measured: Quality) -> str:
    """The equivalent k at up to six of the distances."""
    points = measured.points
    chosen = np.linspace(0, len(points.distances) - 1, min(6, len(points.distances))).astype(int)
    return "  ".join(
        f"{points.distances[i]:.2f} m {points.mean[i]:.2f} ({points.low[i]:.2f} to {points.high[i]:.2f})"
        for i in chosen
    )


def _links_text(links: Links) -> str:
    parts = (("radial", links.radial), ("cyclic", links.cyclic), ("angular", links.angular))
    return ", ".join(f"{name} {each.mean:.2f} +- {each.deviation:.2f}" for name, each in parts)


def _range_lines(found: UsefulRange, intersections: float) -> list[str]:
    """A table over distances, and the largest useful distance."""
    lines = ["distance [m]  pixels across  pixels per mesh step"]
    for distance, pixels in zip(found.distances.tolist(), found.pixels, strict=True):
        step = float(pixels.min()) / intersections
        note = "" if step >= 1.0 else "  several points in a pixel"
        lines.append(f"{distance:12.2f}  {pixels[0]:13.1f}  {step:20.2f}{note}")
    if math.isinf(found.limit):
        return [*lines, "a step of the mesh is larger than a pixel at every distance"]
    return [*lines, f"beyond {found.limit:.1f} m a step of the mesh is less than a pixel: a larger reach is of no use"]


def _comparison_line(built: BuiltMesh, measured: Quality, seen: int | None) -> str:
    points, links = measured.points, measured.links
    return (
        f"{built.model:8s} {len(built.mesh):9d} {'-' if seen is None else seen:>10}  {built.build_ms:10.0f}  "
        f"{points.low.min():6.2f} {points.high.max():5.2f}  {float(np.std(points.mean)):6.2f}  "
        f"{links.radial.mean:5.2f} +- {links.radial.deviation:4.2f}  "
        f"{links.angular.mean:4.0f} +- {links.angular.deviation:3.0f}"
    )


def _points_on_screen(built: BuiltMesh, options: argparse.Namespace, file: LensFile, size: Size) -> int:
    """The number of points that a camera sees."""
    orientation = orientation_of(options, file, built.plan.height)
    return int(project(built.mesh, orientation.level, file.lens.for_image(size), size).on_screen.sum())


def _check_view(options: argparse.Namespace) -> None:
    """Raise InputError for options of the view from above with --image, and for those of a picture without it."""
    if options.image is None:
        _refuse(options, ("pitch", "roll"), "is for a drawing on a picture; give --image, or leave it out")
    else:
        _refuse(options, ("view", "reach", "object"), "is for a drawing without --image; leave one of them out")


def _refuse(options: argparse.Namespace, names: Sequence[str], reason: str) -> None:
    """Raise InputError if one of these options is given."""
    for name in names:
        if getattr(options, name) is not None:
            raise InputError(f"--{name} {reason}")


def _check_figure(path: Path, options: argparse.Namespace) -> None:
    check_figure_path(path)
    check_writable(path, _inputs(options))


def _inputs(options: argparse.Namespace) -> list[Path | None]:
    """The files that a command reads. Raises InputError for an unknown network."""
    network = None if options.network is None else model_path(options.network)
    return [network, getattr(options, "lens", None), getattr(options, "image", None)]


def _write_json(path: Path | None, content: Any) -> None:
    """Write a JSON file, if there is a path, and say so."""
    if path is None:
        return
    write_file(path, json.dumps(_without_nan(content), indent=1, allow_nan=False) + "\n")
    print(f"{path}: written")


def _without_nan(content: Any) -> Any:
    """The content with None in place of NaN and infinity, which JSON does not have."""
    if isinstance(content, dict):
        return {key: _without_nan(each) for key, each in content.items()}
    if isinstance(content, list):
        return [_without_nan(each) for each in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
