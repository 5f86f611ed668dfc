"""What is made from the records of messages (vm_embedded/borders/records.py): the JSON Schema, the tables and the
reader of the documentation, and the structures of the C++ header. help_pages.py writes them.

A page, and the header, hold each made part between a line `messages: NAME` and a line `end`.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import api_page

from vm_embedded.borders.records import Entry, Record, entries
from vm_embedded.detection.detection import Detection
from vm_embedded.detection.detections import STAGES
from vm_embedded.detection.pose_state import PoseState
from vm_embedded.detection.track import Track
from vm_embedded.field.features import FieldFeatures
from vm_embedded.output.binary_form import HEADER, LAYOUT, RECORDS, is_list, number_type
from vm_embedded.output.messages import KINDS, STATES, FileFrame, LiveFrame, StateMessage, Status

Schema = dict[str, Any]

PAGES = ("docs/use.md", "docs/daemon.md", "deploy/cpp/vm_detect.hpp")
"""Files with made parts."""


def pages(top: Path) -> dict[Path, str]:
    """The files of PAGES, each with its made parts as they should be."""
    made = {
        "file_frame": table(FileFrame),
        "detection": table(Detection),
        "field": table(FieldFeatures),
        "features": features_table(),
        "track": table(Track),
        "pose": table(PoseState),
        "frame": table(LiveFrame),
        "state": table(StateMessage),
        "status": table(Status, without=StateMessage),
        "layout": reader_layout(),
        "states": states(),
        "structures": structures(),
        "readers": readers(),
    }
    part = re.compile(r"^([^\w\n]*messages: (\w+)[^\w\n]*\n).*?(^[^\w\n]*end[^\w\n]*\n)", re.MULTILINE | re.DOTALL)
    return {
        top / page: part.sub(lambda found: found[1] + made[found[2]] + found[3], (top / page).read_text())
        for page in PAGES
    }


def meaning(record: type[Record], entry: Entry) -> str:
    """What the docstring says about a field, with its unit."""
    for each in record.__mro__:
        member = vars(each).get(entry.attribute)
        if isinstance(member, property):
            text = inspect.cleandoc(member.__doc__ or "").rstrip(".")
            return text[0].lower() + text[1:]
        found = api_page._field_meanings(each)[0] if "__dataclass_fields__" in vars(each) else {}
        if entry.attribute in found:
            _, unit, text = re.fullmatch(r"(\([^)]*\) )?(\[[^\]]*\] )?(.*)", found[entry.attribute]).groups("")  # type: ignore[union-attr]
            return f"{text} {unit}".strip()
    raise LookupError(f"the docstring of {record.__name__} does not explain {entry.attribute}")


def schema() -> Schema:
    """The JSON Schema (2020-12) of all messages."""
    parts = [each for each in parts_of(*KINDS.values()) if each not in KINDS.values()]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Messages of vm-detect",
        "description": "Lengths are in meters, angles in radians, pixels as x and y. Positions are in the frame of the "
        "observation plane: its origin is below the camera, z points up.",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in KINDS],
        "$defs": {name: _object(each) for name, each in (KINDS | {each.__name__: each for each in parts}).items()},
    }


def parts_of(*records: type[Record]) -> list[type[Record]]:
    """These classes of records and all that they are made of, each behind its parts."""
    found: list[type[Record]] = []
    for record in records:
        found += [*parts_of(*(each.type for each in entries(record) if each.is_record)), record]
    return list(dict.fromkeys(found))


def _object(record: type[Record]) -> Schema:
    table = entries(record)
    return {
        "type": "object",
        "description": inspect.cleandoc(record.__doc__ or "").split("\n\n")[0].replace("\n", " "),
        "properties": {each.name: {"description": meaning(record, each)} | _value(each) for each in table},
        "required": [each.name for each in table if each.sent.null or not each.may_lack],
        "additionalProperties": False,
    }


def _value(entry: Entry) -> Schema:
    sent, value = entry.sent, _one(entry)
    for size in reversed(sent.shape):
        value = {"type": "array", "items": value} | ({"minItems": size, "maxItems": size} if size > 0 else {})
    if entry.many is tuple:
        return {"type": "array", "items": value}
    if entry.many and sent.allowed:
        names = dict.fromkeys(sent.allowed, value)
        return {"type": "object", "properties": names, "required": ["total"], "additionalProperties": False}
    if entry.many:
        return {"type": "object", "additionalProperties": value}
    return {"anyOf": [value, {"type": "null"}]} if entry.may_lack and sent.null else value


def _one(entry: Entry) -> Schema:
    """The schema of each value of a field."""
    if entry.type is None:
        return {}
    if entry.is_record:
        name = next((name for name, kind in KINDS.items() if kind is entry.type), entry.type.__name__)
        return {"$ref": f"#/$defs/{name}"}
    if entry.sent.allowed and not entry.many:
        return {"enum": list(entry.sent.allowed)}
    kind: Any = {float: "number", int: "integer", bool: "boolean", str: "string"}[entry.type]
    limits = {"minimum": entry.sent.least, "maximum": entry.sent.most}
    return {
        "type": [kind, "null"] if entry.sent.null and entry.sent.shape else kind,
        **{name: limit for name, limit in limits.items() if limit is not None},
    }


def table(record: type[Record], without: type[Record] = Record) -> str:
    """A table of a record's fields, without those of another class."""
    left_out = entries(without) if without is not Record else ()
    rows = [f"| `{each.name}` | {_cell(record, each)} |" for each in entries(record) if each not in left_out]
    return "\n".join(["| field | meaning |", "| --- | --- |", *rows]) + "\n"


def features_table() -> str:
    """A table of the fields of all features of the field."""
    kinds: dict[type[Record], list[str]] = {}
    for each in entries(FieldFeatures):
        if each.is_record:
            kinds.setdefault(each.type, []).append(f"`{each.name}`")
    rows = [
        f"| {', '.join(names)} | `{each.name}` | {_cell(record, each)} |"
        for record, names in kinds.items()
        for each in entries(record)
    ]
    return "\n".join(["| of | field | meaning |", "| --- | --- | --- |", *rows]) + "\n"


def _cell(record: type[Record], entry: Entry) -> str:
    """What a table says about a field."""
    letters = entry.sent.allowed if entry.type is str and len(entry.sent.allowed) < 4 else ()
    return "; ".join(filter(None, [", ".join(f"`{each}`" for each in letters), meaning(record, entry)]))


def reader_layout() -> str:
    """The layout of the binary form in Python, as a text of numpy's types for the header and each list of records."""
    lines = [f"NUMBER = {LAYOUT}", "LAYOUT = {"]
    for name, kind in {"header": HEADER, **RECORDS}.items():
        fields = (
            f"{each}:{','.join(map(str, shape[0] if shape else ()))}{code[1:]}" for each, code, *shape in kind.descr
        )
        pieces = textwrap.wrap(" ".join(re.sub(r":(\d,\d)", r":(\1)", each) for each in fields), 100)
        lines.append(f'    "{name}": ' + ' "\n    "'.join(pieces).join('""') + ",")
    return "\n".join([*lines, "}"]) + "\n"


def states() -> str:
    """The states in C++, with their names."""
    lines = textwrap.wrap(", ".join(f'"{each}"' for each in (*STATES, "unreachable")), 100)
    names = "\n".join(f"        {each}" for each in lines)
    return (
        f"enum class State : std::uint8_t {{ {', '.join((*STATES, 'unreachable'))} }};\n\n"
        "inline const char* name(State state) {\n"
        f"    static constexpr std::array<const char*, {len(STATES) + 1}> names{{\n{names}}};\n"
        "    return names[static_cast<std::size_t>(state)];\n}\n"
    )


def structures() -> str:
    """The structures of C++ for a frame and its parts."""
    stages = ", ".join(f"{each} = 0.0F" for each in STAGES)
    lines = textwrap.wrap(f"float {stages};", 110, initial_indent="    ", subsequent_indent="        ")
    about = "// Time of each stage and of the whole call [ms]; NaN for a stage that was not needed."
    times = "\n".join([about, "struct Times {", *lines, "};"]) + "\n"
    return "\n".join([times, *map(_structure, parts_of(LiveFrame))])


def _structure(record: type[Record]) -> str:
    about = inspect.cleandoc(record.__doc__ or "").split("\n\n")[0].replace("\n", " ")
    lines = [*_comment(about), f"struct {_name(record)} {{"]
    for each in _in_binary(record):
        lines += [f"    {line}" for line in _comment(meaning(record, each))]
        lines.append(f"    {_type(each)} {each.attribute}{{}};")
    return "\n".join([*lines, "};"]) + "\n"


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, 110, initial_indent="// ", subsequent_indent="// ")


def _name(record: type[Record]) -> str:
    return "Frame" if record is LiveFrame else record.__name__


def _in_binary(record: type[Record]) -> Iterator[Entry]:
    """The fields of a record in the binary form; the state is in Message."""
    return (each for each in entries(record) if (each.is_record or number_type(each)) and each.name != "state")


def _type(entry: Entry) -> str:
    """The type of a field in C++."""
    if entry.is_record:
        return f"std::{'vector' if entry.many else 'optional'}<{_name(entry.type)}>"
    if entry.many:
        return "Times"
    if entry.type is str:
        return "char" if entry.sent.allowed else "std::string"
    number = {"<f4": "float", "<f8": "double", "<u4": "std::uint32_t"}[number_type(entry)]
    kind = "bool" if entry.type is bool else number
    for size in reversed(entry.sent.shape):
        short = {("float", 2): "Pair", ("float", 3): "Triple"}.get((kind, size), f"std::array<{kind}, {size}>")
        kind = f"std::vector<{kind}>" if size < 0 else short
    return kind


def readers() -> str:
    """The functions of C++ that read the records of the binary form, and the whole frame."""
    rows = [each for each in parts_of(LiveFrame) if each not in (LiveFrame, FieldFeatures)]
    frame = "\n".join(f"    {line}" for line in _read_frame(LiveFrame, "made"))
    return "\n".join(
        [
            f"constexpr std::uint32_t layout_number = {LAYOUT}U;",
            f"constexpr std::size_t header_bytes = {HEADER.itemsize};\n",
            *map(_reader, rows),
            f"inline void read(Cursor& head, Cursor& body, Frame& made) {{\n{frame}\n}}\n",
        ]
    )


def _reader(record: type[Record]) -> str:
    lines = [f"inline void read(Cursor& from, {record.__name__}& made) {{"]
    for each in _in_binary(record):
        place = f"made.{each.attribute}"
        if each.is_record:  # not there if its first number is 0
            first = next(_in_binary(each.type)).attribute
            lines.append(f"    read(from, {place}.emplace());")
            lines.append(f"    if ({place}->{first} == 0) {place}.reset();")
        elif each.sent.allowed:
            lines.append(f'    {place} = from.choice("{"".join(each.sent.allowed)}");')
        else:
            lines.append(f"    read(from, {place}{'.emplace_back()' if -1 in each.sent.shape else ''});")
    return "\n".join([*lines, "}"]) + "\n"


def _read_frame(record: type[Record], made: str) -> Iterator[str]:
    for each in _in_binary(record):
        place = f"{made}.{each.attribute}"
        if is_list(each):
            yield f"read_list(head, body, {place});"
        elif each.is_record:
            yield f"const bool has_{each.attribute} = head.take<std::uint32_t>() != 0;"
            yield f"auto& {each.attribute} = {place}.emplace();"
            yield from _read_frame(each.type, each.attribute)
            yield f"if (!has_{each.attribute}) {place}.reset();"
        else:
            yield f"read(head, {place});"
