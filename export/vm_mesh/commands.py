"""What the commands of vm-mesh do."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cameras.image_files import read_image
from vm_embedded.config.units import parse_angle, parse_length
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write, check_writable
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import LensFile, read_lens_file
from vm_embedded.geometry.make_shape import make_shape
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_workstation.plots import check_figure_path, save_figure

from .made_mesh import MadeMesh, Plan
from .pictures import drawn, on_picture
from .plots import quality_figure, range_figure
from .quality import Links, OnObject, links_of, on_object
from .ranges import range_of

_DEFAULTS = {"shape": "sphere", "radius": 0.095, "object_height": 0.0, "intersections": 4.0, "max_distance": 10.0}


def show(options: argparse.Namespace) -> None:
    """Draw a mesh into a file."""
    _check_figure(options.output)
    if options.model and len(options.model) > 1:
        raise InputError("vm-mesh show draws one mesh; give one --model")
    file = _lens_of(options)
    plan, model = _plan(options, file)
    made = MadeMesh.build((options.model or [model])[0], plan)
    if options.image is not None:
        if file is None:
            raise InputError("a picture needs the lens that took it; give --lens")
        if file.orientation is None and (options.height is None or options.pitch is None):
            raise InputError(f"{options.lens} does not say where the camera was; give --height and --pitch")
        orientation = _orientation(options, file, plan.height)
        figure = on_picture(made, read_image(options.image), file.lens, orientation)
    else:
        view = options.view or ("directions" if made.model == "wall6" else "ground")
        reach = plan.max_distance if view == "directions" else min(2.0, plan.max_distance)
        if options.reach is not None:
            reach = _positive("--reach", options.reach)
        _distances(options.object or (), np.empty(0))
        figure = drawn(made, view, reach, tuple(options.object or ()))
    save_figure(figure, options.output)
    print(f"{options.output}: {made.model}, {len(made.mesh)} points")


def quality(options: argparse.Namespace) -> None:
    """Print, plot and write how evenly meshes sample."""
    if options.output is not None:
        _check_figure(options.output)
    if options.json is not None:
        check_writable(options.json)
    plan, _ = _plan(options, None)
    # Distances in no simple ratio to each other, closer together near the camera's foot, where meshes differ.
    distances = _distances(options.distance, plan.max_distance * 0.8 * np.linspace(0.0, 1.0, 60) ** 2)
    found = {model: _measured(MadeMesh.build(model, plan), distances) for model in _models(options, plan)}
    print(f"{plan.shape}, camera {plan.height:g} m high, k = {plan.intersections:g}, to {plan.max_distance:g} m")
    print("equivalent k on an object: mean (least to most over bearings); links in steps, angles in degrees")
    for model, (curve, links) in found.items():
        at = curve.distances  # of wall6 only those that it serves
        shown = np.linspace(0, len(at) - 1, min(6, len(at))).astype(int)
        on = "  ".join(f"{at[i]:.2f} m {curve.mean[i]:.2f} ({curve.low[i]:.2f} to {curve.high[i]:.2f})" for i in shown)
        print(f"{model:8s} {on}")
        print(f"{'':8s} {_links_text(links)}")
    if options.output is not None:
        save_figure(quality_figure(plan, [(model, curve) for model, (curve, _) in found.items()]), options.output)
        print(f"{options.output}: written")
    _write(options.json, {model: _figures(*each) for model, each in found.items()})


def range_(options: argparse.Namespace) -> None:
    """Print and plot pixels and points on an object, and the farthest distance that is worth configuring."""
    if options.output is not None:
        _check_figure(options.output)
    file = _lens_of(options)
    if file is None:
        raise InputError("vm-mesh range needs --lens")
    plan, _ = _plan(options, file)
    lens = file.lens if options.size is None else file.lens.for_image(_size(options.size))
    scale = lens.scale
    distances = _distances(options.distance, np.array([0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0]))
    found = range_of(plan, scale, distances)
    print(f"{plan.shape}, camera {plan.height:g} m high, lens with {scale:.0f} px/rad on its axis")
    print(f"a whole object has about {found.points:.0f} points at every distance (k = {plan.intersections:g})")
    print("distance [m]  pixels across  pixels for each mesh step")
    for distance, pixels in zip(distances.tolist(), found.pixels, strict=True):
        step = float(pixels.min()) / plan.intersections
        note = "" if step >= 1.0 else "  points repeat each other's pixels"
        print(f"{distance:12.2f}  {pixels[0]:13.1f}  {step:25.2f}{note}")
    if math.isinf(found.worth):
        print("the camera is finer than the mesh at every distance")
    else:
        print(f"beyond {found.worth:.1f} m the mesh is finer than the camera: larger distances are not worth it")
    if options.output is not None:
        figure = range_figure(
            plan, range_of(plan, scale, np.geomspace(max(distances[0], 0.01), max(distances[-1], 0.02), 200))
        )
        save_figure(figure, options.output)
        print(f"{options.output}: written")


def compare(options: argparse.Namespace) -> None:
    """Print and write models side by side."""
    file = _lens_of(options)
    plan, _ = _plan(options, file)
    distances = 0.8 * plan.max_distance * np.linspace(0.0, 1.0, 25) ** 2
    size = None if file is None else _size_of(options, file)
    if options.json is not None:
        check_writable(options.json)
    head = "model       points  on screen  build [ms]  k from    to  spread  link lengths  angles [deg]"
    print(
        f"{plan.shape}, camera {plan.height:g} m high, k = {plan.intersections:g}, to {plan.max_distance:g} m\n{head}"
    )
    found: dict[str, Any] = {}
    for model in _models(options, plan):
        made = MadeMesh.build(model, plan)
        curve, links = _measured(made, distances)
        seen = None if file is None or size is None else _on_screen(made, options, file, size)
        found[model] = _figures(curve, links) | {"points": len(made.mesh), "on_screen": seen, "build_ms": made.build_ms}
        spread = float(np.std(curve.mean))
        print(
            f"{model:8s} {len(made.mesh):9d} {'-' if seen is None else seen:>10}  {made.build_ms:10.0f}  "
            f"{curve.low.min():6.2f} {curve.high.max():5.2f}  {spread:6.2f}  {links.radial.mean:5.2f} +- "
            f"{links.radial.deviation:4.2f}  {links.angular.mean:4.0f} +- {links.angular.deviation:3.0f}"
        )
    _write(options.json, found)


COMMANDS: dict[str, Callable[[argparse.Namespace], None]] = {
    "show": show,
    "quality": quality,
    "range": range_,
    "compare": compare,
}


def _plan(options: argparse.Namespace, file: LensFile | None) -> tuple[Plan, str]:
    """What the options, a network and a lens file say the mesh is made for, and its model."""
    given: dict[str, Any] = dict(_DEFAULTS)
    model = "ring6"
    if options.network is not None:
        manifest = read_model(model_path(options.network)).manifest
        given |= {name: getattr(manifest, name) for name in given}
        model = manifest.mesh
    chosen = {name: getattr(options, name) for name in given}
    if chosen["shape"] not in (None, "cylinder"):
        given["object_height"] = 0.0  # of the network's cylinder
    given |= {name: value for name, value in chosen.items() if value is not None}
    shape = make_shape(given["shape"], given["radius"], given["object_height"])
    height = 1.0 if file is None or file.orientation is None else file.orientation.height
    if options.height is not None:
        height = parse_length(options.height)
    plan = Plan(
        shape,
        _positive("--height", height),
        _positive("--intersections", given["intersections"]),
        _positive("--max-distance", given["max_distance"]),
    )
    if not isinstance(shape, Cylinder):
        shape.spacing(height)  # raises GeometryError for a camera that is too low
    return plan, model


def _models(options: argparse.Namespace, plan: Plan) -> list[str]:
    """The models to look at: those asked for, or all that there are for the shape and height."""
    if options.model:
        return list(options.model)
    cylinder = plan.shape if isinstance(plan.shape, Cylinder) else None
    tall = cylinder is not None and cylinder.object_height >= plan.height
    return [name for name in MESH_MODELS if (cylinder is not None if name == "wall6" else not tall)]


def _measured(made: MadeMesh, distances: Floats) -> tuple[OnObject, Links]:
    return on_object(made, distances), links_of(made, 0.0, 0.8 * made.plan.max_distance)


def _figures(curve: OnObject, links: Links) -> dict[str, Any]:
    """Plain numbers for JSON."""
    on = {name: np.round(getattr(curve, name), 4).tolist() for name in ("distances", "mean", "low", "high")}
    return {"on_object": on, "links": asdict(links)}


def _links_text(links: Links) -> str:
    parts = (("radial", links.radial), ("cyclic", links.cyclic), ("angular", links.angular))
    return ", ".join(f"{name} {each.mean:.2f} +- {each.deviation:.2f}" for name, each in parts)


def _size_of(options: argparse.Namespace, file: LensFile) -> Size:
    """Size of the pictures [px]."""
    size = _size(options.size) if options.size is not None else file.lens.size
    if size is None:
        raise InputError("the lens file does not say how large its pictures are; give --size")
    return size


def _on_screen(made: MadeMesh, options: argparse.Namespace, file: LensFile, size: Size) -> int:
    """How many points a camera sees."""
    orientation = _orientation(options, file, made.plan.height)
    return int(project(made.mesh, orientation.level, file.lens.for_image(size), size).on_screen.sum())


def _orientation(options: argparse.Namespace, file: LensFile, height: float) -> Orientation:
    pitch, roll = (0.0, 0.0) if file.orientation is None else (file.orientation.pitch, file.orientation.roll)
    return Orientation.from_roll_pitch(
        height,
        roll if options.roll is None else parse_angle(options.roll),
        pitch if options.pitch is None else parse_angle(options.pitch),
    )


def _lens_of(options: argparse.Namespace) -> LensFile | None:
    return None if options.lens is None else read_lens_file(options.lens)


def _size(text: str) -> Size:
    width, cross, height = text.partition("x")
    sides = [int(each) if each.isascii() and each.isdigit() else 0 for each in (width, height)]
    if not cross or not all(sides):
        raise InputError(f"size must be WIDTHxHEIGHT in pixels, as 640x512, not {text!r}")
    return sides[0], sides[1]


def _distances(given: Sequence[float] | None, otherwise: Floats) -> Floats:
    """The distances asked for, in order, or others. Raises InputError for what is no distance."""
    if not given:
        return otherwise
    if not all(0.0 <= each < 1e6 for each in given):
        raise InputError(f"distances must be numbers of at least 0 m, not {list(given)}")
    return np.array(sorted(given))


def _positive(name: str, value: float) -> float:
    """A finite number above 0. Raises InputError."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be a number above 0, not {value}")
    return value


def _check_figure(path: Path) -> None:
    check_figure_path(path)
    check_writable(path)


def _without_nan(content: Any) -> Any:
    """The same with None for what is no number: JSON has no NaN."""
    if isinstance(content, dict):
        return {key: _without_nan(each) for key, each in content.items()}
    if isinstance(content, list):
        return [_without_nan(each) for each in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def _write(path: Path | None, content: Any) -> None:
    if path is None:
        return
    with atomic_write(path) as part:
        part.write_text(json.dumps(_without_nan(content), indent=1, allow_nan=False) + "\n")
    print(f"{path}: written")
