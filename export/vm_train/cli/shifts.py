"""vm-train shifts: give a mesh network shifts to the centers of objects."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, unknown
from vm_embedded.files import check_writable
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_workstation.shortened import shortened

from ..data.picture_files import paths_of
from ..data.pictures import find_pictures

_NAMED = 20
"""Pictures that can't be used, to name."""


def shifts_parser() -> argparse.ArgumentParser:
    """The options of vm-train shifts."""
    made = Parser(
        prog="vm-train shifts",
        description="Give a mesh network two more outputs, which shift each point of an object to the object's center. "
        "They make the proposals for the close look more exact; the other answers stay the same. It takes about 0.1 s "
        "for each picture; a thousand pictures are enough.",
    )
    made.add_argument(
        "model",
        type=Path,
        metavar="MODEL",
        help="a checkpoint (.pt), a model file (.onnx), or a network of the package "
        f"({', '.join(SHIPPED)}); its shifts are replaced if it has some",
    )
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")
    made.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="file to write, of the same kind as MODEL"
    )
    made.add_argument("--class", dest="object_class", metavar="NAME", help="class of the objects, if there are several")
    return made


def run_shifts(options: argparse.Namespace) -> int:
    """Fit the shifts, write the network, and return the exit status. Raises VisualMeshError."""
    # Imported here: without torch, help works and the error is one clear line.
    from vm_export.change_model import change_shifts, lost_canary_message
    from vm_export.checkpoint import Checkpoint
    from vm_export.network_weights import network_of
    from vm_export.shifts import with_shifts, without_shifts

    from ..evaluation.mask_colors import classes_with_colors, default_colors
    from ..look.shifts import fit_shifts

    path = model_path(options.model)
    is_model = path.suffix.lower() == ".onnx"
    if options.output.suffix.lower() != path.suffix.lower():
        raise InputError(f"{options.output} must end in {path.suffix}, as {path}")
    pictures = find_pictures(options.data)
    check_writable(options.output, (path, *paths_of(pictures)))
    checkpoint = without_shifts(network_of(read_model(path)) if is_model else Checkpoint.load(path))
    if not checkpoint.grid.is_visual:
        raise InputError(f"{path} was trained on a {checkpoint.grid.kind} grid; the runtime has only the Visual Mesh")
    name = _object_class(checkpoint.manifest, options.object_class)
    classes = classes_with_colors(checkpoint.manifest, default_colors(path, None), [])
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        found = fit_shifts(checkpoint, name, classes, pictures, bar.advance)
    finally:
        bar.clear()
    for line in shortened(found.faults, _NAMED, " pictures can't be used"):
        print(f"vm-train: {line}", file=sys.stderr)
    changed = with_shifts(checkpoint, name, found.weights())
    before, after = found.errors
    print(
        f"{found.points} points on {found.objects} objects of class {name}: {after:.2f} instead of {before:.2f} radii "
        "from the center (root mean square)"
    )
    if not is_model:
        changed.save(options.output)
    elif change_shifts(path, options.output, changed):
        print(f"vm-train: {lost_canary_message(options.output, path)}", file=sys.stderr)
    print(f"{options.output}: written")
    return EXIT_OK


def _object_class(manifest: Manifest, chosen: str | None) -> str:
    """The class of the objects: the chosen one, or the only one. Raises InputError without one, or with several."""
    names = [each.name for each in manifest.classes if each.kind == "object"]
    if chosen is not None and chosen not in names:
        raise InputError(unknown("class of kind object", chosen, names))
    if not names:
        raise InputError("the network has no class of kind object, so it proposes none")
    if chosen is None and len(names) > 1:
        raise InputError(f"the network has several classes of kind object: give one of {', '.join(names)} with --class")
    return chosen or names[0]
