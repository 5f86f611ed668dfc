"""The API reference of the web site: vm_embedded's public names, from their signatures and docstrings."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterable
from functools import cached_property
from itertools import pairwise
from types import FunctionType, ModuleType
from typing import Any

import vm_embedded
from vm_embedded import arrays
from vm_embedded.detection.observation import Observation
from vm_embedded.geometry.calibrated_lenses import CalibratedLens
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_embedded.geometry.shape import Shape
from vm_embedded.mesh.mesh import Mesh

OTHERS: dict[str, type] = {
    each.__name__: each for each in (CalibratedLens, LensFile, Mesh, Observation, RadialLens, Shape)
}
"""Types that public names return or share as their base."""

GROUPS = {
    "Detect": ("Detector", "Settings", "Detections", "Detection", "ClassPoints", "Observation"),
    "Tracks": ("Tracker", "TrackSettings", "Track"),
    "Features of the field": (
        "FieldFeatures",
        "Upright",
        "Segment",
        "CenterCircle",
        "Crossing",
        "Border",
    ),
    "Camera pose": ("Orientation",),
    "Lenses": (
        *("read_lens_file", "LensFile", "Lens", "RadialLens", "Rectilinear", "Equisolid", "Equidistant"),
        *("CalibratedLens", "BrownLens", "FisheyeLens"),
    ),
    "Several cameras and planes": ("detect_views", "CameraView", "Sighting", "Plane", "GROUND", "Pose"),
    "Meshes": ("build_mesh", "Mesh", "Shape", "Circle", "Sphere", "Cylinder"),
    "Errors": ("VisualMeshError", "GeometryError", "InputError", "ModelError"),
}
"""The order of the page. A test checks that it holds every public name."""

_NAMES = {name for names in GROUPS.values() for name in names}

HEAD = """# API reference

Every public name of `vm_embedded`, made from its docstring by `make site`. Examples are on the page
[Use](use.md#from-python). Arrays are numpy arrays: shapes are in parentheses, units in brackets.
"""

_SPECIAL = {"__len__": "len({})", "__iter__": "iter({})", "__getitem__": "{}[index]"}
"""Special methods that the page shows, as a caller writes them."""


def page() -> str:
    """The page's text."""
    parts = [HEAD]
    for title, names in GROUPS.items():
        parts += [f"## {title}", *(_entry(name) for name in names)]
    parts.append("## Array types")
    notes = _attribute_docs(arrays)
    types = [
        f"- `{name}` = `{ast.unparse(value)}`{': ' + notes[name] if name in notes else ''}"
        for name, value in _assignments(arrays).items()
    ]
    parts.append("\n".join(types))
    return re.sub(r"\n{3,}", "\n\n", "\n\n".join(parts)) + "\n"


def _entry(name: str) -> str:
    """The section of a name."""
    value: Any = OTHERS[name] if name in OTHERS else getattr(vm_embedded, name)
    if not inspect.isclass(value) and not inspect.isfunction(value):
        note = _attribute_docs(inspect.getmodule(type(value))).get(name, "")
        return f"### {name}\n\n{_code(f'{name}: {type(value).__name__}')}\n\n{note}"
    if inspect.isfunction(value):
        return f"### {name}\n\n{_code(name + _signature(value))}\n\n{_markdown(value.__doc__, _parameters(value))}"
    if issubclass(value, BaseException):
        head = f"class {name}({value.__bases__[0].__name__})"
        return f"### {name}\n\n{_code(head)}\n\n{_markdown(value.__doc__)}"
    base = next((each for each in value.__mro__[1:] if each.__name__ in _NAMES), None)
    head = f"class {name}({base.__name__ if base else ''})".replace("()", "")
    fields = dataclasses.is_dataclass(value)
    same_fields = fields and base is not None and len(_fields(value)) == len(_fields(base))
    if not fields:
        head += _signature(value)
    meanings: dict[str, str] = {}
    text = _docstring(value)
    if fields:
        for each in reversed(value.__mro__[1:]):
            if dataclasses.is_dataclass(each):
                meanings |= _field_meanings(each)[0]
        own, text = _field_meanings(value)
        meanings |= own
    parts = [f"### {name}", _code(head), _markdown(text)]
    if name in OTHERS:
        parts.append(f"It is in `{value.__module__}`.")
    if base:
        more = "its arguments and more methods" if same_fields else "more methods"
        parts.append(f"[{base.__name__}](#{base.__name__.lower()}) has {more}.")
    if fields and not same_fields:
        parts += [_field_table(value, meanings)]
    parts += [_member(name, value, member) for member in _members(value)]
    return "\n\n".join(parts)


def _field_meanings(value: type) -> tuple[dict[str, str], str]:
    """What a dataclass's docstring says about each field, and the docstring without that."""
    meanings: dict[str, str] = {}
    kept = []
    for paragraph in _docstring(value).split("\n\n"):
        found, rest = _labeled(paragraph, [each.name for each in _fields(value)])
        meanings |= found
        kept += [rest] if rest else []
    return meanings, "\n\n".join(kept)


def _labeled(paragraph: str, names: Iterable[str]) -> tuple[dict[str, str], str]:
    """What a paragraph says about each of some names, and the rest of it.

    Docstrings describe fields and parameters as `name: text. name (n, 3), name [m]: text. name [m].`, in paragraphs
    that start with a name. The errors that they raise come last.
    """
    any_name = "|".join(names) or "(?!)"
    label = rf"(?:{any_name})(?: \([^)]*\))?(?: \[[^\]]*\])?"
    labels = re.compile(rf"(?:^|(?<=\. )|(?<=; ))({label}(?:(?:, | and ){label})*)(?:: |\. )")
    start, *pieces = labels.split(" ".join(paragraph.split()))
    if start or not pieces:
        return {}, paragraph
    pieces[-1], _, raised = pieces[-1].partition(" Raises ")
    found = {}
    for head, text in zip(pieces[::2], pieces[1::2], strict=True):
        for one in re.finditer(rf"({any_name})((?: \([^)]*\))?(?: \[[^\]]*\])?)(?=,|$| and )", head):
            shape = one[2].strip()
            found[one[1]] = " ".join(each for each in (shape, text.strip().rstrip(".")) if each)
    return found, f"Raises {raised}" if raised else ""


def _field_table(value: type, meanings: dict[str, str]) -> str:
    """A table of a dataclass's fields. Settings have help texts, units and limits in their metadata."""
    kind = "Arguments, by name only" if all(each.kw_only for each in _fields(value)) else "Arguments"
    rows = [f"{kind}, which are also fields:", "", "| field | type | default | meaning |", "| --- | --- | --- | --- |"]
    explained = bool(meanings) or any("help" in each.metadata for each in _fields(value))
    rows[2:] = [row if explained else row[: row.rindex("|", 0, -1) + 1] for row in rows[2:]]
    for each in _fields(value):
        data = each.metadata
        meaning = data.get("help", meanings.get(each.name, ""))
        meaning += f" [{data['unit']}]" if data.get("unit") else ""
        meaning += f"; one of {', '.join(data['allowed'])}" if data.get("allowed") else ""
        meaning += "; {:g} to {:g}".format(*data["limits"]) if data.get("limits") else ""
        default = "" if each.default is dataclasses.MISSING else f"`{each.default!r}`"
        default = default if each.default_factory is dataclasses.MISSING else f"`{each.default_factory()!r}`"
        cells = (f"`{each.name}`", f"`{_type(each.type)}`", default, *([meaning] if explained else []))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def _type(annotation: str) -> str:
    """A type as the source has it, without the rest of an Annotated."""
    node = ast.parse(annotation, mode="eval").body
    is_annotated = isinstance(node, ast.Subscript) and ast.unparse(node.value) == "Annotated"
    return ast.unparse(node.slice.elts[0]) if is_annotated else annotation


def _fields(value: type) -> list[dataclasses.Field[Any]]:
    return [each for each in dataclasses.fields(value) if not each.name.startswith("_")]  # type: ignore[arg-type]


def _members(value: type) -> list[str]:
    """Names of a class's public methods and properties, in their order, without those of base classes on this page."""
    listed = {name for each in value.__mro__[1:] if each.__name__ in _NAMES for name in vars(each)}
    listed |= {each.name for each in _fields(value)} if dataclasses.is_dataclass(value) else set()
    kinds = (FunctionType, classmethod, staticmethod, property, cached_property)
    return list(
        dict.fromkeys(
            name
            for owner in reversed(value.__mro__)
            if owner.__module__.startswith("vm_embedded")
            for name, member in vars(owner).items()
            if isinstance(member, kinds) and name not in listed and (name in _SPECIAL or not name.startswith("_"))
        )
    )


def _member(owner: str, value: type, name: str) -> str:
    """A method or property, with the nearest docstring of the class and its bases."""
    found = [vars(each)[name] for each in value.__mro__ if name in vars(each)]
    functions = [
        getattr(each, "fget", None) or getattr(each, "func", None) or getattr(each, "__func__", each) for each in found
    ]
    text = _markdown(next((each.__doc__ for each in functions if each.__doc__), None), _parameters(functions[0]))
    kind = _type(str(inspect.signature(functions[0]).return_annotation))
    if isinstance(found[0], (property, cached_property)):
        return f"**`{name}: {kind}`**\n\n{text}"
    if name in _SPECIAL:
        variable = re.sub(r"(?<!^)(?=[A-Z])", "_", owner).lower()
        return f"**`{_SPECIAL[name].format(variable)} -> {kind}`**\n\n{text}"
    called = f"{owner}.{name}" if isinstance(found[0], (classmethod, staticmethod)) else name
    return f"**`{called}{_signature(functions[0], bound=not isinstance(found[0], staticmethod))}`**\n\n{text}"


def _signature(value: Any, bound: bool = False) -> str:
    """Parameters and result as the source has them, without self and cls."""
    signature = inspect.signature(value)
    shown = []
    for each in list(signature.parameters.values())[1 if bound else 0 :]:
        default = "" if each.default is each.empty else f" = {each.default!r}"
        shown.append(f"{each.name}: {each.annotation}{default.replace(repr(vm_embedded.GROUND), 'GROUND')}")
    result = "" if inspect.isclass(value) else f" -> {signature.return_annotation}"
    return f"({', '.join(shown)}){result}"


def _docstring(value: Any) -> str:
    return inspect.cleandoc(value.__doc__ or "")


def _parameters(function: Any) -> list[str]:
    return list(inspect.signature(function).parameters)


def _markdown(docstring: str | None, parameters: Iterable[str] = ()) -> str:
    """A docstring as Markdown: indented blocks become code, and descriptions of parameters a list."""
    shown = []
    for block in inspect.cleandoc(docstring or "").split("\n\n"):
        if block.startswith("    "):
            shown.append(_code(textwrap.dedent(block)))
            continue
        block = re.sub(r"(?m)^(?!- )(.*)\n(?=- )", r"\1\n\n", block)  # Markdown needs empty lines around a list
        block = re.sub(r"(?m)^(- .*)\n(?!- |  )", r"\1\n\n", block)
        found, rest = _labeled(block, parameters)
        shown += ["\n".join(f"- `{name}`: {text}." for name, text in found.items())] if found else []
        shown += [rest] if rest else []
    return "\n\n".join(shown)


def _code(text: str) -> str:
    return f"```python\n{text}\n```"


def _assignments(module: ModuleType) -> dict[str, ast.expr]:
    """Names that a module assigns at its top, with their values."""
    return {
        node.targets[0].id: node.value
        for node in ast.parse(inspect.getsource(module)).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }


def _attribute_docs(module: ModuleType | None) -> dict[str, str]:
    """Docstrings below a module's assignments."""
    assert module is not None
    body = ast.parse(inspect.getsource(module)).body
    return {
        node.targets[0].id: " ".join(after.value.value.split())
        for node, after in pairwise(body)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)
    }
