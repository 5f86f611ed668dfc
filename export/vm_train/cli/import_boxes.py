"""vm-train import-boxes: frames with boxes, lens and pose as pictures with masks, to train a mesh network on."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.errors import InputError
from vm_embedded.files import write_file
from vm_embedded.geometry.shapes import Sphere, make_shape
from vm_embedded.network.bundled import SHIPPED
from vm_workstation.option_types import add_set
from vm_workstation.text_tables import shortened

from ..boxes.box import BoxedPicture, BoxedSet
from ..boxes.findings import finding_lines
from ..boxes.read import read_boxes
from ..boxes.summary import rename_advice
from ..formats.box_import import import_boxes
from ..formats.box_masks import MaskRule
from ..learning.configuration import TrainConfiguration
from .box_options import add_box_options, divided_remark, parse_names
from .mesh import load_start, read_configuration

_NAMED = 40
"""Boxes without labels to print."""


def import_boxes_parser() -> argparse.ArgumentParser:
    """The options of vm-train import-boxes DIR OUT."""
    made = Parser(
        prog="vm-train import-boxes",
        description="Convert frames with boxes, lens and pose to a folder of pictures with masks, to train a mesh "
        "network on. For each box, the outline of an object on the plane gives the labels. Boxes whose size "
        "does not fit the plane are reported and left unlabeled. Frames without lens or pose are left out.",
    )
    made.add_argument(
        "boxes", type=Path, metavar="DIR", help="folder of frames with boxes, in YOLO, Pascal VOC or COCO format"
    )
    made.add_argument("out", type=Path, metavar="OUT", help="new folder to write to")
    made.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help="the network that you will train: a checkpoint (.pt), a model file (.onnx), or a network of the package "
        f"({', '.join(SHIPPED)}). The masks get its classes and object shape; default: those of the configuration",
    )
    made.add_argument(
        "--object-radius", type=float, metavar="M", help="radius of the real object [m]; default: that of the mesh"
    )
    add_box_options(made)
    made.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration, train.toml, for [classes], [mesh] and [data]"
    )
    add_set(made, "mesh.radius=0.07")
    return made


def run_import_boxes(options: argparse.Namespace) -> int:
    """Import as the options say and return the exit status. Raises VisualMeshError, also if no frame can be used."""
    from ..tuning.boxed_objects import divided, hold_out

    configuration = read_configuration(options, load_start(options.start))
    rule = _rule(configuration, options.object_radius)
    round_names = tuple(rule.colors) if isinstance(rule.shape, Sphere) else ()
    found = read_boxes(options.boxes, options.format, parse_names(options.names), round_names)
    _complain(finding_lines(found.findings, False, f"vm-train check {options.boxes} --boxes --verbose lists all"))
    _check(found, rule, options.boxes)
    write_radius = configuration.mesh.radius_of == "scene"
    result = import_boxes(found.pictures, options.boxes, options.out, rule, write_radius)
    _complain(shortened(result.misfits, _NAMED, "; no label comes from any of them"))
    if len(result.misfits) > result.labeled:
        print(
            "vm-train: most boxes do not fit: check --object-radius (a radius, not a diameter; it is "
            f"{rule.shape.radius:g}), and lens and pose in the lens files",
            file=sys.stderr,
        )
    used = [(each, name) for each, name in zip(found.pictures, result.numbers, strict=True) if name is not None]
    frames = [each for each, _ in used]
    validation = sorted(hold_out(frames, configuration.data.validation, configuration.data.split_seed))
    if validation:
        _write_list(options.out / "validation.txt", [used[each][1] for each in validation])
    if divided(frames, validation):
        _complain([divided_remark("validation")])
    left_out = len(found.pictures) - len(used)
    print(
        f"{options.out}: {len(used)} pictures, {len(validation)} of them in validation.txt; "
        f"{result.labeled} boxes labeled, {len(result.misfits)} left unlabeled; "
        f"{left_out} frames without lens or pose left out"
    )
    return EXIT_OK


def _rule(configuration: TrainConfiguration, object_radius: float | None) -> MaskRule:
    """How to label. With one class beside the objects, all other pixels have it; with more, they are unlabeled.

    Raises InputError and GeometryError.
    """
    mesh, classes = configuration.mesh, configuration.classes
    objects = [name for name, kind in classes.kinds.items() if kind == "object"]
    if not objects:
        raise InputError(f"no class of the network has kind object; it has {', '.join(classes.kinds)}")
    others = [name for name in classes.kinds if name not in objects]
    shape = make_shape(mesh.shape, mesh.radius if object_radius is None else object_radius, mesh.object_height)
    background = classes.colors[others[0]][0] if len(others) == 1 else None
    return MaskRule(shape, {name: classes.colors[name][0] for name in objects}, background)


def _check(found: BoxedSet, rule: MaskRule, folder: Path) -> None:
    """Raise InputError if no frame has both a lens file and a box of an object."""
    counts = Counter(box.name for picture in found.pictures for box in picture.boxes)
    objects = " or ".join(rule.colors)
    if counts and not counts.keys() & rule.colors.keys():
        raise InputError(f"{folder} has no box of class {objects}; {rename_advice(counts, next(iter(rule.colors)))}")
    if not any(_has_object(each, rule) for each in found.pictures if each.lens is not None):
        raise InputError(
            f"no frame of {folder} has a box of {objects} and a lens file beside it (NAME.yaml or lensNAME.yaml); "
            "vm-train tune needs no lens"
        )


def _has_object(picture: BoxedPicture, rule: MaskRule) -> bool:
    return any(box.name in rule.colors for box in picture.boxes)


def _complain(lines: Sequence[str]) -> None:
    for line in lines:
        print(f"vm-train: {line}", file=sys.stderr)


def _write_list(path: Path, numbers: Sequence[str]) -> None:
    """Write the list of pictures for validation: whole recordings."""
    write_file(path, "".join(f"{each}\n" for each in numbers))
