"""Names of classes: through a model's manifest, class tables and box files, and in all outputs of those that are good.

An input is read as bytes of a file, and as the name that its text spells, with escapes such as \\ud800 as in JSON.
"""

import io
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.manifests import ball_manifest
from tests.vm_embedded.output.features import demo_frame
from vm_embedded.borders.text import name_fault
from vm_embedded.cameras.camera import Shot
from vm_embedded.cli.terminal import printable_output
from vm_embedded.config.toml_reader import parse_toml
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.network.manifest import Manifest
from vm_embedded.output.binary_form import HEADER, to_binary
from vm_embedded.output.messages import live_frame, to_json_line
from vm_export.reference import named_class
from vm_label.box_folder import read_box_folder
from vm_train.boxes.read import read_boxes
from vm_train.data.class_table import ClassTable
from vm_train.evaluation.html_page import html_table
from vm_workstation.text_tables import aligned

from .scratch import scratch

_IMAGE, _FRAME = demo_frame(6)
_PNG = cv2.imencode(".png", np.zeros((24, 32, 3), np.uint8))[1].tobytes()
_MANIFEST = json.loads(ball_manifest("ball", "other").as_json())


def run(data: bytes) -> None:
    name = _spelled(data)
    is_good = not name_fault(name)
    with _refused_unless(is_good):
        _use_model(name)
    with _refused_unless(is_good):
        assert named_class(name, "area").name == name
    with _refused_unless(is_good):
        table = ClassTable.from_table({name: _entry(1), name + "x" if len(name) < 9 else "other": _entry(2)})
        again = parse_toml(table.to_commented_toml())["classes"]
        assert ClassTable.from_table(again) == table
    _read_boxes("classes.txt", data, "labeled", read_boxes)
    _read_boxes("classes.txt", name.encode(errors="replace"), "labeled", read_box_folder)
    _read_boxes("data.yaml", b"names:\n  0: " + data + b"\n", "labeled", read_boxes)
    _read_boxes("image1.xml", _voc(data), "alone", read_boxes)
    _read_boxes("all.json", json.dumps(_coco(name)).encode(), "alone", read_boxes)
    candidate = {"image": "image1.png", "class": name, "box": [0.5, 0.5, 0.5, 0.5], "confidence": 0.5, "found": False}
    _read_boxes("candidates.jsonl", json.dumps(candidate).encode(), "alone", read_box_folder)


@contextmanager
def _refused_unless(is_good: bool) -> Iterator[None]:
    """Bad names must be refused, and good ones must not."""
    try:
        yield
    except VisualMeshError:
        assert not is_good
    else:
        assert is_good


def _spelled(data: bytes) -> str:
    """The name of an input. Both halves of a surrogate pair are one character, which JSON makes of them, too."""
    text = data.decode("utf-8", "surrogateescape")
    with suppress(ValueError):
        text = str(json.loads(f'"{text}"'))
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")


def _entry(value: int) -> dict[str, Any]:
    return {"kind": "area", "colors": [[value, 0, 0]]}


def _use_model(name: str) -> None:
    """Read the name in a manifest, and send a frame with it to all outputs. Raises ModelError."""
    entry = {"name": name, "kind": "object"}
    other = {"name": "b" if name == "a" else "a", "kind": "area"}
    manifest = Manifest.from_json(json.dumps(_MANIFEST | {"classes": [entry, other]}))
    assert Manifest.from_json(manifest.as_json()) == manifest
    objects = tuple(replace(each, class_name=manifest.classes[0].name) for each in _FRAME.objects)
    frame = replace(_FRAME, objects=objects)
    now = time.monotonic()
    message = live_frame(1, "ok", Shot(_IMAGE, now, arrived=now), frame, now).as_dict()
    (line,) = to_json_line(message).splitlines()
    assert {each["class"] for each in json.loads(line)["detections"]} == {name}
    binary = to_binary(message)
    size = np.frombuffer(binary, HEADER, 1)["text"][0]
    assert binary[len(binary) - size :].decode().splitlines() == [name]
    frame.draw()
    html_table(["class"], [[name]]).encode()
    print_table(name)


def print_table(name: str) -> None:
    with redirect_stdout(io.StringIO()) as printed, printable_output():
        print("\n".join(aligned([["class", "count"], [name, "1"]])))
    assert printed.getvalue().count("\n") == 2
    assert f"{name} " in printed.getvalue()


def _voc(name: bytes) -> bytes:
    edges = b"".join(b"<%s>%d</%s>" % (each, at, each) for each, at in zip(_EDGES, (2, 2, 20, 20), strict=True))
    return b"<annotation><object><name>%s</name><bndbox>%s</bndbox></object></annotation>" % (name, edges)


_EDGES = (b"xmin", b"ymin", b"xmax", b"ymax")


def _coco(name: str) -> dict[str, Any]:
    return {
        "images": [{"id": 1, "file_name": "image1.png"}],
        "categories": [{"id": 1, "name": name}],
        "annotations": [{"image_id": 1, "category_id": 1, "bbox": [2, 2, 18, 18]}],
    }


def _read_boxes(file: str, content: bytes, folder: str, read: Callable[[Path], Any]) -> None:
    """Read a folder of an image with this file: each class has a good name. Raises nothing."""
    path = _folder(folder) / file
    path.write_bytes(content)
    with suppress(InputError):
        found = read(path.parent)
        names = found.classes if read is read_box_folder else found.names
        assert not any(map(name_fault, names)), names
    path.unlink()


def _folder(name: str) -> Path:
    """A folder with an image, alone or with its label file."""
    folder = scratch(name)
    if not folder.exists():
        folder.mkdir()
        (folder / "image1.png").write_bytes(_PNG)
        if name == "labeled":
            (folder / "image1.txt").write_text("0 0.5 0.5 0.5 0.5\n")
    return folder
