"""vm-export: from a trained network to one self-describing ONNX file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.network.manifest import EDGES, LAYOUTS

if TYPE_CHECKING:
    from .checkpoint import Checkpoint
    from .reference import Overrides

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2


def parser() -> argparse.ArgumentParser:
    """The command line of vm-export."""
    parser = argparse.ArgumentParser(
        prog="vm-export",
        description="Write a network as one ONNX file that describes itself, checked against torch.",
        epilog="Exit status: 0 written, 1 not written (the reason is on standard error), 2 wrong usage.",
    )
    parser.add_argument("model", type=Path, help="a checkpoint (.pt) or a network of the reference (.yaml)")
    parser.add_argument(
        "-o", "--output", type=Path, help="file to write; default: the model's name with .onnx or .yaml"
    )
    parser.add_argument(
        "--layout",
        choices=LAYOUTS,
        help="write one file, in this layout; default: the fastest one, and beside it the portable NAME.plain.onnx "
        "(not of a network with a second look, which has only runs)",
    )
    parser.add_argument("--to-yaml", action="store_true", help="write the reference's format instead")
    facts = parser.add_argument_group("what the file does not say, or says wrongly")
    facts.add_argument("--intersections", type=float, metavar="K", help="rings that cross an object")
    facts.add_argument("--radius", type=float, metavar="M", help="radius that the mesh is made for [m]")
    facts.add_argument("--object-radius", type=float, metavar="M", help="radius of the real object [m]")
    facts.add_argument("--max-distance", type=float, metavar="M", help="how far out the mesh reaches [m]")
    facts.add_argument("--edge", choices=EDGES, help="where a missing neighbor leads: the off-screen point, or itself")
    facts.add_argument(
        "--classes",
        metavar="NAME[:KIND],...",
        help="classes in the order of the outputs; kind: object, upright, area or background",
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-export and return its exit status."""
    options = parser().parse_args(arguments)
    try:
        return _run(options)
    except ImportError as error:
        missing = error.name or str(error)
        print(f"vm-export: {missing} is not installed; run: pip install 'vm-embedded[export]'", file=sys.stderr)
    except VisualMeshError as error:
        print(f"vm-export: {error}", file=sys.stderr)
    return EXIT_FAILED


def _run(options: argparse.Namespace) -> int:
    # Imported here, so that a robot without torch still gets help texts and one clear line.
    from .onnx_graph import export, fastest_layout
    from .reference import write_reference

    output = options.output or options.model.with_suffix(".yaml" if options.to_yaml else ".onnx")
    portable = output.with_suffix(".plain" + output.suffix)
    for path in (output,) if options.to_yaml or options.layout else (output, portable):
        if path.resolve() == options.model.resolve():
            raise InputError(f"{path} is the input and would be written over; give another file with --output")
    if options.to_yaml and options.layout:
        raise InputError("--layout is for ONNX files, and --to-yaml writes none")
    checkpoint = _load(options.model, _overrides(options))
    if checkpoint.grid.kind != "visual":
        raise InputError(
            f"{options.model} was trained on a {checkpoint.grid.kind} mesh, which the runtime does not have"
        )
    manifest = checkpoint.manifest
    classes = ", ".join(f"{each.name} ({each.kind})" for each in manifest.classes)
    print(f"{options.model}: {_layers(checkpoint)}, {manifest.mesh}, {manifest.shape}")
    print(f"  radius {manifest.radius:g} m, {manifest.intersections:g} intersections, to {manifest.max_distance:g} m")
    print(f"  object radius {manifest.object_radius:g} m, edge {manifest.edge}, classes: {classes}")
    if options.to_yaml:
        write_reference(checkpoint, output)
        print(f"{output}: written in the reference's format")
        return EXIT_OK
    layout = options.layout or fastest_layout(checkpoint)
    everywhere = options.layout is None and layout != "plain" and checkpoint.network is checkpoint.last
    files = {portable: "plain"} if everywhere else {}
    files[output] = layout
    for path, layout in files.items():
        difference = export(checkpoint, path, layout)
        size = path.stat().st_size / 1000
        print(f"{path}: layout {layout}, {size:.1f} kB, largest difference to torch {difference:.1e}")
    return EXIT_OK


def _layers(checkpoint: Checkpoint) -> str:
    from .second_look import SecondLook

    network, layers = checkpoint.network, len(checkpoint.network.shape.layers)
    if isinstance(network, SecondLook):
        return f"{len(network.first.shape.layers)} layers, {layers} for a second look"
    return f"{layers} layers"


def _overrides(options: argparse.Namespace) -> Overrides:
    from .reference import Overrides, named_class

    classes = None
    if options.classes is not None:
        pairs = [each.strip().partition(":") for each in options.classes.split(",")]
        classes = tuple(named_class(name, kind or None) for name, _, kind in pairs)
    return Overrides(
        intersections=options.intersections,
        radius=options.radius,
        object_radius=options.object_radius,
        max_distance=options.max_distance,
        edge=options.edge,
        classes=classes,
    )


def _load(path: Path, overrides: Overrides) -> Checkpoint:
    from .checkpoint import Checkpoint
    from .reference import read_reference

    if path.suffix.lower() in (".yaml", ".yml"):
        return read_reference(path, overrides)
    if path.suffix.lower() == ".pt":
        return overrides.applied(Checkpoint.load(path))
    raise InputError(f"{path}: a model is a checkpoint (.pt) or a network of the reference (.yaml)")


if __name__ == "__main__":
    sys.exit(main())
