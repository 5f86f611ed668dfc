"""vm-export: from a trained network to a self-describing ONNX file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, Parser, program
from vm_embedded.errors import InputError, ModelError, VisualMeshError, not_installed
from vm_embedded.files import check_writable
from vm_embedded.network.bundled import model_path
from vm_embedded.network.manifest import EDGES
from vm_embedded.network.model_file import read_model

if TYPE_CHECKING:
    from .attach_canary import CanaryPicture
    from .checkpoint import Checkpoint
    from .look_checkpoint import LookCheckpoint
    from .reference import Overrides


def parser() -> argparse.ArgumentParser:
    """The argument parser of vm-export."""
    parser = Parser(
        prog="vm-export",
        description="Write a network as a self-describing ONNX file, and check its answers against torch.",
        epilog="Exit status: 0 written, 1 not written (standard error says why), 2 wrong usage, 130 interrupted.",
    )
    parser.add_argument(
        "model",
        type=Path,
        help="checkpoint (.pt), network of the reference implementation (.yaml), or a model file (.onnx, or the name "
        "of a network of the package) whose close look or canary you want to change",
    )
    parser.add_argument(
        "-o", "--output", type=Path, help="file to write; default: the name of the model with .onnx or .yaml"
    )
    parser.add_argument(
        "--to-yaml", action="store_true", help="write the format of the reference implementation instead"
    )
    look = parser.add_mutually_exclusive_group()
    look.add_argument(
        "--look",
        type=Path,
        metavar="LOOK",
        help="checkpoint (.pt) of a close look to write into the model file; or a model file (.onnx, or the name of a "
        "network of the package) that has one. Classes that MODEL has no peaks for are left out",
    )
    look.add_argument("--no-look", action="store_true", help="copy a model file (.onnx) without its close look")
    parser.add_argument(
        "--canary",
        type=Path,
        nargs=2,
        metavar=("IMAGE", "LENS"),
        help="small picture that shows an object of every class, and its lens file with Hoc; the detector must find "
        "them again at each start. For a model file (.onnx), this also makes new self-tests",
    )
    facts = parser.add_argument_group("entries that the file lacks, or that you want to replace")
    facts.add_argument(
        "--intersections", type=float, metavar="K", help="rings of points across an object (the paper's k)"
    )
    facts.add_argument("--radius", type=float, metavar="M", help="radius of the object that the mesh is built for [m]")
    facts.add_argument("--object-radius", type=float, metavar="M", help="radius of the real object [m]")
    facts.add_argument("--max-distance", type=float, metavar="M", help="reach of the mesh [m]")
    facts.add_argument(
        "--edge",
        choices=EDGES,
        help="neighbor that replaces a missing one: the off-screen point (hard), or the point itself (same)",
    )
    facts.add_argument(
        "--classes",
        metavar="NAME[:KIND],...",
        help="classes in the order of the outputs; KIND is object, upright, area or background",
    )
    return parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-export and return its exit status."""
    options = parser().parse_args(arguments)
    try:
        return _run(options)
    except ImportError as error:
        print(f"vm-export: {not_installed(error, 'export')}", file=sys.stderr)
    except VisualMeshError as error:
        print(f"vm-export: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("vm-export: stopped", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_FAILED


def _run(options: argparse.Namespace) -> int:
    options.model = model_path(options.model)
    if options.look is not None:
        options.look = model_path(options.look)
    _check_options(options)
    # Imported here: without torch, --help still works and the error is one clear line.
    import torch

    from .attach_canary import CanaryPicture

    # These networks are small: one thread is as fast as several, and much faster while other programs use the cores.
    # The last digits of its sums are also the same on every machine.
    torch.set_num_threads(1)
    output = _checked_output(options)
    canary = CanaryPicture.read(*options.canary) if options.canary else None
    if _is_model_file(options.model):
        _change_model(options, output, canary)
    else:
        _export_checkpoint(options, output, canary)
    return EXIT_OK


def _checked_output(options: argparse.Namespace) -> Path:
    """The file to write. Raises InputError if it can't be written, or for a wrong suffix."""
    output: Path = options.output or options.model.with_suffix(".yaml" if options.to_yaml else ".onnx")
    check_writable(output, (options.model, options.look, *(options.canary or ())))
    suffixes = (".yaml", ".yml") if options.to_yaml else (".onnx",)
    if output.suffix not in suffixes:
        raise InputError(f"--output must end in {suffixes[0]}, not {output}")
    return output


def _change_model(options: argparse.Namespace, output: Path, canary: CanaryPicture | None) -> None:
    """Write a copy of a model file with another canary, or with another close look."""
    from .change_model import change_canary, change_look, lost_canary_message

    if canary is not None:
        change_canary(options.model, output, canary)
        _print_written(output, f"networks of {options.model} with a new canary", None)
        return
    look = _read_look(options)
    changed = change_look(options.model, output, look)
    _print_written(output, f"mesh network of {options.model}", changed.difference if look else None)
    if changed.lost_canary:
        print(f"vm-export: {lost_canary_message(output, options.model)}", file=sys.stderr)


def _export_checkpoint(options: argparse.Namespace, output: Path, canary: CanaryPicture | None) -> None:
    """Write a checkpoint, or a network of the reference implementation, as model files or in the reference's format."""
    from .export import export
    from .reference import write_reference

    checkpoint = _load(options.model, _overrides(options))
    print(f"{options.model}: {_description(checkpoint)}")
    if options.to_yaml:
        write_reference(checkpoint, output)
        print(f"{output}: written in the format of the reference implementation")
        return
    look = _read_look(options)
    _print_written(output, "mesh network", export(checkpoint, output, look, canary))


def _read_look(options: argparse.Namespace) -> LookCheckpoint | None:
    """The close look of --look. Raises InputError, and ModelError for a model file without one."""
    from .look_checkpoint import LookCheckpoint
    from .look_weights import look_of

    if options.look is None or not _is_model_file(options.look):
        return options.look and LookCheckpoint.load(options.look)
    look = look_of(read_model(options.look))
    if look is None:
        raise ModelError(f"{options.look} has no close look")
    return look


def _is_model_file(path: Path) -> bool:
    return path.suffix.lower() == ".onnx"


def _check_options(options: argparse.Namespace) -> None:
    """Refuse options that do not fit each other or the kind of the input. Raises InputError."""
    for each in (options.model, options.output):
        if each is not None and not each.name:
            raise InputError(f"{each} is a folder: give a file")
    if options.to_yaml and (options.look or options.canary):
        option = "--look" if options.look else "--canary"
        raise InputError(f"{option} is for ONNX files; leave it out with --to-yaml")
    if not _is_model_file(options.model):
        if options.no_look:
            raise InputError(f"--no-look is for model files (.onnx); leave it out for {options.model}")
        return
    names = ("to_yaml", "intersections", "radius", "object_radius", "max_distance", "edge", "classes")
    values = {f"--{name.replace('_', '-')}": getattr(options, name) for name in names}
    given = [option for option, value in values.items() if value is not None and value is not False]
    if given:
        raise InputError(
            f"{', '.join(given)} can't change a model file; give the checkpoint (.pt) instead of {options.model}"
        )
    changes = [option for option in ("look", "no_look", "canary") if getattr(options, option)]
    if not changes:
        read_model(options.model)  # raises ModelError for a file of another program
        raise InputError(
            f"{options.model} is a model file already; change its close look with --look or --no-look, or its canary "
            "with --canary"
        )
    if options.canary and len(changes) > 1:
        raise InputError("a model file gets another close look or another canary; give one of the two options")


def _print_written(path: Path, content: str, difference: float | None) -> None:
    """Print a line about a written file: its networks, its size, and the difference to torch of those that are new."""
    parts, look = [content], read_model(path).manifest.look
    if look is not None:
        channels = ", ".join(map(str, look.channels))
        parts.append(f"close look at {', '.join(look.names)} ({look.size} x {look.size}, channels {channels})")
    parts.append(f"{path.stat().st_size / 1000:.1f} kB")
    if difference is not None:
        parts.append(f"largest difference to torch {difference:.1e}")
    print(f"{path}: {', '.join(parts)}")


def _description(checkpoint: Checkpoint) -> str:
    """The layers of a network and the main entries of its manifest, in three lines."""
    manifest = checkpoint.manifest
    classes = ", ".join(f"{each.name} ({each.kind})" for each in manifest.classes)
    return (
        f"{checkpoint.network.shape.summary}, {manifest.mesh}, {manifest.shape}\n"
        f"  radius {manifest.radius:g} m, {manifest.intersections:g} intersections, to {manifest.max_distance:g} m\n"
        f"  object radius {manifest.object_radius:g} m, edge {manifest.edge}, classes: {classes}"
    )


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
    """Read a network and replace entries of its manifest. Raises InputError or ModelError."""
    from .checkpoint import Checkpoint
    from .reference import read_reference

    if path.suffix.lower() in (".yaml", ".yml"):
        return read_reference(path, overrides)
    if path.suffix.lower() != ".pt":
        raise InputError(
            f"{path} must be a checkpoint (.pt), network of the reference implementation (.yaml) or model file (.onnx)"
        )
    checkpoint = overrides.apply_to(Checkpoint.load(path))
    if not checkpoint.grid.is_visual:
        raise InputError(f"{path} was trained on a {checkpoint.grid.kind} grid; the runtime has only the Visual Mesh")
    return checkpoint


if __name__ == "__main__":
    sys.exit(main())
